"""The design variables of patches of every kind: which there are, patches with others, and how points move with them.

They are those of a patch's own directions ("gamma_u", "gamma_v") and those of the curves that it was built from
("profile", "trajectory", "a", "c0", ...), two numbers each; ``name[0]`` and ``name[1]`` are the single ones. The GT
functions are affine in each single design variable g, and so are nearly all patches S: ``dS/dg`` is half of what S at
g = 1 and at g = -1 differ by.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gtcad.basis import Basis, Family, Gamma, checked_gamma
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms
from gtcad.patches._patch import Patch
from gtcad.patches.coons import Coons
from gtcad.patches.developable import Developable, PlaneFamily
from gtcad.patches.lofted import Lofted
from gtcad.patches.minimal import Plateau
from gtcad.patches.sweep import Sweep
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.restricted import RestrictedCurve, RestrictedSurface
from gtcad.surface import Surface

Pair = tuple[float, float]

_STEP = 1e-3  # in a design variable: of differences
_ONE_SIDED = (-25 / 12, 4.0, -3.0, 4 / 3, -1 / 4)  # weights of the first derivative by the value and four beyond it

STENCIL = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
"""Places and weights of the first derivative by a difference of the fourth order."""


def design_variables(patch: SeparableSurface) -> dict[str, Gamma]:
    """The design variables of a patch by name, in the order of its arguments.

    Parameters
    ----------
    patch
        Any surface of the protocol; the variables of a restricted one are those of the whole.

    Returns
    -------
    dict
        For a ``Surface`` "gamma_u" and "gamma_v"; for patches built from curves or planes the names of those that are
        GT curves or families of planes, or parts of such; for ``Lofted`` "sections", which all share one pair, and
        "gamma_v". Boundaries of ``Coons`` that are parts of curves are not among them: their ends move, and would leave
        the corners.

    Examples
    --------
    >>> from gtcad.patches import Ruled
    >>> lower, upper = Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0]], (0.5, 0)), Curve([[0, 0, 1], [1, 2, 1], [2, 0, 1]])
    >>> design_variables(Ruled(lower, upper))
    {'a': (0.5, 0.0), 'b': (0.0, 0.0)}
    """
    if isinstance(patch, RestrictedSurface):
        return design_variables(patch.shape)
    found: dict[str, Gamma | None] = {}
    if isinstance(patch, Surface):
        found = {"gamma_u": _own(patch.gamma_u, patch.family_u), "gamma_v": _own(patch.gamma_v, patch.family_v)}
    elif isinstance(patch, Lofted):
        found = {"sections": _of_curve(patch.sections[0]), "gamma_v": _own(patch.gamma_v, patch.family_v)}
    elif isinstance(patch, Patch):
        curves = {name: value for name, value in vars(patch).items() if isinstance(value, SeparableCurve | PlaneFamily)}
        found = {name: _of_curve(curve, whole=isinstance(patch, Coons)) for name, curve in curves.items()}
    if isinstance(patch, Plateau):
        found |= {"gamma_u": _own(patch.gamma_u, patch.family), "gamma_v": _own(patch.gamma_v, patch.family)}
    return {name: gamma for name, gamma in found.items() if gamma is not None}


def _own(gamma: Gamma, family: Family) -> Gamma | None:
    return gamma if family.takes_gamma else None


def _of_curve(curve: SeparableCurve | PlaneFamily, whole: bool = False) -> Gamma | None:
    """The pair of a curve or of what it is a part of; with ``whole`` of those alone whose ends are the curve's."""
    if isinstance(curve, RestrictedCurve) and not (whole and set(curve.range) != {0.0, 1.0}):
        return _of_curve(curve.shape, whole)
    return _own(curve.gamma, curve.family) if isinstance(curve, Curve | PlaneFamily) else None


def with_design_variables(patch: SeparableSurface, changes: Mapping[str, Sequence[float]]) -> SeparableSurface:
    """The patch with other design variables, of the same kind; all that is not named stays.

    Parameters
    ----------
    patch
        Any surface of the protocol.
    changes
        Pairs in [-1, 1] by name, as in ``design_variables``.

    Raises
    ------
    InputError
        When the patch has no such variables, a value is out of its range, or the kind has no patch with these values.

    Examples
    --------
    >>> bowl = Surface([[[0, 0, 1], [0, 1, 0], [0, 2, 1]]] * 3)
    >>> design_variables(with_design_variables(bowl, {"gamma_v": (0.5, -1)}))
    {'gamma_u': (0.0, 0.0), 'gamma_v': (0.5, -1.0)}
    """
    known = design_variables(patch)
    for name in changes:
        if name not in known:
            raise InputError(f"design variables must be among {', '.join(known) or 'none'} of the patch, got {name!r}")
    return _changed(patch, changes)


