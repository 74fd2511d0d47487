"""Patches that are planes, cylinders, cones, spheres or tori, at even speed in the angle and the height.

Circles come from GT factors of degree 2 with gamma = (0, 0) and from ``Waves``, lines from linear factors. A CAD file
can hold a patch made of these as the analytic surface that it is, and the parameters correspond affinely.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import GT, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.certificate import Certificate, certify_surface
from gtcad.converters.quadrics import FULL_TURN, RIGHT_ANGLE, Quadric, Range, surface_of_quadric
from gtcad.factors import RestrictedFactors, Stacked, SurfaceOfTerms, Waves
from gtcad.protocol import Factors, SeparableSurface

Array = NDArray[np.float64]

_ROUNDING = 1e-13  # of the largest coordinate: what still is rounding when a patch is recognised
_SAMPLES = np.linspace(0.0, 1.0, 9)


# --- the proof --------------------------------------------------------------------------------------------------------


def certify_quadric(surface: SeparableSurface, q: Quadric) -> Certificate:
    """Prove how far a quadric is from a patch, its parameters running affinely with those of the patch.

    Of the eight ways to run over the same rectangle the one that fits best is taken; a full turn may begin anywhere.
    A plane patch lies at z = 0.
    """
    surface = _in_space(surface)
    other = min(_ways(surface, q), key=lambda way: _gap(surface, way))
    terms = [(way.factors_u, way.factors_v, sign * way.coefficients) for way, sign in ((surface, 1), (other, -1))]
    nothing = BSplineSurface(np.zeros((2, 2, 3)), [0.0, 1.0], [2, 2], 1, [0.0, 1.0], [2, 2], 1)
    proved = certify_surface(SurfaceOfTerms.summed(terms), nothing)
    # the coefficients of the quadric are themselves computed, each with a few roundings
    rounding = 16 * UNIT_ROUNDOFF * float(np.linalg.norm(other.coefficients, axis=-1).sum())
    off = rounding + surface.definition_error
    return Certificate(max(0.0, proved.lower - off), proved.upper + off, proved.place)


def _ways(surface: SeparableSurface, q: Quadric) -> Iterator[SurfaceOfTerms]:
    """The quadric with u and v exchanged or not, and each of them run forwards and backwards."""
    for own, arranged in ((surface, SurfaceOfTerms), (_transposed(surface), _transposed_terms)):
        for u_range, v_range in itertools.product((q.u_range, q.u_range[::-1]), (q.v_range, q.v_range[::-1])):
            way = surface_of_quadric(_begun(replace(q, u_range=u_range, v_range=v_range), own))
            yield arranged(way.factors_u, way.factors_v, way.coefficients)


def _begun(q: Quadric, surface: SeparableSurface) -> Quadric:
    """The quadric with its full turns beginning where the patch begins."""
    full_u, full_v = q.full_turns
    if full_u:
        side = surface.evaluate(0.0, 0.5) - q.origin
        q = replace(q, u_range=_moved(q.u_range, math.atan2(side @ q.y_direction, side @ q.x_direction)))
    if full_v:
        side = surface.evaluate(0.5, 0.0) - q.origin
        height = float(side @ q.axis)
        out = float(np.linalg.norm(side - height * q.axis))
        q = replace(q, v_range=_moved(q.v_range, math.atan2(height, out - q.radius)))
    return q


def _moved(ends: Range, start: float) -> Range:
    return start, start + (ends[1] - ends[0])


def _gap(surface: SeparableSurface, other: SeparableSurface) -> float:
    """The largest distance of points of equal parameters, of some samples."""
    u, v = _SAMPLES[:, None], _SAMPLES[None, :]
    return float(np.linalg.norm(surface.evaluate(u, v) - other.evaluate(u, v), axis=-1).max())


def _in_space(surface: SeparableSurface) -> SeparableSurface:
    return surface if surface.dimension == 3 else surface.transformed(np.eye(3, 2))


def _transposed(surface: SeparableSurface) -> SurfaceOfTerms:
    return _transposed_terms(surface.factors_u, surface.factors_v, surface.coefficients)


def _transposed_terms(factors_u: Factors, factors_v: Factors, coefficients: Array) -> SurfaceOfTerms:
    return SurfaceOfTerms(factors_v, factors_u, coefficients.swapaxes(0, 1))


# --- recognition ------------------------------------------------------------------------------------------------------


def quadric_of(surface: SeparableSurface) -> Quadric | None:
    """The quadric that a patch is, with the patch's own normal; None when it is none, up to rounding.

    Its angles and lengths must run evenly with the parameters of the patch, so that ``certify_quadric`` can prove it. A
    plane patch lies at z = 0.

    Examples
    --------
    >>> from gtcad import Curve
    >>> from gtcad.patches import cylinder
    >>> found = quadric_of(cylinder(Curve([[2, 0, 0], [2, 2, 0], [0, 2, 0]]), [0, 0, 5]))
    >>> found.kind, found.radius, found.v_range
    ('cylinder', 2.0, (0.0, 5.0))
    """
    surface = _in_space(surface)
    (matrix_u, turn_u), (matrix_v, turn_v) = _simple(surface.factors_u), _simple(surface.factors_v)
    if max(turn_u, turn_v) > FULL_TURN:
        return None
    table = np.einsum("ia,jb,ijd->abd", matrix_u, matrix_v, surface.coefficients)
    slack = _ROUNDING * float(np.linalg.norm(table, axis=-1).max())
    found = _recognised(_Table(table, turn_u, turn_v, slack), surface)
    if found is not None:
        return found
    found = _recognised(_Table(table.swapaxes(0, 1), turn_v, turn_u, slack), _transposed(surface))
    return None if found is None else replace(found, v_range=found.v_range[::-1])


def _leaves(factors: Factors, start: float = 0.0, end: float = 1.0) -> Iterator[tuple[Factors, float, float]]:
    """The factors without restriction, side by side, and the part of their domain that is meant."""
    if isinstance(factors, RestrictedFactors):
        ends = (factors.start * (1 - x) + factors.end * x for x in (start, end))
        yield from _leaves(factors.base, *ends)
    elif isinstance(factors, Stacked):
        for part in factors.parts:
            yield from _leaves(part, start, end)
    else:
        yield factors, start, end


def _wave(factors: Factors, start: float, end: float) -> tuple[float, float, Array] | None:
    """First angle, turn > 0 and the matrix from 1, cos and sin of the angle; None for factors that are no waves."""
    if isinstance(factors, Waves):
        first, turn, matrix = factors.start + factors.sweep * start, factors.sweep * (end - start), np.eye(3)
    elif isinstance(factors, Basis) and (factors.family, factors.degree, factors.gamma) == (GT, 2, (0.0, 0.0)):
        first, turn = RIGHT_ANGLE * start, RIGHT_ANGLE * (end - start)
        matrix = np.array([[1.0, 0.0, -1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 0.0]])
    else:
        return None
    return (first, turn, matrix) if turn > 0 else (-first, -turn, matrix * [1, 1, -1])


def _simple(factors: Factors) -> tuple[Array, float]:
    """Factors as combinations of 1, t, cos(turn t) and sin(turn t): the matrix, shape (count, 4), and the turn.

    Those that are no such combinations, or of another turn, are replaced by the linear functions between their ends:
    where that matters a comparison with the patch will show it.
    """
    turn, blocks = 0.0, []
    for leaf, start, end in _leaves(factors):
        wave = _wave(leaf, start, end)
        if wave is not None and turn == 0:
            turn = wave[1]
        block = np.zeros((leaf.count, 4))
        if wave is not None and math.isclose(wave[1], turn, rel_tol=1e-15):
            c, s = math.cos(wave[0]), math.sin(wave[0])
            block[:, [0, 2, 3]] = wave[2] @ [[1, 0, 0], [0, c, -s], [0, s, c]]
        else:
            first, last = leaf.rows(np.array([start, end])).T
            block[:, 0], block[:, 1] = first, last - first
        blocks.append(block)
    return np.concatenate(blocks), FULL_TURN if math.isclose(turn, FULL_TURN, rel_tol=1e-14) else turn


@dataclass(frozen=True, eq=False)
class _Table:
    """A patch by its coefficients c_ab for the functions 1, t, cos(turn t) and sin(turn t) of u and of v.

    Where u turns, it is read as ``c_0*(v) + cos(turn u) c_2*(v) + sin(turn u) c_3*(v)``: a center and two radii.
    """

    rows: Array  # (4, 4, 3)
    turn_u: float
    turn_v: float
    slack: float  # lengths up to this one are rounding

    def turns(self) -> tuple[bool, bool]:
        """Whether the patch makes use of cos and sin in u and in v."""
        u, v = (np.abs(rows).max() > self.slack for rows in (self.rows[2:], self.rows[:, 2:]))
        return bool(u), bool(v)


def _recognised(table: _Table, surface: SeparableSurface) -> Quadric | None:
    """The quadric of a patch whose circles run with u; None when it is none, or they do not."""
    match table.turns():
        case False, False:
            found = _plane(table)
        case True, False:
            found = _ruled(table)
        case True, True:
            found = _round(table)
        case _:
            found = None
    if found is None or _gap(surface, surface_of_quadric(found)) > 4 * table.slack:
        return None
    return found


def _frame(a: Array, b: Array) -> tuple[Array, Array] | None:
    """The directions of a x b and of a; None when a and b are nowhere near right angles."""
    lengths = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if min(lengths) == 0:
        return None
    normal = np.cross(a / lengths[0], b / lengths[1])
    length = float(np.linalg.norm(normal))
    return None if length < 0.5 else (normal / length, a / lengths[0])


def _plane(table: _Table) -> Quadric | None:
    along_u, along_v = table.rows[1, 0], table.rows[0, 1]
    frame = _frame(along_u, along_v)
    if frame is None:
        return None
    ends = (0.0, float(np.linalg.norm(along_u))), (0.0, float(np.linalg.norm(along_v)))
    return Quadric("plane", table.rows[0, 0], *frame, 0.0, 0.0, *ends)


def _ruled(table: _Table) -> Quadric | None:
    """Of circles about an axis whose radii run linearly: a cylinder, a cone or a disc."""
    (center, rise), first, second = (table.rows[k, :2] for k in (0, 2, 3))
    wider = int(np.linalg.norm(first.sum(axis=0)) > np.linalg.norm(first[0]))
    frame = _frame(first[0] + wider * first[1], second[0] + wider * second[1])
    if frame is None:
        return None
    axis, x = frame
    radii = [0.0 if abs(r) <= table.slack else float(r) for r in (first[0] @ x, first.sum(axis=0) @ x)]
    height, growth = float(rise @ axis), radii[1] - radii[0]
    if min(radii) < 0 or max(abs(height), abs(growth)) <= table.slack:
        return None
    turn = (0.0, table.turn_u)
    if abs(growth) <= table.slack:
        return Quadric("cylinder", center, axis, x, max(radii), 0.0, turn, (0.0, height))
    if abs(height) <= table.slack:
        return Quadric("disc", center, axis, x, 0.0, 0.0, turn, (radii[0], radii[1]))
    origin, slant = (center, (0.0, 1.0)) if growth > 0 else (center + rise, (1.0, 0.0))
    slant = slant[0] * math.hypot(height, growth), slant[1] * math.hypot(height, growth)
    if height * growth < 0:  # the axis runs to where the cone is wider: turning is then seen from the other side
        y = np.cross(axis, x)
        axis, x = -axis, math.cos(turn[1]) * x + math.sin(turn[1]) * y if turn[1] < FULL_TURN else x
        turn = (turn[1], 0.0)
    return Quadric("cone", origin, axis, x, min(radii), math.atan2(abs(growth), abs(height)), turn, slant)


def _round(table: _Table) -> Quadric | None:
    """Of circles about an axis through the points of a circle in a plane with it: a sphere or a torus."""
    center, first, second = table.rows[0], table.rows[2], table.rows[3]
    widest = int(np.linalg.norm(first, axis=-1).argmax())
    frame = _frame(first[widest], second[widest])
    if frame is None:
        return None
    axis, x = frame
    major, *out = (float(value) for value in (first @ x)[[0, 2, 3]])
    up = (center @ axis)[[2, 3]].tolist()
    if major + out[0] * math.cos(table.turn_v / 2) + out[1] * math.sin(table.turn_v / 2) < 0:
        x, major, out = -x, -major, [-out[0], -out[1]]
    minor = math.hypot(out[0], up[0])
    if minor <= table.slack:
        return None
    sense = math.copysign(1.0, out[0] * up[1] - out[1] * up[0])
    start = math.atan2(up[0], out[0])
    near = table.slack / minor
    turn_u = (0.0, table.turn_u)
    if major > minor + table.slack:
        start = _on_right_angle(start, near)
        ends = (start, start + sense * table.turn_v)
        return Quadric("torus", center[0], axis, x, major, minor, turn_u, ends)
    ends = _on_right_angle(start, near), _on_right_angle(start + sense * table.turn_v, near)
    if abs(major) > table.slack or max(map(abs, ends)) > RIGHT_ANGLE:
        return None
    return Quadric("sphere", center[0], axis, x, minor, 0.0, turn_u, ends)


def _on_right_angle(angle: float, slack: float) -> float:
    """The angle, or the multiple of a right angle that it is but for rounding."""
    right = round(angle / RIGHT_ANGLE) * RIGHT_ANGLE
    return right if abs(angle - right) <= slack else angle
