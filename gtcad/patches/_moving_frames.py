"""Frames that move along a curve, as polynomials with a proved distance from what defines them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.polynomial import chebyshev as series_of
from numpy.typing import NDArray

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF, evaluation, lebesgue, nodes, transform
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms
from gtcad.patches._patch import Vector
from gtcad.patches._singular import first_zero
from gtcad.polynomial import MAX_COUNT, Polynomials, Spanned, chopped, derivative_rounding, resolved
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]
FrameKind = Literal["rotation-minimising", "frenet", "fixed"]

FRAMES: tuple[FrameKind, ...] = ("rotation-minimising", "frenet", "fixed")
_SPANS = (8, 32, 128, 512)  # of a proof: as few as resolve the functions
_VANISHES = 1e-9  # of the largest value: speed, curvature
_STRAIGHT = 1e-12  # of the largest |C'| |C''|: less of |C' x C''| is rounding
_CLOSED = 1e-9  # how far joined ends may be apart, of the speed, and their tangents
_ASIDE = 1e-6  # sine of the least angle of a start normal and the tangent
_SAMPLES = 1025
_MOST_VALUES = 256  # of what is turned and scaled
_WORST = 1e-6  # error of a frame that is not taken for one


def largest_norm(vectors: Array) -> float:
    """The largest length."""
    return float(np.linalg.norm(vectors, axis=-1).max())


def _unit(vector: Array) -> Array:
    return np.asarray(vector / math.hypot(*vector))


def tangent_at(spine: SeparableCurve, v: float) -> Array:
    """The direction of C' where it does not vanish."""
    first = spine.derivative(v)
    if np.linalg.norm(first) <= _VANISHES * largest_norm(spine.derivative(np.linspace(0, 1, 33))):
        raise InputError(f"spine must be regular, but its speed vanishes at v = {v:g}")
    return _unit(first)


def axis_across(tangent: Array) -> Array:
    """The axis of coordinates that is the farthest from the tangent, of equal ones the last."""
    near = np.flatnonzero(np.abs(tangent) <= np.abs(tangent).min() + 1e-9)
    return np.asarray(np.eye(3)[near[-1]])


def check_joined(spine: SeparableCurve, following: SeparableCurve, where: str) -> None:
    """Refuse two curves of which one does not go on with the tangent of the other."""
    first, second = spine.derivative(1.0), following.derivative(0.0)
    gap = float(np.linalg.norm(following.evaluate(0.0) - spine.evaluate(1.0)))
    turn = float(np.linalg.norm(tangent_at(following, 0.0) - tangent_at(spine, 1.0)))
    if gap > _CLOSED * max(largest_norm(first), largest_norm(second)) or turn > _CLOSED:
        raise InputError(f"{where}, got ends {gap:.3g} apart and tangents that differ by {turn:.3g}")


class Unresolved(InputError):
    """A frame needs polynomials of a higher degree."""


@dataclass(frozen=True)
class _Spine:
    """A spine near the origin, where its derivatives have the least rounding; its coefficients are off by the error."""

    curve: SeparableCurve
    error: float

    @classmethod
    def of(cls, spine: SeparableCurve) -> _Spine:
        center = spine.evaluate(0.5)
        error = 4 * UNIT_ROUNDOFF * (largest_norm(spine.coefficients) + float(np.linalg.norm(center)))
        return cls(spine.transformed(np.eye(3), -center), error)

    def at(self, v: Array) -> tuple[Array, Array, Array]:
        """C', C'' and C' x C''."""
        first, second = self.curve.derivative(v, 1), self.curve.derivative(v, 2)
        return first, second, np.cross(first, second)

    def speed(self, v: Array) -> Array:
        """|C'|."""
        return np.asarray(np.linalg.norm(self.at(v)[0], axis=-1))

    def bend(self, v: Array) -> Array:
        """|C' x C''|, the curvature times the cube of the speed; 0 where it is rounding."""
        first, second, across = self.at(v)
        size = np.linalg.norm(across, axis=-1)
        return np.where(size <= _STRAIGHT * largest_norm(first) * largest_norm(second), 0.0, size)

    def turning(self, v: Array) -> Array:
        """The angular velocity of the rotation-minimising frame."""
        first, _, across = self.at(v)
        return np.asarray(across / np.sum(first**2, axis=-1, keepdims=True))

    def fields(self, spans: int) -> tuple[Spanned, Spanned]:
        """C' and C' x C''."""
        first, second = (Spanned.of(self.curve, order, spans, self.error) for order in (1, 2))
        return first, first.cross(second)


def moving_frame(
    spine: SeparableCurve, kind: FrameKind, start_normal: Vector | None, count: int
) -> tuple[Polynomials, float]:
    """Polynomials of n, b and, with a count of 3, t, and the proved error of all together."""
    local = _Spine.of(spine)
    if kind == "fixed":
        vectors, error = _start(local, start_normal)
        return Polynomials(vectors[:count].reshape(-1, 1)), math.sqrt(count) * error
    _check_regular(local, curved=kind == "frenet")
    found = _transported(local, start_normal) if kind == "rotation-minimising" else []
    found += [_direction(local, axis) for axis in ("normal", "binormal", "tangent")[len(found) : count]]
    error = math.hypot(*(bound for _, bound in found))
    if not error <= _WORST:
        raise _unresolved(local)
    return _side_by_side([vector for vector, _ in found]), error


