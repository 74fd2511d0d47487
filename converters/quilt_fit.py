"""From a quilt to B-spline surfaces within a tolerance that share their edges' poles, proved.

Directions of patches that are connected through shared edges (opposite sides of a patch have one direction) form a
strip: all patches of a strip have one knot vector, run backwards where the patch runs against the strip, and one
approximation operator. The operator is linear on functions, hence equal boundary curves get equal poles up to
rounding, of whatever kinds the two neighbours are; these are then made the same to the last bit. Nothing is sewn.

The same linearity carries a join of order k along a whole edge: the derivatives 0..k across the edge are exact on both
sides, and what the conditions of the join say of them as functions along the edge, the operator passes on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import nodes
from gtcad.continuity import parsed_order
from gtcad.converters.approximation import Approximation, Bundle
from gtcad.converters.bspline import MAX_DEGREE, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_surface, deciding
from gtcad.converters.exact import polynomial_form
from gtcad.converters.fit import Degree, precision_floor
from gtcad.converters.search import Side, fewest
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.factors import RestrictedFactors, Stacked
from gtcad.protocol import Factors, SeparableSurface, checked_kind, checked_tolerance
from gtcad.quilt import Quilt, Use, connected

Array = NDArray[np.float64]
_LEAST_DEGREE = 3
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
    degree: Degree = 5,
    continuity: int | None = None,
    max_spans: int = 4096,
    max_degree: int = 11,
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
        3 to 25, or "auto": for every strip the degree up to ``max_degree`` that needs the fewest poles. A strip that is
        polynomial in all its patches keeps their degree where that needs fewer.
    continuity
        Continuity at interior knots, 0 to degree - 1; degree - 1 unless given.
    max_spans
        Largest number of knot spans of a direction.
    max_degree
        Largest degree that "auto" takes, 3 to 25.
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
    checked_kind("quilt", quilt, Quilt, "a Quilt, as Quilt.recognised makes of patches")
    _check(tolerance, max_spans)
    degrees = _degrees(degree, max_degree, continuity)
    if tolerance < (floor := max(map(_floor, quilt.patches))):
        raise ToleranceBelowPrecision(tolerance, floor)
    if (widest := max(quilt.gaps, default=0.0)) > tolerance:
        raise ToleranceNotMet(tolerance, widest, 0, "an edge was stated with a gap as wide as that")
    side = partial(Side, degrees=degrees, continuity=continuity, max_spans=max_spans)
    strips = [_Strip(quilt, members, side, _SHARE * tolerance, adapt) for members in _members(quilt)]
    layout = _Layout(quilt, strips)
    while True:
        failed = layout.estimated_above(tolerance)
        if not failed:
            splines = layout.splines()
            certificates = layout.proved(splines, tolerance)
            failed = [k for k, one in enumerate(certificates) if one.upper > tolerance]
            if not failed:
                return QuiltFit(quilt, splines, tuple((one.lower, one.upper) for one in certificates))
        grown = [strip.grow() for strip in {layout.worse_of(k) for k in failed}]
        if not all(grown):
            raise layout.failure(tolerance, max_spans)


def _check(tolerance: float, max_spans: int) -> None:
    checked_tolerance(tolerance)
    if not max_spans >= 1:
        raise InputError(f"max_spans must be 1 or more, got {max_spans!r}")


def _degrees(degree: Degree, max_degree: int, continuity: int | None) -> tuple[int, ...]:
    allowed = range(_LEAST_DEGREE, MAX_DEGREE + 1)
    if degree == "auto" and max_degree not in allowed:
        raise InputError(f"max_degree must be a whole number in [{_LEAST_DEGREE}, {MAX_DEGREE}], got {max_degree!r}")
    if degree != "auto" and degree not in allowed:
        raise InputError(f'degree must be a whole number in [{_LEAST_DEGREE}, {MAX_DEGREE}] or "auto", got {degree!r}')
    degrees = tuple(range(_LEAST_DEGREE, max_degree + 1)) if degree == "auto" else (degree,)
    if continuity is not None and continuity not in range(max(degrees)):
        raise InputError(f"continuity must be a whole number in [0, {max(degrees) - 1}], got {continuity!r}")
    return tuple(one for one in degrees if continuity is None or one > continuity)


def _floor(patch: SeparableSurface) -> float:
    """The least tolerance that double precision can prove."""
    size = float(np.sqrt((patch.coefficients**2).sum(axis=-1)).max())
    return size * precision_floor((patch.factors_u, patch.factors_v))


_Direction = tuple[int, str]  # the patch, "u" or "v"
_Corner = tuple[int, int, int]  # the patch, and the row and the column of its poles: 0 or -1
_Index = slice | NDArray[np.int_]


def _members(quilt: Quilt) -> list[dict[_Direction, bool]]:
    """The directions of each strip, and whether they run against its first one.

    Two ways around never disagree, because the patches have one orientation.
    """
    links = [((a.patch, a.along), (b.patch, b.along), edge.reversed) for edge in quilt.edges for a, b in [edge.uses]]
    return connected([(patch, along) for patch in range(len(quilt.patches)) for along in "uv"], links)


class _Strip:
    """One direction of all patches in a row, with the approximation that they share."""

    def __init__(
        self, quilt: Quilt, members: dict[_Direction, bool], side: Callable[..., Side], goal: float, adapt: bool
    ) -> None:
        self.members, self.adapt = members, adapt
        own = {key: _parts(_factors(quilt, key, backwards)) for key, backwards in members.items()}
        parts = {one.key: one for several in own.values() for one in several}
        ends = dict(zip(parts, itertools.accumulate(one.count for one in parts.values()), strict=True))
        self.columns = {
            key: np.concatenate([np.arange(ends[one.key] - one.count, ends[one.key]) for one in several])
            for key, several in own.items()
        }
        factors = next(iter(parts.values())) if len(parts) == 1 else Stacked(tuple(parts.values()))
        self.vectors = {key: _vectors(quilt.patches[key[0]], key[1]) for key in members}
        bundle = Bundle(factors, self._side_by_side(factors.count))
        orders = _end_orders(quilt, members)
        self.side = side(bundle, end_order=orders, polynomial=_polynomial(parts.values()))
        if self.side.most < self.side.least:
            room = f"{self.side.most} poles at most, and joins of orders {orders} at the ends take {self.side.least}"
            raise InputError(f"max_spans = {self.side.max_spans} and degree up to {max(self.side.degrees)} give {room}")
        found: Approximation | None = fewest(self.side, goal, lambda one: one, adapt=adapt)
        self.chosen = found or self.side.best_of(min(self.side.max_spans, _SPANS_OF_A_FAILURE))
        poles = self.chosen.knots.poles
        self.most = min(self.side.most, 2 * poles + 16) if found else poles

    def _side_by_side(self, count: int) -> Array:
        """The curves of all members through places of their other direction, as curves of all factors."""
        blocks = []
        for key, own in self.vectors.items():
            block = np.zeros((count, *own.shape[1:]))
            np.add.at(block, self.columns[key], own)
            blocks.append(block)
        return np.concatenate(blocks, axis=1)

    def grow(self) -> bool:
        """Take the next better approximation; False when there is none within the limits."""
        poles, error = self.chosen.knots.poles, self.chosen.error
        while poles < self.most:
            poles += max(1, poles // 24)
            one = self.side.adapted(poles, error / 2) if self.adapt else self.side.kind(poles)
            if one is not None and one.error < error:
                self.chosen = one
                return True
        return False

    def errors(self, key: _Direction) -> Array:
        """Largest error of one member on each sample."""
        values = np.tensordot(self.chosen.residual[:, self.columns[key]], self.vectors[key], 1)
        return np.asarray(np.linalg.norm(values, axis=-1).max(axis=1))

    def samples(self, key: _Direction) -> tuple[Array, Array]:
        """Factors of the member and their errors, on samples of the strip: shape (samples, count)."""
        return self.chosen.values[:, self.columns[key]], self.chosen.residual[:, self.columns[key]]

    def matrix(self, key: _Direction) -> Array:
        """From the member's coefficients to its poles."""
        matrix = self.chosen.matrix[:, self.columns[key]]
        return matrix[::-1] if self.members[key] else matrix

    def knots(self, key: _Direction) -> tuple[Array, tuple[int, ...], int]:
        """Knots, multiplicities and degree of the member."""
        breaks = np.round(np.array(self.chosen.knots.breaks) * _BITS) / _BITS
        multiplicities = self.chosen.knots.multiplicities
        if self.members[key]:
            breaks, multiplicities = 1 - breaks[::-1], multiplicities[::-1]
        return breaks, multiplicities, self.chosen.knots.degree


