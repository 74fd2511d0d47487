"""What all developable patches have in common: tangent planes, rulings, edge of regression, singular places."""

from __future__ import annotations

import abc
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import checked_order, checked_parameters
from gtcad.errors import SingularDevelopable
from gtcad.factors import CurveOfTerms, SurfaceOfTerms
from gtcad.patches._definitions import Edge
from gtcad.patches._moving_frames import largest_norm
from gtcad.patches._patch import LINEAR, Patch, Rows, placed, placed_error
from gtcad.patches._singular import VANISHES, first_zero

Array = NDArray[np.float64]

STILL = 1e-6  # of the size: a change as small in all is no scale to measure by
_SLIGHT = 1e-3  # of the coordinates: of a length or a speed that is less, 1e-9 may be rounding
_AT_INFINITY = 1e-12  # relative difference of the stretches of two boundaries that is rounding


@dataclass(frozen=True)
class Ruling:
    """Straight lines: points ``point + w direction``.

    Attributes
    ----------
    point
        A point of each line, shape (..., 3).
    direction
        Its unit direction, shape (..., 3).
    """

    point: Array
    direction: Array


class Developable(Patch):
    """A patch ``S(u, v) = (1 - v) a(u) + v b(u)`` with one tangent plane along each ruling v -> S(u, v).

    Made by ``PlaneFamily.enveloping``, ``spine_developable`` and ``geodesic_developable``. Its boundaries have
    formulas, but are no finite sums of factors: the patch that is evaluated, fitted and proved has polynomials in their
    place, and ``definition_error`` is a proved bound of its distance from the patch by definition.
    """

    placement: Rows | None

    @property
    @abc.abstractmethod
    def _edges(self) -> tuple[Edge, Edge]:
        """The boundaries v = 0 and v = 1, without placement."""

    @abc.abstractmethod
    def _normals(self, t: Array) -> Array:
        """Unit normals of the tangent planes at flat parameters, to either side, without placement."""

    @abc.abstractmethod
    def _directions(self, t: Array) -> Array:
        """Unit directions of the rulings at flat parameters, either way, without placement."""

    # As a surface

    def _built(self) -> SurfaceOfTerms:
        curves = [edge.curve[0] for edge in self._edges]
        terms = [
            (curve.factors, LINEAR, np.stack([end * curve.coefficients for end in ends], axis=1))
            for curve, ends in zip(curves, ((1.0, 0.0), (0.0, 1.0)), strict=True)
        ]
        return placed(SurfaceOfTerms.summed(terms), self.placement)

    @property
    def a(self) -> CurveOfTerms:
        """The boundary v = 0."""
        return self.boundary("v0")

    @property
    def b(self) -> CurveOfTerms:
        """The boundary v = 1."""
        return self.boundary("v1")

    @cached_property
    def definition_error(self) -> float:
        """Proved bound of the distance from the patch by definition at equal parameters, in the model's unit."""
        curves = [edge.curve for edge in self._edges]
        sizes = [curve.factors.derivative_bound(0) * largest_norm(curve.coefficients) for curve, _ in curves]
        return placed_error(self.placement, max(bound for _, bound in curves), max(sizes))

    # By definition

    def exact_boundaries(self, t: ArrayLike, order: int = 0) -> tuple[Array, Array]:
        """Derivatives of the order of the boundaries v = 0 and v = 1 by definition, each of shape t.shape + (d,).

        In closed form, accurate to rounding times the condition of the formulas: what ``a`` and ``b`` stand for.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the order is not a whole number from 0.
        """
        order, t = checked_order("order", order), checked_parameters("t", t)
        a, b = (one[order].reshape(*t.shape, -1) for one in self.exact_derivatives(t.reshape(-1), order))
        return a, b

    def exact_derivatives(self, t: Array, order: int) -> tuple[Array, Array]:
        """Derivatives 0..order of both at flat parameters, each of shape (order + 1, t.size, d)."""
        a, b = (edge.taylor(t, order + 1) for edge in self._edges)
        both = [np.stack([one.derivative(k) for k in range(order + 1)]) for one in (a, b)]
        if self.placement is not None:
            rows = np.array(self.placement)
            both = [one @ rows[:, :3].T for one in both]
            for one in both:
                one[0] += rows[:, 3]
        return both[0], both[1]

    def normal(self, t: ArrayLike) -> Array:
        """Unit normals of the tangent planes by definition, on the side of S_u x S_v, shape t.shape + (3,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        t = checked_parameters("t", t)
        normals = self._side * self._normals(t.reshape(-1))
        if self.placement is not None:
            normals = normals @ _cofactors(self.placement).T
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals.reshape(*t.shape, 3)

    @cached_property
    def _side(self) -> float:
        """1 where the normals are on the side of S_u x S_v, -1 where they are not."""
        middle = np.array([0.5])
        (a, slope), b = self._edges[0].taylor(middle, 2).terms, self._edges[1].taylor(middle, 1).values
        return float(np.sign(np.cross(slope, b - a)[0] @ self._normals(middle)[0]))

    def ruling(self, t: ArrayLike) -> Ruling:
        """The rulings by definition: their points on the boundary a, and their directions towards b.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        a, b = self.exact_boundaries(t)
        along = b - a
        return Ruling(a, along / np.linalg.norm(along, axis=-1, keepdims=True))

    def regression(self, t: ArrayLike) -> Array:
        """Points of the edge of regression by definition, shape t.shape + (d,); NaN where it is at infinity.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        t = checked_parameters("t", t)
        first, second = self._stretches(t.reshape(-1))
        gap = first - second
        far = np.abs(gap) <= _AT_INFINITY * np.maximum(np.abs(first), np.abs(second))
        place = np.where(far, np.nan, first / np.where(far, 1.0, gap)).reshape(*t.shape, 1)
        a, b = self.exact_boundaries(t)
        return np.asarray(a + place * (b - a))

    def _stretches(self, t: Array) -> tuple[Array, Array]:
        """How fast a and b advance across the rulings, in one tangent plane: at the edge of regression nothing does."""
        first, second = (self._stretch(edge, t) for edge in self._edges)
        return first, second

    def _stretch(self, edge: Edge, t: Array) -> Array:
        """Of one of them."""
        across = np.cross(self._directions(t), self._normals(t))
        return np.asarray(np.einsum("td,td->t", edge.taylor(t, 2).terms[1], across))

    # What makes it singular

    def _refuse_singular(self) -> None:
        """Refuse a patch whose boundaries meet, or that its edge of regression crosses.

        Raises
        ------
        SingularDevelopable
            With the first parameter.
        """
        t = np.linspace(0, 1, 129)
        start, end = (edge.taylor(t, 2).terms for edge in self._edges)
        sizes = [np.linalg.norm(one, axis=2).max(axis=1) for one in (start, end)]
        least = [_SLIGHT * float(size) for size, _ in sizes]
        longest = float(np.linalg.norm(end[0] - start[0], axis=1).max())
        refuse_zero("the boundaries meet", self._gap, max(longest, *least))
        scales = [max(float(speed), slight) for (_, speed), slight in zip(sizes, least, strict=True)]
        zeros = [
            first_zero(partial(self._stretch, edge), scale) for edge, scale in zip(self._edges, scales, strict=True)
        ]
        crossings = [zero for zero in zeros if zero is not None]
        first, second = self._stretches(np.zeros(1))
        if first[0] * second[0] < 0:
            crossings.append(0.0)
        if crossings:
            place = min(crossings)
            stretches = self._stretches(np.array([place]))
            along = all(abs(one[0]) <= VANISHES * scale for one, scale in zip(stretches, scales, strict=True))
            reason = "a ruling has no tangent plane" if along else "the edge of regression meets the patch"
            raise SingularDevelopable(reason, place)

    def _gap(self, t: Array) -> Array:
        """From a to b along the ruling, signed."""
        a, b = (edge.taylor(t, 1).values for edge in self._edges)
        return np.asarray(np.einsum("td,td->t", b - a, self._directions(t)))


def refuse_zero(reason: str, function: Callable[[Array], Array], scale: float) -> None:
    """Refuse where a function vanishes.

    Raises
    ------
    SingularDevelopable
        With the first parameter where it does.
    """
    zero = first_zero(function, scale)
    if zero is not None:
        raise SingularDevelopable(reason, zero)


def _cofactors(placement: Rows) -> Array:
    """The matrix that takes normals to normals."""
    x, y, z = np.pad(np.array(placement)[:, :3], ((0, 3 - len(placement)), (0, 0)))
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
