"""Strips: patches that share rulings, laid into the plane as one sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._development import straight_in
from gtcad._flat_bends import BendLine, checked_count, shared_out
from gtcad._flat_places import Crossing, first_crossing
from gtcad.errors import InputError, NotDevelopable
from gtcad.flat_curves import FlatCurve, ParameterCurve, RolledCurve
from gtcad.flat_pattern import FlatPattern, developed, polygon
from gtcad.measure import Estimate
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt

Array = NDArray[np.float64]

_LOOP = ("v0", "u1", "v1", "u0")
_CREASE = 1e-6  # degrees: patches that meet at less are smooth there


@dataclass(frozen=True)
class Place:
    """A patch of a strip: the side that the strip comes in by, and whether its pattern is turned over."""

    entry: str
    turned: bool

    @property
    def around(self) -> tuple[str, str, str, str]:
        """The sides counter-clockwise from the entry on; the third one is the exit."""
        loop = _LOOP[::-1] if self.turned else _LOOP
        start = loop.index(self.entry)
        a, b, c, d = loop[start:] + loop[:start]
        return a, b, c, d

    @property
    def exit(self) -> str:
        """The side opposite to the entry."""
        return self.around[2]


@dataclass(frozen=True, eq=False)
class FlatStrip:
    """Patterns side by side; made by ``develop_strip``.

    Attributes
    ----------
    patterns
        In the order of the strip, where they lie.
    names
        One for each.
    places
        How each lies in the strip.
    gap
        The largest distance between corresponding ends of shared rulings, in space or in the plane.
    """

    patterns: tuple[FlatPattern, ...]
    names: tuple[str, ...]
    places: tuple[Place, ...]
    gap: float

    @cached_property
    def contour(self) -> tuple[FlatCurve, ...]:
        """The curves around the strip one after the other, counter-clockwise, without shared rulings and points."""
        runs = list(zip(self.patterns, self.places, strict=True))
        order = [(runs[0][0], runs[0][1].entry, runs[0][1])]
        order += [(pattern, place.around[1], place) for pattern, place in runs]
        order += [(runs[-1][0], runs[-1][1].exit, runs[-1][1])]
        order += [(pattern, place.around[3], place) for pattern, place in runs[::-1]]
        found = []
        for pattern, side, place in order:
            if (curve := pattern.running(side)) is not None:
                found.append(curve.reversed() if place.turned else curve)
        return tuple(found)

    @property
    def error(self) -> float:
        """Estimated distance of the points from those of the exact development."""
        return math.fsum(pattern.error for pattern in self.patterns) + self.gap

    @property
    def area(self) -> Estimate:
        """The sum of the areas."""
        parts = [pattern.area for pattern in self.patterns]
        return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))

    @cached_property
    def overlap(self) -> Crossing | None:
        """Where the outline crosses itself, as of a pattern, from 16 to 256 points on each curve; or None."""
        return first_crossing(polygon(self.contour, min(256, max(16, 4096 // len(self.contour)))))

    def bend_lines(self, count: int) -> tuple[BendLine, ...]:
        """Rulings to bend at: that many shared out to the patches by what they turn, and the creases between them.

        Raises
        ------
        InputError
            When the count is not a whole number from 0.
        """
        shares = shared_out(checked_count(count), [pattern.turning for pattern in self.patterns])
        lines = [pattern.bend_lines(share) for pattern, share in zip(self.patterns, shares, strict=True)]
        return tuple(line for part in lines for line in part) + self.creases

    @cached_property
    def creases(self) -> tuple[BendLine, ...]:
        """Shared rulings at which the sheet is folded, with the angle between both tangent planes."""
        found = []
        for k, place in enumerate(self.places[:-1]):
            before, after = self._normal(k, place.exit), self._normal(k + 1, self.places[k + 1].entry)
            curve = self.patterns[k].boundary[place.exit]
            start, end = curve.evaluate(np.array([0.0, 1.0])).tolist()
            p, q = self._side_in_space(k, place.exit)
            along = (q - p) / np.linalg.norm(q - p)
            if place.turned ^ (_sense(place.exit) < 0):
                along = -along
            angle = -math.degrees(math.atan2(float(np.cross(before, after) @ along), float(before @ after)))
            if abs(angle) > _CREASE:
                at = float(place.exit[1])
                found.append(BendLine(at, (start[0], start[1]), (end[0], end[1]), angle))
        return tuple(found)

    def _normal(self, index: int, side: str) -> Array:
        """The normal towards the viewer in the middle of a side."""
        at = float(side[1])
        u, v = (at, 0.5) if side[0] == "u" else (0.5, at)
        patch = self.patterns[index].patch
        missing = (0, 3 - patch.dimension)
        along, across = np.pad(patch.derivative(u, v, (1, 0)), missing), np.pad(patch.derivative(u, v, (0, 1)), missing)
        normal = np.cross(along, across)
        return np.asarray(normal / np.linalg.norm(normal) * (-1.0 if self.places[index].turned else 1.0))

    def _side_in_space(self, index: int, side: str) -> Array:
        return ruling_ends(self.patterns[index].patch, side)

    def pattern(self, which: int | str) -> FlatPattern:
        """A pattern by its index or name.

        Raises
        ------
        InputError
            When there is none.
        """
        if isinstance(which, str):
            if which not in self.names:
                raise InputError(f"there is no patch {which!r}; there are {', '.join(self.names)}")
            which = self.names.index(which)
        if not 0 <= which < len(self.patterns):
            raise InputError(f"there is no patch {which}, the last one is {len(self.patterns) - 1}")
        return self.patterns[which]

    def image(self, which: int | str, curve: ParameterCurve) -> FlatCurve:
        """A curve on a patch, in the plane; as of ``FlatPattern.image``."""
        return self.pattern(which).image(curve)

    def locate(self, point: ArrayLike) -> tuple[str, Array]:
        """The name of the patch that a point of the plane lies in, and the parameters (u, v) there.

        Raises
        ------
        InputError
            When it lies in none, or is no point.
        """
        given = np.asarray(point, dtype=np.float64)
        if given.shape != (2,) or not np.isfinite(given).all():
            raise InputError(f"point must be two finite numbers, got {given.tolist()}")
        for name, pattern in zip(self.names, self.patterns, strict=True):
            try:
                return name, pattern.locate(given)
            except InputError:
                continue
        raise InputError(f"the point {given.tolist()} lies outside the strip")

    def roll(self, which: int | str, curve: ParameterCurve) -> RolledCurve:
        """A curve in the plane, rolled back onto a patch; as of ``FlatPattern.roll``."""
        return self.pattern(which).roll(curve)


def develop_strip(
    patches: Quilt | Sequence[SeparableSurface],
    *,
    names: Sequence[str] | None = None,
    twist_deg: float = 1e-6,
    gap: float = 1e-9,
) -> FlatStrip:
    """The flat pattern of patches that share rulings, one after the other.

    The first patch is the one of the lower index at an end of the strip, and lies as ``develop`` puts it; a ring is cut
    at the first ruling of the first patch. Patches that the strip meets from their other side are turned over.

    Parameters
    ----------
    patches
        Patches that ``develop`` takes, in any order, each sharing whole rulings with one or two others; or a quilt of
        such. Of a plane quadrilateral either pair of opposite sides may be shared.
    names
        One for each; those of the quilt, or "patch 1", "patch 2", ... unless given.
    twist_deg
        As for ``develop``.
    gap
        How far ends of rulings may be apart, relative to the size of the patches, to be one; those of a quilt as far as
        its edges are.

    Raises
    ------
    NotDevelopable
        When a patch is not developable, or the patches are no strip.
    InputError
        When an argument is out of its range.

    Examples
    --------
    Two walls of a box that share an edge, opened out:

    >>> from gtcad import BERNSTEIN, Curve
    >>> from gtcad.patches import cylinder
    >>> walls = [
    ...     cylinder(Curve([[0, 0, 0], [3, 0, 0]], family=BERNSTEIN), [0, 0, 2]),
    ...     cylinder(Curve([[3, 0, 0], [3, 4, 0]], family=BERNSTEIN), [0, 0, 2]),
    ... ]
    >>> strip = develop_strip(walls)
    >>> diagonal = strip.image(1, Curve([[0, 0], [1, 1]], family=BERNSTEIN))
    >>> (diagonal.evaluate([0, 1]).round(12) + 0.0).tolist()
    [[3.0, 0.0], [7.0, 2.0]]
    >>> [round(line.angle_deg, 12) for line in strip.creases]
    [-90.0]
    """
    surfaces = patches.patches if isinstance(patches, Quilt) else tuple(patches)
    if not surfaces:
        raise InputError("a strip needs one patch at least, got none")
    own = patches.names if isinstance(patches, Quilt) else tuple(f"patch {k + 1}" for k in range(len(surfaces)))
    labels = own if names is None else tuple(names)
    if len(labels) != len(surfaces) or len(set(labels)) < len(labels):
        raise InputError(f"names must be {len(surfaces)} different ones, got {list(labels)}")
    for label, patch in zip(labels, surfaces, strict=True):
        if not isinstance(patch, SeparableSurface):
            raise InputError(f"{label!r} must be a surface, got {type(patch).__name__}")
    corners = np.concatenate([ruling_ends(patch, side) for patch in surfaces for side in ("u0", "u1")])
    near = gap * float(np.linalg.norm(np.ptp(corners, axis=0)))
    if isinstance(patches, Quilt):
        near = max(near, *patches.gaps, 0.0)
    patterns = []
    crosswise = _joined_crosswise(surfaces, near)
    for index, (label, patch) in enumerate(zip(labels, surfaces, strict=True)):
        try:
            patterns.append(developed(patch, twist_deg, in_u=index in crosswise))
        except NotDevelopable as error:
            raise NotDevelopable(
                f"patch {label!r}: {error.reason}", twist_deg=error.twist_deg, parameter=error.parameter
            ) from None
    order = _ordered(patterns, labels, near)
    return _placed([patterns[k] for k, _ in order], [labels[k] for k, _ in order], [entry for _, entry in order])


def ruling_ends(patch: SeparableSurface, side: str) -> Array:
    """Both ends of a side, shape (2, 3)."""
    at, ends = float(side[1]), np.array([0.0, 1.0])
    points = patch.evaluate(at, ends) if side[0] == "u" else patch.evaluate(ends, at)
    return np.pad(points, [(0, 0), (0, 3 - points.shape[-1])])


def _ordered(patterns: Sequence[FlatPattern], labels: Sequence[str], near: float) -> list[tuple[int, str]]:
    """The patches of a strip one after the other, each with the side that it is entered by."""
    uses = [(k, side) for k, pattern in enumerate(patterns) for side in pattern.ruling_sides]
    ends = {use: ruling_ends(patterns[use[0]].patch, use[1]) for use in uses}
    partner: dict[tuple[int, str], tuple[int, str]] = {}
    for i, one in enumerate(uses):
        for other in uses[i + 1 :]:
            if one[0] != other[0] and _apart(ends[one], ends[other])[0] <= near < np.linalg.norm(
                np.diff(ends[one], axis=0)
            ):
                if one in partner or other in partner:
                    k, side = one if one in partner else other
                    raise NotDevelopable(f"more than two patches share the ruling {labels[k]}.{side}")
                partner[one], partner[other] = other, one
    free = [use for use in uses if use not in partner]
    here, order = (free or uses)[0], []
    while True:
        order.append(here)
        leaving = (here[0], next(side for side in patterns[here[0]].ruling_sides if side != here[1]))
        following = partner.get(leaving)
        if following is None or following[0] in [k for k, _ in order]:
            break
        here = following
    if len(order) < len(patterns):
        lost = next(label for k, label in enumerate(labels) if k not in [used for used, _ in order])
        raise NotDevelopable(
            f"the patches are no strip: {lost!r} shares no ruling with those before it; a strip goes from patch to "
            "patch by opposite sides"
        )
    return order


def _joined_crosswise(patches: Sequence[SeparableSurface], near: float) -> set[int]:
    """The patches that are straight in both parameters, of which more sides v0 and v1 are shared than u0 and u1."""
    straight = [straight_in(patch) for patch in patches]
    sides = {"": (), "u": ("v0", "v1"), "v": ("u0", "u1"), "uv": ("u0", "u1", "v0", "v1")}
    uses = [(k, side) for k, names in enumerate(straight) for side in sides[names]]
    ends = np.array([ruling_ends(patches[k], side) for k, side in uses]).reshape(-1, 2, 3)
    owner, lengths = np.array([k for k, _ in uses], dtype=int), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shared: dict[int, list[str]] = {k: [] for k, names in enumerate(straight) if names == "uv"}
    for (k, side), end, length in zip(uses, ends, lengths, strict=True):
        if k in shared and length > near:
            others = ends[owner != k]
            apart = [np.linalg.norm(end - other, axis=2).max(axis=1) for other in (others, others[:, ::-1])]
            if (np.minimum(*apart) <= near).any():
                shared[k].append(side[0])
    return {k for k, names in shared.items() if names.count("v") > names.count("u")}


def _apart(one: Array, other: Array) -> tuple[float, bool]:
    """How far ends are apart, and whether they correspond backwards."""
    along, back = (float(np.linalg.norm(one - ends, axis=1).max()) for ends in (other, other[::-1]))
    return (back, True) if back < along else (along, False)


def _placed(patterns: Sequence[FlatPattern], labels: Sequence[str], entries: Sequence[str]) -> FlatStrip:
    """Patterns in their order, each moved to the ruling of the one before."""
    moved, places, gap = [patterns[0]], [Place(entries[0], False)], 0.0
    for pattern, entry in zip(patterns[1:], entries[1:], strict=True):
        before, leaving = moved[-1], places[-1].exit
        space = ruling_ends(before.patch, leaving), ruling_ends(pattern.patch, entry)
        apart, back = _apart(*space)
        target = before.boundary[leaving].evaluate(np.array([0.0, 1.0]))
        source = pattern.boundary[entry].evaluate(np.array([1.0, 0.0] if back else [0.0, 1.0]))
        # a pattern lies to the left of its outline: two that share a ruling run along it against each other
        turned = places[-1].turned ^ (_sense(leaving) == _sense(entry) * (-1 if back else 1))
        matrix = _rotation(source[1] - source[0], target[1] - target[0], turned)
        offset = target.mean(axis=0) - matrix @ source.mean(axis=0)
        moved.append(pattern.moved(matrix, offset))
        places.append(Place(entry, turned))
        left = float(np.linalg.norm(source @ matrix.T + offset - target, axis=1).max())
        gap = max(gap, apart, left)
    return FlatStrip(tuple(moved), tuple(labels), tuple(places), gap)


def _sense(side: str) -> int:
    """1 where the outline runs along the side with its parameter, else -1."""
    return 1 if side in ("v0", "u1") else -1


def _rotation(source: Array, target: Array, turned: bool) -> Array:
    """The matrix of a rotation, or of a reflection, that turns one vector towards the other."""
    flip = np.diag([1.0, -1.0]) if turned else np.eye(2)
    angle = math.atan2(target[1], target[0]) - math.atan2(*(flip @ source)[::-1])
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.asarray(np.array([[cosine, -sine], [sine, cosine]]) @ flip)
