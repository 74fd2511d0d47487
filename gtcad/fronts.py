"""Several objectives at once: the designs of which none can be bettered in one objective without loss in another.

By the genetic algorithm NSGA-II of pymoo, in the extra ``optimize``.

References
----------
K. Deb, A. Pratap, S. Agarwal, T. Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE Trans.
Evol. Comput. 6 (2002) 182-197.
J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8 (2020) 89497-89509.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad._design_space import DesignSpace
from gtcad._extremal_space import Extremal, ExtremalSpace, extremal_kind
from gtcad._search import LEAST, MOST
from gtcad.basis import Gamma, is_whole
from gtcad.errors import ExtraMissing, GtcadError, InputError, NoFeasibleDesign
from gtcad.objectives import evaluator, limited

Array = NDArray[np.float64]
Function = Callable[[Any], float]


@dataclass(frozen=True, eq=False)
class Front:
    """Designs that are not dominated by each other, sorted by the first objective.

    Attributes
    ----------
    objectives
        Their names.
    values
        Of the objectives for each design, shape (count, objectives).
    gammas
        Pairs of design variables by name, for each design.
    shapes
        The shapes.
    evaluations, seed
        How many designs were looked at, and what the random numbers began with.
    setting
        What was held fixed.
    """

    objectives: tuple[str, ...]
    values: Array
    gammas: tuple[Mapping[str, Gamma], ...]
    shapes: tuple[Any, ...]
    evaluations: int
    seed: int
    setting: str

    def __len__(self) -> int:
        return len(self.values)


def pareto_front(
    shape: Any,
    objectives: Sequence[str | Function],
    *,
    variables: str | Sequence[str] | None = None,
    constraints: Sequence[Function] = (),
    extremal: Extremal = "auto",
    seed: int = 0,
    population: int = 40,
    generations: int = 50,
) -> Front:
    """The front of two objectives or more over the design variables of a shape.

    Parameters
    ----------
    shape, variables, extremal, seed
        As for ``gtcad.optimize.optimize``.
    objectives
        Names, or functions of the shape such as ``gtcad.converters.limits.PoleCount``.
    constraints
        As for ``optimize``: shapes that break one are not on the front.
    population, generations
        Designs at once, and how often they are renewed.

    Raises
    ------
    InputError
        When an argument is out of its range.
    NoFeasibleDesign
        When no design keeps the constraints.
    ExtraMissing
        When pymoo is not installed.

    Notes
    -----
    A front is what was found: no design of it is dominated by any other that was looked at.
    """
    for name, value, least in (("seed", seed, 0), ("population", population, 4), ("generations", generations, 1)):
        if not is_whole(value) or value < least:
            raise InputError(f"{name} must be a whole number from {least}, got {value!r}")
    if isinstance(objectives, str) or len(objectives) < 2:
        raise InputError(f"objectives must be two or more, got {objectives!r}; for one there is optimize")
    space = DesignSpace.of(shape, variables)
    energy = extremal_kind(shape, extremal)
    space = space if energy is None else ExtremalSpace.around(space, energy)
    seen = _Seen(space, [_vectorised(space, objective) for objective in objectives], tuple(constraints))
    _evolve(seen, int(population), int(generations), int(seed))
    designs, values = seen.front()
    values.flags.writeable = False
    return Front(
        objectives=tuple(map(_name, objectives)),
        values=values,
        gammas=tuple(space.gammas(design) for design in designs),
        shapes=tuple(space.shape_at(design) for design in designs),
        evaluations=len(seen.designs),
        seed=int(seed),
        setting=space.setting,
    )


def _name(objective: str | Function) -> str:
    return objective if isinstance(objective, str) else getattr(objective, "__name__", type(objective).__name__)


def _vectorised(space: DesignSpace, objective: str | Function) -> Callable[[Array], Array]:
    if isinstance(objective, str):
        return evaluator(space, objective).values
    if not callable(objective):
        raise InputError(f"objective must be a name or a function of the shape, got {objective!r}")
    function: Function = objective
    return lambda designs: np.array([_called(space, function, design) for design in designs])


def _called(space: DesignSpace, function: Function, design: Array) -> float:
    try:
        value = float(function(space.shape_at(design)))
    except GtcadError:
        return math.inf
    return value if not math.isnan(value) else math.inf


class _Seen:
    """All designs that were looked at."""

    def __init__(
        self, space: DesignSpace, objectives: list[Callable[[Array], Array]], constraints: tuple[Function, ...]
    ) -> None:
        self.space, self._objectives, self._constraints = space, objectives, constraints
        self.designs = np.empty((0, space.dimension))
        self.values = np.empty((0, len(objectives)))
        self.excess = np.empty(0)

    def look(self, designs: Array) -> tuple[Array, Array]:
        """Values and how far they are beyond the limits; infinite values count as beyond all."""
        values = np.column_stack([objective(designs) for objective in self._objectives])
        finite = np.isfinite(values).all(axis=1)
        excess = np.where(finite, 0.0, math.inf)
        if self._constraints or limited(self.space.shape):
            excess[finite] = [self._excess(design) for design in designs[finite]]
        self.designs = np.concatenate([self.designs, designs])
        self.values = np.concatenate([self.values, values])
        self.excess = np.concatenate([self.excess, excess])
        return np.where(np.isfinite(values), values, 1e300), np.minimum(excess, 1e300)

    def _excess(self, design: Array) -> float:
        """The sum of what is beyond the limits; infinite when there is no such shape, though it has values."""
        try:
            self.space.shape_at(design)
        except GtcadError:
            return math.inf
        return sum(max(0.0, _called(self.space, one, design)) for one in self._constraints)

    def front(self) -> tuple[Array, Array]:
        """The designs that keep the limits and that no other dominates."""
        kept = self.excess == 0
        if not kept.any():
            raise NoFeasibleDesign("the front", len(kept), float(self.excess.min()))
        designs, values = self.designs[kept], self.values[kept]
        _, first = np.unique(values, axis=0, return_index=True)
        designs, values = designs[first], values[first]
        no_worse = (values[:, None] <= values[None]).all(axis=-1)
        np.fill_diagonal(no_worse, False)
        best = ~no_worse.any(axis=0)
        return designs[best], values[best]


def _evolve(seen: _Seen, population: int, generations: int, seed: int) -> None:
    try:
        algorithms, core, runner = map(
            importlib.import_module, ("pymoo.algorithms.moo.nsga2", "pymoo.core.problem", "pymoo.optimize")
        )
    except ImportError as error:
        raise ExtraMissing(f"fronts need pymoo ({error}): pip install 'gtcad[optimize]'") from error

    def evaluate(_: object, x: Array, out: dict[str, Array], *__: object, **___: object) -> None:
        out["F"], excess = seen.look(np.asarray(x, dtype=np.float64))
        out["G"] = excess[:, None]

    looked = type("Looked", (core.Problem,), {"_evaluate": evaluate})
    problem = looked(n_var=seen.space.dimension, n_obj=seen.values.shape[1], n_ieq_constr=1, xl=LEAST, xu=MOST)
    first = np.random.default_rng(seed).uniform(LEAST, MOST, (population, seen.space.dimension))
    first[0] = seen.space.start
    algorithm = algorithms.NSGA2(pop_size=population, sampling=first)
    runner.minimize(problem, algorithm, ("n_gen", generations), seed=seed, verbose=False)
