"""Quilts: patches that share edges, open sheets and closed bodies alike.

Two sides of patches are one edge when their curves are one function of the parameter, forwards or backwards; that is
what equal rows of control points with equal design variables give, and what a conversion needs to make the two
neighbours' edges identical. The loop around a face that is not turned over runs v0 forwards, u1 forwards, v1 backwards
and u0 backwards; the two uses of an edge must run against each other.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.chebyshev import nodes
from gtcad.continuity import parsed_order
from gtcad.errors import InputError
from gtcad.measure import Estimate, area, volume
from gtcad.protocol import SIDES, SeparableSurface

Array = NDArray[np.float64]
Node = TypeVar("Node", bound=Hashable)

"""The sides of a patch: u = 0, u = 1 (curves in v), v = 0, v = 1 (curves in u)."""

SAME = 1e-12
"""Of the largest coordinate: points nearer than that are one, up to rounding."""

_RUNS = {"u0": -1, "u1": 1, "v0": 1, "v1": -1}  # how the loop of the face runs along its sides
_SPREAD = np.array([0.6180339887, 0.4142135623, 0.7320508075, 0.2360679774, 0.6457513110, 0.3166247903])


@dataclass(frozen=True, order=True)
class Use:
    """One side of one patch.

    Parameters
    ----------
    patch
        Index of the patch.
    side
        "u0", "u1", "v0" or "v1".
    """

    patch: int
    side: str

    @property
    def along(self) -> str:
        """The parameter that runs along the side, "u" or "v"."""
        return "v" if self.side[0] == "u" else "u"


@dataclass(frozen=True)
class SharedEdge:
    """Two sides that are one curve.

    Parameters
    ----------
    first, second
        The sides; the first one's curve is the edge.
    reversed
        Whether the second one's parameter runs backwards.
    order
        The order of continuity across the edge that a conversion is to keep: "C0" to "C3", "G1" to "G3". Whether the
        patches have it is not looked at.
    """

    first: Use
    second: Use
    reversed: bool
    order: str = "C0"

    @property
    def uses(self) -> tuple[Use, Use]:
        """Both sides."""
        return self.first, self.second

    @property
    def turns(self) -> bool:
        """Whether just one of both patches must be turned over for the two to have one orientation."""
        return _RUNS[self.first.side] == _RUNS[self.second.side] * (-1 if self.reversed else 1)


@dataclass(frozen=True, eq=False)
class Quilt:
    """Patches and the edges that they share.

    Parameters
    ----------
    patches
        Surfaces of the protocol, all of one dimension.
    names
        One for each patch, all different.
    edges
        Which sides are one; a side that is in none is free, or collapsed to one point.

    Raises
    ------
    InputError
        When an edge refers to no side, a side is in two edges, or the patches cannot be oriented as one.

    Examples
    --------
    A unit square and its mirror image in the line y = 1:

    >>> from gtcad import BERNSTEIN, Surface
    >>> square = Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> quilt = Quilt.recognised([square, square.transformed([[1, 0], [0, -1]], [0, 2])])
    >>> quilt.edges[0].first, quilt.edges[0].second, len(quilt.free), quilt.flipped
    (Use(patch=0, side='v1'), Use(patch=1, side='v1'), 6, (False, True))
    """

    patches: tuple[SeparableSurface, ...]
    names: tuple[str, ...]
    edges: tuple[SharedEdge, ...]

    def __post_init__(self) -> None:
        _check_patches(self.patches, self.names)
        seen: set[Use] = set()
        for edge in self.edges:
            parsed_order(edge.order)
            for use in edge.uses:
                if use.side not in SIDES or not 0 <= use.patch < len(self.patches):
                    raise InputError(f"an edge refers to side {use.side!r} of patch {use.patch}, which does not exist")
                if use in seen:
                    raise InputError(f"side {self.label(use)} is stated in two edges; an edge is shared by two sides")
                seen.add(use)
        _ = self._oriented

    @classmethod
    def recognised(
        cls,
        patches: Iterable[SeparableSurface],
        *,
        names: Sequence[str] | None = None,
        order: str | Mapping[Use, str] = "C0",
        stated: Iterable[SharedEdge] = (),
        gap: float = 0.0,
    ) -> Quilt:
        """Find the edges that patches share.

        Parameters
        ----------
        patches
            Surfaces of the protocol, all of one dimension.
        names
            One for each patch; "patch 1", "patch 2", ... unless given.
        order
            Order of continuity that is wanted across the edges found: of all, or by either of their sides ("C0" where
            none is given).
        stated
            Edges that are known; their sides are not looked at any further.
        gap
            Distance allowed between the curves of a stated edge, in the model's unit. Where there is a gap, the first
            side's curve is the edge, and only order "C0" can be kept.

        Raises
        ------
        InputError
            When three sides are one curve, a stated edge is wider open than allowed, or as ``Quilt`` does.

        Notes
        -----
        Curves are compared at more Chebyshev nodes than their factors together are many; they agree when no two
        points differ by more than 1e-12 of the largest coordinate; closed curves must begin at one point. The cost is
        that of sorting the sides.
        """
        surfaces = tuple(patches)
        labels = tuple(f"patch {k + 1}" for k in range(len(surfaces))) if names is None else tuple(names)
        known = cls(surfaces, labels, tuple(stated))
        for edge, width in zip(known.edges, known.gaps, strict=True):
            known._check_stated(edge, width, gap)
        found = _matched(known)
        return cls(surfaces, labels, known.edges + _with_orders(known, found, order))

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return self.patches[0].dimension

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Quilt):
            return NotImplemented
        return (self.patches, self.names, self.edges) == (other.patches, other.names, other.edges)

    def __hash__(self) -> int:
        return hash((self.patches, self.names, self.edges))

    def label(self, use: Use) -> str:
        """The side by the name of its patch: "patch 1.u0"."""
        return f"{self.names[use.patch]}.{use.side}"

    @cached_property
    def free(self) -> tuple[Use, ...]:
        """The sides that are in no shared edge and not collapsed."""
        others = {use for edge in self.edges for use in edge.uses}.union(self.collapsed)
        return tuple(use for use in self._uses if use not in others)

    @cached_property
    def collapsed(self) -> tuple[Use, ...]:
        """The sides that are one point."""
        widths = np.linalg.norm(self._samples - self._samples[:, :1], axis=-1).max(axis=1)
        return tuple(use for use, width in zip(self._uses, widths, strict=True) if width <= self._near)

    @property
    def closed(self) -> bool:
        """Whether no side is free."""
        return not self.free

    @cached_property
    def gaps(self) -> tuple[float, ...]:
        """Largest distance between the two curves of each edge at corresponding samples: rounding, unless stated."""
        return tuple(self._distance(edge) for edge in self.edges)

    @cached_property
    def flipped(self) -> tuple[bool, ...]:
        """Which patches must be turned over for one orientation of all.

        The first patch of each connected part stays as it is, unless the part is closed: then its volume is positive.
        """
        open_patches = {use.patch for use in self.free}
        turned = {}
        for part in self._oriented:
            inside = self.patches[0].dimension == 3 and open_patches.isdisjoint(part)
            inwards = (
                inside and math.fsum(-self._volumes[k] if turn else self._volumes[k] for k, turn in part.items()) < 0
            )
            turned.update({k: turn ^ inwards for k, turn in part.items()})
        return tuple(turned[k] for k in range(len(self.patches)))

    def area(self) -> Estimate:
        """Sum of the areas of the patches, in the square of the model's unit."""
        parts = [area(patch) for patch in self.patches]
        return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))

    def volume(self) -> Estimate:
        """Volume inside a closed quilt in space, in the cube of the model's unit.

        Raises
        ------
        InputError
            When sides are free, or the quilt is plane.
        """
        if not self.closed:
            raise InputError(f"a volume needs a closed quilt, but these sides are free: {self._listed(self.free)}")
        parts = self._volumes
        value = math.fsum(-part if turn else part for part, turn in zip(parts, self.flipped, strict=True))
        return Estimate(value, math.fsum(part.error for part in parts))

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Quilt:
        """The affine image: points x become ``matrix @ x + translation``."""
        return replace(self, patches=tuple(patch.transformed(matrix, translation) for patch in self.patches))

    @property
    def _uses(self) -> list[Use]:
        return [Use(patch, side) for patch in range(len(self.patches)) for side in SIDES]

    @cached_property
    def _samples(self) -> Array:
        """Points of all sides at symmetric parameters from 0 to 1, shape (4 patches, samples, d)."""
        counts = [max(patch.factors_u.count, patch.factors_v.count) for patch in self.patches]
        t = np.concatenate([[0.0], (nodes(2 * max(counts) + 3) + 1) / 2, [1.0]])
        ends = np.array([0.0, 1.0])
        sides = [
            (patch.evaluate(ends[:, None], t[None, :]), patch.evaluate(t[:, None], ends[None, :]).swapaxes(0, 1))
            for patch in self.patches
        ]
        return np.concatenate([side for pair in sides for side in pair])

    @property
    def _near(self) -> float:
        return SAME * float(np.abs(self._samples).max())

    def _points(self, use: Use) -> Array:
        return np.asarray(self._samples[4 * use.patch + SIDES.index(use.side)])

    def _distance(self, edge: SharedEdge) -> float:
        second = self._points(edge.second)
        return _largest(self._points(edge.first), second[::-1] if edge.reversed else second)

    def _check_stated(self, edge: SharedEdge, width: float, gap: float) -> None:
        labels = f"{self.label(edge.first)} and {self.label(edge.second)}"
        if not {*edge.uses}.isdisjoint(self.collapsed):
            raise InputError(f"{labels} are stated as one edge, but a side that is one point can be none")
        if width > max(gap, self._near):
            raise InputError(f"{labels} are stated as one edge, but are {width:.3g} apart; gap allows {gap:.3g}")
        if width > self._near and parsed_order(edge.order)[1] > 0:
            raise InputError(f"{labels} are {width:.3g} apart: across a gap only order C0 is kept, got {edge.order}")

    def _listed(self, uses: Iterable[Use]) -> str:
        return ", ".join(map(self.label, uses))

    @cached_property
    def _volumes(self) -> tuple[Estimate, ...]:
        """Signed volumes of the cones over the patches, from a point in their midst."""
        centre = self._samples.mean(axis=(0, 1))
        return tuple(volume(patch, origin=centre) for patch in self.patches)

    @cached_property
    def _oriented(self) -> list[dict[int, bool]]:
        """The connected parts: which patches are turned over against the first one of their part."""
        links = [(edge.first.patch, edge.second.patch, edge.turns) for edge in self.edges]
        parts = connected(range(len(self.patches)), links)
        turned = {patch: turn for part in parts for patch, turn in part.items()}
        for edge in self.edges:
            if edge.turns != turned[edge.first.patch] ^ turned[edge.second.patch]:
                labels = f"{self.label(edge.first)} and {self.label(edge.second)}"
                raise InputError(f"the patches are not orientable: their sides disagree at {labels}")
        return parts


