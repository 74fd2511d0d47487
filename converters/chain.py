"""From a chain of curves to the edges of one wire, with its joins kept and every piece proved.

Pieces are fitted with the derivatives at their ends that their joints ask for, so that a C^k or G^k join of the curves
is one of the splines. Pieces joined C^1 to C^3 share one spline, piece i of it between the knots i and i + 1; other
joints separate edges. What is proved is the edge as it stands in the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import is_whole
from gtcad.composite import Composite
from gtcad.continuity import Derivable, JoinReport, Thresholds, check_join, parsed_order
from gtcad.converters.arcs import arc_of_chain, certify_chain_arc, curve_of_arc, split_arc
from gtcad.converters.bspline import MAX_DEGREE, BSplineCurve
from gtcad.converters.certificate import Certificate, certify_curve, deciding
from gtcad.converters.exact import IDENTITY, ParameterMap, exact_map
from gtcad.converters.fit import fit_curve
from gtcad.converters.part import EllipseArc
from gtcad.converters.spline_basis import EndOrder, both_ends
from gtcad.converters.spline_parts import elevated, extracted, merged
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.protocol import SeparableCurve, checked_kind, checked_tolerance

Array = NDArray[np.float64]

Edge = BSplineCurve | EllipseArc

_JOINING = 1e-12  # of the size: what rounding may add where splines are joined
_LEAST_DEGREE = 3
_PROMISING = 1.25  # adapted knots have not been seen to save more poles at one degree than at another beyond this


@dataclass(frozen=True, eq=False)
class ChainFit:
    """The edges of a chain and what was proved of its pieces.

    Attributes
    ----------
    edges
        In order, each ending where the next begins, to the last digit. A spline of several pieces has them over
        [0, 1], [1, 2], ...; a chain that is one arc of an ellipse is that.
    runs
        The pieces of each edge, as ranges of their indices.
    deviations
        (lower, upper) for each piece, as in ``Fit``: the upper one is proved.
    exact
        Whether the edges are the pieces themselves, up to rounding.
    chain
        What was fitted.
    """

    edges: tuple[Edge, ...]
    runs: tuple[range, ...]
    deviations: tuple[tuple[float, float], ...]
    exact: bool
    chain: Composite

    @property
    def deviation(self) -> tuple[float, float]:
        """(lower, upper) of the whole chain."""
        lower, upper = np.max(self.deviations, axis=0)
        return float(lower), float(upper)

    def report(self, *, thresholds: Thresholds | None = None) -> tuple[JoinReport, ...]:
        """What happens at each joint of the edges, those within a spline included."""
        parts: list[Derivable] = []
        for edge, run in zip(self.edges, self.runs, strict=True):
            parts += map(as_curve, parts_of(edge, self.chain.pieces[run.start : run.stop]))
        following = [*parts[1:], *parts[:1]] if self.chain.closed else parts[1:]
        limits = thresholds or Thresholds()
        return tuple(check_join(a, b, thresholds=limits) for a, b in zip(parts, following, strict=False))


def parts_of(edge: Edge, pieces: Sequence[SeparableCurve]) -> list[Edge]:
    """The parts of an edge that stand for the pieces of a chain.

    Raises
    ------
    InputError
        When the spline has no knots where pieces should meet.
    """
    if len(pieces) == 1:
        return [edge]
    if isinstance(edge, BSplineCurve):
        return [extracted(edge, a, b) for a, b in pairwise(joint_knots(edge, len(pieces)))]
    return [*split_arc(edge, pieces)]


def as_curve(edge: Edge) -> Derivable:
    """An edge with derivatives, an arc by a parameter on [0, 1]."""
    return edge if isinstance(edge, BSplineCurve) else curve_of_arc(edge)


def joint_knots(spline: BSplineCurve, count: int) -> list[int]:
    """Indices of the knots that part a spline into so many equally long parts.

    Raises
    ------
    InputError
        When it has no such knots.
    """
    places = (spline.knots - spline.knots[0]) / (spline.knots[-1] - spline.knots[0]) * count
    found = [int(np.abs(places - joint).argmin()) for joint in range(count + 1)]
    if np.abs(places[found] - np.arange(count + 1)).max() > 1e-9:
        raise InputError(f"a spline of {count} pieces needs knots where they meet, got {spline.knots.tolist()}")
    return found


def runs_of(chain: Composite) -> tuple[range, ...]:
    """The pieces that share an edge: those joined C1 to C3, from the first piece on."""
    count = len(chain.pieces)
    ends = [k + 1 for k, order in enumerate(chain.orders[: count - 1]) if not _is_smooth(order)]
    return tuple(range(a, b) for a, b in pairwise([0, *ends, count]))


def _is_smooth(order: str) -> bool:
    return order in ("C1", "C2", "C3")


def fit_chain(
    chain: Composite,
    *,
    tolerance: float,
    degree: int | str = 5,
    continuity: int | None = None,
    end_order: EndOrder = 0,
    exact: str | bool = "auto",
    max_degree: int = 11,
    adapt: bool = True,
    **options: Any,
) -> ChainFit:
    """The edges of the fewest poles that were found within the tolerance of a chain, with its joins, proved.

    Parameters
    ----------
    chain
        Open or closed; every joint must meet its order.
    tolerance, degree, continuity, end_order, exact, max_degree, adapt
        As of ``fit_curve``. "auto" takes one degree for the whole chain; ``end_order`` is that of the chain's own
        ends; exact forms serve only where every piece has one, and arcs of one ellipse are one edge.
    options
        The other arguments of ``fit_curve``.

    Raises
    ------
    InputError
        When an argument is out of its range, or a joint does not meet its order.
    ToleranceBelowPrecision, ToleranceNotMet
        As ``fit_curve``.
    """
    checked_kind("chain", chain, Composite, "a Composite (fit_curve takes one curve)")
    tolerance = checked_tolerance(tolerance)
    if exact not in ("auto", True, False):
        raise InputError(f'exact must be "auto", True or False, got {exact!r}')
    if problem := chain.unmet():
        raise InputError(problem)
    free = both_ends(end_order)
    if exact is not False and not any(free):
        form = _arc(chain, tolerance) or _exact_forms(chain, tolerance)
        if form is not None:
            return form
    if exact is True:
        raise InputError("exact=True, but this chain has no exact form that keeps its joints at end_order 0")
    ends = [_end_orders(chain, piece, free) for piece in range(len(chain.pieces))]
    size = max(float(np.abs(piece.coefficients).max()) for piece in chain.pieces)
    margin = min(_JOINING * size, tolerance / 10)

    def fitted(one: int | str, *, adapt: bool) -> list[BSplineCurve]:
        settings: dict[str, Any] = {"degree": one, "continuity": continuity, "exact": False, "adapt": adapt, **options}
        pairs = zip(chain.pieces, ends, strict=True)
        try:
            return [
                fit_curve(one, tolerance=tolerance - margin, end_order=end, **settings).spline for one, end in pairs
            ]
        except ToleranceNotMet as error:
            raise ToleranceNotMet(tolerance, error.achieved + margin, error.spans, error.limit) from None
        except ToleranceBelowPrecision as error:
            raise ToleranceBelowPrecision(tolerance, error.floor + margin) from None

    degrees = [degree] if degree != "auto" else _promising(fitted, continuity, max_degree)
    return _joined(chain, min((fitted(one, adapt=adapt) for one in degrees), key=_poles), tolerance)


def _promising(fitted: Callable[..., list[BSplineCurve]], continuity: int | None, max_degree: int) -> list[int]:
    """The degrees that may need the fewest poles once knots are adapted, by what cached operators need."""
    if not (is_whole(max_degree) and _LEAST_DEGREE <= max_degree <= MAX_DEGREE):
        raise InputError(f"max_degree must be a whole number in [{_LEAST_DEGREE}, {MAX_DEGREE}], got {max_degree!r}")
    if continuity is not None and not (is_whole(continuity) and 0 <= continuity < max_degree):
        raise InputError(f"continuity must be a whole number in [0, {max_degree - 1}], got {continuity!r}")
    poles: dict[int, int] = {}
    for degree in range(max(_LEAST_DEGREE, (continuity or 0) + 1), max_degree + 1):
        try:
            poles[degree] = _poles(fitted(degree, adapt=False))
        except ToleranceNotMet:
            if degree == max_degree and not poles:
                raise
    return [degree for degree, count in poles.items() if count <= _PROMISING * min(poles.values())]


def _poles(splines: Sequence[BSplineCurve]) -> int:
    return sum(len(spline.control_points) for spline in splines)


def _end_orders(chain: Composite, piece: int, free: tuple[int, int]) -> tuple[int, int]:
    """Up to which order the derivatives of a piece at its start and end must be exact; `free` at the chain's own."""
    orders = [parsed_order(order)[1] for order in chain.orders]
    before = orders[piece - 1] if piece > 0 or chain.closed else free[0]
    after = orders[piece] if piece < len(orders) else free[1]
    return before, after