def _factors(quilt: Quilt, key: _Direction, backwards: bool) -> Factors:
    patch = quilt.patches[key[0]]
    own = patch.factors_u if key[1] == "u" else patch.factors_v
    return RestrictedFactors(own, 1.0, 0.0) if backwards else own


def _parts(factors: Factors) -> list[Factors]:
    """The factors one by one that they are a stack of, in order."""
    if isinstance(factors, Stacked):
        return [one for part in factors.parts for one in _parts(part)]
    if isinstance(factors, RestrictedFactors):
        return [RestrictedFactors(one, factors.start, factors.end) for one in _parts(factors.base)]
    return [factors]


def _vectors(patch: SeparableSurface, along: str) -> Array:
    """The curves in one direction through places of the other one, shape (count, places, d)."""
    other, coefficients = patch.factors_v, patch.coefficients
    if along == "v":
        other, coefficients = patch.factors_u, coefficients.swapaxes(0, 1)
    places = np.concatenate([[0.0], (nodes(other.count + 3) + 1) / 2, [1.0]])
    return np.asarray(other.rows(places).T @ coefficients)


def _end_orders(quilt: Quilt, members: dict[_Direction, bool]) -> tuple[int, int]:
    """Largest orders of the joins that bound the strip, where it starts and where it ends."""
    orders = [0, 0]
    for edge in quilt.edges:
        for use in edge.uses:
            across = use.patch, use.side[0]
            if across in members:
                end = int(use.side[1]) ^ members[across]
                orders[end] = max(orders[end], parsed_order(edge.order)[1])
    return orders[0], orders[1]


