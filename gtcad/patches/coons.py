"""Coons patches: the Boolean sum of four boundary curves."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, Term
from gtcad.patches._patch import LINEAR, Patch, checked_curves
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_GAP = 1e-9  # of the size: what the ends of the curves may differ by at a corner


@dataclass(frozen=True)
class Coons(Patch):
    """The bilinearly blended patch of four boundary curves, their Boolean sum.

    ``S(u, v) = (1 - v) c0(u) + v c1(u) + (1 - u) d0(v) + u d1(v) - sum_ab L_a(u) L_b(v) P_ab``, with L_0(t) = 1 - t,
    L_1(t) = t and the corners P_ab.

    Parameters
    ----------
    c0, c1
        The boundaries "v0" and "v1", curves in u.
    d0, d1
        The boundaries "u0" and "u1", curves in v: d0 runs from the start of c0 to that of c1, d1 from end to end.

    Raises
    ------
    InputError
        When one is no curve, the dimensions differ, or two ends are apart at a corner by more than 1e-9 of the size.

    Notes
    -----
    Where the ends at a corner are equal, the boundaries are the curves up to rounding. All four may be of different
    kinds; one may be a point (all control points equal) for a patch with three sides.

    References
    ----------
    S. A. Coons, Surfaces for computer-aided design of space forms, MIT Project MAC-TR-41, 1967.

    Examples
    --------
    Four lines give the bilinear patch:

    >>> from gtcad import BERNSTEIN
    >>> def line(a, b):
    ...     return Curve([a, b], family=BERNSTEIN)
    >>> a, b, c, d = [0, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, 0]
    >>> Coons(line(a, b), line(c, d), line(a, c), line(b, d)).evaluate(0.5, 0.5).tolist()
    [0.5, 0.5, 0.5]
    """

    c0: SeparableCurve
    c1: SeparableCurve
    d0: SeparableCurve
    d1: SeparableCurve

    def __post_init__(self) -> None:
        checked_curves(c0=self.c0, c1=self.c1, d0=self.d0, d1=self.d1)
        ends = self._ends()
        gaps = np.linalg.norm(np.diff(ends, axis=2)[:, :, 0], axis=-1)
        size = _size((self.c0, self.c1, self.d0, self.d1))
        if (gaps > _GAP * size).any():
            u, v = np.unravel_index(int(gaps.argmax()), gaps.shape)
            names = f"the {'end' if u else 'start'} of c{v}", f"the {'end' if v else 'start'} of d{u}"
            points = [end.tolist() for end in ends[u, v]]
            raise InputError(
                f"corner u = {u}, v = {v}: {names[0]} {points[0]} and {names[1]} {points[1]} are {gaps[u, v]:.3g} "
                f"apart, at most {_GAP * size:.3g} is allowed"
            )

    def _ends(self) -> Array:
        """The ends that meet at each corner, that of c and that of d: shape (2, 2, 2, d), by u, v, curve."""
        along_u = np.stack([curve.evaluate([0.0, 1.0]) for curve in (self.c0, self.c1)], axis=1)
        along_v = np.stack([curve.evaluate([0.0, 1.0]) for curve in (self.d0, self.d1)])
        return np.stack([along_u, along_v], axis=2)

    def _built(self) -> SurfaceOfTerms:
        return SurfaceOfTerms.summed(self._summands())

    def _summands(self) -> list[Term]:
        terms: list[Term] = [(LINEAR, LINEAR, -self._ends().mean(axis=2))]
        for side, c, d in zip(np.eye(2), (self.c0, self.c1), (self.d0, self.d1), strict=True):
            terms.append((c.factors, LINEAR, c.coefficients[:, None] * side[:, None]))
            terms.append((LINEAR, d.factors, side[:, None, None] * d.coefficients))
        return terms

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Coons:
        """The affine image: points x become ``matrix @ x + translation``."""
        return Coons(*(curve.transformed(matrix, translation) for curve in (self.c0, self.c1, self.d0, self.d1)))


def coons_from_loop(curves: Sequence[SeparableCurve]) -> Coons:
    """The Coons patch inside a loop of four curves in order, each turned round where it must be.

    Parameters
    ----------
    curves
        c0, d1, c1, d0 of the patch, in either direction each.

    Raises
    ------
    InputError
        When they are not four, or do not meet.

    Examples
    --------
    >>> from gtcad import BERNSTEIN
    >>> corners = [[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]]
    >>> loop = [Curve([corners[k], corners[(k + 1) % 4]], family=BERNSTEIN) for k in range(4)]
    >>> coons_from_loop(loop).evaluate(1.0, 1.0).tolist()
    [1.0, 1.0, 0.0]
    """
    if len(curves) != 4:
        raise InputError(f"curves must be four, got {len(curves)}")
    checked_curves(**{f"curves[{k}]": curve for k, curve in enumerate(curves)})
    ends = np.stack([curve.evaluate([0.0, 1.0]) for curve in curves])

    def gap(turned: tuple[int, ...]) -> float:
        """The largest gap of the loop with these curves run backwards."""
        first = np.stack([own[turn] for own, turn in zip(ends, turned, strict=True)])
        last = np.stack([own[1 - turn] for own, turn in zip(ends, turned, strict=True)])
        return float(np.linalg.norm(np.roll(first, -1, axis=0) - last, axis=1).max())

    turned = min(itertools.product((0, 1), repeat=4), key=gap)
    c0, d1, c1, d0 = (
        _reversed(curve) if turn != back else curve
        for curve, turn, back in zip(curves, turned, (0, 0, 1, 1), strict=True)
    )
    return Coons(c0, c1, d0, d1)


def _reversed(curve: SeparableCurve) -> SeparableCurve:
    return curve.reversed() if isinstance(curve, Curve | RestrictedCurve) else RestrictedCurve(curve, (1.0, 0.0))


def _size(curves: Sequence[SeparableCurve]) -> float:
    points = np.concatenate([curve.evaluate(np.linspace(0.0, 1.0, 17)) for curve in curves])
    return float(np.linalg.norm(np.ptp(points, axis=0)))
