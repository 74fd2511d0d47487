"""Rectangles of the analytic surfaces that kernels and files know: planes, cylinders, cones, spheres and tori."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, Waves
from gtcad.protocol import Factors

Array = NDArray[np.float64]
Kind = Literal["plane", "disc", "cylinder", "cone", "sphere", "torus"]
Range = tuple[float, float]

FULL_TURN, RIGHT_ANGLE = 2 * math.pi, math.pi / 2
_LINEAR = Basis(1, family=BERNSTEIN)
_SQUARE = 1e-9  # cosine of an angle that still counts as a right one
_SLACK = 1e-9  # relative: how far given ranges may overstep by rounding
_TIP = {"cone": "apex", "disc": "center"}
ENTITIES: dict[Kind, str] = {
    "plane": "PLANE",
    "disc": "PLANE",
    "cylinder": "CYLINDRICAL_SURFACE",
    "cone": "CONICAL_SURFACE",
    "sphere": "SPHERICAL_SURFACE",
    "torus": "TOROIDAL_SURFACE",
}
"""What Part 21 calls the surface of each kind."""


@dataclass(frozen=True, eq=False)
class Quadric:
    r"""A parameter rectangle of a plane, cylinder, cone, sphere or torus, in the parameters that kernels and STEP use.

    With the unit vectors Z = axis, X = x_direction, Y = Z x X and :math:`e(u) = \cos u\, X + \sin u\, Y`:

    ========  ===================================================================  =========================
    kind      point at (u, v)                                                      radius, second
    ========  ===================================================================  =========================
    plane     origin + u X + v Y                                                   0, 0
    disc      origin + v e(u)                                                      0, 0
    cylinder  origin + radius e(u) + v Z                                           radius, 0
    cone      origin + (radius + v sin(second)) e(u) + v cos(second) Z             radius at v = 0, half angle
    sphere    origin + radius (cos(v) e(u) + sin(v) Z)                             radius, 0
    torus     origin + (radius + second cos(v)) e(u) + second sin(v) Z             major radius, minor radius
    ========  ===================================================================  =========================

    Parameters
    ----------
    kind
        One of these. A disc, a ring or a sector of one, is a plane in polar parameters.
    origin
        Shape (3,), in mm.
    axis, x_direction
        Of any length but 0, at right angles; kept as unit vectors.
    radius, second
        In mm, a half angle in radians in (0, pi/2). A torus needs radius > second > 0.
    u_range, v_range
        First and last parameter, in radians where they are angles and else in mm. Either may run backwards, which
        turns the normal of the patch round.

    Raises
    ------
    InputError
        When an argument is out of its range, an angle goes beyond a full turn or a pole, or a cone beyond its apex.

    Examples
    --------
    >>> tube = Quadric("cylinder", [0, 0, 1], [0, 0, 1], [1, 0, 0], 2.0, 0.0, (0.0, 3.0), (0.0, 5.0))
    >>> tube.evaluate(0.0, 4.0).tolist()
    [2.0, 0.0, 5.0]
    """

    kind: Kind
    origin: Array
    axis: Array
    x_direction: Array
    radius: float
    second: float
    u_range: Range
    v_range: Range

    def __init__(
        self,
        kind: Kind,
        origin: ArrayLike,
        axis: ArrayLike,
        x_direction: ArrayLike,
        radius: float,
        second: float,
        u_range: Range,
        v_range: Range,
    ) -> None:
        if kind not in get_args(Kind):
            raise InputError(f"kind must be one of {', '.join(get_args(Kind))}, got {kind!r}")
        z, x = _unit("axis", axis), _unit("x_direction", x_direction)
        if abs(cosine := float(z @ x)) > _SQUARE:
            raise InputError(f"axis and x_direction must be at right angles, got an angle with cosine {cosine:.3g}")
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "origin", spatial("origin", origin))
        object.__setattr__(self, "axis", z)
        object.__setattr__(self, "x_direction", _unit("x_direction", x - cosine * z))
        object.__setattr__(self, "radius", float(radius))
        object.__setattr__(self, "second", float(second))
        object.__setattr__(self, "u_range", _range("u_range", u_range))
        object.__setattr__(self, "v_range", _range("v_range", v_range))
        _check_sizes(self)
        _check_ranges(self)

    @property
    def y_direction(self) -> Array:
        """Y = axis x x_direction."""
        return np.cross(self.axis, self.x_direction)

    @property
    def reversed(self) -> bool:
        """Whether the normal is opposite to that of the analytic surface: outwards, or along the axis of a plane."""
        backwards = [first > last for first, last in (self.u_range, self.v_range)]
        return sum(backwards) % 2 == (0 if self.kind == "disc" else 1)  # a disc's u and v turn the other way

    @property
    def full_turns(self) -> tuple[bool, bool]:
        """Whether u, and whether v, goes through a full turn, to the last digits of its ends."""
        full_u, full_v = (
            abs(abs(b - a) - FULL_TURN) <= 4 * UNIT_ROUNDOFF * (abs(a) + abs(b))
            for a, b in (self.u_range, self.v_range)
        )
        return full_u and self.kind != "plane", full_v and self.kind == "torus"

    def meridian(self, v: ArrayLike) -> tuple[Array, Array]:
        """Distance from the axis and height over the origin at v; of no meaning for a plane."""
        v = np.asarray(v, dtype=np.float64)
        if self.kind == "disc":
            return v, np.zeros_like(v)
        if self.kind == "cylinder":
            return np.full_like(v, self.radius), v
        if self.kind == "cone":
            return self.radius + v * math.sin(self.second), v * math.cos(self.second)
        if self.kind == "sphere":
            return self.radius * np.cos(v), self.radius * np.sin(v)
        return self.radius + self.second * np.cos(v), self.second * np.sin(v)

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Points at the surface's own parameters, which broadcast: shape broadcast(u, v).shape + (3,)."""
        u, v = (values[..., None] for values in np.broadcast_arrays(*(np.asarray(p, dtype=np.float64) for p in (u, v))))
        x, y = self.x_direction, self.y_direction
        if self.kind == "plane":
            return np.asarray(self.origin + u * x + v * y)
        out, height = self.meridian(v)
        return np.asarray(self.origin + out * (np.cos(u) * x + np.sin(u) * y) + height * self.axis)