def _polynomial(parts: Iterable[Factors]) -> Array | None:
    """Matrix from the coefficients of factors side by side to poles of one Bezier form, when all are polynomials."""
    forms = [polynomial_form(one) for one in parts]
    known = [form for form in forms if form is not None]
    degree = max((len(form) - 1 for form in known), default=0)
    if len(known) < len(forms) or degree > MAX_DEGREE:
        return None
    return np.concatenate([_elevation(len(form) - 1, degree) @ form for form in known], axis=1)


def _elevation(lower: int, degree: int) -> Array:
    """Matrix from the control points of a Bezier curve to those of a higher degree."""
    matrix = np.zeros((degree + 1, lower + 1))
    for i, j in itertools.product(range(degree + 1), range(lower + 1)):
        if i >= j:
            matrix[i, j] = math.comb(lower, j) * math.comb(degree - lower, i - j) / math.comb(degree, i)
    return matrix


class _Layout:
    """The strips of every patch, and the poles that follow."""

    def __init__(self, quilt: Quilt, strips: Sequence[_Strip]) -> None:
        self.quilt = quilt
        of = {key: strip for strip in strips for key in strip.members}
        self.pairs = [((of[k, "u"], (k, "u")), (of[k, "v"], (k, "v"))) for k in range(len(quilt.patches))]
        self._proofs: dict[int, tuple[BSplineSurface, Certificate]] = {}

    def estimated_above(self, tolerance: float) -> list[int]:
        """Patches whose splines are seen to miss the tolerance on samples."""
        return [k for k in range(len(self.pairs)) if self._estimate(k, tolerance) > tolerance]

    def _estimate(self, patch: int, tolerance: float) -> float:
        """Largest error where one direction is worst; where the errors of both add up to less than asked, their sum."""
        (u, key_u), (v, key_v) = self.pairs[patch]
        errors_u, errors_v = u.errors(key_u), v.errors(key_v)
        if (total := float(errors_u.max() + errors_v.max())) <= tolerance:
            return total
        net = self.quilt.patches[patch].coefficients.transpose(2, 0, 1)
        (f, f_rest), (g, g_rest) = u.samples(key_u), v.samples(key_v)

        def difference(rows: _Index, columns: _Index) -> float:
            # F c G - (F - f) c (G - g) = F c g + f c (G - g), with f and g the residuals
            rest = g_rest[columns]
            values = f[rows] @ net @ rest.T + f_rest[rows] @ net @ (g[columns] - rest).T
            return math.sqrt(float(np.einsum("dij,dij->ij", values, values).max()))

        return max(
            difference(np.argsort(-errors_u)[:_WORST], slice(None)),
            difference(slice(None), np.argsort(-errors_v)[:_WORST]),
        )

    def worse_of(self, patch: int) -> _Strip:
        """The strip that has the larger part in the error of the patch, and room to grow."""
        u, v = sorted(self.pairs[patch], key=lambda pair: float(pair[0].errors(pair[1]).max()))
        return v[0] if v[0].chosen.knots.poles < v[0].most else u[0]

    def splines(self) -> tuple[BSplineSurface, ...]:
        """The splines of all patches, with their edges and corners made one."""
        nets = []
        for patch, ((u, key_u), (v, key_v)) in zip(self.quilt.patches, self.pairs, strict=True):
            lines = v.matrix(key_v) @ patch.coefficients  # (count of u, poles of v, d)
            nets.append(np.tensordot(u.matrix(key_u), lines, 1))
        _glue(self.quilt, nets)
        return tuple(
            BSplineSurface(net, *u.knots(key_u), *v.knots(key_v))
            for net, ((u, key_u), (v, key_v)) in zip(nets, self.pairs, strict=True)
        )

    def proved(self, splines: Sequence[BSplineSurface], tolerance: float) -> list[Certificate]:
        """The certificates of all patches; those of splines that are still the same are kept."""
        for k, (patch, spline) in enumerate(zip(self.quilt.patches, splines, strict=True)):
            known = self._proofs.get(k)
            if known is None or not _same(known[0], spline):
                certify = partial(certify_surface, patch, spline, resolution=_TAIL * tolerance, limit=tolerance)
                self._proofs[k] = spline, deciding(certify, tolerance)
        return [self._proofs[k][1] for k in range(len(splines))]

    def failure(self, tolerance: float, max_spans: int) -> ToleranceNotMet:
        """What is proved of the patch that is worst now."""
        splines = self.splines()
        found = [one.lower for one in self.proved(splines, tolerance)]
        worst = found.index(max(found))
        certificate = certify_surface(self.quilt.patches[worst], splines[worst])
        spans = math.prod(strip.chosen.knots.spans for strip, _ in self.pairs[worst])
        limit = f"max_spans = {max_spans} in each direction, at {self.quilt.names[worst]}"
        return ToleranceNotMet(tolerance, certificate.upper, spans, limit)


