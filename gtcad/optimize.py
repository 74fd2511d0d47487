"""Shape optimisation: the design variables that make an objective small, control points and boundary being given.

The published method is a particle swarm of 30 particles and 100 iterations with inertia 0.7298 and both pulls 1.49618.
It is the default, with two additions: particles know their neighbours on a ring only, and what the swarm finds is
polished, by gradients and by looking along each variable. scipy's differential evolution is there as an independent
check, and ``gtcad.fronts`` for several objectives at once.

References
----------
M. Ammad, M. Y. Misro, M. Bibi, A. Ramli, arXiv:2601.11677: Dirichlet extremals by particle swarms.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gtcad._descent import evolution, is_minimum, polish, scan
from gtcad._design_space import DesignSpace
from gtcad._extremal_space import Extremal, ExtremalSpace, extremal_kind
from gtcad._search import Problem, Progress, Search
from gtcad._swarm import Neighbourhood, SwarmSettings, swarm
from gtcad.basis import Gamma, is_whole
from gtcad.errors import GtcadError, InputError, NoFeasibleDesign
from gtcad.measure import Estimate
from gtcad.objectives import carrier_of, checked_objective, evaluator, limited, measured

__all__ = ["METHODS", "Optimum", "Progress", "SwarmSettings", "optimize"]

Array = NDArray[np.float64]
Method = Literal["pso", "polish", "de"]
Function = Callable[[Any], float]
Objective = str | Function

METHODS: tuple[Method, ...] = get_args(Method)
_STARTS = 3  # valleys of a swarm that are gone down
_RULES = (1, 2, 4)  # times the usual nodes of a quadrature
_AGREE = 1e-5  # relative: what a search's quadrature may be off by at its end; else it is run again with more nodes
_NOTHING = 1e-13  # relative: what a better design has to gain
_SURE = 1e-6  # relative: the error of the value of a minimum


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best design that was found.

    Attributes
    ----------
    shape
        The best shape.
    gamma
        Its pairs of design variables, by the names of ``gtcad.design_variables``, "gamma" for curves and planes.
    value
        Of the objective. The error of a named one is estimated, by doubling the nodes of its quadrature; that of a
        function is unknown: NaN.
    start_value
        The same for the shape that was given.
    history
        Best value after each iteration, shape (iterations,); infinite while no design had kept the limits. The last is
        the end of swarm and polish together. These are the values of the search, by one fixed quadrature.
    evaluations
        How many designs were looked at, those of differences included; an exact gradient counts as one.
    seed
        Of the random numbers: equal ones give equal results, bit for bit.
    method, objective, setting
        How it was looked for; for what; and what was held fixed meanwhile.
    converged
        Whether it is a local minimum: no slope is left in the box [-1, 1]^d, and the value's error is small. No method
        proves that there is no lower valley elsewhere.
    interrupted
        Whether it is only the best so far.
    """

    shape: Any
    gamma: Mapping[str, Gamma]
    value: Estimate
    start_value: Estimate
    history: Array
    evaluations: int
    seed: int
    method: Method
    objective: str
    setting: str
    converged: bool
    interrupted: bool = False

    def plot(self, path: str | os.PathLike[str], *, title: str | None = None) -> None:
        """Draw how the search converged.

        Parameters
        ----------
        path
            The picture, ending in .png or .svg.
        title
            Above the picture; objective and method by default.

        Raises
        ------
        InputError
            When an argument is out of its range.
        FileError
            When the path cannot be written to.
        ExtraMissing
            When matplotlib is not installed.
        """
        from gtcad.optimum_pictures import draw_convergence

        draw_convergence(self, path, title=title)

    def as_data(self) -> dict[str, Any]:
        """All but the shape as plain data."""
        return {
            "objective": self.objective,
            "setting": self.setting,
            "method": self.method,
            "seed": self.seed,
            "gamma": {name: list(pair) for name, pair in self.gamma.items()},
            "value": self.value.value,
            "error": self.value.error,
            "start_value": self.start_value.value,
            "evaluations": self.evaluations,
            "converged": self.converged,
            "interrupted": self.interrupted,
            "history": self.history.tolist(),
        }


