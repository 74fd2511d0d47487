"""Shared edges of patches that a file holds in several faces, stretch by stretch between the places where these end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gtcad._sides import DerivableSurface
from gtcad.continuity import JoinReport
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.correspondence import Way
from gtcad.converters.exact import IDENTITY, ParameterMap
from gtcad.converters.pace import paced
from gtcad.converters.rounding import rounding_limits
from gtcad.converters.spline_parts import part_of_surface
from gtcad.edge_check import EdgeReport, check_edge
from gtcad.protocol import SeparableSurface
from gtcad.restricted import RestrictedSurface

Array = NDArray[np.float64]
Bounds = tuple[float, float]
Surface = BSplineSurface | SeparableSurface

_SAME = 1e-6  # of the edge: ends of faces that near are one


@dataclass(frozen=True, eq=False)
class Stretch:
    """What a face holds of a patch's side.

    Attributes
    ----------
    surface
        All of the face, untrimmed.
    side
        Of the surface: the one that lies on the patch's.
    moved
        How far rounding may have moved the surface's coordinates, in mm.
    ends
        The edge's parameters at the first and the last parameter of the surface along it.
    map
        From the surface's parameter along the side, on [0, 1], to where between the ends that is.
    """

    surface: Surface
    side: str
    moved: float
    ends: Bounds
    map: ParameterMap = IDENTITY

    def mirrored(self) -> Stretch:
        """With the edge run through from its other end."""
        return Stretch(self.surface, self.side, self.moved, (1 - self.ends[0], 1 - self.ends[1]), self.map)

    def over(self, start: float, end: float) -> Surface:
        """The surface between two of the edge's parameters, all of it across, running from the first to the last."""
        first, last = self.ends
        inside = np.clip((np.array([start, end]) - first) / (last - first), 0.0, 1.0)
        x0, x1 = (float(x) for x in self.map.inverse(inside))
        x0, x1 = (float(np.round(x)) if abs(x - np.round(x)) <= _SAME else x for x in (x0, x1))
        along = int(self.side[0] == "u")
        if isinstance(self.surface, SeparableSurface):
            return RestrictedSurface(self.surface, ((0.0, 1.0), (x0, x1)) if along else ((x0, x1), (0.0, 1.0)))
        ranges = list(self.surface.domain)
        a, b = ranges[along]
        ranges[along] = a * (1 - x0) + b * x0, a * (1 - x1) + b * x1
        return part_of_surface(self.surface, (ranges[0], ranges[1]))[0]


def stretches_of(ways: Sequence[Way], moved: Sequence[float], side: str) -> list[Stretch]:
    """Those of the faces, of which it is known how they run over the patch, that reach the side."""
    axis, place, found = "uv".index(side[0]), float(side[1]), []
    for way, by in zip(ways, moved, strict=True):
        surface = way.piece.geometry
        if place in way.ranges[axis] and isinstance(surface, BSplineSurface | SeparableSurface):
            own = f"{'uv'[axis ^ way.transposed]}{way.ranges[axis].index(place)}"
            found.append(Stretch(surface, own, by, way.ranges[1 - axis], way.maps[1 - axis]))
    return found


def check_split_edge(first: Sequence[Stretch], second: Sequence[Stretch], wanted: str) -> JoinReport | None:
    """What happens along an edge that both sides hold in stretches: the worst of all; None where one holds nothing.

    Parameters
    ----------
    first, second
        Of both sides, with the edge's parameter in one direction.
    wanted
        "G0" to "G3": parts of a patch have speeds of their own.

    Notes
    -----
    As for whole faces the figures come from samples, 257 on each stretch. Where the stretches of both sides do not run
    alike, nearest points tell what lies opposite.
    """
    found = []
    for start, end in _pieces([*first, *second]):
        a, b = (_there(stretches, (start + end) / 2) for stretches in (first, second))
        if a is None or b is None:
            return None
        found.append(_stretch_report(a, b, start, end, wanted))
    if not found:
        return None
    jumps = np.max([report.parametric_jumps for report, _ in found], axis=0)
    return JoinReport(
        max(report.gap[1] for report, _ in found),
        _largest(report.normal_angle_deg for report, _ in found),
        _largest(report.curvature_jump for report, _ in found),
        _largest(report.curvature_rate_jump for report, _ in found),
        0.0,
        (float(jumps[0]), float(jumps[1]), float(jumps[2])),
        min(report.parametric_order for report, _ in found),
        min(max(order, report.parametric_order) for report, order in found),
    )


def _pieces(stretches: Sequence[Stretch]) -> Iterator[Bounds]:
    """From each place where a face ends to the next."""
    places = np.sort([0.0, 1.0, *(end for one in stretches for end in one.ends)])
    kept = places[np.r_[True, np.diff(places) > _SAME]]
    kept[-1] = 1.0
    yield from pairwise(kept.tolist())


def _there(stretches: Sequence[Stretch], place: float) -> Stretch | None:
    return next((one for one in stretches if min(one.ends) <= place <= max(one.ends)), None)


def _stretch_report(a: Stretch, b: Stretch, start: float, end: float, wanted: str) -> tuple[EdgeReport, int]:
    """The report, and the geometric order that rounding allows for."""
    own = a.over(start, end)
    reports = []
    for by_points in (False, True):
        other: Surface | DerivableSurface = paced(b.surface, b.side, own, a.side) if by_points else b.over(start, end)
        found = check_edge(own, a.side, other, b.side, reversed=False)
        if found.meets(wanted):
            return found, found.geometric_order
        limits = rounding_limits((a.surface, b.surface), (a.side, b.side), (a.moved, b.moved), found.curvature)
        order = check_edge(own, a.side, other, b.side, reversed=False, thresholds=limits).geometric_order
        reports.append((found, order))
        if order >= int(wanted[1]):
            break
    return max(reports, key=lambda pair: pair[1])


def _largest(values: Iterator[float]) -> float:
    """Of those that are known."""
    return float(np.fmax.reduce([*values]))
