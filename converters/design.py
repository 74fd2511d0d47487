"""GT curves nearest to given geometry: B-splines, ellipse arcs, edges of a kernel, any curve of the protocol.

The control points and design variables are those of least squares on samples of the source; the deviation is proved
afterwards, from the source itself. At equal parameters that is one certificate. With corrected parameters both curves
are cut into many parts that are matched one by one, each at equal parameters: a monotone correspondence of the whole,
so that the largest bound of a part bounds the distance of the point sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import Basis, is_whole
from gtcad.chebyshev import gauss_legendre
from gtcad.composite import Composite
from gtcad.continuity import check_join, parsed_order
from gtcad.converters.certificate import Certificate
from gtcad.converters.fit import precision_floor
from gtcad.converters.nearest import PointSet, distances, grid
from gtcad.converters.sources import Source, source_of
from gtcad.curve import Curve
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.interpolation import PointFit, approximate
from gtcad.protocol import checked_tolerance
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]
Shape = TypeVar("Shape", Curve, Composite)

_CLOSED = 1e-12  # of the size: ends that differ by less are one
_MATCHED = (32, 64, 128, 256, 512)  # parts that corrected parameters are proved with
_GOOD = 1.05  # upper bound over the largest distance at matched parameters that needs no more parts
_FEET = 20
_SEEN = 501  # samples of each curve in an estimated lower bound


@dataclass(frozen=True, eq=False)
class Design(Generic[Shape]):
    """A GT curve, or a chain of them, made for given geometry, and what was proved of it.

    Attributes
    ----------
    curve
        A Curve, or a Composite.
    deviation
        (lower, upper) in the source's unit. The upper bound is proved, rounding included, and bounds the distance of
        the point sets either way. At equal parameters it is that of the largest distance at equal parameters, and the
        lower one is attained. With corrected parameters the lower one is the largest distance from a sample of either
        curve to the other one: estimated.
    parametrisation
        "equal": the curve's parameter runs with the source's, piece by piece linearly; "corrected": it does not.
    breaks
        The source's parameters, mapped to [0, 1], where the pieces start and end: (0, 1) for one curve.
    """

    curve: Shape
    deviation: tuple[float, float]
    parametrisation: Literal["equal", "corrected"]
    breaks: tuple[float, ...] = (0.0, 1.0)


def nearest_gt(
    source: Any,
    degree: int,
    *,
    tolerance: float | None = None,
    gamma: Sequence[float] | None = None,
    correct_parameters: bool = False,
) -> Design[Curve]:
    """The GT curve nearest to given geometry, with its ends, and the proved deviation.

    Parameters
    ----------
    source
        A BSplineCurve (rational or not), an EllipseArc, a curve of the protocol, or an edge of the kernel (a TopoDS
        edge, an edge of build123d or CadQuery), which gives a curve in the direction of the edge, in mm.
    degree
        Of the curve; with a tolerance the largest that is tried, from 2 on.
    tolerance
        Largest deviation allowed, in the source's unit; None takes what the degree gives.
    gamma
        Design variables; None makes them unknowns.
    correct_parameters
        Whether the correspondence of the parameters is an unknown too: nearer as a point set, and slower.

    Raises
    ------
    InputError
        When an argument is out of its range or the source is of no known kind.
    ToleranceNotMet
        When no degree within the limit keeps the tolerance.
    KernelError
        When an edge has no exact form.

    Notes
    -----
    One curve is smooth: it cannot follow the knots of a spline closely, see ``nearest_chain``. Least squares with the
    weight of Chebyshev polynomials comes near to the least largest deviation where the source is smooth.

    Examples
    --------
    >>> half = EllipseArc([0, 0, 0], [2, 0, 0], [0, 2, 0], 0.0, 3.141592653589793)
    >>> design = nearest_gt(half, 8, tolerance=1e-3)
    >>> design.curve.degree, design.deviation[1] <= 1e-3
    (4, True)
    """
    given, backwards = source_of(source)
    Basis(degree)
    if tolerance is not None:
        checked_tolerance(tolerance)
    least = math.inf
    for one in (degree,) if tolerance is None else range(2, degree + 1):
        design = _nearest(given, int(one), gamma, correct_parameters)
        if tolerance is None or design.deviation[1] <= tolerance:
            return (
                design if not backwards else Design(design.curve.reversed(), design.deviation, design.parametrisation)
            )
        least = min(least, design.deviation[1])
    assert tolerance is not None
    raise ToleranceNotMet(tolerance, least, 1, f"degree = {degree} is the largest allowed")


def nearest_chain(
    source: Any,
    degree: int,
    *,
    tolerance: float,
    order: str = "G1",
    gamma: Sequence[float] | None = None,
    max_pieces: int = 256,
) -> Design[Composite]:
    """A chain of GT curves within a tolerance of given geometry, joined as the source is.

    Each piece has the source's derivatives 0..k at its ends, so that a joint is of order k where the source is. The
    source is cut at its corners, then in the middle, or at a knot near it, where a piece misses the tolerance. The
    basis has no linear precision, so that at equal parameters pieces of degree 3 or 4 gain little from being short:
    the deviation falls with the length, or not much faster, while each degree gains about a digit.

    Parameters
    ----------
    source, gamma
        As for ``nearest_gt``.
    degree
        Of all pieces, at least 2 k + 1.
    tolerance
        Largest deviation allowed, in the source's unit.
    order
        Wanted at the joints: "C0", "G0", "G1", "G2" or "G3". Pieces over intervals of different lengths join G^k, not
        C^k.
    max_pieces
        Largest number of pieces.

    Returns
    -------
    Design
        Its curve closed when the source is, its orders those that ``check_join`` finds: lower than wanted where the
        source is, "C1" and up where the pieces happen to join so.

    Raises
    ------
    InputError, KernelError
        As ``nearest_gt``.
    ToleranceBelowPrecision
        When double precision cannot prove the tolerance for coordinates of this size.
    ToleranceNotMet
        When ``max_pieces`` are not enough.

    Examples
    --------
    >>> circle = EllipseArc([0, 0, 0], [2, 0, 0], [0, 2, 0], 0.0, 6.283185307179586)
    >>> design = nearest_chain(circle, 2, tolerance=1e-9, order="C0")
    >>> len(design.curve.pieces), design.curve.closed, design.deviation[1] < 1e-12
    (4, True, True)
    """
    kind, count = parsed_order(order)
    if kind == "C" and count:
        raise InputError(f'order must be "C0", or "G0" to "G3" as pieces have different lengths, got {order!r}')
    if not is_whole(max_pieces) or max_pieces < 1:
        raise InputError(f"max_pieces must be a whole number from 1, got {max_pieces!r}")
    checked_tolerance(tolerance)
    given, backwards = source_of(source)
    if Basis(degree).degree < 2 * count + 1:
        raise InputError(f"order {order} needs degree {2 * count + 1} at least, got {degree}")
    size = float(np.abs(given.evaluate(np.linspace(0, 1, 33))).max())
    floor = size * precision_floor((Basis(degree),))
    if tolerance < floor:
        raise ToleranceBelowPrecision(tolerance, floor)
    joints = _Joints.of(given, size)
    found: dict[tuple[float, float], tuple[Curve, Certificate]] = {}
    spans = list(pairwise(given.corners(max(count, 1))))
    while True:
        for span in spans:
            if span not in found:
                found[span] = _piece(given.part(*span), joints.ends(*span), int(degree), count, gamma)
        missed = [span for span in spans if found[span][1].upper > tolerance]
        if not missed:
            break
        if len(spans) + len(missed) > max_pieces:
            largest = max(found[span][1].upper for span in missed)
            raise ToleranceNotMet(tolerance, largest, len(spans), f"max_pieces = {max_pieces}")
        halves = [half for a, b in missed for half in pairwise((a, given.middle(a, b), b))]
        spans = sorted(set(spans).difference(missed).union(halves))
    pieces, proofs = zip(*(found[span] for span in spans), strict=True)
    after = (*pieces[1:], pieces[0]) if joints.closed else pieces[1:]
    orders = tuple(check_join(*joint).order for joint in zip(pieces, after, strict=False))
    chain, breaks = Composite(pieces, orders, joints.closed), (0.0, *(span[1] for span in spans))
    if backwards:
        chain, breaks = chain.reversed(), tuple(1 - x for x in breaks[::-1])
    deviation = max(proof.lower for proof in proofs), max(proof.upper for proof in proofs)
    return Design(chain, deviation, "equal", breaks)


# --- fits and their proofs ----------------------------------------------------------------------------------------


def _nearest(source: Source, degree: int, gamma: Sequence[float] | None, correct: bool) -> Design[Curve]:
    if not correct:
        ends = source.evaluate(np.array([0.0, 1.0]))
        curve, proof = _piece(source, ends, degree, 0, gamma)
        return Design(curve, (proof.lower, proof.upper), "equal")
    x, weights = _samples(source, degree)
    fit = approximate(source.evaluate(x), degree, gamma=gamma, parameters=x, weights=weights, correct_parameters=True)
    return Design(fit.curve, _matched_deviation(source, fit, x), "corrected")


def _piece(
    source: Source, ends: Array, degree: int, order: int, gamma: Sequence[float] | None
) -> tuple[Curve, Certificate]:
    """The curve of least squares with the given ends and the source's derivatives there up to the order."""
    x, weights = _samples(source, degree)
    points = source.evaluate(x)
    points[[0, -1]] = ends
    start, end = (np.array([source.derivative(np.array([t]), r)[0] for r in range(1, order + 1)]) for t in (0.0, 1.0))
    fit = approximate(points, degree, gamma=gamma, parameters=x, weights=weights, end_derivatives=(start, end))
    return fit.curve, source.certify(fit.curve)