def optimize(
    shape: Any,
    objective: Objective = "dirichlet",
    *,
    method: Method = "pso",
    variables: str | Sequence[str] | None = None,
    constraints: Function | Sequence[Function] = (),
    extremal: Extremal = "auto",
    seed: int = 0,
    particles: int = 30,
    iterations: int = 100,
    inertia: float = 0.7298,
    own_pull: float = 1.49618,
    common_pull: float = 1.49618,
    neighbourhood: Neighbourhood = "ring",
    patience: int | None = None,
    polished: bool = True,
    on_step: Callable[[Progress], None] | None = None,
    keep_interrupted: bool = False,
) -> Optimum:
    """The design variables of a shape that make an objective least.

    Parameters
    ----------
    shape
        A curve, any patch with design variables, or a ``PlaneFamily``.
    objective
        A name of ``gtcad.objectives.objectives_of(shape)``, or a function of the shape. Designs for which the function
        gives no number, or the kind has no shape, count as infinitely bad.
    method
        "pso": particle swarm; "de": scipy's differential evolution with as many members and generations; "polish":
        downhill from the shape itself.
    variables
        Those that are free, such as "gamma_u" or "gamma_u[0]"; by default all, but of an objective for the dual curve
        or the spine of a developable those of that alone.
    constraints
        Functions of the shape that say how far it is beyond a limit, 0 or less where it keeps it, such as
        ``gtcad.converters.limits.PoleLimit``. A shape that breaks one is never the result.
    extremal
        "dirichlet", "quasi-harmonic" or "bending": control points inside the boundary are solved anew for all design
        variables, so that the patch stays the extremal of that energy. "auto": so it is when the given patch is one
        of these extremals, to 1e-9 of its size. None: control points stay.
    seed
        Of the random numbers.
    particles, iterations, inertia, own_pull, common_pull, neighbourhood, patience
        As of ``gtcad.optimize.SwarmSettings``.
    polished
        Whether to go downhill from the best places of three valleys, and to look for lower ones along each variable
        and, where that is cheap, over planes of two.
    on_step
        Called with a ``Progress`` after each iteration.
    keep_interrupted
        Whether an interrupt (Ctrl-C) ends the search with the best design so far, instead of a KeyboardInterrupt.

    Raises
    ------
    InputError
        When an argument is out of its range, the shape has no design variables, or the objective does not fit it.
    NoFeasibleDesign
        When no design was found that keeps the constraints.

    Notes
    -----
    Named objectives are looked at for all particles at once, and have exact gradients, where points are affine in each
    pair of design variables: all but developables by their area, ``Sweep`` by its spine, ``Lofted`` by gamma_v, and
    extremals by other energies than their own. Functions of the shape are called about 4500 times by the defaults;
    their slopes are differences of the step 1e-4.

    On multimodal functions (Rastrigin, Schwefel, Ackley) of two and of four variables the defaults found the lowest
    valley from 50 seeds of 50, the worst to 1e-12; of two variables also on Rastrigin's function turned by an angle.
    Turned in four variables at once they may miss it: try several seeds.

    Examples
    --------
    The control polygon of a quarter circle; the shortest curve with it is the chord:

    >>> from gtcad import Curve
    >>> found = optimize(Curve([[1, 0], [1, 1], [0, 1]]), "length", iterations=20)
    >>> found.gamma, round(found.value, 9)
    ({'gamma': (-1.0, -1.0)}, 1.414213562)
    """
    settings = SwarmSettings(particles, iterations, inertia, own_pull, common_pull, neighbourhood, patience)
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if not is_whole(seed) or seed < 0:
        raise InputError(f"seed must be a whole number from 0, got {seed!r}")
    space = _space(shape, objective, variables, extremal)
    limits = _Limits(space, (constraints,) if callable(constraints) else tuple(constraints), objective)
    run = _Run(space, objective, limits.excess if limits.needed else None, method, settings, int(seed), polished)
    return run.optimum(on_step, keep_interrupted)


def _space(shape: Any, objective: Objective, variables: str | Sequence[str] | None, extremal: Extremal) -> DesignSpace:
    space = DesignSpace.of(shape, variables)
    energy = extremal_kind(shape, extremal)
    if not isinstance(objective, str):
        if not callable(objective):
            raise InputError(f"objective must be a name or a function of the shape, got {objective!r}")
    elif (field := carrier_of(shape, checked_objective(shape, objective))) is not None:
        own = tuple(single for single in space.singles if single[0] == field)
        if not own:
            raise InputError(f"variables must be some of {field}: {objective} depends on no others, got {variables!r}")
        space = space if variables is not None else DesignSpace(shape, own)
    return space if energy is None else ExtremalSpace.around(space, energy)