def _changed(patch: SeparableSurface, changes: Mapping[str, Sequence[float]]) -> SeparableSurface:
    if isinstance(patch, RestrictedSurface):
        return replace(patch, shape=_changed(patch.shape, changes))
    fields: Any = {name: _with_gamma(name, getattr(patch, name), gamma) for name, gamma in changes.items()}
    if isinstance(patch, Plateau):
        kept = {name: getattr(patch, name) for name in inspect.signature(Plateau).parameters}
        return Plateau(**kept | fields)
    return replace(patch, **fields)  # type: ignore[type-var]


def _with_gamma(name: str, value: Any, gamma: Sequence[float]) -> Any:
    """A field of a patch with another pair: a curve, sections, or the pair itself."""
    if isinstance(value, Curve | PlaneFamily):
        return replace(value, gamma=checked_gamma(name, gamma, value.family))
    if isinstance(value, RestrictedCurve):
        return replace(value, shape=_with_gamma(name, value.shape, gamma))
    if isinstance(value[0], SeparableCurve):
        return [_with_gamma(name, section, gamma) for section in value]
    return gamma


def design_rate(patch: SeparableSurface, variable: str) -> SurfaceOfTerms:
    """The derivative of all points of a patch by a single design variable, ``dS/dg``, as a surface.

    Parameters
    ----------
    patch
        Any surface of the protocol.
    variable
        A single one, such as "gamma_u[0]".

    Raises
    ------
    InputError
        When the patch has no such variable.

    Notes
    -----
    Exact up to rounding, but for developables and the spine of a ``Sweep``, whose rulings and frames are not affine:
    there it is a difference of the fourth order with step 1e-3, within [-1, 1], off by about 1e-9 of the size.

    Examples
    --------
    The middle of an arch rises with gamma_1: ``dphi_1/dgamma_1 = s (1 - s)``.

    >>> from gtcad.patches import cylinder
    >>> roof = cylinder(Curve([[0, 0, 0], [1, 0, 1], [2, 0, 0]]), [0, 3, 0])
    >>> s = np.sqrt(0.5)
    >>> bool(np.isclose(design_rate(roof, "a[0]").evaluate(0.5, 0.0)[2], s * (1 - s)))
    True
    """
    name, index = _single(patch, variable)
    return _rate(patch, name, index)


def _single(patch: SeparableSurface, variable: str) -> tuple[str, int]:
    singles = {f"{name}[{k}]": (name, k) for name in design_variables(patch) for k in (0, 1)}
    if variable not in singles:
        raise InputError(f"the variable must be one of {', '.join(singles) or 'none'}, got {variable!r}")
    return singles[variable]


def _rate(patch: SeparableSurface, name: str, index: int) -> SurfaceOfTerms:
    if isinstance(patch, RestrictedSurface):
        whole = RestrictedSurface(_rate(patch.shape, name, index), patch.range)
        return weighted_sum((1.0, whole))
    if isinstance(patch, Lofted) and name == "gamma_v":
        return _loft_rate(patch, index)
    gamma = design_variables(patch)[name]
    ends: Sequence[Pair] = ((1.0, 0.5), (-1.0, -0.5))
    if (isinstance(patch, Sweep) and name == "spine") or isinstance(patch, Developable):
        ends = _difference(gamma[index])
    return weighted_sum(*((weight, _changed(patch, {name: _placed(gamma, index, g)})) for g, weight in ends))


def _difference(value: float) -> list[Pair]:
    """Values within [-1, 1], and their weights in the derivative at the given one."""
    if abs(value) <= 1 - 2 * _STEP:
        return [(value + k * _STEP, weight / _STEP) for k, weight in STENCIL]
    inward = -math.copysign(_STEP, value)
    return [(value + k * inward, weight / inward) for k, weight in enumerate(_ONE_SIDED)]


def _loft_rate(patch: Lofted, index: int) -> SurfaceOfTerms:
    """With the values A of the functions f at the sections, ``d(f A^-1) = (df - f A^-1 dA) A^-1``."""
    basis = Basis(len(patch.sections) - 1, patch.gamma_v, patch.family_v)
    upper, lower = (replace(basis, gamma=_placed(patch.gamma_v, index, end)) for end in (1.0, -1.0))
    v = np.array(patch.parameters)
    change = np.linalg.solve(basis.evaluate(v), (upper.evaluate(v) - lower.evaluate(v)) / 2)
    rows, factors = patch.coefficients, patch.factors_u
    back = np.einsum("jk,ikd->ijd", change, rows)
    return SurfaceOfTerms.summed([(factors, upper, rows / 2), (factors, lower, -rows / 2), (factors, basis, -back)])


def _placed(gamma: Gamma, index: int, value: float) -> Gamma:
    return (value, gamma[1]) if index == 0 else (gamma[0], value)


def weighted_sum(*parts: tuple[float, SeparableSurface]) -> SurfaceOfTerms:
    """The sum of weighted surfaces."""
    return SurfaceOfTerms.summed([(s.factors_u, s.factors_v, weight * s.coefficients) for weight, s in parts])
