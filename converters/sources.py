"""Curves to be approximated, whatever they are: parts of them, where they are not smooth, and proofs against them."""

from __future__ import annotations

import abc
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.converters.arcs import curve_of_arc
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import Certificate, certify_curve
from gtcad.converters.part import EllipseArc
from gtcad.converters.spline_parts import cut
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Stacked
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_SAME_KNOT = 1e-12  # of the domain


class Source(abc.ABC):
    """A curve on [0, 1] that parts can be cut from and that curves can be proved against."""

    breaks: Array
    """Where it is not analytic, with both ends."""

    @abc.abstractmethod
    def corners(self, order: int) -> list[float]:
        """Where it may be less than C^order, with both ends."""

    @abc.abstractmethod
    def derivative(self, x: Array, order: int) -> Array:
        """Derivatives of the order by x, shape (x.size, d)."""

    @abc.abstractmethod
    def part(self, a: float, b: float) -> Source:
        """The part over [a, b], stretched to [0, 1]."""

    @abc.abstractmethod
    def certify(self, curve: SeparableCurve) -> Certificate:
        """Prove how far a curve is from it at equal parameters."""

    def evaluate(self, x: Array) -> Array:
        """Points, shape (x.size, d)."""
        return self.derivative(x, 0)

    def middle(self, a: float, b: float) -> float:
        """Where to cut a part: at the break nearest to its middle, unless there is none in its inner half."""
        middle = (a + b) / 2
        nearest = float(self.breaks[np.abs(self.breaks - middle).argmin()])
        return nearest if abs(nearest - middle) <= (b - a) / 4 else middle


class ShapeSource(Source):
    """A curve of the protocol."""

    def __init__(self, curve: SeparableCurve) -> None:
        self.curve, self.breaks = curve, np.array([0.0, 1.0])

    def corners(self, order: int) -> list[float]:
        """Where it may be less than C^order, with both ends."""
        return [0.0, 1.0]

    def derivative(self, x: Array, order: int) -> Array:
        """Derivatives of the order by x, shape (x.size, d)."""
        return self.curve.derivative(x, order)

    def part(self, a: float, b: float) -> Source:
        """The part over [a, b], stretched to [0, 1]."""
        return ShapeSource(RestrictedCurve(self.curve, (a, b)))

    def certify(self, curve: SeparableCurve) -> Certificate:
        """Prove how far a curve is from it at equal parameters."""
        coefficients = np.concatenate([curve.coefficients, -self.curve.coefficients])
        difference = CurveOfTerms(Stacked((curve.factors, self.curve.factors)), coefficients)
        return certify_curve(difference, BSplineCurve(np.zeros((2, curve.dimension)), [0.0, 1.0], [2, 2], 1))


class SplineSource(Source):
    """A B-spline; ``slack`` bounds the rounding of its points where it was cut from another one."""

    def __init__(self, spline: BSplineCurve, slack: float = 0.0) -> None:
        self.spline, self.slack = spline, slack
        self.breaks = (spline.knots - spline.knots[0]) / (spline.knots[-1] - spline.knots[0])

    def corners(self, order: int) -> list[float]:
        """Where it may be less than C^order, with both ends."""
        least = self.spline.degree - order + 1
        return [float(x) for x, m in zip(self.breaks, self.spline.multiplicities, strict=True) if m >= least]

    def derivative(self, x: Array, order: int) -> Array:
        """Derivatives of the order by x, shape (x.size, d)."""
        start, end = self.spline.domain
        return self.spline.derivative(start * (1 - x) + end * x, order) * (end - start) ** order

    def part(self, a: float, b: float) -> Source:
        """The part over [a, b], stretched to [0, 1]."""
        if (a, b) == (0.0, 1.0):
            return self
        spline = cut(self.spline, self._knot(a), self._knot(b))
        # every pole is a chain of up to 2 p combinations of two, each with an error of at most 8 units
        weights = np.ones(1) if spline.weights is None else spline.weights
        rounding = (
            16 * self.spline.degree * UNIT_ROUNDOFF * float(np.linalg.norm(self.spline.homogeneous, axis=1).max())
        )
        size = float(np.linalg.norm(self.spline.control_points, axis=1).max())
        growth = 1.0 if self.spline.weights is None else (1 + size) / float(weights.min())
        return SplineSource(spline, rounding * growth)

    def _knot(self, x: float) -> float:
        """The spline's own parameter, at a break the knot to the last digit."""
        nearest = int(np.abs(self.breaks - x).argmin())
        if abs(self.breaks[nearest] - x) <= _SAME_KNOT:
            return float(self.spline.knots[nearest])
        start, end = self.spline.domain
        return start * (1 - x) + end * x

    def certify(self, curve: SeparableCurve) -> Certificate:
        """Prove how far a curve is from it at equal parameters."""
        found = certify_curve(curve, self.spline)
        return Certificate(max(0.0, found.lower - self.slack), found.upper + self.slack, found.place)


def source_of(source: Any) -> tuple[Source, bool]:
    """What to approximate, and whether its direction is against that of the edge it came from."""
    if isinstance(source, BSplineCurve):
        return SplineSource(source), False
    if isinstance(source, EllipseArc):
        return ShapeSource(curve_of_arc(source)), False
    if isinstance(source, SeparableCurve):
        return ShapeSource(source), False
    shape = getattr(source, "wrapped", source)
    if not type(shape).__name__.startswith("TopoDS_"):
        kinds = "a BSplineCurve, an EllipseArc, a curve of gtcad or an edge of the kernel"
        raise InputError(f"source must be {kinds}, got {type(source).__name__}")
    return _source_of_edge(shape)


def _source_of_edge(shape: Any) -> tuple[Source, bool]:
    from gtcad.converters.occt.compat import kernel_guard, kernel_module
    from gtcad.converters.occt.pieces import edge_geometry

    kinds = kernel_module("TopAbs")
    if shape.IsNull() or shape.ShapeType() != kinds.TopAbs_EDGE:
        kind = "an empty shape" if shape.IsNull() else str(shape.ShapeType()).rsplit("_", 1)[-1].lower()
        raise InputError(f"source must be an edge of the kernel, got {kind}")
    with kernel_guard("the curve of an edge"):
        geometry, _ = edge_geometry(shape)
    return source_of(geometry)[0], shape.Orientation() == kinds.TopAbs_REVERSED
