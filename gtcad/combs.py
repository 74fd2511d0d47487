"""Curvature combs of plane and space curves, and what the design variables do to a curve: figures without pictures.

A comb shows the curvature of a curve as teeth that stand on it. Each points away from the centre of curvature, by the
curvature vector k = kappa N:

    tip = C(t) - scale * k(t).

No frame is needed, the teeth change side at inflections, and where the curvature vanishes so does the tooth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import ParametricCurve, curve_jets, norm
from gtcad.basis import is_whole
from gtcad.composite import Composite
from gtcad.continuity import Derivable
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.extremes import curvature_extremes
from gtcad.measure import Estimate, curvature_energy, length
from gtcad.protocol import SeparableCurve, checked_kind

Array = NDArray[np.float64]

_LONGEST = 1 / 3  # of the diagonal: the longest tooth at the automatic scale
_STRAIGHT = 1e-6  # over the diagonal: the automatic scale takes no smaller curvature for the largest, nor shows it
_POINT = 1e-12  # over its distance from the origin: a curve no longer than that is a point
_LEAST_CELLS, _CELLS = 256, 8  # of the table of arc lengths on a span, in all and for each gap between teeth
_MOST_TEETH = 100_000
_SAMPLES = 1000


@dataclass(frozen=True, eq=False)
class Comb:
    """A curvature comb of n teeth, in the order of the curve.

    Attributes
    ----------
    parameters
        Of the feet, shape (n,), never decreasing; a joint stands there twice, with the values before and after it.
    arc_lengths
        From the start of the curve to the feet, shape (n,).
    points, tips
        Feet and tips of the teeth, each of shape (n, d); a tip is NaN where the curvature is not finite.
    curvature
        Shape (n,): of plane curves (d = 2) with a sign, positive where it turns left; NaN where it is not finite.
    scale
        Length of a tooth over the curvature, in the square of the unit.
    joints
        The two teeth, before and after, at each joint; of a closed chain the last is (n - 1, 0).
    """

    parameters: Array
    arc_lengths: Array
    points: Array
    tips: Array
    curvature: Array
    scale: float
    joints: tuple[tuple[int, int], ...]

    @property
    def envelope(self) -> Array:
        """The line along the tips, shape (n, d), or (n + 1, d) for a closed chain: straight up and down at jumps."""
        closed = any(after == 0 for _, after in self.joints)
        return np.concatenate([self.tips, self.tips[:1]]) if closed else self.tips


@dataclass(frozen=True)
class Span:
    """A part of a curve without jumps, with the values from inside at both ends.

    Attributes
    ----------
    start, end
        Its part of the whole curve's domain.
    curve
        The part, on [0, 1].
    """

    start: float
    end: float
    curve: ParametricCurve


@dataclass(frozen=True)
class Part:
    """The part of anything with derivatives over [start, end] of its domain, as a curve on [0, 1]."""

    whole: Derivable
    start: float
    end: float

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.whole.derivative(self.start, 0).shape[-1])

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order; splines give those after a knot, so the end is taken one rounding before it."""
        width = self.end - self.start
        inner = np.minimum(self.start + width * np.asarray(t, dtype=np.float64), np.nextafter(self.end, self.start))
        return self.whole.derivative(inner, order) * width**order


def spans(curve: Derivable) -> tuple[Span, ...]:
    """The parts of a curve between those joints and knots where the curvature may jump.

    Parameters
    ----------
    curve
        A shape of the protocol, a ``Composite``, a B-spline, or anything with ``domain`` and ``derivative``.

    Examples
    --------
    >>> [(span.start, span.end) for span in spans(Curve([[0, 0], [1, 1], [2, 0]]))]
    [(0.0, 1.0)]
    """
    if isinstance(curve, Composite):
        return tuple(Span(float(i), i + 1.0, piece) for i, piece in enumerate(curve.pieces))
    if isinstance(curve, SeparableCurve):
        return (Span(*curve.domain, curve),)
    if not hasattr(curve, "domain"):
        raise InputError(f"curve must be a curve, a chain or a spline, got {type(curve).__name__}")
    first, last = curve.domain
    bounds = [first, *_rough_knots(curve), last]
    return tuple(Span(a, b, Part(curve, a, b)) for a, b in pairwise(bounds))


