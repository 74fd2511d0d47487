"""What a file holds of one curve or surface of a model: proved where it can be, estimated where not.

Equal parameters bound the distance of the point sets from above, so they can prove a pass. They cannot prove a fail: a
shape fails when a sample of it, or of what the file holds, is farther than the tolerance from the other point set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.correspondence import Way, common_ranges, covers, part_way, whole_way
from gtcad.converters.estimates import estimated
from gtcad.converters.figures import Figure, Piece, areas_differ
from gtcad.converters.nearest import lattice

Array = NDArray[np.float64]
Verdict = Literal["proved", "estimated", "failed", "missing", "invalid", "undecided"]

_LINES = {1: 129, 2: 25}
_BINS = 12


@dataclass(frozen=True)
class Worst:
    """The place of the largest deviation that was seen.

    Attributes
    ----------
    parameters
        (t,) or (u, v) of the model's shape, in its own parameters.
    point
        Of the model, in mm.
    vector
        From there to what the file holds, in mm.
    """

    parameters: tuple[float, ...]
    point: tuple[float, float, float]
    vector: tuple[float, float, float]


@dataclass(frozen=True)
class Histogram:
    """How often deviations of samples lie between two bounds.

    Attributes
    ----------
    edges
        Ascending, in mm, one more than there are counts.
    counts
        Of samples.
    """

    edges: tuple[float, ...]
    counts: tuple[int, ...]

    @classmethod
    def of(cls, deviations: Array, tolerance: float) -> Histogram:
        """From 0 to the largest one, or the tolerance when there is none."""
        most = float(deviations.max(initial=0.0)) or tolerance
        counts, edges = np.histogram(deviations, _BINS, (0.0, most))
        return cls(tuple(edges.tolist()), tuple(counts.tolist()))


@dataclass(frozen=True)
class Row:
    """What was found of one shape of the model.

    Attributes
    ----------
    name
        The shape's name in the model.
    verdict
        "proved": within the tolerance by a certificate; "estimated": within it on dense samples; "failed": a sample
        is farther than the tolerance from the other point set; "missing": the file holds no part for it; "invalid":
        the kernel calls the part invalid; "undecided": none of these could be settled.
    deviation
        (lower, upper) in mm: of a certificate when proved; twice the largest distance found when estimated or failed.
    method
        How the figure was had.
    remark
        What a reader should know besides.
    worst
        Where it deviates most, of samples at corresponding parameters when proved, and of nearest points otherwise.
    histogram
        Of the deviations of these samples.
    face
        Indices of the parts that hold it, in the parts as read.
    """

    name: str
    verdict: Verdict
    deviation: tuple[float, float] | None = None
    method: str = ""
    remark: str = ""
    worst: Worst | None = None
    histogram: Histogram | None = None
    face: tuple[int, ...] = ()


def joined(*remarks: str) -> str:
    """Those remarks that are not empty, as one."""
    return "; ".join(dict.fromkeys(remark for remark in remarks if remark))


def compared(
    name: str, figure: Figure, pieces: Sequence[Figure], tolerance: float, ways: list[Way] | None = None
) -> Row:
    """Hold one or several pieces, which may be parts of the figure or reach it together, against a figure.

    The ways over these parts are looked for unless they are given.
    """
    trimmed = any(piece.face is not None for piece in pieces)
    if any(piece.face is not None and np.isnan(piece.face.area) for piece in pieces):
        return Row(name, "undecided", remark="trimmed, and nothing is known of its boundary")
    row, suspect = (None, None) if trimmed or figure.face is not None else _proof(name, figure, pieces, tolerance, ways)
    if row is None:
        row = _estimate(name, figure, pieces, tolerance, suspect)
    remark = joined(row.remark, f"held by {len(pieces)} parts" if len(pieces) > 1 else "")
    return replace(row, remark=remark)


def compared_parts(
    name: str, figure: Figure, group: Sequence[Piece], tolerance: float, ways: list[Way] | None = None
) -> Row:
    """Hold the parts of a file that stand for a figure against it: missing without any, invalid when one is."""
    if not group:
        return Row(name, "missing")
    numbers = tuple(piece.index for piece in group)
    if not all(piece.part.valid for piece in group):
        return Row(name, "invalid", remark="the kernel calls it invalid", face=numbers)
    return replace(compared(name, figure, [piece.figure for piece in group], tolerance, ways), face=numbers)


def ways_over(figure: Figure, pieces: Sequence[Figure], tolerance: float) -> list[Way] | None:
    """The ways over the parts of a figure that several pieces are; None where one of them runs otherwise."""
    found = [part_way(figure, piece, tolerance) for piece in pieces]
    ways = [way for way in found if way is not None]
    if len(ways) < len(pieces):
        return None
    return common_ranges(ways, lambda axis: tolerance / float(figure.points.speed[axis]))


# --- proofs -----------------------------------------------------------------------------------------------------------


def _proof(
    name: str, figure: Figure, pieces: Sequence[Figure], tolerance: float, ways: list[Way] | None
) -> tuple[Row | None, Array | None]:
    """The row if there is a proof; else parameters that are suspect, if any."""
    if len(pieces) == 1:
        way = whole_way(figure, pieces[0])
        certificate = way.certificate(tolerance)
        if certificate.upper > tolerance:
            return None, np.array(certificate.place)
        deviation = certificate.lower, certificate.upper
        return _proved(name, [way], deviation, way.method, tolerance), None
    ways = ways_over(figure, pieces, tolerance) if ways is None else ways
    if ways is None or not covers(ways):
        return None, None
    certificates = [way.certificate(tolerance) for way in ways]
    worst = max(certificates, key=lambda one: one.lower)
    upper = max(one.upper for one in certificates)
    if upper > tolerance:
        return None, np.array(worst.place)
    method = " and ".join(dict.fromkeys(way.method for way in ways)) + " of parts that cover it"
    return _proved(name, ways, (worst.lower, upper), method, tolerance), None


def _proved(name: str, ways: Sequence[Way], deviation: tuple[float, float], method: str, tolerance: float) -> Row:
    figure = ways[0].figure
    grid = lattice(*[np.linspace(0.0, 1.0, _LINES[figure.variables])] * figure.variables)
    places = np.concatenate([way.parameters(grid) for way in ways])
    vectors = np.concatenate([way.differences(grid) for way in ways])
    lengths = np.linalg.norm(vectors, axis=1)
    worst = _worst(figure, places, figure.points.evaluate(places), vectors, lengths)
    return Row(name, "proved", deviation, method, worst=worst, histogram=Histogram.of(lengths, tolerance))


# --- estimates --------------------------------------------------------------------------------------------------------


def _estimate(name: str, figure: Figure, pieces: Sequence[Figure], tolerance: float, suspect: Array | None) -> Row:
    found = estimated(figure, pieces, tolerance, suspect)
    largest = float(found.distances.max())
    verdict: Verdict = found.verdict
    remarks = ["trimmed in the file"] if any(piece.face is not None for piece in pieces) else []
    if verdict == "estimated" and remarks and figure.face is None:
        areas = areas_differ(figure, tuple(pieces), tolerance)
        remarks.append(areas)
        verdict = "undecided" if areas else verdict
    if largest > figure.size > 0:
        remarks.append(f"it lies up to {largest:.3g} mm away")
    known = ~np.isnan(found.figure_places).any(axis=1) & ~np.isnan(found.vectors).any(axis=1)
    worst = None
    if known.any():
        columns = (found.figure_places, found.figure_points, found.vectors, found.distances)
        worst = _worst(figure, *(column[known] for column in columns))
    histogram = Histogram.of(found.distances, tolerance)
    return Row(name, verdict, (largest, largest), found.method, joined(*remarks), worst, histogram)


def _worst(figure: Figure, places: Array, points: Array, vectors: Array, lengths: Array) -> Worst:
    k = int(lengths.argmax())
    u = figure.own(places[k : k + 1])[0].tolist()
    point, vector = points[k].tolist(), vectors[k].tolist()
    return Worst(tuple(u), (point[0], point[1], point[2]), (vector[0], vector[1], vector[2]))
