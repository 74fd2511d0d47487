"""Poles and deviation of converted shapes, as constraints and objectives of ``gtcad.optimize``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.fit import fit_curve, fit_surface
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.protocol import SeparableCurve, SeparableSurface


@dataclass(frozen=True)
class PoleCount:
    """How many poles the B-spline of a shape has: a function of the shape, to be made small.

    Parameters
    ----------
    tolerance
        Of the fit, in the shape's unit.
    degree
        Of the spline.

    Raises
    ------
    InputError
        When it is called with anything but a curve or a surface, or the fit takes no such arguments.

    Notes
    -----
    One fit each, 5 to 100 ms. Infinite for a shape that is not fitted within the tolerance.

    Examples
    --------
    The quarter circle is exact with three poles:

    >>> from gtcad import Curve
    >>> PoleCount(1e-4)(Curve([[1, 0], [1, 1], [0, 1]]))
    3.0
    """

    tolerance: float
    degree: int = 5

    def __call__(self, shape: Any) -> float:
        """The number of poles."""
        try:
            return float(_poles(self._spline(shape)))
        except (ToleranceNotMet, ToleranceBelowPrecision):
            return math.inf

    def _spline(self, shape: Any) -> BSplineCurve | BSplineSurface:
        if isinstance(shape, SeparableCurve):
            return fit_curve(shape, tolerance=self.tolerance, degree=self.degree).spline
        if isinstance(shape, SeparableSurface):
            return fit_surface(shape, tolerance=self.tolerance, degree=self.degree).spline
        raise InputError(f"only curves and surfaces have poles, got {type(shape).__name__}")


def _poles(spline: BSplineCurve | BSplineSurface) -> int:
    return math.prod(spline.control_points.shape[:-1])


@dataclass(frozen=True)
class PoleLimit:
    """How many poles too many the B-spline of a shape has: a constraint, kept at 0 or below.

    Parameters
    ----------
    poles
        The most that are allowed.
    tolerance, degree
        Of the fit, as for ``PoleCount``.

    Examples
    --------
    >>> from gtcad import Curve
    >>> PoleLimit(5, tolerance=1e-4)(Curve([[1, 0], [1, 1], [0, 1]]))
    -2.0
    """

    poles: int
    tolerance: float
    degree: int = 5

    def __call__(self, shape: Any) -> float:
        """Poles beyond the limit."""
        return PoleCount(self.tolerance, self.degree)(shape) - self.poles


@dataclass(frozen=True)
class DeviationLimit:
    """How far beyond a limit the proved deviation of a shape's B-spline is, in orders of magnitude: a constraint.

    Parameters
    ----------
    deviation
        The largest distance allowed, in the shape's unit.
    spans
        Of the spline in each direction: what it has to do with.
    degree
        Of the spline.

    Raises
    ------
    InputError
        As for ``PoleCount``.

    Examples
    --------
    >>> from gtcad import Curve
    >>> arc = Curve([[0, 0], [30, 70], [70, -20], [100, 30]])
    >>> DeviationLimit(1e-1, spans=2)(arc) <= 0, DeviationLimit(1e-6, spans=2)(arc) <= 0
    (True, False)
    """

    deviation: float
    spans: int = 1
    degree: int = 5

    def __call__(self, shape: Any) -> float:
        """Common logarithm of the deviation over the limit; below 0 by an unknown amount when the limit is kept."""
        fit: Any = fit_curve if isinstance(shape, SeparableCurve) else fit_surface
        if not isinstance(shape, SeparableCurve | SeparableSurface):
            raise InputError(f"only curves and surfaces are converted, got {type(shape).__name__}")
        try:
            found = fit(shape, tolerance=self.deviation, degree=self.degree, max_spans=self.spans)
        except ToleranceNotMet as error:
            return max(math.log10(error.achieved / self.deviation), math.ulp(1.0))
        except ToleranceBelowPrecision as error:
            return max(math.log10(error.floor / self.deviation), math.ulp(1.0))
        return min(math.log10(max(found.deviation[1], 1e-300) / self.deviation), 0.0)
