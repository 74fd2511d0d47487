"""The fewest poles that keep a tolerance, in one direction and in two.

Two stages. Approximations that depend on the kind of shape alone are cached: they bracket the number of poles and
serve batches. Then knots are adapted to the piece for as long as that saves poles. Sampled errors guide the search;
what it returns has passed the caller's proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.approximation import Approximation, Bundle, of_kind
from gtcad.converters.knot_search import adapted
from gtcad.converters.spline_basis import EndOrder, Knots, both_ends

Array = NDArray[np.float64]
Proved = TypeVar("Proved")
Found = TypeVar("Found")
Proof = Callable[[Approximation], Proved | None]
PairProof = Callable[[Approximation, Approximation], Proved | None]

_ADAPTATION_GAIN = 12.0  # adapted knots have not been seen to divide the error of equidistributed ones by more
_MARGIN = 0.97  # of the goal: the true maximum lies a little above the largest sample
_FIRST_SPANS = 4  # where the search for the first number of poles begins
_GUESSES = 64  # 2 to the power of the guesses that may be made before it bisects
_WORST = 16  # samples of one direction that stand for all when it is combined with the other one
_CHOICES = 10  # numbers of poles of one direction that are paired with those of the other


class Side:
    """Approximations of one direction by the number of poles they may have.

    Parameters
    ----------
    bundle
        What is approximated.
    degrees
        Spline degrees allowed.
    continuity
        Continuity at interior knots, or None for degree - 1.
    end_order
        Derivatives 0..end_order are exact at both ends; a pair holds for the start and the end.
    max_spans
        Largest number of spans.
    polynomial
        The matrix of the factors' own Bezier form when they are polynomials and may be taken as they are.
    """

    def __init__(
        self,
        bundle: Bundle,
        degrees: Sequence[int],
        continuity: int | None,
        end_order: EndOrder,
        max_spans: int,
        polynomial: Array | None = None,
    ) -> None:
        self.bundle, self.end_order, self.max_spans = bundle, both_ends(end_order), max_spans
        self.degrees = tuple(degrees)
        self.continuity = continuity
        self.polynomial = None if polynomial is None else _polynomial(bundle, polynomial)
        self._kind: dict[int, Approximation | None] = {}
        self._adapted: dict[tuple[int, float], Approximation | None] = {}

    @property
    def least(self) -> int:
        """Fewest poles that any spline of these degrees has."""
        return max(min(self.degrees) + 1, sum(self.end_order) + 2)

    @property
    def most(self) -> int:
        """Most poles that the limit of spans allows."""
        return max(self._poles(degree, self.max_spans) for degree in self.degrees)

    @property
    def exact(self) -> bool:
        """Whether the factors are polynomials that every spline of these degrees holds, whatever its knots."""
        return self.bundle.factors.derivative_bound(min(self.degrees) + 1) == 0

    def kind(self, poles: int) -> Approximation | None:
        """The best cached approximation with at most so many poles, with its error for this bundle."""
        if poles not in self._kind:
            found = list(self._kinds(poles))
            if self.polynomial is not None and self.polynomial.knots.poles <= poles:
                found.append(self.polynomial)
            self._kind[poles] = min(found, key=lambda one: (one.error, one.knots.degree), default=None)
        return self._kind[poles]

    def adapted(self, poles: int, goal: float) -> Approximation | None:
        """The best with at most so many poles and knots of its own; any that reaches the goal will do."""
        if (poles, goal) not in self._adapted:
            self._adapted[poles, goal] = self._adapt(poles, goal)
        return self._adapted[poles, goal]

    def of_degree(self, poles: int, degree: int, goal: float) -> Approximation | None:
        """The adapted approximation of that degree, or None when it is out of reach of the goal."""
        quick = next((one for one in self._kinds(poles) if one.knots.degree == degree), None)
        if quick is None or quick.error > _ADAPTATION_GAIN * goal or self._multiplicity(degree) != 1:
            return quick
        own = adapted(self.bundle, degree, quick.knots.spans, self.end_order, goal=goal)
        return min((one for one in (quick, own) if one is not None), key=lambda one: one.error)

    def best_of(self, spans: int) -> Approximation:
        """The best cached approximation with that many spans, for want of one that is good enough."""
        found = (of_kind(self.bundle.factors, *self._way(degree), spans) for degree in self.degrees)
        return min((self._measured(one) for one in found if one is not None), key=lambda one: one.error)

    def _adapt(self, poles: int, goal: float) -> Approximation | None:
        best = self.kind(poles)
        if best is None or best.error == 0:
            return best
        ranked = sorted(self._kinds(poles), key=lambda one: one.error)
        for quick in ranked:
            own = self.of_degree(poles, quick.knots.degree, goal)
            if own is not None and own.error < best.error:
                best = own
            if best.error <= goal:
                break
        return best

    def _kinds(self, poles: int) -> Iterator[Approximation]:
        for degree in self.degrees:
            spans = min((poles - degree - 1) // self._multiplicity(degree) + 1, self.max_spans)
            one = of_kind(self.bundle.factors, *self._way(degree), spans) if spans > 0 else None
            if one is not None:
                yield self._measured(one)

    def _way(self, degree: int) -> tuple[int, int, tuple[int, int]]:
        return degree, degree - self._multiplicity(degree), self.end_order

    def _measured(self, one: Approximation) -> Approximation:
        return replace(one, errors=self.bundle.norms(one.residual))

    def _multiplicity(self, degree: int) -> int:
        return 1 if self.continuity is None else degree - self.continuity

    def _poles(self, degree: int, spans: int) -> int:
        return degree + 1 + (spans - 1) * self._multiplicity(degree)


def _polynomial(bundle: Bundle, matrix: Array) -> Approximation:
    degree = len(matrix) - 1
    knots = Knots.smooth((0.0, 1.0), degree)
    values = bundle.factors.rows(np.array([0.0, 0.5, 1.0])).T
    return Approximation(knots, matrix, values, np.zeros_like(values), np.zeros(3))


def fewest(side: Side, goal: float, proof: Proof[Proved], *, adapt: bool) -> Proved | None:
    """The proof's result for the approximation of one direction with the fewest poles that passes, or None."""
    found = None
    for poles in _numbers(side, goal):
        found = _passing(side.kind(poles), goal, proof)
        if found is not None:
            break
    if adapt and found is None:
        found = _passing(side.adapted(side.most, _MARGIN * goal), goal, proof)
    if found is None or not adapt:
        return None if found is None else found[1]
    failed, passed = side.least - 1, found[0].knots.poles
    poles = passed - max(1, round(0.1 * passed))
    while passed - failed > 1:
        poles = min(max(poles, failed + 1), passed - 1)
        one = side.adapted(poles, _MARGIN * goal)
        better = _passing(one, goal, proof)
        if better is None:
            failed = poles
        else:
            found, passed = better, poles
        poles += _step(one, goal) or (1 if better is None else -1)
    return _lower_degree(side, found[0], goal, lambda one: _passing(one, goal, proof), found)[1]


