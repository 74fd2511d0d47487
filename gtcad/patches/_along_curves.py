"""Developable patches along a curve: its tangents, or the rulings that make it a geodesic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.errors import InputError
from gtcad.patches._definitions import (
    Cut,
    DarbouxDirection,
    Direction,
    Edge,
    RulingDirection,
    TangentDirection,
    centred,
)
from gtcad.patches._developable import STILL, Developable, refuse_zero
from gtcad.patches._moving_frames import largest_norm
from gtcad.patches._patch import (
    Rows,
    checked_curves,
    checked_number,
    checked_placement,
    followed,
    handedness,
    in_space,
)
from gtcad.patches._plane_family import PlaneFamily
from gtcad.patches._taylor import Taylor
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]
Distances = tuple[float, float]


@dataclass(frozen=True)
class SpineDevelopable(Developable):
    """The tangent surface of a spine C between two distances along its tangents.

        ``S(u, v) = C(u) + w C'(u) / |C'(u)|``, w running from the first distance to the second.

    Parameters
    ----------
    spine
        C, in space; or a family of planes, whose edge of regression is meant, with its rulings along n x n'.
    distances
        First and last w, both above 0 or both below, different: the spine is the edge of regression.
    placement
        Rows ``[matrix | translation]`` of an affine map that the patch is moved by afterwards, shape (2 or 3, 4).

    Raises
    ------
    SingularDevelopable
        With the first parameter where speed or curvature of the spine vanish, or its tangent surface is singular.
    InputError
        When an argument is out of its range, or the patch needs polynomials of a degree above 190.
    """

    spine: SeparableCurve | PlaneFamily
    distances: Distances
    placement: Rows | None = None

    def __init__(
        self,
        spine: SeparableCurve | PlaneFamily,
        distances: Sequence[float],
        placement: ArrayLike | None = None,
    ) -> None:
        if not isinstance(spine, PlaneFamily):
            checked_curves(spine=spine)
            spine = in_space(spine)
        object.__setattr__(self, "spine", spine)
        object.__setattr__(self, "distances", _checked_distances(distances))
        object.__setattr__(self, "placement", checked_placement(placement))
        start, end = self.distances
        if min(start, end) <= 0 <= max(start, end):
            raise InputError(
                "distances must be both above 0 or both below, for the spine is the edge of regression, got "
                f"{self.distances}"
            )
        if isinstance(spine, PlaneFamily):
            _refuse_still(spine)
        else:
            _refuse_straight(spine, "spine")
        self._refuse_singular()
        _ = self.definition_error  # refuses what has no polynomials

    @cached_property
    def _edges(self) -> tuple[Edge, Edge]:
        base: SeparableCurve | Cut
        along: Direction
        if isinstance(self.spine, PlaneFamily):
            planes = self.spine.planes()
            base, along = Cut(0.0, planes, None), RulingDirection(0.0, planes)
        else:
            local, error = centred(self.spine)
            base, along = self.spine, TangentDirection(error, local)
        start, end = self.distances
        return Edge(base, along, start), Edge(base, along, end)

    def _normals(self, t: Array) -> Array:
        if isinstance(self.spine, PlaneFamily):
            return self.spine.normal(t)
        return _bends(self.spine, t).unit().values

    def _directions(self, t: Array) -> Array:
        along = self._edges[0].along
        assert along is not None
        return along.taylor(t, 1).values

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> SpineDevelopable:
        """The affine image: points x become ``matrix @ x + translation``; of a similarity it has no placement."""
        hand = 0 if self.placement is not None else handedness(matrix)
        if not hand:
            return replace(self, placement=followed(self.placement, matrix, translation))
        turned = hand if isinstance(self.spine, PlaneFamily) else 1  # n x n' turns round in a mirror
        return SpineDevelopable(self.spine.transformed(matrix, translation), _scaled(self.distances, matrix, turned))


@dataclass(frozen=True)
class GeodesicDevelopable(Developable):
    """The developable that has a given curve C as a geodesic: its rectifying developable.

    With torsion and curvature, T and B of the Frenet frame, and the unit vector D along ``torsion T + curvature B``,

        ``S(u, v) = C(u) + w D(u)``, w running from the first distance to the second.

    Flattened, C becomes a straight line.

    Parameters
    ----------
    curve
        C, in space, its speed and curvature nowhere 0.
    distances
        First and last w, different; the curve lies on the patch when 0 is between them.
    placement
        Rows ``[matrix | translation]`` of an affine map that the patch is moved by afterwards, shape (2 or 3, 4).

    Raises
    ------
    SingularDevelopable
        With the first parameter where speed or curvature vanish, or where the edge of regression meets the patch.
    InputError
        When an argument is out of its range, or the patch needs polynomials of a degree above 190.
    """

    curve: SeparableCurve
    distances: Distances
    placement: Rows | None = None

    def __init__(self, curve: SeparableCurve, distances: Sequence[float], placement: ArrayLike | None = None) -> None:
        checked_curves(curve=curve)
        object.__setattr__(self, "curve", in_space(curve))
        object.__setattr__(self, "distances", _checked_distances(distances))
        object.__setattr__(self, "placement", checked_placement(placement))
        _refuse_straight(self.curve, "curve")
        self._refuse_singular()
        _ = self.definition_error  # refuses what has no polynomials

    @cached_property
    def _edges(self) -> tuple[Edge, Edge]:
        local, error = centred(self.curve)
        along = DarbouxDirection(error, local)
        start, end = self.distances
        return Edge(self.curve, along, start), Edge(self.curve, along, end)

    def _normals(self, t: Array) -> Array:
        first = Taylor.at(t, 1)(self.curve, 1)
        return _bends(self.curve, t).cross(first).unit().values

    def _directions(self, t: Array) -> Array:
        along = self._edges[0].along
        assert along is not None
        return along.taylor(t, 1).values

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> GeodesicDevelopable:
        """The affine image: points x become ``matrix @ x + translation``; of a similarity it has no placement."""
        hand = 0 if self.placement is not None else handedness(matrix)
        if not hand:
            return replace(self, placement=followed(self.placement, matrix, translation))
        return GeodesicDevelopable(self.curve.transformed(matrix, translation), _scaled(self.distances, matrix, hand))


def spine_developable(spine: SeparableCurve | PlaneFamily, distances: Sequence[float]) -> SpineDevelopable:
    """The tangent surface of a curve, or of a plane family's edge of regression; see ``SpineDevelopable``.

    Examples
    --------
    The tangents of a circle fill its plane:

    >>> from gtcad import Curve
    >>> ring = spine_developable(Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]]), (1.0, 2.0))
    >>> ring.evaluate(0.0, 1.0).round(12).tolist()
    [1.0, 2.0, 0.0]
    """
    return SpineDevelopable(spine, distances)


def geodesic_developable(curve: SeparableCurve, distances: Sequence[float]) -> GeodesicDevelopable:
    """The rectifying developable of a curve between two distances along its rulings; see ``GeodesicDevelopable``.

    Examples
    --------
    A circle is a geodesic of the cylinder on it:

    >>> from gtcad import Curve
    >>> wall = geodesic_developable(Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]]), (-1.0, 2.0))
    >>> wall.evaluate([0.0, 1.0], 1.0).round(12).tolist()
    [[1.0, 0.0, 2.0], [0.0, 1.0, 2.0]]
    """
    return GeodesicDevelopable(curve, distances)


def _bends(curve: SeparableCurve, t: Array) -> Taylor:
    at = Taylor.at(t, 1)
    return at(curve, 1).cross(at(curve, 2))


def _refuse_straight(curve: SeparableCurve, name: str) -> None:
    t = np.linspace(0, 1, 129)
    first, second = (float(np.linalg.norm(curve.derivative(t, order), axis=1).max()) for order in (1, 2))
    first = max(first, STILL * curve.factors.derivative_bound(1) * largest_norm(curve.coefficients))
    refuse_zero(f"the speed of the {name} vanishes", curve.derivative, first)
    bend = first * max(second, STILL * first)
    refuse_zero(f"the curvature of the {name} vanishes", lambda t: _bends(curve, t).values, bend)


def _refuse_still(family: PlaneFamily) -> None:
    """Refuse planes whose edge of regression is not regular."""
    t, planes = np.linspace(0, 1, 129), family.planes()
    n, slope, bend = (float(np.linalg.norm(planes.normals.derivative(t, order), axis=1).max()) for order in range(3))
    slope, bend = max(slope, STILL * n), max(bend, STILL * n)
    refuse_zero("a plane of the family has no normal", planes.normals.evaluate, n)
    refuse_zero("a plane of the family does not turn", lambda t: planes.rulings(Taylor.at(t, 1)).values, n * slope)
    refuse_zero("the edge of regression is at infinity", Cut(0.0, planes, None).determinant, n * slope * bend)


def _checked_distances(value: Sequence[float]) -> Distances:
    try:
        start, end = value
    except (TypeError, ValueError):
        raise InputError(f"distances must be two different numbers, got {value!r}") from None
    start, end = checked_number("distances[0]", start), checked_number("distances[1]", end)
    if start == end:
        raise InputError(f"distances must be two different numbers, got {(start, end)}")
    return start, end


def _scaled(distances: Distances, matrix: ArrayLike, hand: int) -> Distances:
    size = hand * float(np.linalg.norm(np.asarray(matrix, dtype=np.float64)[0]))
    return size * distances[0], size * distances[1]
