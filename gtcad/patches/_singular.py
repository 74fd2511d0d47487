"""Where functions of one parameter vanish: what makes a developable singular."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

_SAMPLES = 1025
_STEP = 1 / (_SAMPLES - 1)
VANISHES = 1e-9  # of the scale
_WORTH_A_LOOK = 0.05  # of the scale: a sample below may be next to a zero
_ROUNDS = 14


def zeros(function: Function, scale: float) -> list[float]:
    """The t in [0, 1] where numbers, or the norms of vectors, vanish, in ascending order.

    Found from 1025 samples: a change of sign is bracketed, a dip of the size is followed to its bottom.

    Parameters
    ----------
    function
        From flat parameters to values of shape (size,), or vectors of shape (size, d).
    scale
        What is below 1e-9 of it vanishes.
    """
    t = np.linspace(0, 1, _SAMPLES)
    values = function(t)
    found = []
    if values.ndim == 1:
        changes = np.flatnonzero(values[:-1] * values[1:] < 0)
        found += [_bracketed(function, float(t[k]), float(t[k + 1])) for k in changes]
    for place in _dips(t, _sizes(values), _WORTH_A_LOOK * scale):
        nearest, least = _lowest(function, *place)
        if least <= VANISHES * scale and not any(abs(nearest - other) <= 2 * _STEP for other in found):
            found.append(nearest)
    return sorted(found)


def first_zero(function: Function, scale: float) -> float | None:
    """The least of the ``zeros``, None where there is none."""
    return next(iter(zeros(function, scale)), None)


def _sizes(values: Array) -> Array:
    return np.abs(values) if values.ndim == 1 else np.asarray(np.linalg.norm(values, axis=1))


def _dips(t: Array, sizes: Array, level: float) -> list[tuple[float, float]]:
    """Intervals about the least samples that are below the level."""
    padded = np.pad(sizes, 1, constant_values=np.inf)
    low = (padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]) & (sizes <= level)
    return [(float(t[max(k - 1, 0)]), float(t[min(k + 1, t.size - 1)])) for k in np.flatnonzero(low).tolist()]


def _lowest(function: Function, low: float, high: float) -> tuple[float, float]:
    """Where the size is least, and that size: nested intervals."""
    for _ in range(_ROUNDS):
        t = np.linspace(low, high, 33)
        sizes = _sizes(function(t))
        k = int(sizes.argmin())
        low, high = float(t[max(k - 1, 0)]), float(t[min(k + 1, 32)])
    return float(t[k]), float(sizes[k])


def _bracketed(function: Function, low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda t: float(function(np.array([t]))[0]), low, high, xtol=1e-15))


def lowest(function: Function) -> tuple[float, float]:
    """Where the size of a function is least on [0, 1], from samples, and that size."""
    t = np.linspace(0, 1, _SAMPLES)
    k = int(_sizes(function(t)).argmin())
    return _lowest(function, float(t[max(k - 1, 0)]), float(t[min(k + 1, _SAMPLES - 1)]))


def highest(function: Function) -> tuple[float, float]:
    """Where the values of a function are largest on [0, 1], from samples, and that value."""
    t = np.linspace(0, 1, _SAMPLES)
    values = function(t)
    for _ in range(_ROUNDS):
        k = int(values.argmax())
        t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, t.size - 1)], 33)
        values = function(t)
    k = int(values.argmax())
    return float(t[k]), float(values[k])