def _samples(source: Source, degree: int) -> tuple[Array, Array]:
    """Parameters, both ends among them, and weights: quadrature on each span, with the weight of Chebyshev."""
    widths = np.diff(source.breaks)
    z, weights = gauss_legendre(max(8, -(-8 * (degree + 2) // len(widths))))
    inner = (source.breaks[:-1, None] + widths[:, None] * (z + 1) / 2).reshape(-1)
    density = (widths[:, None] * weights).reshape(-1) / np.sqrt(inner * (1 - inner))
    ends = [density.min()]  # the ends are met: their weight plays no part
    return np.concatenate([[0.0], inner, [1.0]]), np.concatenate([ends, density, ends])


def _matched_deviation(source: Source, fit: PointFit, x: Array) -> tuple[float, float]:
    """Lower bound, estimated, and upper bound, proved, of the distance of two point sets, by matching small parts."""
    lower = _estimated_distance(source, fit.curve)
    upper = source.certify(fit.curve).upper
    for count in _MATCHED:
        if upper <= _GOOD * lower:
            break
        places = np.linspace(0.0, 1.0, count + 1)
        t = _feet(fit.curve, source.evaluate(places), np.interp(places, x, np.maximum.accumulate(fit.parameters)))
        kept = np.concatenate([[True], np.diff(np.maximum.accumulate(t)) > 1e-9])
        kept[-1] = True
        matches = np.stack([places, np.maximum.accumulate(t)])[:, kept]
        if (np.diff(matches[1]) <= 0).any():
            continue
        proofs = [
            source.part(places[0], ends[0]).certify(RestrictedCurve(fit.curve, (places[1], ends[1])))
            for places, ends in pairwise(matches.T.tolist())
        ]
        upper = min(upper, max(proof.upper for proof in proofs))
    return min(lower, upper), upper


def _feet(curve: Curve, points: Array, t: Array) -> Array:
    """Parameters of the feet of points near given ones, by Gauss-Newton; the ends stay ends."""
    for _ in range(_FEET):
        speeds, gaps = curve.derivative(t), points - curve.evaluate(t)
        squares = np.maximum((speeds * speeds).sum(axis=1), np.finfo(float).tiny)
        t = np.clip(t + (speeds * gaps).sum(axis=1) / squares, 0.0, 1.0)
        t[[0, -1]] = 0.0, 1.0
    return t


def _estimated_distance(source: Source, curve: Curve) -> float:
    def measured(one: Source | Curve) -> PointSet:
        return PointSet.measured(1, lambda t: one.evaluate(t[:, 0]), lambda t: one.derivative(t[:, 0], 1)[:, None])

    pair, places = (measured(source), measured(curve)), grid(1, _SEEN)
    return max(float(distances(a.evaluate(places), b).max()) for a, b in (pair, pair[::-1]))


@dataclass(frozen=True, eq=False)
class _Joints:
    """Points where pieces meet: the same numbers for both, and for both ends of a closed source."""

    source: Source
    closed: bool

    @classmethod
    def of(cls, source: Source, size: float) -> _Joints:
        start, end = source.evaluate(np.array([0.0, 1.0]))
        return cls(source, float(np.linalg.norm(end - start)) <= _CLOSED * size)

    def ends(self, a: float, b: float) -> Array:
        return self.source.evaluate(np.array([a, 0.0 if self.closed and b == 1 else b]))
