"""Shapes as functions of their design variables, one by one or, where they are affine in them, thousands at a time.

The GT functions are affine in a pair: ``f = a + gamma_1 b + gamma_2 c``. So are, in each of their pairs, most shapes
and all their derivatives, and

    S(gamma) = sum_k w_k(gamma) S_k,   w_k = product over the pairs of 1, gamma_1 or gamma_2.

The S_k are differences of shapes with design variables 0 and 1; whether the sum holds is tried at other values.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import Gamma
from gtcad.curve import Curve
from gtcad.design_variables import design_variables, with_design_variables
from gtcad.errors import GtcadError, InputError
from gtcad.patches.developable import PlaneFamily
from gtcad.protocol import SeparableSurface
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]
Numbers = NDArray[Any]  # real, or complex for derivatives
Sampler = Callable[[Any], Array]
"""From a shape to an array that is linear in it: derivatives at nodes."""

_MOST_TERMS = 100
_NO_TERM = 1e-14  # of the largest: a term that rounding leaves
_AFFINE = 1e-11  # of the largest: what the sum may be off by
_AT_ONCE = 2_000_000  # numbers in one block of designs


def variables_of(shape: Any) -> dict[str, Gamma]:
    """Pairs of design variables by name: "gamma" of a curve or planes, those of ``design_variables`` of a patch.

    Raises
    ------
    InputError
        When the shape is of no kind that has any.
    """
    if isinstance(shape, RestrictedCurve):
        return variables_of(shape.shape)
    if isinstance(shape, SeparableSurface):
        return design_variables(shape)
    if isinstance(shape, Curve | PlaneFamily):
        return {"gamma": shape.gamma} if shape.family.takes_gamma else {}
    raise InputError(f"shape must be a curve, a patch or a family of planes, got {type(shape).__name__}")


def with_variables(shape: Any, changes: Mapping[str, Gamma]) -> Any:
    """The shape with other design variables."""
    if isinstance(shape, RestrictedCurve):
        return replace(shape, shape=with_variables(shape.shape, changes))
    if isinstance(shape, SeparableSurface):
        return with_design_variables(shape, changes)
    return replace(shape, **changes)


@dataclass(frozen=True)
class DesignSpace:
    """All shapes that differ from one by some of its design variables.

    Attributes
    ----------
    shape
        That one.
    singles
        The variables that are free: names and indices 0 or 1 of pairs.
    """

    shape: Any
    singles: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, shape: Any, variables: str | Sequence[str] | None = None) -> DesignSpace:
        """The space of the named variables, such as "gamma_u" or "gamma_u[0]"; of all by default.

        Raises
        ------
        InputError
            When the shape has no design variables, or none of that name.
        """
        known = variables_of(shape)
        if not known:
            raise InputError("the shape has no design variables: its functions are all of families without any")
        allowed: dict[str, tuple[tuple[str, int], ...]] = {
            f"{name}[{k}]": ((name, k),) for name in known for k in (0, 1)
        }
        allowed |= {name: ((name, 0), (name, 1)) for name in known}
        wanted = tuple(known) if variables is None else (variables,) if isinstance(variables, str) else tuple(variables)
        if not wanted or not all(isinstance(name, str) and name in allowed for name in wanted):
            raise InputError(f"variables must be some of {', '.join(sorted(allowed))}, got {variables!r}")
        return cls(shape, tuple(dict.fromkeys(single for name in wanted for single in allowed[name])))

    @property
    def dimension(self) -> int:
        """How many variables are free."""
        return len(self.singles)

    @property
    def setting(self) -> str:
        """What stays."""
        return "control planes fixed" if isinstance(self.shape, PlaneFamily) else "control points fixed"

    @property
    def start(self) -> Array:
        """The design of the shape itself, shape (dimension,)."""
        known = variables_of(self.shape)
        return np.array([known[name][k] for name, k in self.singles])

    def gammas(self, design: Array) -> dict[str, Gamma]:
        """All pairs of a design by name."""
        pairs = {name: list(gamma) for name, gamma in variables_of(self.shape).items()}
        for (name, k), value in zip(self.singles, design.tolist(), strict=True):
            pairs[name][k] = value + 0.0
        return {name: (pair[0], pair[1]) for name, pair in pairs.items()}

    def shape_at(self, design: Array) -> Any:
        """The shape of a design."""
        free = {name for name, _ in self.singles}
        return with_variables(self.shape, {name: pair for name, pair in self.gammas(design).items() if name in free})


@dataclass(frozen=True)
class AffineSamples:
    """Samples of all shapes of a space that is affine in each pair.

    Attributes
    ----------
    groups
        The places in a design of the free variables of each pair.
    terms
        Which products are needed, as indices into each group's (1, first, second), shape (count, groups).
    samples
        Of the shapes S_k, shape (count, ...).
    """

    groups: tuple[tuple[int, ...], ...]
    terms: NDArray[np.intp]
    samples: Array

    @classmethod
    def of(cls, space: DesignSpace, sample: Sampler) -> AffineSamples | None:
        """The samples of a space, or None when it is not affine."""
        names = tuple(dict.fromkeys(name for name, _ in space.singles))
        groups = tuple(tuple(k for k, single in enumerate(space.singles) if single[0] == name) for name in names)
        if math.prod(len(group) + 1 for group in groups) > _MOST_TERMS:
            return None
        try:
            table = cls._differences(space, sample, groups)
            size = float(np.abs(table.samples).max(initial=0.0))
            needed = np.abs(table.samples).reshape(len(table.samples), -1).max(axis=1) > _NO_TERM * size
            found = cls(groups, table.terms[needed], table.samples[needed])
            for trial in (0.83 * np.cos(1.0 + np.arange(space.dimension)), -0.7 * np.cos(np.arange(space.dimension))):
                if np.abs(found.at(trial[None])[0] - sample(space.shape_at(trial))).max() > _AFFINE * size:
                    return None
        except GtcadError:  # no such shape for some of the values: it is not affine then
            return None
        return found if math.isfinite(size) else None

    @classmethod
    def _differences(cls, space: DesignSpace, sample: Sampler, groups: tuple[tuple[int, ...], ...]) -> AffineSamples:
        terms = np.array(list(itertools.product(*(range(len(group) + 1) for group in groups))))
        designs = np.zeros((len(terms), space.dimension))
        for column, group in zip(terms.T, groups, strict=True):
            for k, place in enumerate(group):
                designs[column == k + 1, place] = 1.0
        values = np.stack([sample(space.shape_at(design)) for design in designs])
        cube = values.reshape(*(len(group) + 1 for group in groups), *values.shape[1:])
        for axis in range(len(groups)):
            cube = np.moveaxis(cube, axis, 0)
            cube = np.concatenate([cube[:1], cube[1:] - cube[:1]])
            cube = np.moveaxis(cube, 0, axis)
        return cls(groups, terms, cube.reshape(values.shape))

    def weights(self, designs: Numbers) -> Numbers:
        """The w_k of designs, shape (designs, count)."""
        one = np.ones((len(designs), 1))
        result: Numbers = np.ones((len(designs), len(self.terms)))
        for column, group in zip(self.terms.T, self.groups, strict=True):
            result = result * np.concatenate([one, designs[:, list(group)]], axis=1)[:, column]
        return result

    def at(self, designs: Numbers) -> Numbers:
        """Samples of designs, shape (designs, ...)."""
        flat = self.weights(designs) @ self.samples.reshape(len(self.samples), -1)
        return flat.reshape(len(designs), *self.samples.shape[1:])

    def each_block(self, designs: Numbers, function: Callable[[Numbers], Numbers]) -> Numbers:
        """A function of the samples of all designs, block by block."""
        step = max(1, _AT_ONCE // max(self.samples[0].size, 1))
        return np.concatenate(
            [function(self.at(designs[start : start + step])) for start in range(0, len(designs), step)]
        )
