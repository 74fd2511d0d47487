"""What every search over design variables shares: the problem, the ranking of designs, and what was found so far.

Designs are vectors in the box [-1, 1]^d. One is better than another when it breaks the limits less, and of two that
keep them when its value is smaller (the rules of Deb): no value, however small, makes up for a broken limit.

References
----------
K. Deb, An efficient constraint handling method for genetic algorithms, Comput. Methods Appl. Mech. Engrg. 186 (2000).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = Callable[[Array], Array]
Gradient = Callable[[Array], Array]

LEAST, MOST = -1.0, 1.0
STEP = 1e-4  # of differences: errors of about 1e-8 from the third derivative and 1e-12 from rounding


@dataclass(frozen=True)
class Problem:
    """What is to be made small, and the limits that it is subject to.

    Attributes
    ----------
    dimension
        The number d of variables.
    values
        From designs, shape (count, d), to their values, shape (count,); one that is no number counts as infinite.
    gradient
        From a design, shape (d,), to the exact gradient of its value; None to take differences.
    excess
        From a design to how far it is beyond the limits, 0 where it keeps them; None without limits.
    quick
        Whether thousands of values cost next to nothing.
    """

    dimension: int
    values: Values
    gradient: Gradient | None = None
    excess: Callable[[Array], float] | None = None
    quick: bool = False


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes
    ----------
    step, steps
        Steps done, and how many there are at most.
    design
        The best design so far, shape (d,).
    value, excess
        Its value, and how far it is beyond the limits.
    """

    step: int
    steps: int
    design: Array
    value: float
    excess: float


class Search:
    """The designs that were looked at: their number, the best of them, and how it became better.

    Parameters
    ----------
    problem
        The problem.
    on_step
        Called after each step of a search.
    """

    def __init__(self, problem: Problem, on_step: Callable[[Progress], None] | None = None) -> None:
        self.problem = problem
        self.evaluations = 0
        self.history: list[float] = []
        self.best: tuple[Array, float, float] = (np.zeros(problem.dimension), math.inf, math.inf)
        self.largest = -math.inf  # of the finite values
        self._on_step = on_step

    @property
    def design(self) -> Array:
        """The best design so far."""
        return self.best[0]

    @property
    def value(self) -> float:
        """Its value."""
        return self.best[1]

    @property
    def excess(self) -> float:
        """How far it is beyond the limits; infinite before the first design."""
        return self.best[2]

    def values(self, designs: Array) -> Array:
        """Values of designs, shape (count, d)."""
        self.evaluations += len(designs)
        with np.errstate(all="ignore"):
            found = np.asarray(self.problem.values(designs), dtype=np.float64)
        finite = found[np.isfinite(found)]
        if finite.size:
            self.largest = max(self.largest, float(finite.max()))
        return np.where(np.isfinite(found), found, math.inf)

    def excesses(self, designs: Array) -> Array:
        """How far designs are beyond the limits."""
        if self.problem.excess is None:
            return np.zeros(len(designs))
        return np.array([self._excess(design) for design in designs])

    def _excess(self, design: Array) -> float:
        assert self.problem.excess is not None
        found = self.problem.excess(design)
        return max(float(found), 0.0) if not math.isnan(found) else math.inf

    def gradient(self, design: Array) -> Array:
        """The gradient of the value: exact, or by differences of the step 1e-4, of the second order, in the box."""
        if self.problem.gradient is not None:
            self.evaluations += 1
            with np.errstate(all="ignore"):
                return np.asarray(self.problem.gradient(design), dtype=np.float64)
        middle = np.clip(design, LEAST + STEP, MOST - STEP)  # the parabola through three places in the box
        steps = STEP * np.eye(self.problem.dimension)
        places = np.where(steps != 0, middle, design)  # (d, d): the i-th has its i-th variable in the middle
        low, centre, high = np.split(self.values(np.concatenate([places - steps, places, places + steps])), 3)
        with np.errstate(all="ignore"):
            away = (design - middle) / STEP
            return np.asarray(((high - low) / 2 + away * (high - 2 * centre + low)) / STEP)

    def offer(self, designs: Array, values: Array, excesses: Array) -> None:
        """Keep the best of these designs when it is better than all before."""
        first = int(np.lexsort((values, excesses))[0])
        if better(values[first], excesses[first], self.value, self.excess):
            self.best = designs[first].copy(), float(values[first]), float(excesses[first])  # at once: see interrupts

    def step(self, number: int, count: int) -> None:
        """A step is done: note the best value, or infinity while no design keeps the limits."""
        self.history.append(self.value if self.excess == 0 else math.inf)
        if self._on_step is not None:
            self._on_step(Progress(number, count, self.design, self.value, self.excess))


def better(value: float, excess: float, other: float, other_excess: float) -> bool:
    """Whether a design is better than another."""
    return bool((excess, value) < (other_excess, other))


def kept_inside(designs: Array) -> Array:
    """The nearest designs in the box."""
    return np.clip(designs, LEAST, MOST)


def projected(design: Array, gradient: Array) -> Array:
    """The gradient without what points out of the box: 0 at a minimum."""
    blocked = ((design <= LEAST) & (gradient > 0)) | ((design >= MOST) & (gradient < 0))
    return np.where(blocked, 0.0, gradient)
