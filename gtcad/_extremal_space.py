"""Spaces of extremals: the design variables move, and the interior of the patch is solved anew for each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gtcad._design_space import DesignSpace
from gtcad.basis import Gamma
from gtcad.errors import GtcadError, InputError
from gtcad.patches._forms import Energy
from gtcad.patches.minimal import ExtremalEnergies, Plateau, extremal, fixed_contour
from gtcad.protocol import SeparableSurface
from gtcad.surface import Surface

Array = NDArray[np.float64]
Extremal = Energy | Literal["auto"] | None

ENERGIES: tuple[Energy, ...] = get_args(Energy)
_SAME = 1e-9  # of the size: how far control points may be from those of an extremal


def extremal_kind(shape: object, wanted: Extremal) -> Energy | None:
    """The energy whose extremal a patch is meant to be; with "auto" that whose extremal it is, if any.

    Raises
    ------
    InputError
        When the shape can be no extremal, or there is no such energy.
    """
    if wanted not in (None, "auto", *ENERGIES):
        raise InputError(f"extremal must be one of auto, {', '.join(ENERGIES)} or None, got {wanted!r}")
    possible = _can_be_one(shape)
    if wanted == "auto":
        return next((energy for energy in ENERGIES if _is_extremal(shape, energy)), None) if possible else None
    if wanted is not None and not possible:
        raise InputError(
            f"extremal={wanted!r} is for a Surface of one family with design variables, or a Plateau patch, got "
            f"{type(shape).__name__}"
        )
    return wanted


def _can_be_one(shape: object) -> bool:
    if isinstance(shape, Surface):
        return shape.family_u is shape.family_v and shape.family_u.takes_gamma
    return isinstance(shape, Plateau) and shape.family.takes_gamma


def _is_extremal(shape: object, energy: Energy) -> bool:
    assert isinstance(shape, Surface | Plateau)
    try:
        solved = _solved(shape, energy, shape.gamma_u, shape.gamma_v)
    except (GtcadError, np.linalg.LinAlgError):
        return False
    size = float(np.ptp(shape.coefficients.reshape(-1, shape.dimension), axis=0).max())
    return bool(np.abs(_inner(solved) - _inner(shape)).max(initial=0.0) <= _SAME * size)


def _inner(shape: Surface | Plateau) -> Array:
    return shape.interior if isinstance(shape, Plateau) else shape.control_points[1:-1, 1:-1]


def _solved(shape: Surface | Plateau, energy: Energy, gamma_u: Gamma, gamma_v: Gamma) -> Surface | Plateau:
    gammas: Any = {"gamma_u": gamma_u, "gamma_v": gamma_v}
    if isinstance(shape, Plateau):
        return fixed_contour(shape.contour, shape.degrees, energy, family=shape.family, **gammas)
    return extremal(shape.control_points, energy, family=shape.family_u, **gammas)


@dataclass(frozen=True)
class ExtremalSpace(DesignSpace):
    """All extremals of one boundary: ``shape_at`` solves for the interior.

    Attributes
    ----------
    energy
        What they are least in.
    """

    energy: Energy

    @classmethod
    def around(cls, space: DesignSpace, energy: Energy) -> ExtremalSpace:
        """The space of the same variables; of a fixed contour those of the interior functions."""
        singles = tuple(single for single in space.singles if single[0] in ("gamma_u", "gamma_v"))
        if not singles:
            raise InputError("variables must be some of gamma_u, gamma_v: the boundary of an extremal is given")
        return cls(space.shape, singles, energy)

    @property
    def setting(self) -> str:
        """What stays."""
        boundary = "fixed contour" if isinstance(self.shape, Plateau) else "free boundary"
        return f"{boundary}, interior solved anew as the {self.energy} extremal"

    def shape_at(self, design: Array) -> SeparableSurface:
        """The extremal of a design."""
        gammas = self.gammas(design)
        return _solved(self.shape, self.energy, gammas["gamma_u"], gammas["gamma_v"])

    def energies(self) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
        """The energy of the extremals of many designs, and the exact gradient of one: both vectorised."""
        shape = self.shape
        if isinstance(shape, Plateau):
            many = ExtremalEnergies(shape.contour, self.energy, degree=shape.degrees, family=shape.family)
        else:
            many = ExtremalEnergies(shape.control_points, self.energy, family=shape.family_u)
        start = np.array([*shape.gamma_u, *shape.gamma_v])
        places = [2 * (name == "gamma_v") + k for name, k in self.singles]

        def all_four(designs: Array) -> Array:
            gammas = np.tile(start, (len(designs), 1))
            gammas[:, places] = designs
            return gammas

        return lambda designs: many(all_four(designs)), lambda design: many.with_rates(all_four(design[None]))[1][
            0, places
        ]