def _passing(one: Approximation | None, goal: float, proof: Proof[Proved]) -> tuple[Approximation, Proved] | None:
    if one is None or one.error > goal:
        return None
    result = proof(one)
    return None if result is None else (one, result)


def _step(one: Approximation | None, goal: float) -> int:
    """How many spans more or fewer the goal asks for: the error falls with the power degree + 1 of the spans."""
    if one is None or one.error == 0:
        return 0
    ratio: float = (one.error / goal) ** (1 / (one.knots.degree + 1))
    return round(one.knots.spans * (ratio - 1))


def _numbers(side: Side, goal: float) -> Iterator[int]:
    """Numbers of poles upwards from the first whose cached approximation is within the goal, to twice as many."""
    first = _first_within(side, goal)
    if first is None:
        return
    poles = first
    while poles <= min(side.most, 2 * first + 16):
        yield poles
        poles += max(1, poles // 24)


def _first_within(side: Side, goal: float) -> int | None:
    """From the power law of the error, then by bisection; the error is taken to fall with the number of poles."""

    def within(poles: int) -> bool:
        one = side.kind(poles)
        return one is not None and one.error <= goal

    below, above, stride = side.least - 1, side.most + 1, 1
    poles = min(side.least + _FIRST_SPANS, side.most)
    while above - below > 1:
        one, passed = side.kind(poles), within(poles)
        below, above = (below, poles) if passed else (poles, above)
        guess = poles + (_step(one, goal) or (-1 if passed else 1))
        stride *= 2
        if above > side.most:
            guess = max(guess, below + stride // 2)
        elif stride > _GUESSES:
            guess = (below + above) // 2
        poles = min(max(guess, below + 1), above - 1)
    if above > side.most:
        return None
    while above - 2 >= side.least and within(above - 2):  # odd and even numbers may differ
        above -= 2
    return above


def _lower_degree(
    side: Side, one: Approximation, goal: float, passing: Callable[[Approximation | None], Found | None], found: Found
) -> Found:
    """What passes with the lowest degree and as many poles as the one found."""
    for degree in sorted(side.degrees):
        if degree >= one.knots.degree:
            break
        lower = passing(side.of_degree(one.knots.poles, degree, goal))
        if lower is not None:
            return lower
    return found


def fewest_pair(
    u: Side, v: Side, goal: float, proof: PairProof[Proved], coefficients: Array, *, adapt: bool
) -> Proved | None:
    """The proof's result for the tensor product of two approximations with the fewest poles that passes, or None."""

    def passing(a: Approximation | None, b: Approximation | None) -> tuple[_Pair, Proved] | None:
        if a is None or b is None:
            return None
        if not _within(a, b, coefficients, goal):
            return None
        result = proof(a, b)
        return None if result is None else ((a, b), result)

    goals = {u: _goals(v, goal), v: _goals(u, goal)}

    def own(side: Side, poles: int) -> Approximation | None:
        return _first_of(goals[side], lambda share: side.adapted(poles, share))

    found = _search_pair(u, v, goal, Side.kind, passing, math.inf)
    if adapt:
        limit = math.inf if found is None else math.prod(one.knots.poles for one in found[0])
        found = _search_pair(u, v, goal, own, passing, limit) or found
    if found is None or not adapt:
        return None if found is None else found[1]
    (a, b), _ = found
    found = _lower_degree(u, a, goals[u][0], lambda one: passing(one, b), found)
    (a, b), _ = found
    return _lower_degree(v, b, goals[v][0], lambda one: passing(a, one), found)[1]


def _goals(other: Side, goal: float) -> tuple[float, ...]:
    """What the knots of a side are adapted to: half the goal, or all of it when splines hold the other side exactly.

    A search for half of it ends elsewhere, and sometimes better.
    """
    return (_MARGIN * goal, 0.5 * goal) if other.exact else (0.5 * goal,)


def _first_of(goals: Sequence[float], made: Callable[[float], Approximation | None]) -> Approximation | None:
    """The first that is within the largest of the goals, else the best."""
    best = None
    for share in goals:
        one = made(share)
        if one is not None and (best is None or one.error < best.error):
            best = one
        if best is not None and best.error <= goals[0]:
            break
    return best


_Index = slice | NDArray[np.int_]
_Pair = tuple[Approximation, Approximation]
_Source = Callable[[Side, int], Approximation | None]


def _search_pair(
    u: Side,
    v: Side,
    goal: float,
    source: _Source,
    passing: Callable[[Approximation, Approximation], tuple[_Pair, Proved] | None],
    limit: float,
) -> tuple[_Pair, Proved] | None:
    """The first pair that passes, in the order of their products of poles, below the limit."""
    rows, columns = _Choices(u, goal, source), _Choices(v, goal, source)
    sizes = sorted((p * q, i, j) for i, p in enumerate(rows.numbers) for j, q in enumerate(columns.numbers))
    for _, group in groupby(sizes, key=lambda size: size[0]):
        pairs = [(a, b) for _, i, j in group if (a := rows[i]) is not None and (b := columns[j]) is not None]
        for a, b in sorted(pairs, key=lambda pair: pair[0].error + pair[1].error):
            if a.knots.poles * b.knots.poles < limit and (found := passing(a, b)) is not None:
                return found
    return None


class _Choices:
    """Approximations with more and more poles, from the first within the goal to one far below it, made on demand."""

    def __init__(self, side: Side, goal: float, source: _Source) -> None:
        self.side, self.goal, self.source = side, goal, source
        self.made: list[Approximation | None] = []
        first = _first_within(side, goal)
        if first is None and source is not Side.kind and self._within(side.most):
            first = side.most
        if first is None:
            self.numbers = range(0)
            return
        step = max(1, first // 24)
        while source is not Side.kind and first > side.least and self._within(first - step):
            first -= step
        self.numbers = range(first, first + _CHOICES * step, step)

    def _within(self, poles: int) -> bool:
        one = self.source(self.side, poles)
        return one is not None and one.error <= self.goal

    def __getitem__(self, index: int) -> Approximation | None:
        """None when it is not within the goal, or when one with fewer poles is far below it."""
        while len(self.made) <= index:
            last = self.made[-1] if self.made else None
            if last is not None and last.error < 0.05 * self.goal:
                return None
            one = self.source(self.side, self.numbers[len(self.made)])
            self.made.append(one if one is not None and one.error <= self.goal else None)
        return self.made[index]


def _within(a: Approximation, b: Approximation, coefficients: Array, goal: float) -> bool:
    """Whether the tensor product is within the goal where one of the two is worst, on the samples of both."""
    if a.error + b.error <= goal:
        return True
    worst_a, worst_b = (np.argsort(-one.errors)[:_WORST] for one in (a, b))
    along_a = _difference(a, b, worst_a, slice(None), coefficients)
    return along_a <= goal and _difference(a, b, slice(None), worst_b, coefficients) <= goal


def _difference(a: Approximation, b: Approximation, rows: _Index, columns: _Index, coefficients: Array) -> float:
    swapped = coefficients.transpose(2, 0, 1)
    # S - spline = F c G - (F - f) c (G - g) = F c g + f c (G - g), with f and g the residuals
    rest = b.residual[columns]
    difference = a.values[rows] @ swapped @ rest.T + a.residual[rows] @ swapped @ (b.values[columns] - rest).T
    return math.sqrt(float(np.einsum("dij,dij->ij", difference, difference).max()))