def _rough_knots(curve: Derivable) -> list[float]:
    """The interior knots of a spline at which it is not twice differentiable."""
    knots, multiplicities = getattr(curve, "knots", ()), getattr(curve, "multiplicities", ())
    degree = getattr(curve, "degree", 0)
    inner = list(zip(knots, multiplicities, strict=True))[1:-1]
    return [float(knot) for knot, multiplicity in inner if degree - multiplicity < 2]


def comb(curve: Derivable, *, teeth: int = 120, scale: float | None = None) -> Comb:
    """The curvature comb of a curve, its teeth at equal distances by arc length.

    Parameters
    ----------
    curve
        A shape of the protocol, a ``Composite``, a B-spline, or anything with ``domain`` and ``derivative``.
    teeth
        How many, 2 to 100000, with one on each end. A curve with joints has two at each of them, and its distances
        are equal within each piece; so there are some more, or less, in all.
    scale
        Length of a tooth over the curvature, positive, in the square of the unit; by default the longest tooth is a
        third of the diagonal of the box around the feet.

    Raises
    ------
    InputError
        When an argument is out of its range, or the curve is a point.

    Notes
    -----
    Curvatures are those of ``gtcad.differential``; limits at singular points included. The distances are equal to
    about a thousandth. At the automatic scale curvatures below 1e-6 over the diagonal are too small to be seen.

    Examples
    --------
    The comb of a circle of radius 2 is a circle: tips at 2 + 4 / 2.

    >>> found = comb(Curve([[2, 0], [2, 2], [0, 2]]), teeth=5, scale=4.0)
    >>> np.hypot(*found.tips.T).round(12).tolist()
    [4.0, 4.0, 4.0, 4.0, 4.0]
    """
    if not is_whole(teeth) or not 2 <= teeth <= _MOST_TEETH:
        raise InputError(f"teeth must be a whole number in [2, {_MOST_TEETH}], got {teeth!r}")
    if scale is not None and not (math.isfinite(scale) and scale > 0):
        raise InputError(f"scale must be positive and finite, got {scale}")
    parts = spans(curve)
    lengths = _lengths(parts, int(teeth))
    total = sum(float(table[-1]) for table in lengths)
    if total <= _POINT * float(norm(curve.derivative(curve.domain[0], 0))):
        raise InputError("the curve is a point: it has no curvature")
    rows: list[tuple[Array, Array]] = []
    before = 0.0
    for table in lengths:
        gaps = max(1, round((teeth - 1) * float(table[-1]) / total))
        along = np.linspace(0, table[-1], gaps + 1)
        local = np.interp(along, table, np.linspace(0, 1, len(table)))
        rows.append((local, before + along))
        before += float(table[-1])
    return _standing(curve, parts, rows, scale)


