"""Developable patches that a family of planes envelops."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.errors import InputError, SingularDevelopable
from gtcad.patches._definitions import Cut, Edge, Planes, constant
from gtcad.patches._developable import STILL, Developable, refuse_zero
from gtcad.patches._patch import Rows, checked_placement, followed, handedness, in_space
from gtcad.patches._plane_family import PlaneFamily, checked_plane, moved_planes
from gtcad.patches._singular import first_zero, highest
from gtcad.patches._taylor import Taylor
from gtcad.protocol import SeparableCurve, domain_part
from gtcad.restricted import Restricted

Array = NDArray[np.float64]
Plane = tuple[float, float, float, float]
Bound = Plane | SeparableCurve


@dataclass(frozen=True)
class Enveloping(Developable):
    """The developable that planes ``n(t).x = d(t)`` envelop, each ruling cut off by two bounds.

    A bounding plane m.x = e cuts the ruling at ``[n; n'; m] x = [d; d'; e]``; a bounding curve c ends it at its point
    nearest to c(t), where ``[n; n'; n x n'] x = [d; d'; (n x n').c]``.

    Parameters
    ----------
    family
        The planes.
    bound_a, bound_b
        Planes (a, b, c, d), a x + b y + c z = d, or curves in space: boundaries "v0" and "v1".
    part
        The part of the parameters t that is meant, of the planes and of bounding curves alike.
    placement
        Rows ``[matrix | translation]`` of an affine map that the patch is moved by afterwards, shape (2 or 3, 4).

    Raises
    ------
    SingularDevelopable
        With the first parameter of the patch, in [0, 1], where a plane stands still, a ruling is parallel to a bounding
        plane, the bounds meet, or the edge of regression meets the patch, looked for in this order.
    InputError
        When an argument is out of its range, or the patch needs polynomials of a degree above 190: take parts.

    Notes
    -----
    ``definition_error`` comes from the residual of the equations above with the polynomials in place, bounded on spans
    of [0, 1] together with the least determinant; 1e-14 to 1e-11 of the size for regular families, in 5 to 50 ms.
    """

    family: PlaneFamily
    bound_a: Bound
    bound_b: Bound
    part: tuple[float, float] = (0.0, 1.0)
    placement: Rows | None = None

    def __init__(
        self,
        family: PlaneFamily,
        bound_a: ArrayLike | SeparableCurve,
        bound_b: ArrayLike | SeparableCurve,
        part: tuple[float, float] = (0.0, 1.0),
        placement: ArrayLike | None = None,
    ) -> None:
        if not isinstance(family, PlaneFamily):
            raise InputError(f"family must be a PlaneFamily, got {type(family).__name__}")
        object.__setattr__(self, "family", family)
        for name, bound in (("bound_a", bound_a), ("bound_b", bound_b)):
            object.__setattr__(self, name, _checked_bound(name, bound))
        object.__setattr__(self, "part", domain_part("part", part))
        object.__setattr__(self, "placement", checked_placement(placement))
        self._refuse_vanishing()
        self._refuse_singular()
        _ = self.definition_error  # refuses what has no polynomials

    @cached_property
    def _planes(self) -> Planes:
        return self.family.planes(self.part)

    @cached_property
    def _edges(self) -> tuple[Edge, Edge]:
        return Edge(self._cut(self.bound_a)), Edge(self._cut(self.bound_b))

    def _cut(self, bound: Bound) -> Cut:
        if isinstance(bound, SeparableCurve):
            return Cut(0.0, self._planes, bound if self.part == (0.0, 1.0) else Restricted(bound, self.part))
        return Cut(0.0, self._planes, Planes(constant(bound[:3]), constant(bound[3])))

    def _normals(self, t: Array) -> Array:
        normals = self._planes.normals.evaluate(t)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def _directions(self, t: Array) -> Array:
        return self._planes.rulings(Taylor.at(t, 1)).unit().values

    def _refuse_vanishing(self) -> None:
        """Refuse planes that stand still, and rulings parallel to a bounding plane."""
        t = np.linspace(0, 1, 129)
        n, slope = (np.linalg.norm(self._planes.normals.derivative(t, order), axis=1).max() for order in (0, 1))
        refuse_zero("a plane of the family has no normal", self._planes.normals.evaluate, float(n))
        refuse_zero("a plane of the family does not turn", self._rulings, float(n * max(slope, STILL * n)))
        parallel = []
        for name, bound in (("bound_a", self.bound_a), ("bound_b", self.bound_b)):
            if not isinstance(bound, SeparableCurve):
                normal = np.array(bound[:3])
                place = first_zero(partial(self._along, normal), float(np.linalg.norm(normal)))
                parallel += [] if place is None else [(place, name)]
        if parallel:
            place, name = min(parallel)
            raise SingularDevelopable(f"a ruling is parallel to the plane {name}", place)

    def _along(self, normal: Array, t: Array) -> Array:
        return np.asarray(self._directions(t) @ normal)

    def _rulings(self, t: Array) -> Array:
        return self._planes.rulings(Taylor.at(t, 1)).values

    @cached_property
    def bound_gaps(self) -> tuple[float, float]:
        """Largest distances of the boundaries from their bounds at equal parameters, sampled; 0 from a plane.

        Before the placement.
        """
        gaps = []
        for edge, bound in zip(self._edges, (self.bound_a, self.bound_b), strict=True):
            cut = edge.base
            if not isinstance(bound, SeparableCurve) or not isinstance(cut, Cut):
                gaps.append(0.0)
                continue
            curve = bound if self.part == (0.0, 1.0) else Restricted(bound, self.part)

            def apart(t: Array, cut: Cut = cut, curve: SeparableCurve = curve) -> Array:
                return np.asarray(np.linalg.norm(cut.taylor(t, 1).values - curve.evaluate(t), axis=1))

            gaps.append(highest(apart)[1])
        return gaps[0], gaps[1]

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Enveloping:
        """The affine image: points x become ``matrix @ x + translation``; of a similarity it has no placement."""
        if self.placement is not None or not handedness(matrix):
            return replace(self, placement=followed(self.placement, matrix, translation))
        a, b = (
            bound.transformed(matrix, translation)
            if isinstance(bound, SeparableCurve)
            else moved_planes(np.array(bound), matrix, translation)
            for bound in (self.bound_a, self.bound_b)
        )
        return Enveloping(self.family.transformed(matrix, translation), a, b, self.part)


def _checked_bound(name: str, bound: ArrayLike | SeparableCurve) -> Bound:
    if not isinstance(bound, SeparableCurve):
        return checked_plane(name, bound)
    if bound.dimension not in (2, 3):
        raise InputError(f"{name} must be a curve in space, got one of dimension {bound.dimension}")
    return in_space(bound)
