"""Arcs of circles and ellipses: GT curves of degree 2 with gamma = (0, 0) are such arcs, at even speed in the angle.

``C(t) = P_0 - P_1 + P_2 + cos(pi t / 2) (P_1 - P_2) + sin(pi t / 2) (P_1 - P_0)``: a CAD file can hold them as the
analytic curves that they are, and the angle corresponds linearly to the curve's parameter.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import GT, Basis
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import Certificate, certify_curve
from gtcad.converters.exact import whole_factors
from gtcad.converters.part import EllipseArc
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]

_FLAT = 1e-9  # of the longer half axis: an ellipse as flat as this goes as a B-spline
_SQUARE = 1e-14  # cosine of the angle of two half diameters that are axes already


def ellipse_arc(curve: SeparableCurve) -> EllipseArc | None:
    """The arc that a space curve is, in the direction of its parameter; None when it is none.

    Conjugate half diameters a, b are turned into the axes by ``tan(2 phi) = 2 a.b / (|a|^2 - |b|^2)``.
    """
    basis, start, end = whole_factors(curve.factors)
    if not (isinstance(basis, Basis) and basis.family is GT and basis.degree == 2 and basis.gamma == (0.0, 0.0)):
        return None
    if curve.dimension != 3:
        return None
    p, q, r = curve.coefficients
    a, b = q - r, q - p
    across = float(a @ b)
    turn = math.atan2(2 * across, float(a @ a - b @ b)) / 2
    if abs(across) <= _SQUARE * np.linalg.norm(a) * np.linalg.norm(b):
        turn = 0.0
    axes = math.cos(turn) * a + math.sin(turn) * b, math.cos(turn) * b - math.sin(turn) * a
    lengths = sorted(float(np.linalg.norm(axis)) for axis in axes)
    if lengths[0] <= _FLAT * lengths[1]:
        return None
    first, last = (math.pi / 2 * t - turn for t in (start, end))
    if first < last:
        return EllipseArc(p - q + r, axes[0], axes[1], first, last)
    return EllipseArc(p - q + r, axes[0], -axes[1], -first, -last)


def curve_of_arc(arc: EllipseArc) -> CurveOfTerms:
    """The arc as a curve on [0, 1], its angle linear in the parameter."""
    return CurveOfTerms(Waves(arc.start, arc.end - arc.start), [arc.center, arc.axis_a, arc.axis_b])


def certify_arc(curve: SeparableCurve, arc: EllipseArc) -> Certificate:
    """Prove how far an arc is from a space curve, at angles that run with the curve's parameter."""
    other = curve_of_arc(arc)
    coefficients = np.concatenate([curve.coefficients, -other.coefficients])
    difference = CurveOfTerms(Stacked((curve.factors, other.factors)), coefficients)
    return certify_curve(difference, BSplineCurve(np.zeros((2, 3)), [0.0, 1.0], [2, 2], 1))
