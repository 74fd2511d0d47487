"""Which faces and edges of a file hold which curves and surfaces: by where they lie, with names to choose by.

Whole shapes come first: pairs whose points are near each other both ways, as near as possible over all. Then parts of
shapes: faces and edges that lie within a shape that is not covered yet. What is left goes by name, and by nearness at
last. Boxes and sampled points keep the pairs that are looked at few.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.estimates import nearest_of
from gtcad.converters.figures import Figure, scaled
from gtcad.converters.nearest import SEARCHES

Array = NDArray[np.float64]

_NEAR = 0.05  # of a shape: what lies farther from it than that does not hold it, unless it is the last choice
_APART = 4.0  # tolerances: pieces nearer than that are one piece twice
_BESIDE = 1.1  # of the distances of two parts from one target: so near each other, they are on one place of it
_SMALL = 0.25  # of a part: what may be apart without being beside each other
_OTHER_NAME, _ORDER = 0.5, 1e-6  # of the tolerance: what counts against a pair with unlike names, or in another order
_MARGIN = 0.05  # of a figure: what its box of samples may lack
_FEW = 16  # figures whose trees are looked through for a first answer
_FORBIDDEN = 1e9  # of the largest cost

UNITS = {
    25.4: "as if written in inches",
    304.8: "as if written in feet",
    10.0: "as if written in centimetres",
    1000.0: "as if written in metres",
    1 / 25.4: "as if inches were taken for mm",
    1 / 304.8: "as if feet were taken for mm",
    0.1: "as if centimetres were taken for mm",
    0.001: "as if metres were taken for mm",
}
"""By how much larger a file is than the model when units were mistaken."""
_SAME_RATIO = 1e-3


@dataclass(frozen=True, eq=False)
class Named:
    """A figure with the name that its model or file gives it."""

    name: str
    figure: Figure


@dataclass
class Matches:
    """What was found.

    Attributes
    ----------
    groups
        For each target the indices of the parts that hold it, all of it or together.
    units
        Of targets that the file holds in another size: by what factor.
    """

    groups: list[list[int]]
    units: dict[int, float] = field(default_factory=dict)

    @property
    def used(self) -> set[int]:
        """The parts that hold something."""
        return {part for group in self.groups for part in group}


def matched(parts: Sequence[Named], targets: Sequence[Named], tolerance: float) -> Matches:
    """For each target the parts that hold it.

    Parameters
    ----------
    parts
        Of the file.
    targets
        Curves, chains and surfaces of the model.
    tolerance
        In mm: what is nearer than that is equally near.
    """
    result = Matches([[] for _ in targets])
    for variables in (1, 2):
        f = [k for k, part in enumerate(parts) if part.figure.variables == variables]
        t = [k for k, target in enumerate(targets) if target.figure.variables == variables]
        if f and t:
            found = _Search([parts[k] for k in f], [targets[k] for k in t], tolerance).all()
            for k, group in enumerate(found.groups):
                result.groups[t[k]] = [f[part] for part in group]
            result.units.update({t[k]: factor for k, factor in found.units.items()})
    return result


class _Search:
    """Parts and targets of one kind, and what is known of pairs of them."""

    def __init__(self, parts: Sequence[Named], targets: Sequence[Named], tolerance: float) -> None:
        self.parts, self.targets, self.tolerance = parts, targets, tolerance
        self.near = np.array([_NEAR * target.figure.size for target in targets]) + tolerance
        self.names = {target.name for target in targets if target.name}
        self.groups: list[list[int]] = [[] for _ in targets]
        self.one = self._one_sided()

    def all(self) -> Matches:
        """All steps, one after the other."""
        self.by_place()
        units = self._in_other_units()
        self._by_name()
        self._last_choices()
        return Matches([sorted(group) for group in self.groups], units)

    def by_place(self) -> None:
        """Whole shapes, then parts of shapes."""
        self._whole()
        self._partial(np.full(len(self.targets), self.tolerance))
        if self.left:
            covered = [self._is_covered(t) for t in range(len(self.targets))]
            self._partial(np.where(covered, 0.0, self.near))

    @property
    def left(self) -> list[int]:
        """Parts that hold nothing yet."""
        used = {part for group in self.groups for part in group}
        return [k for k in range(len(self.parts)) if k not in used]

    # --- nearness -----------------------------------------------------------------------------------------------------

    def _one_sided(self) -> dict[tuple[int, int], float]:
        """How far a part is from within a target, of those pairs that may be near: {(part, target): mm}."""
        boxes = np.array([part.figure.box for part in self.parts])
        bounds = []
        for t, target in enumerate(self.targets):
            low, high = target.figure.box
            inside = ((boxes[:, 0] >= low - self.near[t]) & (boxes[:, 1] <= high + self.near[t])).all(axis=1)
            for p in np.flatnonzero(inside).tolist():
                far = float(target.figure.points.tree.query(self.parts[p].figure.marks)[0].max())
                least = far - target.figure.points.reach
                if least <= self.near[t]:
                    bounds.append((p, t, least, far))
        best: dict[int, float] = {}
        for p, _, _, far in bounds:
            best[p] = min(far, best.get(p, np.inf))
        found = {}
        for p, t, least, _ in bounds:
            if least <= best[p] + self.tolerance:
                marks = self.parts[p].figure.marks
                figure = self.targets[t].figure
                searches = SEARCHES if figure.is_chain else 1  # a chain may stop a search at its corners
                found[p, t] = float(figure.nearest(marks, searches=searches, enough=self.tolerance).distances.max())
        return found

    def _two_sided(self, p: int, t: int) -> float:
        part, target = self.parts[p].figure, self.targets[t].figure
        if target.size > part.size + 2 * self.near[t]:
            return np.inf
        back = part.nearest(target.marks, searches=1).distances
        return max(self.one[p, t], float(back.max()))

    # --- the steps ----------------------------------------------------------------------------------------------------

    def _whole(self) -> None:
        """Pairs that are near both ways, their sum as small as can be."""
        pairs = {(p, t): self._two_sided(p, t) for (p, t), far in self.one.items() if far <= self.near[t]}
        pairs = {(p, t): far for (p, t), far in pairs.items() if far <= self.near[t]}
        for p, t in self._assigned(pairs):
            self.groups[t].append(p)

    def _assigned(self, pairs: dict[tuple[int, int], float]) -> list[tuple[int, int]]:
        """The pairs of least cost, as many as there can be."""
        from scipy.optimize import linear_sum_assignment

        if not pairs:
            return []
        rows, columns = sorted({p for p, _ in pairs}), sorted({t for _, t in pairs})
        most = max(pairs.values()) + 10 * self.tolerance
        cost = np.full((len(rows), len(columns)), _FORBIDDEN * most)
        for (p, t), far in pairs.items():
            unlike = self.parts[p].name != self.targets[t].name
            later = abs(p / len(self.parts) - t / len(self.targets))
            extra = _OTHER_NAME * unlike + _ORDER * later
            cost[rows.index(p), columns.index(t)] = max(far, self.tolerance) + extra * self.tolerance
        found = zip(*linear_sum_assignment(cost), strict=True)
        return [(rows[i], columns[j]) for i, j in found if (rows[i], columns[j]) in pairs]

    def _partial(self, limits: Array) -> None:
        """Parts within a target, nearer than its limit, where nothing covers it yet: near ones first, then large ones.

        Where all of a file misses the tolerance, the other side of a thin wall is so not taken for the patch.
        """
        homes: dict[int, list[tuple[float, bool, int]]] = {p: [] for p in self.left}
        for (p, t), far in self.one.items():
            if p in homes:
                homes[p].append((max(far, self.tolerance), self.parts[p].name != self.targets[t].name, t))
        nearest = {p: min(own) for p, own in homes.items() if own}
        for p in sorted(nearest, key=lambda p: (_times(nearest[p][0], self.tolerance), -self.parts[p].figure.size)):
            equal = [home for home in sorted(homes[p]) if home[0] == nearest[p][0]]  # shapes may share a doubled edge
            far, unlike, t = next((home for home in equal if not self._is_double(p, home[2])), equal[0])
            known = unlike and self.parts[p].name in self.names and far > self.tolerance
            if far <= max(limits[t], self.tolerance) and not known and not self._is_double(p, t):
                self.groups[t].append(p)

    def _is_double(self, p: int, t: int) -> bool:
        """Whether the pieces of a target are already where the part is, as far as the target tells."""
        figure, pieces = self.parts[p].figure, [self.parts[q].figure for q in self.groups[t]]
        apart = self.one[p, t] + max((self.one.get((q, t), 0.0) for q in self.groups[t]), default=0.0)
        limit = max(_APART * self.tolerance, _BESIDE * apart)
        return _all_near(figure, pieces, limit if limit <= _SMALL * figure.size else _APART * self.tolerance)

    def _is_covered(self, t: int) -> bool:
        pieces = [self.parts[p].figure for p in self.groups[t]]
        return _all_near(self.targets[t].figure, pieces, _APART * self.tolerance)

    def _by_name(self) -> None:
        for t, target in enumerate(self.targets):
            if not self.groups[t] and target.name:
                same = [p for p in self.left if self.parts[p].name == target.name]
                self.groups[t] = same if target.figure.is_chain else same[:1]

    def _last_choices(self) -> None:
        """Parts whose names tell nothing, to the shapes that are left: as they lie nearest over all."""
        free = [t for t, group in enumerate(self.groups) if not group]
        unknown = [p for p in self.left if not self._is_named(self.parts[p].name)]
        if len(free) == 1 and self.targets[free[0]].figure.is_chain:
            self.groups[free[0]] = unknown
            return
        centers = {p: self.parts[p].figure.box for p in unknown}
        pairs = {(p, t): float(np.abs(centers[p] - self.targets[t].figure.box).max()) for p in unknown for t in free}
        for p, t in self._assigned(pairs):
            self.groups[t].append(p)

    def _is_named(self, name: str) -> bool:
        bodies = {one.rpartition(".")[0] for one in self.names}
        return name in self.names or any(name.startswith(f"{body}.") for body in bodies if body)

    # --- units --------------------------------------------------------------------------------------------------------

    def _in_other_units(self) -> dict[int, float]:
        """Where parts fit targets of another size better than any of this one: those targets, and the factors."""
        open_targets = [t for t in range(len(self.targets)) if not self._is_covered(t)]
        loose = [p for t in open_targets for p in self.groups[t]] + self.left
        if not open_targets or not loose:
            return {}
        best: tuple[int, float, dict[int, list[int]]] = (0, 1.0, {})
        for factor in UNITS:
            found = self._scaled(open_targets, loose, factor)
            if len(found) > best[0]:
                best = len(found), factor, found
        for t in best[2]:
            self.groups[t] = []
        taken = {p for group in best[2].values() for p in group}
        self.groups = [[p for p in group if p not in taken] for group in self.groups]
        for t, group in best[2].items():
            self.groups[t] = group
        return dict.fromkeys(best[2], best[1])

    def _scaled(self, targets: Sequence[int], parts: Sequence[int], factor: float) -> dict[int, list[int]]:
        """The targets that the parts cover when these are so many times larger."""
        held, wanted = [self.parts[p].figure for p in parts], [self.targets[t].figure for t in targets]
        sizes, own = (np.array([_extent(group), *(one.size for one in group)]) for group in (held, wanted))
        if not (np.abs(sizes[:, None] - factor * own) <= _SAME_RATIO * sizes[:, None]).any():
            return {}
        larger = [replace(self.targets[t], figure=scaled(self.targets[t].figure, factor)) for t in targets]
        search = _Search([self.parts[p] for p in parts], larger, factor * self.tolerance)
        search.by_place()
        return {
            targets[t]: [parts[p] for p in group]
            for t, group in enumerate(search.groups)
            if group and search._is_covered(t)
        }


def _times(far: float, tolerance: float) -> int:
    """How many times the tolerance must be doubled to reach so far."""
    return max(0, math.frexp(far / tolerance)[1] - 1)


def _all_near(figure: Figure, others: Sequence[Figure], limit: float) -> bool:
    """Whether all marks of a figure are within a limit of others; boxes and trees tell most of those that are not."""
    margin = limit + np.array([_MARGIN * one.size for one in others])
    beside = [one for one, wide in zip(others, margin, strict=True) if _boxes_meet(figure.box, one.box, float(wide))]
    if not beside:
        return False
    if len(beside) <= _FEW:
        bounds = np.min([one.points.tree.query(figure.marks)[0] - one.points.reach for one in beside], axis=0)
        if bounds.max() > limit:
            return False
    return bool(nearest_of(beside, figure.marks, limit, 1).distances.max() <= limit)


def _boxes_meet(a: Array, b: Array, margin: float) -> bool:
    return bool((a[0] <= b[1] + margin).all() and (b[0] <= a[1] + margin).all())


def _extent(figures: Sequence[Figure]) -> float:
    """The diagonal of the box around all."""
    boxes = np.array([figure.box for figure in figures])
    return float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)))