def connected(nodes: Iterable[Node], links: Iterable[tuple[Node, Node, bool]]) -> list[dict[Node, bool]]:
    """What links connect, part by part.

    Parameters
    ----------
    nodes
        All nodes; a part begins with the first of its nodes.
    links
        Pairs of nodes, and whether one of the two is turned against the other.

    Returns
    -------
    list of dict
        For each node of a part whether it is turned against the first one, by the first way that was found.
    """
    beside: dict[Node, list[tuple[Node, bool]]] = defaultdict(list)
    for a, b, turned in links:
        beside[a].append((b, turned))
        beside[b].append((a, turned))
    parts: list[dict[Node, bool]] = []
    seen: set[Node] = set()
    for start in nodes:
        if start in seen:
            continue
        part, queue = {start: False}, deque([start])
        while queue:
            here = queue.popleft()
            for other, turned in beside[here]:
                if other not in part:
                    part[other] = part[here] ^ turned
                    queue.append(other)
        seen.update(part)
        parts.append(part)
    return parts


def _check_patches(patches: tuple[SeparableSurface, ...], names: tuple[str, ...]) -> None:
    if not patches:
        raise InputError("a quilt needs one patch at least, got none")
    for k, patch in enumerate(patches):
        if not isinstance(patch, SeparableSurface):
            raise InputError(f"patches[{k}] must be a surface, got {type(patch).__name__}")
    if len(dimensions := {patch.dimension for patch in patches}) > 1:
        raise InputError(f"patches must have one dimension, got {sorted(dimensions)}")
    if len(names) != len(patches) or len(set(names)) < len(names):
        raise InputError(f"names must be {len(patches)} different ones, got {list(names)}")