def _transported(local: _Spine, start_normal: Vector | None) -> list[tuple[Polynomials, float]]:
    """The n and b of the rotation-minimising frame, and their proved errors."""
    vectors, error = _start(local, start_normal)
    whole, kept = _resolved(local, partial(_collocated, local, vectors[:2]))
    found = []
    for k, start in enumerate(vectors[:2]):
        rows = slice(3 * k, 3 * k + 3)
        vector = Polynomials(whole[rows])
        off = float(np.linalg.norm(vector.rows(np.zeros(1))[:, 0] - start)) + vector.rounding + error
        off += proved_bound(partial(_transport_error, local, vector))
        left_out = float(np.linalg.norm(whole[rows, kept.shape[1] :], axis=0).sum())
        found.append((Polynomials(kept[rows]), off + left_out))
    return found


def _direction(local: _Spine, axis: str) -> tuple[Polynomials, float]:
    """A vector of the Frenet frame, and its proved error."""
    vector = Polynomials(_resolved(local, partial(_directions, local, axis))[1])
    return vector, proved_bound(partial(_direction_error, local, axis, vector))


def _side_by_side(vectors: list[Polynomials]) -> Polynomials:
    width = max(vector.degree for vector in vectors) + 1
    padded = [np.pad(p.coefficients, ((0, 0), (0, width - 1 - p.degree))) for p in vectors]
    return Polynomials(np.concatenate(padded))


def _start(local: _Spine, start_normal: Vector | None) -> tuple[Array, float]:
    """The n, b and t at the start, shape (3, 3), and a bound of the error of each."""
    tangent = tangent_at(local.curve, 0.0)
    assert start_normal is not None
    along = _unit(np.array(start_normal))
    across = along - (along @ tangent) * tangent
    sine = math.hypot(*across)
    if sine < _ASIDE:
        raise InputError(f"start_normal must not be along the tangent {tangent.tolist()}, got {start_normal}")
    normal = _unit(across - (across @ tangent) * tangent)
    size, factors = largest_norm(local.curve.coefficients), local.curve.factors
    off = derivative_rounding(factors, 1) * size
    off += factors.derivative_bound(1) * (local.error + factors.count * UNIT_ROUNDOFF * size)
    error = (2 * off / float(np.linalg.norm(local.curve.derivative(0.0))) + 32 * UNIT_ROUNDOFF) / sine
    return np.array([normal, np.cross(tangent, normal), tangent]), error


def _check_regular(local: _Spine, *, curved: bool) -> None:
    """Refuse a spine whose speed, or curvature where it matters, vanishes, and say where."""
    v = np.linspace(0, 1, _SAMPLES)
    for name, size in {"speed": local.speed, "curvature": local.bend}.items():
        if name == "speed" or curved:
            place = first_zero(size, float(size(v).max()))
            if place is not None:
                raise InputError(f"spine must have no vanishing {name}, but it vanishes at v = {place:.6g}")


def _unresolved(local: _Spine) -> Unresolved:
    v = np.linspace(0, 1, _SAMPLES)
    rate = np.linalg.norm(local.turning(v), axis=-1)
    k = int(rate.argmax())
    return Unresolved(
        f"the frame has no polynomials of degree {MAX_COUNT - 1} within rounding: at v = {v[k]:.4g} it turns by "
        f"{rate[k]:.3g} radians per unit of v; sweep along parts of the spine (sweep_parts)"
    )


def _resolved(local: _Spine, series_with: Callable[[int], Array]) -> tuple[Array, Array]:
    """Series, and the same without their rounding."""
    found = resolved(series_with)
    if found is None or found[1].shape[1] > MAX_COUNT:
        raise _unresolved(local)
    return found


def _collocated(local: _Spine, starts: Array, count: int) -> Array:
    """Series of the vectors that start as given and turn with the frame, by collocation of ``r = r(0) + int w x r``."""
    rates = local.turning((nodes(count) + 1) / 2)
    integrals = series_of.chebint(transform(count), lbnd=-1, axis=0) / 2  # from values to coefficients
    to_values = evaluation(count, count + 1) @ integrals
    turning = np.cross(rates[:, None], np.eye(3)).swapaxes(1, 2)  # matrices [w x]
    system = np.eye(3 * count) - np.einsum("ij,jde->idje", to_values, turning).reshape(3 * count, -1)
    solved = np.linalg.solve(system, np.tile(starts.T, (count, 1))).reshape(count, 3, -1)
    series = np.einsum("kj,jdm->mdk", integrals, turning @ solved)
    series[..., 0] += starts
    return np.asarray(series.reshape(-1, count + 1))


