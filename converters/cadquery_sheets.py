"""Functions that return faces of CadQuery from developable and minimal patches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, Unpack

import numpy as np
from numpy.typing import ArrayLike

from gtcad.converters.cadquery_functions import gtSurface
from gtcad.converters.cadquery_shapes import CurveLike, GtFace, Settings, cq, curve_of
from gtcad.patches._patch import in_space
from gtcad.patches.coons import coons_from_loop
from gtcad.patches.developable import Enveloping, GeodesicDevelopable, PlaneFamily, SpineDevelopable
from gtcad.patches.minimal import dirichlet_extremal, fixed_contour
from gtcad.protocol import SeparableCurve

PlaneLike: TypeAlias = Sequence[float]
"""(a, b, c, d) of the plane a x + b y + c z = d."""


def gtEnveloping(
    planes: PlaneFamily | Sequence[PlaneLike],
    boundA: PlaneLike | SeparableCurve | cq.Edge,
    boundB: PlaneLike | SeparableCurve | cq.Edge,
    gamma: Sequence[float] = (0.0, 0.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The developable face that planes envelop, each ruling cut off by two bounds; ``gtcad.patches.Enveloping``.

    Parameters
    ----------
    planes
        Control planes (a, b, c, d), at least three, or a family of planes of gtcad.
    boundA, boundB
        Planes, curves of gtcad or edges.
    gamma
        Design variables of the family.
    """
    family = planes if isinstance(planes, PlaneFamily) else PlaneFamily(np.asarray(planes, dtype=np.float64), gamma)
    return gtSurface(Enveloping(family, _bound("boundA", boundA), _bound("boundB", boundB)), **settings)


def _bound(name: str, given: PlaneLike | SeparableCurve | cq.Edge) -> SeparableCurve | ArrayLike:
    return in_space(curve_of(name, given)) if isinstance(given, SeparableCurve | cq.Shape) else given


def gtSpineDevelopable(
    spine: CurveLike | PlaneFamily, distances: tuple[float, float], **settings: Unpack[Settings]
) -> GtFace:
    """The face of a spine's tangents, between two distances along them; ``gtcad.patches.SpineDevelopable``."""
    curve = spine if isinstance(spine, PlaneFamily) else in_space(curve_of("spine", spine))
    return gtSurface(SpineDevelopable(curve, distances), **settings)


def gtGeodesicDevelopable(curve: CurveLike, distances: tuple[float, float], **settings: Unpack[Settings]) -> GtFace:
    """The developable face on which a curve is a geodesic; ``gtcad.patches.GeodesicDevelopable``."""
    return gtSurface(GeodesicDevelopable(in_space(curve_of("curve", curve)), distances), **settings)


def gtPlateau(
    curves: Sequence[CurveLike],
    innerDegree: int | tuple[int, int] = 4,
    functional: Literal["dirichlet", "quasi-harmonic", "bending"] = "dirichlet",
    **settings: Unpack[Settings],
) -> GtFace:
    """The face of least energy inside a loop of four curves, which may run either way; ``gtcad.patches.Plateau``.

    Parameters
    ----------
    curves
        As of ``gtCoons``.
    innerDegree
        Of the functions inside, or a pair.
    functional
        The energy.
    """
    loop = [in_space(curve_of(f"curves[{k}]", curve)) for k, curve in enumerate(curves)]
    return gtSurface(fixed_contour(coons_from_loop(loop), innerDegree, functional), **settings)


def gtDirichlet(
    net: ArrayLike, gammaU: ArrayLike = (0.0, 0.0), gammaV: ArrayLike = (0.0, 0.0), **settings: Unpack[Settings]
) -> GtFace:
    """The face of least Dirichlet energy with these boundary control points, NaN or any inside."""
    return gtSurface(dirichlet_extremal(net, gammaU, gammaV), **settings)
