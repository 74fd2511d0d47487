"""Particle swarms: seeded, with ring or global neighbourhoods.

Each of the particles x has a velocity v, its own best place p and the best place l of its neighbours:

    v <- w v + c1 r1 (p - x) + c2 r2 (l - x),    x <- x + v,

with random numbers r1, r2 in [0, 1) for each particle and variable. A particle that would leave the box [-1, 1]^d stops
on its wall: that variable is set to the bound, and its velocity to 0.

References
----------
J. Kennedy, R. Eberhart, Particle swarm optimization, Proc. IEEE Int. Conf. Neural Networks 1995, 1942-1948.
M. Clerc, J. Kennedy, The particle swarm: explosion, stability, and convergence, IEEE Trans. Evol. Comput. 6 (2002)
58-73: w = 0.7298, c1 = c2 = 1.49618.
J. Kennedy, R. Mendes, Population structure and particle swarm performance, Proc. CEC 2002, 1671-1676: the ring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gtcad._search import LEAST, MOST, Search, kept_inside
from gtcad.basis import is_whole
from gtcad.errors import InputError

Array = NDArray[np.float64]
Neighbourhood = Literal["ring", "global"]

_ENOUGH = 1e-12  # relative: what counts as an improvement when a swarm may stop early


@dataclass(frozen=True)
class SwarmSettings:
    """The settings of a swarm; the defaults are the published ones.

    Parameters
    ----------
    particles, iterations
        30 and 100: as many evaluations as their product. The first iteration is the random start.
    inertia, own_pull, common_pull
        w = 0.7298, c1 = c2 = 1.49618.
    neighbourhood
        "ring": each particle knows the one before and the one after it, so that news spread slowly and several minima
        are looked at; "global": all know the best one.
    patience
        Stop after so many iterations that made the best value no better by 1e-12 of its size; None: never.

    Raises
    ------
    InputError
        When a setting is out of its range.
    """

    particles: int = 30
    iterations: int = 100
    inertia: float = 0.7298
    own_pull: float = 1.49618
    common_pull: float = 1.49618
    neighbourhood: Neighbourhood = "ring"
    patience: int | None = None

    def __post_init__(self) -> None:
        for name, least in (("particles", 3), ("iterations", 1), ("patience", 1)):
            value = getattr(self, name)
            if not (is_whole(value) and value >= least) and not (name == "patience" and value is None):
                raise InputError(f"{name} must be a whole number from {least}, got {value!r}")
        for name, most in (("inertia", 1.0), ("own_pull", 4.0), ("common_pull", 4.0)):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0 <= value <= most):
                raise InputError(f"{name} must lie in [0, {most:g}], got {value!r}")
        if self.neighbourhood not in ("ring", "global"):
            raise InputError(f"neighbourhood must be 'ring' or 'global', got {self.neighbourhood!r}")


def swarm(search: Search, start: Array, settings: SwarmSettings, rng: np.random.Generator) -> Array:
    """Let a swarm look for the best design; the first particle begins at the given one.

    Parameters
    ----------
    search
        What is looked for, and where it is noted.
    start
        A design, shape (d,).
    settings
        Of the swarm.
    rng
        All randomness: an equal state gives equal results, bit for bit.

    Returns
    -------
    Array
        The own best places of the particles that keep the limits, the best first, shape (count, d).
    """
    shape = (settings.particles, search.problem.dimension)
    x = rng.uniform(LEAST, MOST, shape)
    x[0] = start
    velocity = (rng.uniform(LEAST, MOST, shape) - x) / 2
    own, value, excess = x.copy(), np.full(len(x), math.inf), np.full(len(x), math.inf)
    last_value, last_change = math.inf, 1
    for number in range(1, settings.iterations + 1):
        if number > 1:
            leader = own[_leaders(value, excess, settings.neighbourhood)]
            pulls = settings.own_pull * rng.random(shape) * (own - x)
            pulls += settings.common_pull * rng.random(shape) * (leader - x)
            velocity = settings.inertia * velocity + pulls
            x = x + velocity
            velocity[(x < LEAST) | (x > MOST)] = 0.0
            x = kept_inside(x)
        _remember(search, x, own, value, excess)
        search.step(number, settings.iterations)
        if excess.min() > 0 or not search.value >= last_value - _ENOUGH * abs(last_value):
            last_value, last_change = search.value, number
        if settings.patience is not None and number - last_change >= settings.patience:
            break
    order = np.lexsort((value, excess))
    return np.asarray(own[order[excess[order] == 0]])


def _remember(search: Search, x: Array, own: Array, value: Array, excess: Array) -> None:
    """Move own best places to where the particles are now, if that is better."""
    found = search.values(x)
    promising = np.flatnonzero((found < value) | (excess > 0))  # limits may be dear: only where they decide
    over = search.excesses(x[promising])
    improved = (over < excess[promising]) | ((over == excess[promising]) & (found[promising] < value[promising]))
    places = promising[improved]
    own[places], value[places], excess[places] = x[places], found[places], over[improved]
    search.offer(own, value, excess)


def _leaders(value: Array, excess: Array, neighbourhood: Neighbourhood) -> NDArray[np.intp]:
    """For each particle the best one of its neighbourhood; of equals the first."""
    rank = np.empty(len(value), dtype=np.intp)
    order = np.lexsort((value, excess))
    rank[order] = np.arange(len(value))
    if neighbourhood == "global":
        return np.full(len(value), order[0])
    here = np.arange(len(value))
    around = np.stack([np.roll(here, 1), here, np.roll(here, -1)])
    return np.asarray(around[rank[around].argmin(axis=0), here])
