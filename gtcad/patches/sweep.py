"""Sweeps: a profile moved along a spine in a frame that moves with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import MAX_DEGREE, checked_parameters
from gtcad.composite import Composite
from gtcad.differential import Frame
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, constant_term
from gtcad.patches._moving_frames import (
    FRAMES,
    FrameKind,
    Unresolved,
    axis_across,
    check_joined,
    largest_norm,
    moving_frame,
    tangent_at,
    turned,
    twisted,
)
from gtcad.patches._patch import (
    Patch,
    Rows,
    Vector,
    checked_curves,
    checked_direction,
    checked_number,
    checked_placement,
    followed,
    handedness,
    in_space,
    placed,
    placed_error,
)
from gtcad.polynomial import Polynomials
from gtcad.protocol import SeparableCurve
from gtcad.queries import split

Array = NDArray[np.float64]

_CLOSES = "spine must close with one tangent for closed=True"
_NARROWEST = 2.0**-10  # of the spine: a part


@dataclass(frozen=True)
class Sweep(Patch):
    """The surface of a profile (x, y) that a spine C carries along in its frame (t, n, b), turned and scaled.

    With s the scaling law, phi = twist v, N = cos(phi) n + sin(phi) b and B = cos(phi) b - sin(phi) n,

        ``S(u, v) = C(v) + s(v) (x(u) N(v) + y(u) B(v) + z(u) t(v))``.

    Parameters
    ----------
    profile
        (x, y), or (x, y, z) with z along the tangent; in the model's unit.
    spine
        C, in space, regular; a plane one lies at z = 0.
    frame
        "rotation-minimising": n and b nowhere turn about the tangent, so that ``n' || t``. "frenet": n towards the
        centre of curvature, which must not vanish. "fixed": as at the start, everywhere; the profile does not turn.
    start_normal
        n at the start is its part across the tangent; by default it is the axis of the coordinates that is the
        farthest from the tangent, of equal ones the last: z for a spine that starts in the plane z = 0. None for
        "frenet".
    scale
        s by its Bernstein coefficients, not negative: one number, two for a linear law, up to 61.
    twist_deg
        Degrees the profile turns about the tangent, from n to b, at even speed in v.
    closed
        Whether to turn the profile by ``closing_deg`` more, so that it closes with a closed spine.
    placement
        Rows ``[matrix | translation]`` of an affine map that the surface is moved by afterwards, shape (2 or 3, 4).

    Raises
    ------
    InputError
        When an argument is out of its range, speed or (frenet) curvature vanish, or the frame has no polynomials of
        degree 190 within rounding: the message says where, and ``sweep_parts`` sweeps along parts.

    Notes
    -----
    C is exact. Frames have no closed form: s N, s B and s t are polynomials, and this is the surface that is evaluated,
    fitted and proved. ``definition_error`` is a proved bound of its distance from the sweep as defined above, 1e-12 to
    1e-9 of the profile's size, to be added to the deviation of a fit. For the frames it comes from the residuals of
    their equations: with w = C' x C'', the rotation-minimising n satisfies ``|C'|^2 n' = w x n``, whose flow is a
    rotation, so a polynomial p with ``|p(0) - n(0)| <= d`` is within ``d + max |p' - w x p / |C'|^2|``. The bound takes
    it that derivatives of the spine's factors are computed as accurately as their values
    (``gtcad.polynomial.derivative_rounding``).

    The frame depends on the spine alone: pieces of a profile that meet are swept to patches with one edge, to the last
    digit. The frame takes 0.01 s, where it needs a high degree 0.3 s.

    References
    ----------
    R. L. Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82 (1975) 246-251.

    Examples
    --------
    A segment at the distance 1 from a straight spine, tapered to a half, makes a trapezoid:

    >>> from gtcad import BERNSTEIN, Curve
    >>> spine = Curve([[0, 0, 0], [8, 0, 0]], family=BERNSTEIN)
    >>> tape = Sweep(Curve([[1, -1], [1, 1]], family=BERNSTEIN), spine, scale=(1, 0.5))
    >>> tape.evaluate([0.0, 0.0, 1.0], [0.0, 1.0, 1.0]).round(12).tolist()
    [[0.0, 1.0, 1.0], [8.0, 0.5, 0.5], [8.0, -0.5, 0.5]]
    """

    profile: SeparableCurve
    spine: SeparableCurve
    frame: FrameKind = "rotation-minimising"
    start_normal: Vector | None = None
    scale: tuple[float, ...] = (1.0,)
    twist_deg: float = 0.0
    closed: bool = False
    placement: Rows | None = None

    def __init__(
        self,
        profile: SeparableCurve,
        spine: SeparableCurve,
        *,
        frame: FrameKind = "rotation-minimising",
        start_normal: ArrayLike | None = None,
        scale: ArrayLike = 1.0,
        twist_deg: float = 0.0,
        closed: bool = False,
        placement: ArrayLike | None = None,
    ) -> None:
        checked_curves(profile=profile)
        checked_curves(spine=spine)
        if frame not in FRAMES:
            raise InputError(f"frame must be one of {', '.join(FRAMES)}, got {frame!r}")
        if frame == "frenet" and start_normal is not None:
            raise InputError(f"start_normal must be None: the Frenet frame has its own, got {start_normal}")
        object.__setattr__(self, "profile", in_space(profile))
        object.__setattr__(self, "spine", in_space(spine))
        object.__setattr__(self, "frame", frame)
        if start_normal is None and frame != "frenet":
            start_normal = axis_across(tangent_at(self.spine, 0.0))
        normal = None if start_normal is None else checked_direction("start_normal", start_normal)
        object.__setattr__(self, "start_normal", normal)
        object.__setattr__(self, "scale", _checked_scale(scale))
        object.__setattr__(self, "twist_deg", checked_number("twist_deg", twist_deg))
        if not isinstance(closed, bool):
            raise InputError(f"closed must be True or False, got {closed!r}")
        object.__setattr__(self, "closed", closed)
        object.__setattr__(self, "placement", checked_placement(placement))
        _ = self._moving, self._turned  # refuses what has no frame

    @property
    def frame_error(self) -> float:
        """Proved bound of the distance of the polynomial frame from the one defined, both without scale and twist.

        The root of the sum of squares over n and b, and t where the profile has a z.
        """
        return self._moving[1]

    @property
    def definition_error(self) -> float:
        """Proved bound of the distance of this surface from the sweep as defined, in the model's unit."""
        radius, reach = (
            curve.factors.derivative_bound(0) * largest_norm(curve.coefficients) for curve in (self.profile, self.spine)
        )
        error = radius * (max(self.scale) * self.frame_error + self._turned[1])
        return placed_error(self.placement, error, reach + 2 * max(self.scale) * radius)

    @cached_property
    def closing_deg(self) -> float:
        """Degrees from the frame at v = 1 to that at v = 0 about their tangent, in (-180, 180]; 0 unless closed."""
        if not self.closed:
            return 0.0
        check_joined(self.spine, self.spine, _CLOSES)
        if self.frame != "rotation-minimising":
            return 0.0
        start, end = self._moving[0].rows(np.array([0.0, 1.0])).T
        return _angle_deg(start[:3], end[:3], end[3:6])

    def frame_at(self, v: ArrayLike) -> Frame:
        """The frame (t, N, B) at parameters v, each of shape v.shape + (3,), without placement.

        With a fixed frame t is the tangent at the start.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        v = checked_parameters("v", v)
        rows = self._moving[0].rows(v.reshape(-1))
        normal, binormal = twisted(rows, self._angle * v.reshape(-1))[:6].reshape(2, 3, *v.shape)
        vectors = np.moveaxis(np.stack([np.cross(normal, binormal, axis=0), normal, binormal]), 1, -1)
        return Frame(*vectors)

    @property
    def _angle(self) -> float:
        return math.radians(self.twist_deg + self.closing_deg)

    @cached_property
    def _moving(self) -> tuple[Polynomials, float]:
        """Rows n, b, and t if the profile has a z, and the proved error."""
        count = 3 if self.profile.coefficients[:, 2].any() else 2
        return moving_frame(self.spine, self.frame, self.start_normal, count)

    @cached_property
    def _turned(self) -> tuple[Polynomials, float]:
        """The same turned and scaled, and the error of these."""
        closes = self.closed and self.scale[0] == self.scale[-1]
        return turned(self._moving[0], self._angle, self.scale, closes)

    def _built(self) -> SurfaceOfTerms:
        factors, coefficients, frame = self.profile.factors, self.profile.coefficients, self._turned[0]
        one, weights = constant_term(factors)
        carried = np.einsum("ik,de->ikde", coefficients[:, : frame.count // 3], np.eye(3))
        terms = [
            (one, self.spine.factors, weights[:, None, None] * self.spine.coefficients),
            (factors, frame, carried.reshape(len(coefficients), -1, 3)),
        ]
        return placed(SurfaceOfTerms.summed(terms), self.placement)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Sweep:
        """The affine image: points x become ``matrix @ x + translation``; of a similarity it has no placement."""
        if self.placement is not None or not (hand := handedness(matrix)):
            return replace(self, placement=followed(self.placement, matrix, translation))
        linear = np.asarray(matrix, dtype=np.float64)
        size = float(np.linalg.norm(linear[0]))
        return Sweep(
            self.profile.transformed(size * np.diag([1.0, hand, 1.0])),
            self.spine.transformed(linear, translation),
            frame=self.frame,
            start_normal=None if self.start_normal is None else linear @ self.start_normal / size,
            scale=self.scale,
            twist_deg=hand * self.twist_deg,
            closed=self.closed,
        )


def _checked_scale(scale: ArrayLike) -> tuple[float, ...]:
    try:
        values = np.atleast_1d(np.asarray(scale, dtype=np.float64))
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim != 1 or not 1 <= values.size <= MAX_DEGREE + 1 or not np.isfinite(values).all():
        raise InputError(f"scale must be 1 to {MAX_DEGREE + 1} finite numbers, got {scale!r}")
    if values.min() < 0 or not values.any():
        raise InputError(f"scale must not be negative, nor 0 throughout, got {values.tolist()}")
    return tuple((values + 0.0).tolist())


def sweep_parts(
    profile: SeparableCurve,
    spine: SeparableCurve | Composite,
    *,
    start_normal: ArrayLike | None = None,
    scale: ArrayLike = 1.0,
    twist_deg: float = 0.0,
    closed: bool = False,
) -> tuple[Sweep, ...]:
    """A sweep with the rotation-minimising frame in as many parts as it needs, one behind the other.

    Parameters
    ----------
    profile, start_normal, scale, twist_deg, closed
        As of ``Sweep``, for the whole; v runs from 0 to 1 over it.
    spine
        A curve, or a chain whose pieces go on with one tangent; each piece has an equal share of v.

    Returns
    -------
    tuple of Sweep
        A piece that has no frame in polynomials is halved until its parts do. The frame of a part starts as that of
        the part before ends, so its distance from the frame of the whole is at most the sum of the ``frame_error`` up
        to it.

    Raises
    ------
    InputError
        As for ``Sweep``; or when pieces do not go on with one tangent, or a part of 2^-10 of v has no frame yet.

    Examples
    --------
    The four quarters of a torus:

    >>> from gtcad import Curve
    >>> from gtcad.conics import circle
    >>> quarters = sweep_parts(Curve([[1, 0], [1, 1], [0, 1]]), circle([0, 0, 0], 5))
    >>> [part.evaluate(0.0, 0.0).round(12).tolist() for part in quarters[:2]]
    [[5.0, 0.0, 1.0], [0.0, 5.0, 1.0]]
    """
    law, twist = _checked_scale(scale), checked_number("twist_deg", twist_deg)
    pieces = [in_space(piece) for piece in (spine.pieces if isinstance(spine, Composite) else (spine,))]
    for k, (piece, following) in enumerate(pairwise(pieces)):
        check_joined(piece, following, f"pieces of the spine must go on with one tangent at joint {k + 1}")
    if closed:
        check_joined(pieces[-1], pieces[0], _CLOSES)
        plain = sweep_parts(profile, spine, start_normal=start_normal)
        _, normal, binormal = plain[-1].frame_at(1.0)
        twist += _angle_deg(plain[0].frame_at(0.0).normal, normal, binormal)
    shares = np.linspace(0, 1, len(pieces) + 1)
    left = [(piece, float(a), float(b)) for piece, (a, b) in zip(pieces, pairwise(shares), strict=True)][::-1]
    found: list[Sweep] = []
    while left:
        piece, a, b = left.pop()
        try:
            part = Sweep(
                profile, piece, start_normal=start_normal, scale=_on_part(law, a, b), twist_deg=(b - a) * twist
            )
        except Unresolved:
            if b - a < 2 * _NARROWEST:
                raise
            first, second = split(piece, 0.5)
            left += [(second, (a + b) / 2, b), (first, a, (a + b) / 2)]
            continue
        found.append(part)
        start_normal = part.frame_at(1.0).normal
    return tuple(found)


def _angle_deg(wanted: Array, normal: Array, binormal: Array) -> float:
    """Degrees from the normal, towards the binormal, to the wanted direction."""
    return math.degrees(math.atan2(wanted @ binormal, wanted @ normal))


def _on_part(law: tuple[float, ...], start: float, end: float) -> tuple[float, ...]:
    """Bernstein coefficients of the part over [start, end], by de Casteljau's algorithm."""
    for place, side in ((end, 0), (start / end, -1)):  # what is left of the end, then what is right of the start
        row, ends = np.array(law), []
        while row.size:
            ends.append(float(row[side]))
            row = (1 - place) * row[:-1] + place * row[1:]
        law = tuple(ends if side == 0 else ends[::-1])
    return law
