"""Where functions of one parameter vanish: what makes a developable singular."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Array]
Kept = TypeVar("Kept")

_SAMPLES = 1025
_STEP = 1 / (_SAMPLES - 1)
VANISHES = 1e-9  # of the scale
_WORTH_A_LOOK = 0.05  # of the scale: a sample below may be next to a zero
_ROUNDS = 14
_FEW_ROUNDS = 3  # enough for a maximum, which is flat
_FLAT = 0.9  # of the sizes beside it: a least value as large is not on the way to 0


def zeros(function: Function, scale: float) -> list[float]:
    """The t in [0, 1] where numbers, or the norms of vectors, vanish, in ascending order.

    Found from 1025 samples: a change of sign is bracketed, a dip of the size is followed to its bottom or below 0.

    Parameters
    ----------
    function
        From flat parameters to values of shape (size,), or vectors of shape (size, d).
    scale
        What is below 1e-9 of it vanishes.
    """
    return sorted(_found(function, scale, all_of_them=True))


def first_zero(function: Function, scale: float) -> float | None:
    """The least of the ``zeros``, None where there is none."""
    return min(_found(function, scale, all_of_them=False), default=None)


def _found(function: Function, scale: float, all_of_them: bool) -> list[float]:
    """All zeros, or some with the first among them: a change of sign hides all that comes after."""
    t = np.linspace(0, 1, _SAMPLES)
    values = function(t)
    if _sizes(values).max() <= VANISHES * scale:
        return [0.0]  # everywhere
    found, last = [], 1.0
    if values.ndim == 1:
        changes = np.flatnonzero(values[:-1] * values[1:] < 0)
        if changes.size and not all_of_them:
            changes, last = changes[:1], float(t[changes[0]])
        found += [_bracketed(function, float(t[k]), float(t[k + 1])) for k in changes]
    for place in _dips(t, _sizes(values), _WORTH_A_LOOK * scale):
        if place[0] > last:
            break
        here = _hidden(function, *place) if values.ndim == 1 else []
        if not here:
            nearest, least = _lowest(function, *place)
            new = least <= VANISHES * scale and not any(abs(nearest - other) <= 2 * _STEP for other in found)
            here = [nearest] if new else []
        found += here
        if here and not all_of_them:
            break
    return found


def _sizes(values: Array) -> Array:
    return np.abs(values) if values.ndim == 1 else np.asarray(np.linalg.norm(values, axis=1))


def _dips(t: Array, sizes: Array, level: float) -> list[tuple[float, float]]:
    """Intervals about the least samples that are below the level."""
    padded = np.pad(sizes, 1, constant_values=np.inf)
    low = (padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]) & (sizes <= level)
    return [(float(t[max(k - 1, 0)]), float(t[min(k + 1, t.size - 1)])) for k in np.flatnonzero(low).tolist()]


def _hidden(function: Function, low: float, high: float) -> list[float]:
    """Zeros of numbers that have one sign at the samples, and another one between them."""
    t = np.linspace(low, high, 33)
    values = function(t)
    if len(set(np.sign(values[[0, 16, 32]]).tolist())) > 1:
        return []
    return [_bracketed(function, float(t[k]), float(t[k + 1])) for k in np.flatnonzero(values[:-1] * values[1:] < 0)]


def _lowest(function: Function, low: float, high: float) -> tuple[float, float]:
    """Where the size is least, and that size: nested intervals, given up where the least does not go down to 0."""
    for _ in range(_ROUNDS):
        t = np.linspace(low, high, 33)
        sizes = _sizes(function(t))
        k = int(sizes.argmin())
        before, after = max(k - 1, 0), min(k + 1, 32)
        if sizes[k] > _FLAT * max(sizes[before], sizes[after]):
            break
        low, high = float(t[before]), float(t[after])
    return float(t[k]), float(sizes[k])


def _bracketed(function: Function, low: float, high: float) -> float:
    from scipy.optimize import brentq

    def value(t: float) -> float:
        return float(function(np.array([t]))[0])

    start, end = value(low), value(high)
    if not start * end < 0:  # values one at a time are rounded otherwise than many at once: an end is the zero
        return low if abs(start) < abs(end) else high
    return float(brentq(value, low, high, xtol=1e-15))


def highest(function: Function) -> tuple[float, float]:
    """Where the values of a function are largest on [0, 1], from samples, and that value."""
    t = np.linspace(0, 1, _SAMPLES)
    values = function(t)
    for _ in range(_FEW_ROUNDS):
        k = int(values.argmax())
        t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, t.size - 1)], 33)
        values = function(t)
    k = int(values.argmax())
    return float(t[k]), float(values[k])


def kept(source: Callable[[Array], Kept]) -> Callable[[Array], Kept]:
    """The same function, which remembers its values on the samples: several things are asked of them."""
    samples = np.linspace(0, 1, _SAMPLES)
    known: list[Kept] = []

    def of(t: Array) -> Kept:
        if not np.array_equal(t, samples):
            return source(t)
        if not known:
            known.append(source(t))
        return known[0]

    return of
