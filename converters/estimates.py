"""Two-sided estimates of the distance of two point sets, by searches from samples that grow denser where it is large.

A sample is at least as near as the search says. So a shape is said to fail only when a sample of it, or of what the
file holds, has no point of the other within the tolerance even by subdivision.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.figures import Figure
from gtcad.converters.nearest import SEARCHES, Nearest, lattice

Array = NDArray[np.float64]

_LINES = {1: 257, 2: 49}
_TRIMMED_LINES = 33
_WORST, _ROUNDS, _FINER = 3, 3, 5  # places that are looked at more closely, how often, and into how many parts
_SUSPECTS = 400  # points that are looked at by subdivision, if none of them decides
_GAIN = 1e-3  # relative: what a face must promise to be nearer, to be asked
_ENOUGH = 0.25  # of the tolerance: a search that comes so near is not begun again


@dataclass(frozen=True, eq=False)
class Estimate:
    """What samples tell.

    Attributes
    ----------
    verdict
        "estimated": no sample is farther than the tolerance; "failed": one is; "undecided": it may be.
    figure_places
        Parameters of the figure on [0, 1] or its square, shape (n, variables).
    figure_points
        Shape (n, 3).
    vectors
        From there to what the file holds, shape (n, 3); NaN where no nearest point is known.
    distances
        Their lengths, or what they are at most; shape (n,).
    spacing
        The largest distance of neighbouring samples, in mm.
    """

    verdict: Literal["estimated", "failed", "undecided"]
    figure_places: Array
    figure_points: Array
    vectors: Array
    distances: Array
    spacing: float

    @property
    def method(self) -> str:
        """How the figure was had."""
        return f"nearest points of {len(self.distances)} samples at most {self.spacing:.2g} mm apart"


@dataclass(frozen=True, eq=False)
class _Samples:
    """Pairs of points that the search found to be nearest, seen from one side."""

    places: Array  # of the figure
    points: Array  # of the figure
    others: Array  # of what the file holds
    distances: Array
    from_figure: bool


def estimated(figure: Figure, pieces: Sequence[Figure], tolerance: float, suspect: Array | None = None) -> Estimate:
    """Hold the pieces together against a figure.

    Parameters
    ----------
    figure, pieces
        What the model has, and what the file holds of it.
    tolerance
        In mm.
    suspect
        Parameters of the figure, (variables,), that are looked at besides.
    """
    sides = [_from_figure(figure, pieces, tolerance, suspect)]
    sides += [_from_piece(figure, piece, tolerance) for piece in pieces]
    spacing = max(gap for _, gap in sides)
    found = [samples for samples, _ in sides]
    verdict = _verdict(figure, pieces, found, tolerance)
    places, points, others, distances = _columns(found)
    vectors = others - points
    if verdict == "estimated":  # a search may end too far away, where subdivision finds a nearer point
        vectors[distances > tolerance] = np.nan
        distances = np.minimum(distances, tolerance)
    return Estimate(verdict, places, points, vectors, distances, spacing)


def _verdict(
    figure: Figure, pieces: Sequence[Figure], found: Sequence[_Samples], tolerance: float
) -> Literal["estimated", "failed", "undecided"]:
    answers = [
        _suspects(samples.points, pieces, samples.distances, tolerance)
        if samples.from_figure
        else _suspects(samples.others, (figure,), samples.distances, tolerance)
        for samples in found
    ]
    return next((verdict for verdict in ("failed", "undecided") if verdict in answers), "estimated")


def _suspects(
    points: Array, targets: Sequence[Figure], distances: Array, tolerance: float
) -> Literal["estimated", "failed", "undecided"]:
    """What subdivision tells of the points that the search left farther than the tolerance."""
    far = np.argsort(-distances)[: np.count_nonzero(distances > tolerance)]
    for count, place in enumerate(far):
        answers = [target.is_farther(points[place], tolerance) for target in targets]
        if all(answer is True for answer in answers):
            return "failed"
        if count >= _SUSPECTS or not any(answer is False for answer in answers):
            return "undecided"
    return "estimated"


# --- from the figure to the pieces ------------------------------------------------------------------------------------


def _from_figure(
    figure: Figure, pieces: Sequence[Figure], tolerance: float, suspect: Array | None
) -> tuple[_Samples, float]:
    def look(points: Array, places: Array | None) -> _Samples:
        found = nearest_of(pieces, points, _ENOUGH * tolerance)
        known = figure.points.tree.query(points)[1] if places is None else None
        own = figure.points.places[known] if places is None else places
        return _Samples(own, points, found.points, found.distances, from_figure=True)

    points, places, spacing = _sampled(figure)
    if places is not None and suspect is not None:
        places = np.vstack([places, suspect])
        points = figure.points.evaluate(places)
    samples = look(points, places)
    if places is None:
        return samples, spacing
    finer = _closer(figure, places, samples.distances, lambda near: look(figure.points.evaluate(near), near))
    return _joined([samples, *finer]), spacing


def nearest_of(figures: Sequence[Figure], points: Array, enough: float, searches: int = SEARCHES) -> Nearest:
    """The nearest points of several figures together; figures that are too far away are not searched.

    Where points lie beside trimmed faces is asked only if no other figure is near.
    """
    best = Nearest(
        np.full(len(points), np.inf),
        np.full_like(points, np.nan),
        np.full((len(points), figures[0].variables), np.nan),
    )
    floors, ceiling = _bounds(figures, points)
    for k, figure in enumerate(figures):
        open_ones = np.flatnonzero((floors[k] <= np.minimum(best.distances, ceiling)) & (best.distances > enough))
        if len(open_ones):
            found, floors[k, open_ones] = figure.nearest_inside(points[open_ones], enough=enough, searches=searches)
            _keep_nearer(best, found, open_ones)
    for k, figure in enumerate(figures):
        open_ones = np.flatnonzero((floors[k] < (1 - _GAIN) * best.distances) & (best.distances > enough))
        if figure.face is not None and len(open_ones):
            unknown = Nearest(*(getattr(best, name)[open_ones] for name in ("distances", "points", "places")))
            found = figure.with_feet(points[open_ones], unknown, np.arange(len(open_ones)))
            _keep_nearer(best, found, open_ones)
    return best


def _bounds(figures: Sequence[Figure], points: Array) -> tuple[Array, Array]:
    """From boxes and grids: how near each figure may be to each point, and how near the nearest one must be."""
    if len(figures) == 1:
        return np.zeros((1, len(points))), np.full(len(points), np.inf)
    floors = np.array([_box_distances(figure.box, points) for figure in figures])
    ceiling = np.full(len(points), np.inf)
    for k in np.argsort(floors.sum(axis=1)):
        figure, near = figures[k], np.flatnonzero(floors[k] <= ceiling)
        if figure.face is not None and figure.face.region is None:
            continue
        found = figure.points.tree.query(points[near])[0]
        floors[k, near] = np.maximum(floors[k, near], found - figure.points.reach)
        if figure.face is None:
            ceiling[near] = np.minimum(ceiling[near], found)
    return floors, ceiling


def _keep_nearer(best: Nearest, found: Nearest, which: NDArray[np.int_]) -> None:
    better = found.distances < best.distances[which]
    kept = which[better]
    best.distances[kept], best.points[kept] = found.distances[better], found.points[better]
    best.places[kept] = found.places[better]


def _box_distances(box: Array, points: Array) -> Array:
    """Bounds from below, as far as a box of samples, made a little larger, can tell."""
    margin = 0.05 * float(np.linalg.norm(box[1] - box[0]))
    beyond = np.maximum(np.maximum(box[0] - points, points - box[1]), 0.0)
    return np.asarray(np.maximum(np.linalg.norm(beyond, axis=1) - margin, 0.0))


# --- from a piece to the figure ---------------------------------------------------------------------------------------


def _from_piece(figure: Figure, piece: Figure, tolerance: float) -> tuple[_Samples, float]:
    def look(points: Array) -> _Samples:
        found = figure.nearest(points, enough=_ENOUGH * tolerance)
        return _Samples(found.places, found.points, points, found.distances, from_figure=False)

    points, places, spacing = _sampled(piece)
    samples = look(points)
    if places is None:
        return samples, spacing
    finer = _closer(piece, places, samples.distances, lambda near: look(piece.points.evaluate(near)))
    return _joined([samples, *finer]), spacing


# --- samples ----------------------------------------------------------------------------------------------------------


def _sampled(figure: Figure) -> tuple[Array, Array | None, float]:
    """Points, their parameters where these are known, and how far neighbours are apart, in mm."""
    if figure.face is not None:
        if figure.face.region is None:  # only distances from it are known
            return np.empty((0, 3)), None, 0.0
        return *figure.sampled(_TRIMMED_LINES), figure.size / _TRIMMED_LINES
    least = _LINES[figure.variables]
    points, places = figure.sampled(least)
    assert places is not None
    lines = points.reshape(*figure.lines(least), 3)
    spacing = max(float(np.linalg.norm(np.diff(lines, axis=axis), axis=-1).max()) for axis in range(figure.variables))
    besides = figure.passed_by(least)
    return np.concatenate([points, figure.points.evaluate(besides)]), np.concatenate([places, besides]), spacing


def _closer(figure: Figure, places: Array, distances: Array, look: Callable[[Array], _Samples]) -> list[_Samples]:
    """Denser samples around the worst ones, and around the worst of these."""
    counts = np.array(figure.lines(_LINES[figure.variables]))
    worst = places[np.argsort(-distances)[:_WORST]]
    half = 1.0 / (counts - 1)
    found: list[_Samples] = []
    for _ in range(_ROUNDS):
        steps = lattice(*[np.linspace(-1.0, 1.0, _FINER)] * figure.variables) * half
        near = np.clip((worst[:, None] + steps).reshape(-1, figure.variables), 0.0, 1.0)
        samples = look(near)
        found.append(samples)
        worst = near[np.argsort(-samples.distances)[:_WORST]]
        half = half / 2
    return found


def _joined(samples: Sequence[_Samples]) -> _Samples:
    return _Samples(*_columns(samples), samples[0].from_figure)


def _columns(samples: Sequence[_Samples]) -> tuple[Array, Array, Array, Array]:
    return (
        np.concatenate([one.places for one in samples]),
        np.concatenate([one.points for one in samples]),
        np.concatenate([one.others for one in samples]),
        np.concatenate([one.distances for one in samples]),
    )
