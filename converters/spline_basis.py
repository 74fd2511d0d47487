"""B-spline basis functions span by span: values at given places of every span, and derivatives at the ends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.float64]
EndOrder = int | tuple[int, int]  # derivatives that are exact at both ends, or at the start and at the end


@dataclass(frozen=True)
class Knots:
    """A clamped knot vector on [0, 1].

    Attributes
    ----------
    breaks
        Distinct knots from 0 to 1.
    multiplicities
        One for each break, degree + 1 at both ends.
    degree
        Degree of the splines.
    window
        First and last break of the spans that are meant, by their index; all of them for None. With a window, [0, 1]
        is the interval between these two breaks.
    """

    breaks: tuple[float, ...]
    multiplicities: tuple[int, ...]
    degree: int
    window: tuple[int, int] | None = None

    @classmethod
    def smooth(cls, breaks: Array | tuple[float, ...], degree: int, continuity: int | None = None) -> Knots:
        """Interior knots of the multiplicity that gives the continuity, degree - 1 unless told."""
        inner = 1 if continuity is None else degree - continuity
        counts = (degree + 1, *[inner] * (len(breaks) - 2), degree + 1)
        return cls(tuple(float(b) for b in breaks), counts, degree)

    @classmethod
    def normalised(
        cls, breaks: Array, multiplicities: tuple[int, ...], degree: int, window: tuple[int, int] | None = None
    ) -> Knots:
        """Knots of any interval, mapped so that the window becomes [0, 1]."""
        start, end = window or (0, len(breaks) - 1)
        values = (breaks - breaks[start]) / (breaks[end] - breaks[start])
        return cls(tuple(values.tolist()), tuple(multiplicities), degree, window)

    def subdivided(self, parts: int) -> Knots:
        """The same splines, each span seen as several: the new breaks have multiplicity 0."""
        breaks = np.array(self.breaks)
        inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts
        counts = [count for m in self.multiplicities[:-1] for count in (m, *[0] * (parts - 1))]
        window = None if self.window is None else (self.window[0] * parts, self.window[1] * parts)
        ends = self.breaks[-1], self.multiplicities[-1]
        return Knots((*inner.reshape(-1).tolist(), ends[0]), (*counts, ends[1]), self.degree, window)

    @property
    def meant(self) -> slice:
        """The spans of the window."""
        return slice(*(self.window or (0, len(self.breaks) - 1)))

    @property
    def spans(self) -> int:
        """Number of spans in the window."""
        return int(self.meant.stop - self.meant.start)

    @property
    def poles(self) -> int:
        """Number of poles."""
        return sum(self.multiplicities) - self.degree - 1

    @property
    def flat(self) -> Array:
        """Each knot repeated by its multiplicity."""
        return np.repeat(self.breaks, self.multiplicities)

    @property
    def first(self) -> NDArray[np.int_]:
        """Index of the first basis function that lives on each span, shape (spans,)."""
        return (np.cumsum(self.multiplicities[:-1]) - self.degree - 1)[self.meant]

    def places(self, z: Array) -> Array:
        """Parameters of the local coordinates z in [-1, 1] on every span, shape (spans, z.size)."""
        breaks = np.array(self.breaks)
        return (breaks[:-1, None] * (1 - z) + breaks[1:, None] * (1 + z))[self.meant] / 2

    @property
    def widest(self) -> float:
        """Largest half width of a span."""
        return float(np.diff(self.breaks)[self.meant].max()) / 2


def local_values(knots: Knots, z: Array) -> Array:
    """Values of the degree + 1 functions that live on each span, shape (spans, z.size, degree + 1).

    Cox-de Boor recursion, all terms non-negative: relative error at most about 5 (degree + 1) units.
    """
    return _local_values(knots, z.tobytes())


@lru_cache(maxsize=256)
def _local_values(knots: Knots, z: bytes) -> Array:
    flat, degree = knots.flat, knots.degree
    t = knots.places(np.frombuffer(z))
    last = (knots.first + degree)[:, None]
    left = [t - flat[last + 1 - j] for j in range(1, degree + 1)]
    right = [flat[last + j] - t for j in range(1, degree + 1)]
    values = np.zeros((*t.shape, degree + 1))
    values[..., 0] = 1.0
    for j in range(1, degree + 1):
        saved = np.zeros(t.shape)
        for r in range(j):
            share = values[..., r] / (right[r] + left[j - r - 1])
            values[..., r] = saved + right[r] * share
            saved = left[j - r - 1] * share
        values[..., j] = saved
    values.flags.writeable = False
    return values


def both_ends(order: EndOrder) -> tuple[int, int]:
    """The orders at the start and at the end."""
    return order if isinstance(order, tuple) else (order, order)


def end_derivatives(knots: Knots, order: EndOrder) -> tuple[Array, Array]:
    """Derivatives 0..order of the first order + 1 functions at 0, and of the last ones at 1, outermost first.

    Both lower triangular, shape (order + 1, order + 1) with each end's own order: row k gives the k-th derivative.
    """
    flat = knots.flat
    at_start, at_end = both_ends(order)
    start = _end_triangle(flat, knots.degree, at_start)
    end = _end_triangle(1 - flat[::-1], knots.degree, at_end)
    return start, end * (-1.0) ** np.arange(at_end + 1)[:, None]


def _end_triangle(flat: Array, degree: int, order: int) -> Array:
    """The k-th derivative at the first knot is a k-th divided difference of the first k + 1 poles."""
    poles = np.eye(order + 1)
    triangle = np.zeros((order + 1, order + 1))
    for k in range(order + 1):
        triangle[k] = poles[0] * math.perm(degree, k)
        low = flat[k + 1 : order + 1]
        gaps = flat[degree + 1 : degree + 1 + len(low)] - low
        poles = np.diff(poles, axis=0) / gaps[:, None]
    return triangle


@dataclass(frozen=True, eq=False)
class Sampled:
    """Values of functions of small support at many parameters, as triplets."""

    values: Array
    rows: NDArray[np.int_]
    columns: NDArray[np.int_]
    shape: tuple[int, int]

    def dense(self) -> Array:
        """Shape (parameters, functions)."""
        matrix = np.zeros(self.shape)
        matrix[self.rows, self.columns] = self.values
        return matrix

    def sparse(self) -> csr_array:
        """The same with the zeros left out."""
        return csr_array((self.values, (self.rows, self.columns)), shape=self.shape)


def sampled(flat: Array, degree: int, t: Array) -> Sampled:
    """All basis functions of flat knots at parameters inside."""
    span = np.searchsorted(flat, t, "right") - 1
    near = flat[span + np.arange(1 - degree, degree + 1)[:, None]]
    values = np.ones((1, len(t)))
    for step in range(1, degree + 1):
        low = near[degree - step : degree]
        ramps = (t - low) / (near[degree : degree + step] - low)
        raised = ramps * values
        values = np.concatenate([values - raised, np.zeros((1, len(t)))])
        values[1:] += raised
    columns = span - np.arange(degree, -1, -1)[:, None]
    rows = np.broadcast_to(np.arange(len(t)), columns.shape)
    return Sampled(values.reshape(-1), rows.reshape(-1), columns.reshape(-1), (len(t), len(flat) - degree - 1))


def doubled(flat: Array, degree: int, end_order: tuple[int, int], t: Array) -> tuple[Sampled, Array]:
    """For each interior knot a B-spline that has it as a double knot, and the jump of its derivative there.

    Parameters
    ----------
    flat
        Flat knots, the interior ones simple.
    degree
        p.
    end_order
        The B-splines' derivatives up to these vanish at the start and at the end.
    t
        Ascending parameters, shape (m,).

    Returns
    -------
    Sampled, Array
        Values, shape (m, interior knots), and the jumps of the (p - 1)-th derivatives over p!, shape (interior knots,).
    """
    inner = np.arange(degree + 1, len(flat) - degree - 1)
    first = np.clip(inner - degree // 2, end_order[0] + 1, len(flat) - degree - 2 - end_order[1])
    place = inner - first
    window = np.arange(degree + 2)
    near = flat[(first[:, None] + window - (window > place[:, None])).T]
    low, high = np.searchsorted(t, near[0], "right"), np.searchsorted(t, near[-1], "left")
    columns = np.repeat(np.arange(len(inner)), high - low)
    rows = np.arange(len(columns)) + (low - np.cumsum(high - low) + high - low)[columns]
    values = _b_spline(near[:, columns], t[rows])
    gaps = flat[inner] - near
    gaps[place, np.arange(len(inner))] = gaps[place + 1, np.arange(len(inner))] = 1.0
    jumps = (near[-1] - near[0]) / gaps.prod(axis=0) * (-1.0) ** degree
    return Sampled(values, rows, columns, (len(t), len(inner))), jumps


def _b_spline(near: Array, t: Array) -> Array:
    """Cox-de Boor recursion for one function at each parameter, its own knots in the column of ``near``."""
    values = ((near[:-1] <= t) & (t < near[1:])).astype(np.float64)
    for step in range(1, len(near) - 1):
        gaps = near[step:] - near[:-step]
        ramps = np.divide(t - near[:-step], gaps, out=np.zeros_like(gaps), where=gaps > 0)
        raised = ramps * values
        values = raised[:-1] + values[1:] - raised[1:]
    return np.asarray(values[0])


def top_jumps(poles: Array, flat: Array, degree: int) -> Array:
    """Jumps of the spline's p-th derivative over p! at its interior knots, all simple, shape (interior knots, d)."""
    for k in range(1, degree + 1):
        poles = np.diff(poles, axis=0) / (flat[degree + 1 : len(flat) - k] - flat[k : len(flat) - degree - 1])[:, None]
    return np.asarray(np.diff(poles, axis=0))


def dense(local: Array, columns: NDArray[np.int_], poles: int) -> Array:
    """Values of all basis functions from the local ones, shape (spans * places, poles)."""
    spans, places, _ = local.shape
    matrix = np.zeros((spans, places, poles))
    np.put_along_axis(matrix, np.broadcast_to(columns[:, None], local.shape), local, axis=2)
    return matrix.reshape(-1, poles)
