"""Where to bend a flat pattern, and by how much."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebval
from numpy.typing import ArrayLike, NDArray

from gtcad._development import Span
from gtcad.basis import checked_parameters
from gtcad.errors import InputError
from gtcad.flat_curves import localised

Array = NDArray[np.float64]

_SAMPLES = 2049
_FLAT = 1e-9  # radians: a patch that turns by less is plane


@dataclass(frozen=True)
class BendLine:
    """A ruling as a line to bend at.

    Attributes
    ----------
    parameter
        The patch's parameter that the rulings follow each other in.
    start, end
        In the plane, in the model's unit.
    angle_deg
        The angle that the sheet turns by over the share of the line, half way to its neighbours: above 0 towards
        the viewer of the pattern.
    holes
        The parts of the line that lie in holes, each from and to a fraction of its length, in their order.
    """

    parameter: float
    start: tuple[float, float]
    end: tuple[float, float]
    angle_deg: float
    holes: tuple[tuple[float, float], ...] = ()

    @property
    def pieces(self) -> tuple[tuple[tuple[float, float], tuple[float, float]], ...]:
        """Start and end of each part that lies in the sheet: of the whole line where there are no holes."""
        cuts = [0.0, *(cut for hole in self.holes for cut in hole), 1.0]
        return tuple((self._at(a), self._at(b)) for a, b in zip(cuts[::2], cuts[1::2], strict=True) if a < b)

    def _at(self, part: float) -> tuple[float, float]:
        (x, y), (z, w) = self.start, self.end
        return (1 - part) * x + part * z, (1 - part) * y + part * w


def checked_count(count: object) -> int:
    """A number of bend lines."""
    if not isinstance(count, int) or isinstance(count, bool) or count < 0:
        raise InputError(f"count must be a whole number from 0, got {count!r}")
    return count


def shared_out(count: int, turning: Sequence[float]) -> list[int]:
    """That many bend lines for parts that turn by such angles: in proportion, and just as many in all."""
    whole = math.fsum(turning)
    if whole <= _FLAT:
        return [0] * len(turning)
    due = [count * angle / whole for angle in turning]
    shares = [math.floor(share) for share in due]
    short = sorted(range(len(due)), key=lambda k: shares[k] - due[k])
    for k in short[: count - sum(shares)]:
        shares[k] += 1
    return shares


class Turning:
    """The angle that the normal of a pattern's patch turns by along its rulings."""

    def __init__(self, spans: Sequence[Span]) -> None:
        self.spans = spans
        self.breaks = (spans[0].start, *(span.end for span in spans))
        self.t = np.linspace(0.0, 1.0, _SAMPLES)
        rate = np.abs(self._summed(self.t, 1))
        self.sums = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2) / (_SAMPLES - 1)])

    @property
    def total(self) -> float:
        """In radians, both ways counted."""
        return float(self.sums[-1])

    def turned(self, t: ArrayLike) -> Array:
        """The angle in radians by which the normal has turned since the first ruling, signed."""
        return self._summed(checked_parameters("t", t), 0)

    def _summed(self, t: Array, order: int) -> Array:
        """The angle up to flat parameters, or with order 1 its derivative."""
        place, local = localised(t, self.breaks)
        before = np.cumsum([0.0, *(float(chebval(1.0, span.bend)) for span in self.spans)])
        result = before[place] if order == 0 else np.zeros(t.size)
        for k, span in enumerate(self.spans):
            here = place == k
            series = span.bend if order == 0 else 2 * chebder(span.bend) / (span.end - span.start)
            result[here] += chebval(2 * local[here] - 1, series)
        return np.asarray(result)

    def equal(self, count: int | None) -> tuple[Array, Array]:
        """Parameters in the middle of equal shares of all turning, and the signed angles of the shares in degrees."""
        count = checked_count(count)
        if count == 0 or self.total <= _FLAT:
            return np.zeros(0), np.zeros(0)
        shares = np.interp(self.total * np.linspace(0.0, 1.0, 2 * count + 1), self.sums, self.t)
        return shares[1::2], np.degrees(np.diff(self.turned(shares[::2])))

    def at(self, places: Sequence[float]) -> tuple[Array, Array]:
        """The parameters, and the signed angles up to half way to their neighbours in degrees."""
        t = checked_parameters("at", places).reshape(-1)
        if (np.diff(t) <= 0).any():
            raise InputError(f"at must increase, got {list(places)}")
        if t.size == 0:
            return t, t
        ends = np.concatenate([[0.0], (t[1:] + t[:-1]) / 2, [1.0]])
        return t, np.degrees(np.diff(self.turned(ends)))
