"""Local searches from a design downhill, and scipy's differential evolution as an independent global one."""

from __future__ import annotations

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
_LARGE = 1e300
_SCANNED = 129  # places on a line through the box
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
    """Look along each variable alone, over its whole range, for a lower valley, and go down there, until none is left.

    A swarm that has settled in the wrong one of many valleys leaves it by this.
    """
    line = np.linspace(LEAST, MOST, _SCANNED)
    for _ in range(_MOST_SCANS):
        before = search.value
        for index in range(search.problem.dimension):
            places = np.tile(search.design, (_SCANNED, 1))
            places[:, index] = line
            values = search.values(places)
            if values.min() < search.value:
                _downhill(search, places[values.argmin()])
        if not search.value < before:
            return


def is_minimum(search: Search) -> bool:
    """Whether the best design has no slope left, in units of the span of all values seen."""
    if not math.isfinite(search.value):
        return False
    slope = np.abs(projected(search.design, search.gradient(search.design))).max(initial=0.0)
    return bool(slope <= _FLAT * max(abs(search.value), search.largest - search.value))


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
    end = kept_inside(found.x)[None]
    if found.fun < search.value or search.excess > 0:
        search.offer(end, np.array([found.fun]), search.excesses(end))


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
    """Scipy's differential evolution with as many members and generations, vectorised."""
    from scipy.optimize import NonlinearConstraint, differential_evolution

    dimension = search.problem.dimension
    generation = 0

    def values(designs: Array) -> Array:
        found = search.values(np.atleast_2d(designs.T))
        if search.problem.excess is None:
            search.offer(np.atleast_2d(designs.T), found, np.zeros(len(found)))
        return np.minimum(found, _LARGE)

    def excess(designs: Array) -> Array:
        rows = np.atleast_2d(designs.T)
        over = search.excesses(rows)
        for row in np.flatnonzero(over <= search.excess):
            one = rows[row : row + 1]
            search.offer(one, search.values(one), over[row : row + 1])
        return over.reshape((1, -1) if designs.ndim > 1 else 1)

    def done(*_: object, **__: object) -> None:
        nonlocal generation
        generation += 1
        search.step(generation, iterations)

    first = rng.uniform(LEAST, MOST, (max(particles, 5), dimension))
    first[0] = start
    limits = () if search.problem.excess is None else (NonlinearConstraint(excess, -math.inf, 0.0),)
    differential_evolution(
        values,
        [(LEAST, MOST)] * dimension,
        maxiter=iterations,
        init=first,
        seed=rng,
        tol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        constraints=limits,
        callback=done,
    )
