"""Arcs of circles and ellipses: GT curves of degree 2 with gamma = (0, 0) are such arcs, at even speed in the angle.

``C(t) = P_0 - P_1 + P_2 + cos(pi t / 2) (P_1 - P_2) + sin(pi t / 2) (P_1 - P_0)``: a CAD file can hold them as the
analytic curves that they are, and the angle corresponds linearly to the curve's parameter. A chain of them can be one
arc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import GT, Basis
from gtcad.composite import Composite
from gtcad.conics import Arc
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import Certificate, certify_curve
from gtcad.converters.exact import whole_factors
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]

_FLAT = 1e-9  # of the longer half axis: an ellipse as flat as this goes as a B-spline
_SQUARE = 1e-14  # cosine of the angle of two half diameters that are axes already
_SAME = 1e-12  # of the coordinates: what the ellipses of two pieces may differ by to be one; the proof decides


def ellipse_arc(curve: SeparableCurve) -> EllipseArc | None:
    """The arc that a space curve is, in the direction of its parameter; None when it is none."""
    found = _Turning.of(curve)
    return None if found is None else found.arc()


def arc_of_chain(chain: Composite) -> EllipseArc | None:
    """The one arc that a chain of space curves is, in the direction of its parameter; None when it is none.

    Every piece is an arc of the same ellipse, begins where the one before ends, and all together turn a full turn at
    most. An ``Arc`` gives its own center and half diameters: its control points have them with rounding.
    """
    pieces = _turnings(chain)
    if pieces is None or not all(piece.goes_on_as(following) for piece, following in pairwise(pieces)):
        return None
    quarters = sum(piece.quarters for piece in pieces)
    if quarters > 4 + _SAME:
        return None
    first = pieces[0]
    if isinstance(chain, Arc):
        sense = math.copysign(1.0, chain.end_deg - chain.start_deg)
        start = sense * math.remainder(chain.start_deg, 360.0) / 90
        first = _Turning(chain.center, chain.axis_a, sense * chain.axis_b, start, 0.0)
    return replace(first, end=first.start + (4.0 if quarters > 4 - _SAME else quarters)).arc()


def certify_chain_arc(chain: Composite, arc: EllipseArc) -> tuple[Certificate, ...]:
    """Prove how far an arc is from each piece of a chain, each against its own part of the arc's angle.

    Raises
    ------
    InputError
        When a piece is no arc of an ellipse in space.
    """
    if _turnings(chain) is None:
        raise InputError("every piece must be a space curve of degree 2 with gamma = (0, 0)")
    return tuple(map(certify_arc, chain.pieces, split_arc(arc, chain.pieces)))


def split_arc(arc: EllipseArc, pieces: Sequence[SeparableCurve]) -> list[EllipseArc]:
    """The parts of an arc for the pieces of a chain: of the angle, each gets what it is of a whole piece's domain."""
    shares = [abs(end - start) for _, start, end in (whole_factors(piece.factors) for piece in pieces)]
    places = np.cumsum([0.0, *shares])
    angles = (arc.start + (arc.end - arc.start) * places / places[-1]).tolist()
    return [EllipseArc(arc.center, arc.axis_a, arc.axis_b, *ends) for ends in pairwise(angles)]


def curve_of_arc(arc: EllipseArc) -> CurveOfTerms:
    """The arc as a curve on [0, 1], its angle linear in the parameter."""
    return CurveOfTerms(Waves(arc.start, arc.end - arc.start), [arc.center, arc.axis_a, arc.axis_b])


def certify_arc(curve: SeparableCurve, arc: EllipseArc) -> Certificate:
    """Prove how far an arc is from a space curve, at angles that run with the curve's parameter."""
    other = curve_of_arc(arc)
    coefficients = np.concatenate([curve.coefficients, -other.coefficients])
    difference = CurveOfTerms(Stacked((curve.factors, other.factors)), coefficients)
    return certify_curve(difference, BSplineCurve(np.zeros((2, 3)), [0.0, 1.0], [2, 2], 1))


@dataclass(frozen=True, eq=False)
class _Turning:
    """``center + cos(pi x / 2) a + sin(pi x / 2) b`` for x from start to end, start < end: x counts quarters."""

    center: Array
    a: Array
    b: Array
    start: float
    end: float

    @property
    def quarters(self) -> float:
        return self.end - self.start

    @staticmethod
    def of(curve: SeparableCurve) -> _Turning | None:
        """What a space curve is, at its own speed; None when it is none."""
        basis, start, end = whole_factors(curve.factors)
        if not (isinstance(basis, Basis) and basis.family is GT and basis.degree == 2 and basis.gamma == (0.0, 0.0)):
            return None
        if curve.dimension != 3:
            return None
        p, q, r = curve.coefficients
        a, b = q - r, q - p
        return _Turning(p - q + r, a, b, start, end) if start < end else _Turning(p - q + r, a, -b, -start, -end)

    def goes_on_as(self, other: _Turning) -> bool:
        """Whether the other goes on where this one ends, along the same ellipse."""
        angle = math.pi / 2 * (self.end - other.start)
        c, s = math.cos(angle), math.sin(angle)
        turned = np.array([self.center, c * self.a + s * self.b, c * self.b - s * self.a])
        given = np.array([other.center, other.a, other.b])
        return bool(np.abs(turned - given).max() <= _SAME * np.abs(turned).max())

    def arc(self) -> EllipseArc | None:
        """The same by its axes, which ``tan(2 phi) = 2 a.b / (|a|^2 - |b|^2)`` gives; None when it is too flat."""
        a, b = self.a, self.b
        across = float(a @ b)
        turn = math.atan2(2 * across, float(a @ a - b @ b)) / 2
        if abs(across) <= _SQUARE * np.linalg.norm(a) * np.linalg.norm(b):
            turn = 0.0
        axes = math.cos(turn) * a + math.sin(turn) * b, math.cos(turn) * b - math.sin(turn) * a
        lengths = sorted(float(np.linalg.norm(axis)) for axis in axes)
        if lengths[0] <= _FLAT * lengths[1]:
            return None
        return EllipseArc(self.center, *axes, *(math.pi / 2 * x - turn for x in (self.start, self.end)))


def _turnings(chain: Composite) -> list[_Turning] | None:
    """What the pieces are, or None when one of them is no arc."""
    found = [_Turning.of(piece) for piece in chain.pieces]
    pieces = [piece for piece in found if piece is not None]
    return pieces if len(pieces) == len(found) else None
