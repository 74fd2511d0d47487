"""Face objects of build123d from developable and minimal patches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Unpack

from numpy.typing import ArrayLike

from gtcad.converters.build123d_faces import GTFace
from gtcad.converters.build123d_lines import FaceOptions, GTObject, curve_of
from gtcad.patches._patch import in_space
from gtcad.patches.developable import Enveloping, GeodesicDevelopable, PlaneFamily, SpineDevelopable
from gtcad.patches.minimal import dirichlet_extremal, fixed_contour
from gtcad.protocol import SeparableCurve

Functional = Literal["dirichlet", "quasi-harmonic", "bending"]


class GTEnveloping(GTFace):
    """Face object: the developable that planes envelop, each ruling cut off by two bounds.

    Parameters
    ----------
    control_planes
        Rows (a, b, c, d) of the planes a x + b y + c z = d, at least three; or a ``PlaneFamily``.
    bound_a, bound_b
        Planes as such rows, or curves.
    gamma
        Design variables of the family.
    options
        See ``FaceOptions``.

    Raises
    ------
    SingularDevelopable
        As ``patches.Enveloping``.

    Examples
    --------
    >>> wall = GTEnveloping([(1, 0, 0, 1), (1, 1, 0, 1), (0, 1, 0, 1)], (0, 0, 1, 0), (0, 0, 1, 3))
    >>> round(wall.bounding_box().size.Z, 6)
    3.0
    """

    def __init__(
        self,
        control_planes: ArrayLike | PlaneFamily,
        bound_a: Any,
        bound_b: Any,
        gamma: Sequence[float] = (0.0, 0.0),
        **options: Unpack[FaceOptions],
    ) -> None:
        family = control_planes if isinstance(control_planes, PlaneFamily) else PlaneFamily(control_planes, gamma)
        super().__init__(Enveloping(family, _bound(bound_a, "bound_a"), _bound(bound_b, "bound_b")), **options)


def _bound(given: Any, name: str) -> Any:
    return in_space(curve_of(given, name)) if isinstance(given, SeparableCurve | GTObject) else given


class GTSpineDevelopable(GTFace):
    """Face object: the tangent surface of a spine, between two distances along its tangents."""

    def __init__(self, spine: Any, distances: Sequence[float], **options: Unpack[FaceOptions]) -> None:
        curve = spine if isinstance(spine, PlaneFamily) else in_space(curve_of(spine, "spine"))
        super().__init__(SpineDevelopable(curve, distances), **options)


class GTGeodesicDevelopable(GTFace):
    """Face object: the developable on which a curve is a geodesic: a straight line, once it is laid flat."""

    def __init__(self, curve: Any, distances: Sequence[float], **options: Unpack[FaceOptions]) -> None:
        super().__init__(GeodesicDevelopable(in_space(curve_of(curve, "curve")), distances), **options)


class GTPlateau(GTFace):
    """Face object: the patch of least energy inside four curves, v = 0, v = 1, u = 0 and u = 1.

    Parameters
    ----------
    c0, c1, d0, d1
        The boundary, as of ``GTCoons``.
    inner_degree
        Of the functions inside, or a pair.
    functional
        The energy.
    options
        See ``FaceOptions``.
    """

    def __init__(
        self,
        c0: Any,
        c1: Any,
        d0: Any,
        d1: Any,
        inner_degree: int | tuple[int, int] = 4,
        functional: Functional = "dirichlet",
        **options: Unpack[FaceOptions],
    ) -> None:
        curves = curve_of(c0, "c0"), curve_of(c1, "c1"), curve_of(d0, "d0"), curve_of(d1, "d1")
        super().__init__(fixed_contour(curves, inner_degree, functional), **options)


class GTDirichlet(GTFace):
    """Face object: the surface of least Dirichlet energy with these boundary control points.

    Parameters
    ----------
    net
        Shape (n + 1, m + 1, 3); interior control points are not looked at and may be NaN.
    gamma_u, gamma_v
        Design variables.
    options
        See ``FaceOptions``.
    """

    def __init__(
        self,
        net: ArrayLike,
        gamma_u: Sequence[float] = (0.0, 0.0),
        gamma_v: Sequence[float] = (0.0, 0.0),
        **options: Unpack[FaceOptions],
    ) -> None:
        super().__init__(dirichlet_extremal(net, gamma_u, gamma_v), **options)
