"""From a quilt to B-spline surfaces within a tolerance that share their edges' poles, proved.

Directions of patches that are connected through shared edges (opposite sides of a patch have one direction) form a
strip: all patches of a strip have one knot vector, run backwards where the patch runs against the strip, and one
approximation operator. The operator is linear on functions, hence equal boundary curves get equal poles up to
rounding, of whatever kinds the two neighbours are; these are then made the same to the last bit. Nothing is sewn.

The same linearity carries a join of order k along a whole edge: the derivatives 0..k across the edge are exact on both
sides, and what the conditions of the join say of them as functions along the edge, the operator passes on.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import nodes
from gtcad.continuity import parsed_order
from gtcad.converters.approximation import Approximation, Bundle
from gtcad.converters.bspline import MAX_DEGREE, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_surface, deciding
from gtcad.converters.exact import polynomial_form
from gtcad.converters.fit import precision_floor
from gtcad.converters.search import Side, fewest
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.factors import RestrictedFactors, Stacked
from gtcad.protocol import Factors, SeparableSurface
from gtcad.quilt import SIDES, Quilt, Use

Array = NDArray[np.float64]
Node = TypeVar("Node", int, tuple[int, str])

_SHARE = 0.7  # of the tolerance for each direction at first: the errors of both seldom peak at one place
_TAIL = 1e-3  # of the tolerance may go into the tails of series
_WORST = 24  # samples of one direction that stand for all when it is combined with the other one
_SPANS_OF_A_FAILURE = 64
_BITS = 2.0**50  # knots are multiples of its inverse: 1 - t is exact, so that a strip is one either way


@dataclass(frozen=True, eq=False)
class QuiltFit:
    """Splines for the patches of a quilt, and what was proved of them.

    Attributes
    ----------
    quilt
        What was fitted.
    splines
        One for each patch, clamped, on [0, 1]. Both sides of a shared edge have the same poles to the last bit, and
        the same knots (backwards: the poles in reverse and the knots 1 - t, exactly); every vertex is one point, and so
        are all poles of a collapsed side.
    deviations
        (lower, upper) for each patch: bounds of the largest distance at equal parameters, in the model's unit. The
        upper one is proved, rounding included, and bounds the distance of the point sets; the lower one is attained.
    """

    quilt: Quilt
    splines: tuple[BSplineSurface, ...]
    deviations: tuple[tuple[float, float], ...]

    @property
    def deviation(self) -> tuple[float, float]:
        """The largest lower and the largest upper bound: those of the whole quilt."""
        return max(lower for lower, _ in self.deviations), max(upper for _, upper in self.deviations)


def fit_quilt(
    quilt: Quilt,
    *,
    tolerance: float,
    degree: int = 5,
    continuity: int | None = None,
    max_spans: int = 4096,
    adapt: bool = True,
) -> QuiltFit:
    """B-spline surfaces of few poles within the tolerance of all patches, neighbours with identical edges.

    Parameters
    ----------
    quilt
        The patches and the edges that they share. Joins of the order that its edges state stay joins of that order
        between the splines, along the whole edge.
    tolerance
        Largest distance allowed, in the model's unit, above 0.
    degree
        3 to 25. A strip that is polynomial in all its patches keeps their degree where that needs fewer poles.
    continuity
        Continuity at interior knots, 0 to degree - 1; degree - 1 unless given.
    max_spans
        Largest number of knot spans of a direction.
    adapt
        Move the knots of every strip as long as that saves poles.

    Raises
    ------
    InputError
        When an argument is out of its range.
    ToleranceBelowPrecision
        When double precision cannot prove the tolerance for coordinates of this size.
    ToleranceNotMet
        When ``max_spans`` are not enough, or an edge was stated with a gap that the tolerance does not allow.

    Examples
    --------
    >>> from gtcad import Surface
    >>> net = [[[0, 0, 0], [0, 10, 4], [0, 20, 0]], [[10, 0, 3], [10, 10, 0], [10, 20, 5]], [[20, 0, 0]] * 3]
    >>> patch = Surface(net)
    >>> fit = fit_quilt(Quilt.recognised([patch, patch.transformed(np.diag([1, -1, 1]))]), tolerance=1e-4)
    >>> a, b = fit.splines
    >>> fit.deviation[1] <= 1e-4, bool((a.control_points[:, 0] == b.control_points[:, 0]).all())
    (True, True)
    """
    _check(tolerance, degree, continuity, max_spans)
    for patch in quilt.patches:
        size = float(np.sqrt((patch.coefficients**2).sum(axis=-1)).max())
        floor = size * precision_floor((patch.factors_u, patch.factors_v))
        if tolerance < floor:
            raise ToleranceBelowPrecision(tolerance, floor)
    strips = _strips(quilt)
    for strip in strips:
        strip.choose(tolerance, degree, continuity, max_spans, adapt)
    layout = _Layout(quilt, strips)
    widest = max(quilt.gaps, default=0.0)
    if widest > tolerance:
        raise ToleranceNotMet(tolerance, widest, 0, "an edge was stated with a gap as wide as that")
    while True:
        failed = layout.estimated_above(tolerance)
        if not failed:
            splines = layout.splines()
            certificates = layout.proved(splines, tolerance)
            failed = [k for k, one in enumerate(certificates) if one.upper > tolerance]
            if not failed:
                return QuiltFit(quilt, splines, tuple((one.lower, one.upper) for one in certificates))
        wanting = {layout.worse_of(k).first: layout.worse_of(k) for k in failed}
        if not all([strip.grow() for strip in wanting.values()]):
            raise layout.failure(tolerance, max_spans)


def _check(tolerance: float, degree: int, continuity: int | None, max_spans: int) -> None:
    if not (tolerance > 0 and math.isfinite(tolerance)):
        raise InputError(f"tolerance must be a finite number above 0, got {tolerance}")
    if degree not in range(3, MAX_DEGREE + 1):
        raise InputError(f"degree must be a whole number in [3, {MAX_DEGREE}], got {degree!r}")
    if continuity is not None and continuity not in range(degree):
        raise InputError(f"continuity must be a whole number in [0, {degree - 1}], got {continuity!r}")
    if max_spans < 1:
        raise InputError(f"max_spans must be 1 or more, got {max_spans!r}")