def _arc(chain: Composite, tolerance: float) -> ChainFit | None:
    spatial = chain if chain.dimension == 3 else chain.transformed(np.eye(3, 2))
    arc = arc_of_chain(spatial)
    if arc is None:
        return None
    proofs = certify_chain_arc(spatial, arc)
    if max(proof.upper for proof in proofs) > tolerance:
        return None
    return ChainFit((arc,), (range(len(chain.pieces)),), _pairs(proofs), True, chain)


def _exact_forms(chain: Composite, tolerance: float) -> ChainFit | None:
    """The exact forms of all pieces, when they have one; one with another parameter is no side of a C join."""
    maps = [exact_map(piece.factors) for piece in chain.pieces]
    if any(one is None for one in maps):
        return None
    if any(_is_smooth(order) for order in chain.orders) and any(one != IDENTITY for one in maps):
        return None
    try:
        fits = [fit_curve(piece, tolerance=tolerance, exact=True) for piece in chain.pieces]
    except InputError:
        return None
    joined = _joined(chain, [fit.spline for fit in fits], tolerance, [fit.parameter_map for fit in fits])
    return replace(joined, exact=True)


def _joined(
    chain: Composite, splines: Sequence[BSplineCurve], tolerance: float, maps: Sequence[ParameterMap] | None = None
) -> ChainFit:
    """The splines as edges that meet to the last digit, and their proof."""
    runs = runs_of(chain)
    edges = _met([_merged_run(chain, splines, run) for run in runs], chain.closed)
    proofs = []
    for edge, run in zip(edges, runs, strict=True):
        joints = joint_knots(edge, len(run))
        for piece, window in zip(run, pairwise(joints), strict=True):
            parameter_map = IDENTITY if maps is None else maps[piece]
            certify = partial(certify_curve, chain.pieces[piece], edge, parameter_map=parameter_map, window=window)
            proofs.append(deciding(certify, tolerance))
    largest = max(proof.upper for proof in proofs)
    if largest > tolerance:
        raise ToleranceNotMet(tolerance, largest, len(edges), "joining the pieces' splines")
    return ChainFit(tuple(edges), runs, _pairs(proofs), False, chain)


def _pairs(proofs: Sequence[Certificate]) -> tuple[tuple[float, float], ...]:
    return tuple((proof.lower, proof.upper) for proof in proofs)


def _merged_run(chain: Composite, splines: Sequence[BSplineCurve], run: range) -> BSplineCurve:
    """One spline of several; only exact forms, which are single spans, come in several degrees."""
    degree = max(splines[piece].degree for piece in run)
    edge, *others = (splines[k] if splines[k].degree == degree else elevated(splines[k], degree) for k in run)
    for piece, following in zip(run, others, strict=False):
        order = parsed_order(chain.orders[piece])[1]
        edge = merged(edge, following, min(order, degree - 1))
    return edge


def _met(edges: Sequence[BSplineCurve], closed: bool) -> list[BSplineCurve]:
    """The edges, each beginning just where the one before ends."""
    result = list(edges)
    for k in range(0 if closed else 1, len(result)):
        points = np.array(result[k].control_points)
        points[0] = result[k - 1].control_points[-1]
        edge = result[k]
        result[k] = BSplineCurve(points, edge.knots, edge.multiplicities, edge.degree, edge.weights)
    return result
