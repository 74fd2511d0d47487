"""Tables of curves beside other libraries and beside the limit."""

from __future__ import annotations

import statistics
from functools import cache

from gtcad import Curve
from tests import pieces
from tests.benchmarks import limit, peers
from tests.benchmarks.peers import Peer
from tests.benchmarks.timing import table
from tests.benchmarks.workload import DEGREES, SEED, TOLERANCES, Result, all_curves, random_curves

_LIMIT_SECONDS = 3.0  # for one curve, degree and tolerance


@cache
def _own(curve: Curve, degree: int | str, tolerance: float, adapt: bool = True) -> Result:
    return peers.gtcad(curve, degree, tolerance, adapt=adapt)


@cache
def _peer(peer: Peer, curve: Curve, degree: int, tolerance: float) -> Result | None:
    return peer.best(curve, degree, tolerance)


def run() -> str:
    """The tables of this part."""
    heading = f"Seed of the 20 random curves: {SEED}."
    return "\n\n".join(
        ["## Curves beside others", heading, _totals(), "### With their defaults", _defaults(), "### Wins", _wins()]
    )


def _row(name: str, degree: str, found: dict[float, list[Result | None]], random: bool) -> list[str]:
    row = [name, degree]
    for tolerance in TOLERANCES:
        results = found.get(tolerance)
        row += [_sum(results[:5]), _sum(results[5:]) if random else "-"] if results else ["-", "-"]
        worst = max((one.deviation / tolerance for one in results or () if one), default=None)
        row.append("-" if worst is None else f"{worst:.2f}")
    times = [one.seconds for results in found.values() for one in results if one]
    return [*row, f"{1e3 * statistics.median(times):.1f}" if times else "-"]


def _sum(results: list[Result | None]) -> str:
    misses = results.count(None)
    total = sum(one.poles for one in results if one)
    return f"{total}" if not misses else f"misses {misses} of {len(results)}"


def _totals() -> str:
    rows = []
    for degree in (*DEGREES, "auto"):
        for adapt in (True, False):
            found = {tol: [_own(c, degree, tol, adapt) for c in all_curves().values()] for tol in TOLERANCES}
            rows.append(_row(f"**gtcad**, {'adapted' if adapt else 'cached'}", str(degree), found, True))
    for peer in peers.BEST:
        curves = (all_curves() if peer.random else pieces.curves()).values()
        for degree in peer.degrees:
            found = {
                tol: [_peer(peer, c, degree, tol) for c in curves] for tol in TOLERANCES if tol >= peer.least_tolerance
            }
            rows.append(_row(peer.name, str(degree), found, peer.random))
    columns = [f"{tol:.0e}: {which}" for tol in TOLERANCES for which in ("five", "twenty", "deviation")]
    return table(["method", "degree", *columns, "ms"], rows)


def _defaults() -> str:
    rows = []
    for peer in peers.DEFAULTS:
        row = [peer.name]
        for tolerance in TOLERANCES:
            results = [next(peer.tries(curve, 3, tolerance), None) for curve in all_curves().values()]
            kept = [one for one in results if one and one.deviation <= tolerance]
            worst = max((one.deviation / tolerance for one in results if one), default=0)
            row.append(f"misses {len(results) - len(kept)} of {len(results)}, worst by a factor of {worst:.3g}")
        rows.append(row)
    return table(["asked with 50 points and the tolerance", *(f"{tol:.0e}" for tol in TOLERANCES)], rows)


def _wins() -> str:
    """On how many random pieces gtcad has fewer poles than every peer of the same degree, and why not on all."""
    rows = []
    for degree in DEGREES:
        for tolerance in TOLERANCES:
            gains, settled, possible = [], 0, []  # possible: whether one pole less was found, where not settled
            for curve in random_curves().values():
                others = [
                    _peer(peer, curve, degree, tolerance)
                    for peer in peers.BEST
                    if degree in peer.degrees and peer.random and tolerance >= peer.least_tolerance
                ]
                own = _own(curve, degree, tolerance).poles
                gains.append(min(one.poles for one in others if one) - own)
                if gains[-1] == 0:
                    if own == limit.least_poles(curve, degree, tolerance):
                        settled += 1
                    else:
                        possible.append(limit.fewer_possible(curve, degree, tolerance, own))
            counts = [sum(gain > 0 for gain in gains), gains.count(0), settled]
            counts += [possible.count(False), possible.count(True)]
            counts += [sum(gain < 0 for gain in gains), max(0, -min(gains)), max(gains)]
            rows.append([str(degree), f"{tolerance:.0e}", *map(str, counts)])
    header = ["degree", "tolerance, mm", "fewer than every peer, of 20", "equal"]
    header += ["of these at the sampled lower bound", "else: one pole less not found", "one pole less found"]
    header += ["more", "most more", "most fewer"]
    return table(header, rows)


def run_limit() -> str:
    """How far gtcad's counts are from the least ones found and from what is possible at all."""
    rows, every = [], []
    for degree in DEGREES:
        for tolerance in TOLERANCES:
            if (degree, tolerance) == (3, 1e-6):
                continue  # about 80 knots: the optimiser takes minutes
            ratios, bounds, ended = [], [], 0
            for curve in all_curves().values():
                own = _own(curve, degree, tolerance).poles
                best, complete = limit.fewest_poles(curve, degree, tolerance, own, _LIMIT_SECONDS)
                ratios.append(own / best)
                bounds.append(own / limit.least_poles(curve, degree, tolerance))
                ended += complete
            every += ratios
            figures = f"{statistics.median(ratios):.3f}", f"{max(ratios):.3f}", f"{statistics.median(bounds):.2f}"
            rows.append([str(degree), f"{tolerance:.0e}", *figures, f"{ended} of {len(ratios)}"])
    rows.append(["all", "all", f"{statistics.median(every):.3f}", f"{max(every):.3f}", "", ""])
    header = ["degree", "tolerance, mm", "gtcad / least found, median", "worst"]
    header += ["gtcad / lower bound, median", "searches that ended by themselves"]
    return "## The limit\n\n" + table(header, rows)
