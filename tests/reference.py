"""The basis at many digits from its recursion, by Taylor arithmetic: independent of any closed form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath as mp
import numpy as np

DIGITS = 50


def taylor_rows(family: str, degree: int, gamma: Sequence[Any], x: Any, order: int) -> list[list[Any]]:
    """Taylor coefficients 0..order of f_0..f_n at x: one list of mpf for each function."""
    with mp.workdps(DIGITS):
        x = mp.mpf(x)
        rows = [[mp.mpf(1)] + [mp.mpf(0)] * order] if family == "bernstein" else _quadratic(gamma, x, order)
        zero = [mp.mpf(0)] * (order + 1)
        while len(rows) <= degree:
            padded = [zero, *rows, zero]
            rows = [_blend(padded[i + 1], padded[i], x) for i in range(len(rows) + 1)]
        return rows


def values(family: str, degree: int, gamma: Sequence[Any], x: Any) -> list[Any]:
    """f_0(x)..f_n(x) as mpf."""
    return [row[0] for row in taylor_rows(family, degree, gamma, x, 0)]


def derivatives(family: str, degree: int, gamma: Sequence[Any], x: Any, order: int) -> np.ndarray:
    """Derivatives of the orders 0..order, shape (order + 1, n + 1), rounded to double precision."""
    rows = taylor_rows(family, degree, gamma, x, order)
    return np.array([[float(row[k] * mp.factorial(k)) for row in rows] for k in range(order + 1)])


def _blend(left: list[Any], right: list[Any], x: Any) -> list[Any]:
    """(1 - t) left + t right as Taylor series at x."""
    difference = [b - a for a, b in zip(left, right, strict=True)]
    return [a + x * d + (difference[k - 1] if k else 0) for k, (a, d) in enumerate(zip(left, difference, strict=True))]


def _quadratic(gamma: Sequence[Any], x: Any, order: int) -> list[list[Any]]:
    g1, g2 = (mp.mpf(g) for g in gamma)
    h = mp.pi / 2
    sine, cosine = mp.sin(h * x), mp.cos(h * x)
    turns = [sine, cosine, -sine, -cosine]
    s = [h**k / mp.factorial(k) * turns[k % 4] for k in range(order + 1)]
    c = [h**k / mp.factorial(k) * turns[(k + 1) % 4] for k in range(order + 1)]
    first, last = (_product(_one_minus(1, f), _one_minus(g, f)) for f, g in ((s, g1), (c, g2)))
    middle = [(1 if k == 0 else 0) - a - b for k, (a, b) in enumerate(zip(first, last, strict=True))]
    return [first, middle, last]


def _one_minus(factor: Any, series: list[Any]) -> list[Any]:
    return [(1 if k == 0 else 0) - factor * x for k, x in enumerate(series)]


def _product(a: list[Any], b: list[Any]) -> list[Any]:
    return [mp.fsum(a[j] * b[k - j] for j in range(k + 1)) for k in range(len(a))]