def spatial(name: str, value: ArrayLike) -> Array:
    """A read-only vector of three finite numbers; the name is for the error."""
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} must be three finite numbers, got {np.asarray(value).tolist()}")
    vector.flags.writeable = False
    return vector


def _unit(name: str, value: ArrayLike) -> Array:
    vector = spatial(name, value)
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise InputError(f"{name} must not be zero")
    return spatial(name, vector / length)


def _range(name: str, ends: Range) -> Range:
    first, last = (float(end) for end in ends)
    if not (math.isfinite(first) and math.isfinite(last)) or first == last:
        raise InputError(f"{name} must be two different finite numbers, got {first} and {last}")
    return first, last


def _check_sizes(q: Quadric) -> None:
    radius, second = q.radius, q.second
    allowed, wanted = {
        "plane": (radius == 0 == second, "radius = second = 0"),
        "disc": (radius == 0 == second, "radius = second = 0"),
        "cylinder": (0 < radius < math.inf and second == 0, "radius > 0 and second = 0"),
        "cone": (0 <= radius < math.inf and 0 < second < RIGHT_ANGLE, "radius >= 0 and 0 < second < pi/2"),
        "sphere": (0 < radius < math.inf and second == 0, "radius > 0 and second = 0"),
        "torus": (0 < second < radius < math.inf, "radius > second > 0"),
    }[q.kind]
    if not allowed:
        raise InputError(f"a {q.kind} needs {wanted}, got {radius} and {second}")


def _check_ranges(q: Quadric) -> None:
    turns = {"plane": [], "torus": [("u_range", q.u_range), ("v_range", q.v_range)]}.get(
        q.kind, [("u_range", q.u_range)]
    )
    for name, (first, last) in turns:
        if abs(last - first) > FULL_TURN * (1 + _SLACK):
            raise InputError(f"{name} must be at most a full turn, got {first} to {last}")
    if q.kind == "sphere" and max(map(abs, q.v_range)) > RIGHT_ANGLE * (1 + _SLACK):
        raise InputError(f"v_range of a sphere must lie in [-pi/2, pi/2], got {q.v_range}")
    if q.kind in ("cone", "disc"):
        out = q.meridian(q.v_range)[0]
        if out.min() < -_SLACK * out.max():
            raise InputError(f"v_range of a {q.kind} must not go beyond its {_TIP[q.kind]}, got {q.v_range}")


def surface_of_quadric(q: Quadric) -> SurfaceOfTerms:
    """The patch on [0, 1]^2, its own parameters linear in u and v."""
    (u0, u1), (v0, v1) = q.u_range, q.v_range
    x, y, ends = q.x_direction, q.y_direction, np.array([v0, v1])
    if q.kind == "plane":
        corners = q.origin + np.multiply.outer([u0, u1], x)[:, None] + np.multiply.outer(ends, y)
        return SurfaceOfTerms(_LINEAR, _LINEAR, corners)
    factors_v: Factors
    if q.kind in ("sphere", "torus"):
        major, minor = (0.0, q.radius) if q.kind == "sphere" else (q.radius, q.second)
        factors_v, constant = Waves(v0, v1 - v0), np.array([1.0, 0.0, 0.0])
        out, height = np.array([major, minor, 0.0]), np.array([0.0, 0.0, minor])
    else:
        factors_v, constant = _LINEAR, np.ones(2)
        out, height = q.meridian(ends)
    middle = np.multiply.outer(constant, q.origin) + np.multiply.outer(height, q.axis)
    coefficients = np.stack([middle, np.multiply.outer(out, x), np.multiply.outer(out, y)])
    return SurfaceOfTerms(Waves(u0, u1 - u0), factors_v, coefficients)


def extremes(q: Quadric) -> Array:
    """Points of the patch, shape (n, 3), among them those that lie farthest out along the axes of space."""
    places = list(itertools.product(q.u_range, q.v_range))
    if q.kind != "plane":
        for x, y, z in zip(q.x_direction.tolist(), q.y_direction.tolist(), q.axis.tolist(), strict=True):
            for u in (*q.u_range, *_inside(math.atan2(y, x), q.u_range)):
                level = math.atan2(z, math.cos(u) * x + math.sin(u) * y)
                turning = _inside(level, q.v_range) if q.kind in ("sphere", "torus") else ()
                places += itertools.product((u,), (*q.v_range, *turning))
    return q.evaluate(*np.array(places).T)


def _inside(angle: float, ends: Range) -> Iterator[float]:
    """The angles in the range that differ from one by half turns."""
    first, last = sorted(ends)
    for k in range(math.ceil((first - angle) / math.pi), math.floor((last - angle) / math.pi) + 1):
        yield angle + k * math.pi
