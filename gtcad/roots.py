"""All real zeros of an analytic function on an interval, from Chebyshev interpolants.

The interval is halved until the interpolant of degree 32 on every span has reached the noise of the values. On a span
the extrema of the interpolant, the eigenvalues of a colleague matrix, cut it into monotone parts: a part whose ends
differ in sign has one zero, found by bracketing, and an extremum within the noise is a zero where the function touches
0. So no start values are needed, and neither close nor double zeros are lost.

References
----------
J. P. Boyd, Computing zeros on a real interval through Chebyshev expansion and polynomial rootfinding, SIAM J. Numer.
Anal. 40 (2002) 1666-1682.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial import chebyshev as series_of
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, nodes, transform
from gtcad.errors import InputError

Array = NDArray[np.float64]

_COUNT = 33  # values on a span
_LAST = 4  # coefficients that tell whether a span is resolved
_MOST_SPANS = 4096
_LEAST_WIDTH = 2.0**-28  # of the interval
_NEARLY_REAL = 0.1  # extrema are cuts only: one too many does no harm


def roots(
    function: Callable[[Array], Array], *, breaks: Sequence[float] = (0.0, 1.0), noise: float | None = None
) -> Array:
    """All zeros of a function that is analytic between neighbouring breaks, in ascending order.

    Parameters
    ----------
    function
        From flat parameters to values of the same shape.
    breaks
        Two or more, ascending: the ends of the interval and where the function may have kinks.
    noise
        Absolute error of the values; 128 units of the largest one unless given. A smaller value counts as 0.

    Returns
    -------
    Array
        Shape (zeros,). Zeros between which the function stays within the noise are one, in the place where it is
        least; a function within the noise everywhere has none.

    Raises
    ------
    InputError
        When the breaks do not ascend, a value is not finite, or the function is not resolved: it has a jump or a
        kink between breaks, a singularity near the interval, or more noise than was said.

    Notes
    -----
    A zero of multiplicity m is found to about ``(noise / |f^(m)|)^(1/m)``; zeros at the ends are found like others.
    Whether a span is resolved is judged by the last coefficients of its interpolant, not proved. Cost: 33 values and
    about 0.2 ms for each span that may have a zero, 2^-28 of the interval is the narrowest.

    Examples
    --------
    Of (x - 1/2)^2 (x + 1), which touches 0 at 1/2 and crosses it at -1, an end:

    >>> roots(lambda x: (x - 0.5) ** 2 * (x + 1), breaks=(-1, 1)).round(6).tolist()
    [-1.0, 0.5]
    """
    edges = np.asarray(breaks, dtype=np.float64)
    if edges.ndim != 1 or edges.size < 2 or not (np.diff(edges) > 0).all() or not np.isfinite(edges).all():
        raise InputError(f"breaks must be two finite numbers or more that ascend, got {list(breaks)}")
    low, high = edges[:-1], edges[1:]
    values = _sampled(function, low, high)
    level = 128 * UNIT_ROUNDOFF * float(np.abs(values).max()) if noise is None else float(noise)
    least, tried, within, found = _LEAST_WIDTH * np.ptp(edges), 0, True, [np.zeros(0)]
    while low.size:
        series = values @ transform(_COUNT).T
        open_spans = np.abs(series[:, -_LAST:]).max(axis=1) > level
        tried += low.size
        if open_spans.any() and (tried > _MOST_SPANS or (high - low)[open_spans].min() < least):
            place = low[open_spans][(high - low)[open_spans].argmin()]
            raise InputError(f"the function is not resolved near {place:.6g}: it is not analytic there, or too noisy")
        for a, b, one in zip(low[~open_spans], high[~open_spans], series[~open_spans], strict=True):
            z = _zeros(one, level)
            found.append(a * (1 - z) / 2 + b * (1 + z) / 2)
        within = within and bool((np.abs(values) <= level).all())
        a, b = low[open_spans], high[open_spans]
        low, high = np.concatenate([a, (a + b) / 2]), np.concatenate([(a + b) / 2, b])
        values = _sampled(function, low, high)
    return np.zeros(0) if within else _merged(function, np.sort(np.concatenate(found)), level)


def _sampled(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Values on the nodes of every span, shape (spans, _COUNT)."""
    z = nodes(_COUNT)
    places = (low[:, None] * (1 - z) + high[:, None] * (1 + z)) / 2
    values = np.asarray(function(places.reshape(-1)), dtype=np.float64)
    if values.shape != (places.size,):
        raise InputError(f"the function must return one value for each parameter, got shape {values.shape}")
    if not np.isfinite(values).all():
        raise InputError(f"the function must be finite, got {values[~np.isfinite(values)][0]}")
    return values.reshape(places.shape)


def _zeros(series: Array, noise: float) -> Array:
    """Zeros of a Chebyshev series in [-1, 1], those within the noise at the cuts included."""
    if abs(series[0]) > np.abs(series[1:]).sum() + noise:
        return np.zeros(0)
    cuts = np.concatenate([[-1.0], _extrema(series), [1.0]])
    values = series_of.chebval(cuts, series)
    signs = np.where(np.abs(values) <= noise, 0.0, np.sign(values))
    changes = np.flatnonzero(signs[:-1] * signs[1:] < 0)
    between = [_bracketed(series, cuts[k], cuts[k + 1]) for k in changes]
    return np.concatenate([cuts[signs == 0], between])


def _extrema(series: Array) -> Array:
    """Places in (-1, 1) between which the series is monotone, ascending."""
    slope = series_of.chebder(series)
    kept = np.flatnonzero(np.abs(slope) > UNIT_ROUNDOFF * np.abs(slope).max())
    if kept.size == 0 or kept[-1] == 0:
        return np.zeros(0)
    found = series_of.chebroots(slope[: kept[-1] + 1])
    real = found.real[(np.abs(found.imag) < _NEARLY_REAL) & (np.abs(found.real) < 1)]
    return np.sort(real)


def _bracketed(series: Array, low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda z: float(series_of.chebval(z, series)), low, high, xtol=1e-16, rtol=4 * math.ulp(1.0)))


def _merged(function: Callable[[Array], Array], zeros: Array, noise: float) -> Array:
    """One zero for all those between which the function stays within the noise."""
    if zeros.size < 2:
        return zeros
    apart = np.abs(function((zeros[:-1] + zeros[1:]) / 2)) > noise
    groups = np.split(zeros, np.flatnonzero(apart) + 1)
    return np.array([group[np.abs(function(group)).argmin()] for group in groups])
