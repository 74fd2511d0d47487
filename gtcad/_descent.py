"""Local searches from a design downhill, and scipy's differential evolution as an independent global one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad._search import LEAST, MOST, Search, better, kept_inside, projected

Array = NDArray[np.float64]

_MOST_STEPS = 300
_FLAT = 1e-6  # over the span of values: a slope as small as this is none
_FIRST_MOVE, _LAST_MOVE = 0.25, 1e-6  # in a design variable
_APART = 0.05  # in a design variable: nearer designs are taken to lie in one valley
_LARGE = 1e140
_BEYOND, _LEAST_BEYOND, _MOST_WITHIN = 1e120, 1e105, 1e100  # of values, where one number has to say all
_AT_WALL = 1e-12  # a design as close as this to a bound is meant to lie on it
_LINE, _PLANE = 129, 33  # places on a line through the box, and on a line of a grid over a plane through it
_HOLLOWS = 4  # of a grid: those that are gone down
_MOST_SCANS = 10


def polish(search: Search, designs: Sequence[Array] | Array, most: int = 1, *, noted: bool = False) -> bool:
    """Go downhill from the best of these designs, and from others that are not near them.

    By L-BFGS-B as if there were no limits; where that leads beyond them, whose size says nothing about directions, by
    a compass search, which keeps to the ranking of designs.

    Parameters
    ----------
    search
        What is looked for, and where it is noted.
    designs
        The best first.
    most
        From how many of them.
    noted
        Whether each step counts as one of the search.

    Returns
    -------
    bool
        Whether the best design is a local minimum: no slope is left but out of the box, or no move of 1e-6 helps.
    """
    starts: list[Array] = []
    for design in designs:
        if len(starts) < most and all(np.abs(design - other).max() > _APART for other in starts):
            starts.append(design)
    for start in starts:
        _downhill(search, start, noted=noted)
    if search.problem.excess is None or is_minimum(search):
        return is_minimum(search)
    return _compass(search, search.design)


def scan(search: Search) -> None:
    """Look along single variables and over planes of two for lower valleys, from end to end, and go down there.

    A swarm that has settled in the wrong one of many valleys leaves it by this. It ends when nothing lower is found.
    Planes cost 1089 designs each: with more than two variables they are for objectives that are quick.
    """
    dimension = search.problem.dimension
    planes = dimension == 2 or search.problem.quick
    for _ in range(_MOST_SCANS):
        before = search.value
        for index in range(dimension):
            places = np.tile(search.design, (_LINE, 1))
            places[:, index] = np.linspace(LEAST, MOST, _LINE)
            values = search.values(places)
            if values.min() < search.value:
                _downhill(search, places[values.argmin()])
        if search.value < before:
            continue
        for pair in itertools.combinations(range(dimension), 2) if planes else ():
            _scan_plane(search, pair)
        if not search.value < before:
            return


def _scan_plane(search: Search, pair: tuple[int, int]) -> None:
    """Go down from the lowest hollows of a grid."""
    line = np.linspace(LEAST, MOST, _PLANE)
    places = np.tile(search.design, (_PLANE**2, 1))
    places[:, pair] = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    table = search.values(places).reshape(_PLANE, _PLANE)
    around = np.pad(table, 1, constant_values=math.inf)
    shifts = [(i, k) for i in range(3) for k in range(3) if (i, k) != (1, 1)]
    hollow = np.all([table <= around[i : i + _PLANE, k : k + _PLANE] for i, k in shifts], axis=0).ravel()
    order = np.argsort(np.where(hollow, table.ravel(), math.inf), kind="stable")
    for place in order[: min(_HOLLOWS, int(hollow.sum()))]:
        if np.abs(places[place] - search.design).max() > _APART:
            _downhill(search, places[place])


def is_minimum(search: Search) -> bool:
    """Whether the best design has no slope left, in units of the span of all values seen."""
    if not math.isfinite(search.value):
        return False
    slope = np.abs(projected(search.design, search.gradient(search.design))).max(initial=0.0)
    if slope <= _FLAT * max(abs(search.value), search.largest - search.value):
        return True
    corners = np.array([[LEAST], [MOST]]) * np.ones(search.problem.dimension)
    search.values(corners)  # at a minimum of 0 from the start, nothing has shown yet how large values are
    return bool(slope <= _FLAT * (search.largest - search.value))


def _downhill(search: Search, start: Array, *, noted: bool = False) -> None:
    from scipy.optimize import minimize

    steps = 0

    def value_and_slope(design: Array) -> tuple[float, Array]:
        design = kept_inside(design)
        value = search.values(design[None])
        slope = search.gradient(design)
        return min(float(value[0]), _LARGE), np.where(np.isfinite(slope), slope, 0.0)

    def note(intermediate_result: Any) -> None:
        nonlocal steps
        steps += 1
        here = kept_inside(intermediate_result.x)[None]
        search.offer(here, np.array([intermediate_result.fun]), search.excesses(here))
        search.step(steps, _MOST_STEPS)

    found = minimize(
        value_and_slope,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(LEAST, MOST)] * len(start),
        callback=note if noted else None,
        options={"maxiter": _MOST_STEPS, "ftol": 1e-16, "gtol": 0.0},
    )
    if found.fun < _LARGE and (found.fun < search.value or search.excess > 0):
        end = np.where(np.abs(found.x) > MOST - _AT_WALL, np.sign(found.x), found.x)[None]
        search.offer(end, search.values(end), search.excesses(end))


def _compass(search: Search, start: Array) -> bool:
    """Try moves along each variable, of half the length when none helps."""
    place, value, excess = start, search.values(start[None])[0], search.excesses(start[None])[0]
    move = _FIRST_MOVE
    while move >= _LAST_MOVE:
        moved = False
        for direction in np.concatenate([np.eye(len(start)), -np.eye(len(start))]):
            trial = kept_inside(place + move * direction)
            if np.array_equal(trial, place):
                continue
            found = search.values(trial[None])[0]
            if not found < value and excess == 0:
                continue
            over = search.excesses(trial[None])[0]
            if better(found, over, value, excess):
                place, value, excess, moved = trial, found, over, True
        search.offer(place[None], np.array([value]), np.array([excess]))
        if not moved:
            move /= 2
    return bool(excess == 0 and value <= search.value)


def evolution(search: Search, start: Array, particles: int, iterations: int, rng: np.random.Generator) -> None:
    """Differential evolution by scipy with as many members and generations, vectorised.

    What is beyond the limits gets a value above all others, by how far it is.
    """
    from scipy.optimize import differential_evolution

    generation = 0

    def ranked(designs: Array) -> Array:
        rows = np.atleast_2d(designs.T)
        found, over = search.values(rows), search.excesses(rows)
        search.offer(rows, found, over)
        return np.where(over > 0, np.clip(_BEYOND * over, _LEAST_BEYOND, _LARGE), np.minimum(found, _MOST_WITHIN))

    def done(*_: object, **__: object) -> None:
        nonlocal generation
        generation += 1
        search.step(generation, iterations)

    first = rng.uniform(LEAST, MOST, (max(particles, 5), search.problem.dimension))
    first[0] = start
    differential_evolution(
        ranked,
        [(LEAST, MOST)] * search.problem.dimension,
        maxiter=iterations,
        init=first,
        seed=rng,
        tol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=done,
    )