def _lengths(parts: Sequence[Span], teeth: int) -> list[Array]:
    """Arc lengths from the start of each span at equally spaced parameters, by Gauss' rule of 5 nodes between them."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    cells = max(_LEAST_CELLS, _CELLS * math.ceil(teeth / len(parts)))
    t = (np.arange(cells)[:, None] + (nodes + 1) / 2) / cells
    tables = [norm(part.curve.derivative(t, 1)) @ weights / (2 * cells) for part in parts]
    return [np.concatenate([[0.0], np.cumsum(table)]) for table in tables]


def _standing(curve: Derivable, parts: Sequence[Span], rows: list[tuple[Array, Array]], scale: float | None) -> Comb:
    """The comb with its teeth at the (local parameters, arc lengths) of each span."""
    points = np.concatenate([part.curve.derivative(t, 0) for part, (t, _) in zip(parts, rows, strict=True)])
    bends = [_bend(part.curve, t) for part, (t, _) in zip(parts, rows, strict=True)]
    vectors, curvature = (np.concatenate(column) for column in zip(*bends, strict=True))
    if scale is None:
        diagonal = float(norm(np.ptp(points, axis=0)))
        largest = np.abs(curvature[np.isfinite(curvature)]).max(initial=_STRAIGHT / diagonal)
        scale = _LONGEST * diagonal / float(largest)
    last = np.cumsum([len(t) for t, _ in rows]) - 1
    joints = [(int(k), int(k) + 1) for k in last[:-1]]
    if isinstance(curve, Composite) and curve.closed:
        joints.append((int(last[-1]), 0))
    arrays = (
        np.concatenate([part.start + (part.end - part.start) * t for part, (t, _) in zip(parts, rows, strict=True)]),
        np.concatenate([along for _, along in rows]),
        points,
        points - scale * vectors,
        curvature,
    )
    for array in arrays:
        array.flags.writeable = False
    return Comb(*arrays, float(scale), tuple(joints))


def _bend(curve: ParametricCurve, t: Array) -> tuple[Array, Array]:
    """Curvature vectors, shape (size, d), and curvatures, in the plane with a sign; NaN where not finite."""
    with np.errstate(all="ignore"):
        jets = curve_jets(curve, t, 2)
        across, straight = jets.across(2)
        across[straight] = 0.0
        vectors = np.cross(across, jets.derivatives[0] / jets.speed[:, None])
    return vectors[:, : curve.dimension], across[:, 2] if curve.dimension == 2 else norm(across)


@dataclass(frozen=True)
class GammaVariant:
    """A curve of a study and its figures.

    Attributes
    ----------
    curve
        The control points of the study with other design variables.
    length
        In the unit.
    curvature_energy
        ``int kappa^2 ds``, in the inverse of the unit.
    curvature_range
        Smallest and largest curvature, in the plane with a sign, in the inverse of the unit: of 1000 samples and the
        stations of ``gtcad.extremes.curvature_extremes``, so estimated. NaN when a sample is a cusp.
    """

    curve: Curve
    length: Estimate
    curvature_energy: Estimate
    curvature_range: tuple[float, float]


@dataclass(frozen=True)
class GammaStudy:
    """The curves of the same control points over a grid of design variables.

    Attributes
    ----------
    gamma_1, gamma_2
        The values of both.
    variants
        One for each pair, gamma_2 running first.
    """

    gamma_1: tuple[float, ...]
    gamma_2: tuple[float, ...]
    variants: tuple[GammaVariant, ...]

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The curves, gamma_2 running first."""
        return tuple(variant.curve for variant in self.variants)

    @property
    def columns(self) -> tuple[str, ...]:
        """What the numbers of ``rows`` are."""
        return "gamma_1", "gamma_2", "length", "curvature energy", "smallest curvature", "largest curvature"

    def rows(self) -> list[tuple[float, ...]]:
        """A table: for each curve the numbers of ``columns``."""
        return [(*v.curve.gamma, v.length.value, v.curvature_energy.value, *v.curvature_range) for v in self.variants]


def gamma_study(
    curve: Curve, *, gamma_1: Sequence[float] = (-1.0, 0.0, 1.0), gamma_2: Sequence[float] = (-1.0, 0.0, 1.0)
) -> GammaStudy:
    """What the design variables do to a curve: all pairs of the values, with the same control points.

    Parameters
    ----------
    curve
        A curve of a family that takes design variables; its own are not used.
    gamma_1, gamma_2
        Values in [-1, 1], one or more of each.

    Raises
    ------
    InputError
        When the family takes none, or a value is out of its range.

    Examples
    --------
    gamma_1 = gamma_2 = 0 makes this the quarter of the unit circle.

    >>> study = gamma_study(Curve([[1, 0], [1, 1], [0, 1]]), gamma_1=[0], gamma_2=[0])
    >>> [round(value, 9) for value in study.rows()[0]]
    [0.0, 0.0, 1.570796327, 1.570796327, 1.0, 1.0]
    """
    checked_kind("curve", curve, Curve, "a Curve")
    if not curve.family.takes_gamma:
        raise InputError(f"the family {curve.family.name} takes no design variables: there is nothing to study")
    first, second = (tuple(np.atleast_1d(np.asarray(values)).tolist()) for values in (gamma_1, gamma_2))
    if not (first and second):
        raise InputError(f"gamma_1 and gamma_2 need one value or more each, got {len(first)} and {len(second)}")
    curves = [Curve(curve.control_points, (a, b), curve.family) for a in first for b in second]
    return GammaStudy(first, second, tuple(_variant(one) for one in curves))


def _variant(curve: Curve) -> GammaVariant:
    stations = [extreme.curvature for extreme in curvature_extremes(curve)]
    curvature = np.concatenate([comb(curve, teeth=_SAMPLES).curvature, stations])
    extent = float(curvature.min()), float(curvature.max())
    return GammaVariant(curve, length(curve, rtol=1e-9), curvature_energy(curve, rtol=1e-9), extent)
