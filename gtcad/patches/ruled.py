"""Ruled patches, cylinders and cones: straight in v."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms
from gtcad.patches._patch import (
    LINEAR,
    Patch,
    checked_curves,
    checked_direction,
    checked_number,
    checked_vector,
    in_space,
)
from gtcad.protocol import SeparableCurve


@dataclass(frozen=True)
class Ruled(Patch):
    """The patch ``S(u, v) = (1 - v) a(u) + v b(u)`` between two curves: of degree 1 in v.

    Parameters
    ----------
    a, b
        Curves of any kind, not necessarily of one, of one dimension; points of equal parameter are joined. Boundaries
        "v0" and "v1".

    Raises
    ------
    InputError
        When one is no curve, or the dimensions differ.

    Examples
    --------
    Two lines that cross each other in space span a hyperbolic paraboloid, z = x y:

    >>> from gtcad import BERNSTEIN, Curve
    >>> saddle = Ruled(
    ...     Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN), Curve([[0, 1, 0], [1, 1, 1]], family=BERNSTEIN)
    ... )
    >>> saddle.evaluate(0.5, 0.25).tolist()
    [0.5, 0.25, 0.125]
    """

    a: SeparableCurve
    b: SeparableCurve

    def __post_init__(self) -> None:
        checked_curves(a=self.a, b=self.b)

    def _built(self) -> SurfaceOfTerms:
        return SurfaceOfTerms.summed(
            [
                (curve.factors, LINEAR, np.stack([end * curve.coefficients for end in ends], axis=1))
                for curve, ends in ((self.a, (1.0, 0.0)), (self.b, (0.0, 1.0)))
            ]
        )

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Ruled:
        """The affine image: points x become ``matrix @ x + translation``."""
        return Ruled(self.a.transformed(matrix, translation), self.b.transformed(matrix, translation))


def cylinder(curve: SeparableCurve, vector: ArrayLike) -> Ruled:
    """The general cylinder ``S(u, v) = C(u) + v w``.

    Parameters
    ----------
    curve
        C; a plane one lies at z = 0.
    vector
        w, from the first boundary to the second, not 0.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> from gtcad import Curve
    >>> cylinder(Curve([[1, 0], [1, 1], [0, 1]]), [0, 0, 2]).evaluate(1.0, 0.5).tolist()
    [0.0, 1.0, 1.0]
    """
    checked_curves(curve=curve)
    offset = checked_direction("vector", vector)
    return Ruled(in_space(curve), curve.transformed(np.eye(3, curve.dimension), offset))


def cone(curve: SeparableCurve, apex: ArrayLike, range: Sequence[float] = (0.0, 1.0)) -> Ruled:
    """The general cone ``S(u, v) = (1 - w) C(u) + w apex``, w running linearly over the range.

    Parameters
    ----------
    curve
        C; a plane one lies at z = 0.
    apex
        The point that all rulings run to. Where w reaches 1 the boundary is that point alone.
    range
        First and last w: 0 on the curve, 1 at the apex. The apex must not lie between them.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    The half of a cone that is next to its base:

    >>> from gtcad import Curve
    >>> cone(Curve([[2, 0], [2, 2], [0, 2]]), [0, 0, 4], (0.0, 0.5)).evaluate(0.0, 1.0).tolist()
    [1.0, 0.0, 2.0]
    """
    checked_curves(curve=curve)
    tip = np.array(checked_vector("apex", apex))
    try:
        start, end = range
    except (TypeError, ValueError):
        raise InputError(f"range must be two numbers, got {range!r}") from None
    start, end = checked_number("range[0]", start), checked_number("range[1]", end)
    if start == end or min(start, end) < 1 < max(start, end):
        raise InputError(f"range must be two different numbers, not on both sides of the apex at 1, got {(start, end)}")
    lifted = np.eye(3, curve.dimension)
    return Ruled(*(curve.transformed((1 - w) * lifted, w * tip) for w in (start, end)))