def _directions(local: _Spine, axis: str, count: int) -> Array:
    """Series of a vector of the Frenet frame."""
    first, _, across = local.at((nodes(count) + 1) / 2)
    field = {"tangent": first, "binormal": across, "normal": np.cross(across, first)}[axis]
    return np.asarray((transform(count) @ (field / np.linalg.norm(field, axis=1, keepdims=True))).T)


def proved_bound(bound_with: Callable[[int], float]) -> float:
    """A bound on so many spans that more of them would not halve it."""
    best = math.inf
    for spans in _SPANS:
        bound = bound_with(spans)
        if best / 2 < bound < math.inf:
            return min(best, bound)
        best = min(best, bound)
    return best


def _transport_error(local: _Spine, vector: Polynomials, spans: int) -> float:
    """Bound of ``|p' - w x p / |C'|^2|``, w = C' x C''."""
    first, across = local.fields(spans)
    square = first.dot(first)
    least = square.least()
    if not least.all():
        return math.inf
    slope, value = (Spanned.of(CurveOfTerms(vector, np.eye(3)), order, spans) for order in (1, 0))
    return (slope.times(square) - across.cross(value)).largest(least)


def _direction_error(local: _Spine, axis: str, vector: Polynomials, spans: int) -> float:
    """Bound of ``|p - f / |f||`` for the direction f of t, b or n, from ``p x f`` and ``|p|^2 - 1``."""
    first, across = local.fields(spans)
    field = {"tangent": first, "binormal": across, "normal": across.cross(first)}[axis]
    least = first.dot(first).least() if axis != "binormal" else 1.0
    least = least * (across.dot(across).least() if axis != "tangent" else 1.0)
    if not np.all(least):
        return math.inf
    value = Spanned.of(CurveOfTerms(vector, np.eye(3)), 0, spans)
    lean = value.cross(field).largest(np.sqrt(least))
    stretch = value.dot(value).plus(-1.0).largest()
    return math.hypot(lean, stretch + lean**2)


# Twist and scale


def twisted(rows: Array, angle: Array) -> Array:
    """Rows n, b, ... turned about t."""
    cosine, sine, (n, b) = np.cos(angle), np.sin(angle), (rows[:3], rows[3:6])
    return np.concatenate([cosine * n + sine * b, cosine * b - sine * n, rows[6:]])


def turned(frame: Polynomials, angle: float, scale: tuple[float, ...], closes: bool) -> tuple[Polynomials, float]:
    """Polynomials of ``s N``, ``s B`` and ``s t``, and the proved error of all together but that of the frame."""
    if angle == 0 and set(scale) == {1.0} and not closes:
        return frame, 0.0
    if abs(angle) > _MOST_VALUES:
        raise _too_much(angle)
    law = Basis(max(len(scale) - 1, 1), family=BERNSTEIN)
    coefficients = np.array(scale if len(scale) > 1 else scale * 2)
    tails = _product_tails(frame, angle, law) * coefficients.max()
    enough = np.flatnonzero(tails <= 4 * UNIT_ROUNDOFF * coefficients.max())
    enough = enough[enough > frame.degree]
    if not enough.size:
        raise _too_much(angle)
    count = int(enough[0])
    v = (nodes(count) + 1) / 2
    rows, factor = frame.rows(v), coefficients @ law.rows(v)
    values = factor * twisted(rows, angle * v)
    series = values @ transform(count).T
    series = chopped(series, 16 * UNIT_ROUNDOFF * float(np.abs(series).max()))
    if closes and series.shape[1] > 1:
        series[:, 1] -= series[:, 1::2].sum(axis=1)
    if series.shape[1] > MAX_COUNT:
        raise _too_much(angle)
    found = Polynomials(series)
    off = float(np.linalg.norm(found.rows(v) - values, axis=0).max()) + found.rounding
    units = (4 * abs(angle) + 16) * UNIT_ROUNDOFF + law.rounding
    off += coefficients.max() * (2 * frame.rounding + units * 2 * float(np.abs(rows).sum(axis=0).max()))
    return found, lebesgue(count) * off + float(tails[count])


def _too_much(angle: float) -> Unresolved:
    return Unresolved(
        f"the frame turned by {math.degrees(angle):g} degrees in all and scaled has no polynomials of degree "
        f"{MAX_COUNT - 1} within rounding; sweep along parts of the spine (sweep_parts)"
    )


def _product_tails(frame: Polynomials, angle: float, law: Basis) -> Array:
    """Bounds of the distance of turned and scaled (by 1 at most) rows from their interpolant at K nodes, K from 0."""
    orders = range(_MOST_VALUES + 1)
    steps = np.cumprod([1.0] + [0.5 / k for k in orders[1:]])
    taylors = [
        np.pad(frame.taylor, (0, len(orders) - frame.degree - 1)),
        np.cumprod([1.0] + [abs(angle) / 2 / k for k in orders[1:]]),
        np.array([law.derivative_bound(k) for k in orders]) * steps,
    ]
    product = taylors[0]
    for taylor in taylors[1:]:
        product = np.convolve(product, taylor)[: len(steps)]
    return np.asarray(2 * product * 2.0 ** (1 - np.array(orders)))
