"""Times as medians, ratios as medians of pairs run one after the other: the machine is shared and noisy."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable


def seconds(action: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """How long one call takes."""
    start = clock()
    action()
    return clock() - start


def median(action: Callable[[], object], repeats: int = 9, clock: Callable[[], float] = time.perf_counter) -> float:
    """Median time of a call, in seconds, after one that does not count."""
    action()
    return statistics.median(seconds(action, clock) for _ in range(repeats))


def paired(first: Callable[[], object], second: Callable[[], object], repeats: int = 9) -> tuple[float, float, float]:
    """Median times of two calls and the median of ``second / first`` over pairs, after one pair that does not count."""
    first(), second()
    pairs = [(seconds(first), seconds(second)) for _ in range(repeats)]
    times = [statistics.median(column) for column in zip(*pairs, strict=True)]
    return times[0], times[1], statistics.median(b / a for a, b in pairs)


def table(header: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