def _largest(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max())


def _matched(quilt: Quilt) -> list[SharedEdge]:
    """The free sides that are one curve, two by two, in the order of the sides."""
    uses, near = quilt.free, quilt._near
    if not uses:
        return []
    points = np.stack([quilt._points(use) for use in uses])
    # equal curves, also backwards, have equal marks: only sides with neighbouring marks are compared
    marks = np.concatenate([points[:, 0] + points[:, -1], points[:, points.shape[1] // 2]], axis=1)
    marks = marks @ _SPREAD[: marks.shape[1]]
    order = np.argsort(marks)
    beyond = np.searchsorted(marks[order], marks[order] + 8 * near, side="right")
    partners: dict[int, list[tuple[int, bool]]] = defaultdict(list)
    for place, i in enumerate(order.tolist()):
        for j in order[place + 1 : beyond[place]].tolist():
            along = _largest(points[i], points[j]) <= near
            if along or _largest(points[i], points[j][::-1]) <= near:
                partners[i].append((j, not along))
                partners[j].append((i, not along))
    for i in sorted(partners):
        if len(partners[i]) > 1:
            those = quilt._listed(uses[k] for k in sorted([i, *(j for j, _ in partners[i])]))
            raise InputError(f"an edge is shared by two sides at most, but these are one curve: {those}")
    return [SharedEdge(uses[i], uses[j], back) for i in sorted(partners) for j, back in partners[i] if i < j]


def _with_orders(quilt: Quilt, edges: Iterable[SharedEdge], order: str | Mapping[Use, str]) -> tuple[SharedEdge, ...]:
    if isinstance(order, str):
        return tuple(replace(edge, order=order) for edge in edges)
    result, left = [], dict(order)
    for edge in edges:
        given = {left.pop(use) for use in edge.uses if use in left}
        if len(given) > 1:
            raise InputError(f"order differs for {quilt.label(edge.first)} and {quilt.label(edge.second)}, one edge")
        result.append(replace(edge, order=given.pop() if given else "C0"))
    if left:
        raise InputError(f"order is given for sides that are in no edge found: {quilt._listed(left)}")
    return tuple(result)