@dataclass(frozen=True)
class _Limits:
    """What a design must keep to: constraints, and that there is such a shape where the objective does not need one."""

    space: DesignSpace
    constraints: tuple[Function, ...]
    objective: Objective

    def __post_init__(self) -> None:
        for index, constraint in enumerate(self.constraints):
            if not callable(constraint):
                raise InputError(f"constraints[{index}] must be a function of the shape, got {constraint!r}")

    @property
    def needed(self) -> bool:
        """Whether there is anything to keep to."""
        return bool(self.constraints) or (isinstance(self.objective, str) and limited(self.space.shape))

    def excess(self, design: Array) -> float:
        """The sum of what is beyond the limits; infinite when there is no such shape."""
        try:
            shape = self.space.shape_at(design)
        except GtcadError:
            return math.inf
        found = [_number(f"constraints[{k}]", one(shape)) for k, one in enumerate(self.constraints)]
        return math.inf if any(map(math.isnan, found)) else sum(value for value in found if value > 0)


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must give a number, got {value!r}") from None


def _kept(values: Sequence[float] | None) -> Array:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True)
class _Run:
    """A search, with all that it depends on."""

    space: DesignSpace
    objective: Objective
    excess: Callable[[Array], float] | None
    method: Method
    settings: SwarmSettings
    seed: int
    polished: bool

    def optimum(self, on_step: Callable[[Progress], None] | None, keep_interrupted: bool) -> Optimum:
        start = self.space.start
        begun = self._measured(self.space.shape_at(start))
        evaluations, converged, interrupted = 0, False, False
        best = history = None
        for factor in _RULES if isinstance(self.objective, str) else _RULES[:1]:
            search = Search(Problem(self.space.dimension, self._called), on_step)
            try:
                search.problem = self._problem(factor)  # may take its time, and be interrupted
                search.offer(start[None], search.values(start[None]), search.excesses(start[None]))
                converged = self._search(search, start)
            except KeyboardInterrupt:
                interrupted, converged = True, False
                if not keep_interrupted or (search.excess > 0 and best is None):
                    raise
            evaluations += search.evaluations
            if search.excess == 0 or not interrupted:
                best, value = self._checked(search, evaluations), search.value
                found, history = self._measured(self.space.shape_at(best)), search.history or [value]
                span = max(abs(found), search.largest - found)
            if interrupted or not isinstance(self.objective, str) or abs(found - value) <= _AGREE * span:
                break
        assert best is not None
        if begun - found <= _NOTHING * span and (self.excess is None or self.excess(start) == 0):
            best, found = start, begun  # rounding is no reason to move
        return Optimum(
            shape=self.space.shape_at(best),
            gamma=self.space.gammas(best),
            value=found,
            start_value=begun,
            history=_kept(history),
            evaluations=evaluations,
            seed=self.seed,
            method=self.method,
            objective=self.objective_name,
            setting=self.space.setting,
            converged=converged and not found.error > _SURE * span,
            interrupted=interrupted,
        )

    def _checked(self, search: Search, evaluations: int) -> Array:
        """The best design.

        Raises
        ------
        NoFeasibleDesign, InputError
            When there is none that may be returned.
        """
        if search.excess > 0:
            raise NoFeasibleDesign(self.objective_name, evaluations, search.excess)
        if not math.isfinite(search.value):
            raise InputError(f"objective {self.objective_name} is finite for no design that was looked at")
        return search.design

    @property
    def objective_name(self) -> str:
        if isinstance(self.objective, str):
            return self.objective
        return getattr(self.objective, "__name__", type(self.objective).__name__)

    def _measured(self, shape: Any) -> Estimate:
        if isinstance(self.objective, str):
            return measured(shape, self.objective)
        return Estimate(_number("objective", self.objective(shape)), math.nan)

    def _problem(self, factor: int) -> Problem:
        if isinstance(self.objective, str):
            found = evaluator(self.space, self.objective, factor)
            return Problem(self.space.dimension, found.values, found.gradient, self.excess, found.quick)
        return Problem(self.space.dimension, self._called, None, self.excess)

    def _called(self, designs: Array) -> Array:
        """A function of the shape, for one design after the other."""
        assert callable(self.objective)
        values = np.full(len(designs), math.inf)
        for index, design in enumerate(designs):
            try:
                shape = self.space.shape_at(design)
            except GtcadError:  # the kind has no shape with these values
                continue
            values[index] = _number("objective", self.objective(shape))
        return values

    def _search(self, search: Search, start: Array) -> bool:
        """Run the method; whether it ended in a local minimum."""
        if self.method == "polish":
            return polish(search, [start], noted=True)
        rng = np.random.default_rng(self.seed)
        if self.method == "de":
            evolution(search, start, self.settings.particles, self.settings.iterations, rng)
            ends = search.design[None]
        else:
            ends = swarm(search, start, self.settings, rng)
        if self.polished and search.excess == 0:
            converged = polish(search, ends, _STARTS)
            if self.excess is None:
                scan(search)
                converged = polish(search, [search.design])
        else:
            converged = search.excess == 0 and is_minimum(search)
        if search.history:
            search.history[-1] = search.value if search.excess == 0 else math.inf
        return converged