def _same(a: BSplineSurface, b: BSplineSurface) -> bool:
    def arrays(one: BSplineSurface) -> tuple[Array, ...]:
        return one.control_points, one.flat_knots_u, one.flat_knots_v

    return all(np.array_equal(*pair) for pair in zip(arrays(a), arrays(b), strict=True))


def _glue(quilt: Quilt, nets: list[Array]) -> None:
    """Make the poles of shared edges, of vertices and of collapsed sides equal, which they are up to rounding."""
    for corners in _vertices(quilt):
        point = nets[corners[0][0]][corners[0][1:]].copy()
        for patch, i, j in corners:
            nets[patch][i, j] = point
    for use in quilt.collapsed:
        _row(nets, use)[:] = _row(nets, use)[0]
    for edge in quilt.edges:
        row = _row(nets, edge.first)
        _row(nets, edge.second)[:] = row[::-1] if edge.reversed else row


def _row(nets: list[Array], use: Use) -> Array:
    net, end = nets[use.patch], -int(use.side[1])
    return net[end] if use.side[0] == "u" else net[:, end]


def _corners(use: Use) -> tuple[_Corner, _Corner]:
    """Where the side starts and where it ends."""
    end = -int(use.side[1])
    if use.side[0] == "u":
        return (use.patch, end, 0), (use.patch, end, -1)
    return (use.patch, 0, end), (use.patch, -1, end)


def _vertices(quilt: Quilt) -> list[list[_Corner]]:
    """The corners that are one point, first the one whose point it is: not on a second side, where that can be."""
    links = [(*_corners(use), False) for use in quilt.collapsed]
    later: set[_Corner] = set()
    for edge in quilt.edges:
        first, second = map(_corners, edge.uses)
        later.update(second)
        links += [(a, b, False) for a, b in zip(first, second[::-1] if edge.reversed else second, strict=True)]
    corners = [(patch, i, j) for patch in range(len(quilt.patches)) for i in (0, -1) for j in (0, -1)]
    return [list(part) for part in connected(sorted(corners, key=later.__contains__), links)]
