"""Lofts: patches through given sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms
from gtcad.patches._patch import Patch, checked_curves
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]

_LEAST_CONDITION = 1e-10  # below, not half of the digits of the sections would be left


@dataclass(frozen=True)
class Lofted(Patch):
    """The patch through n + 1 sections, ``S(u, v_k) = C_k(u)``, of degree n in v.

    ``S(u, v) = sum_j f_j(v) B_j(u)`` with the functions f_j of degree n and ``sum_j f_j(v_k) B_j = C_k``.

    Parameters
    ----------
    sections
        Curves C_0..C_n of one kind: of equal degree, design variables and family (and part of the domain). At least
        three for GT, two for BERNSTEIN.
    parameters
        v_0 < ... < v_n in [0, 1]; at equal distances from 0 to 1 unless given. Beyond the first and the last section
        the patch goes on by its formula.
    gamma_v, family_v
        Design variables and family of the functions of v.

    Raises
    ------
    InputError
        When an argument is out of its range, or the functions of v do not determine a patch through sections at these
        parameters: GT functions of degree 2 with gamma = (-1, -1) are only two.

    Notes
    -----
    The sections lie on the patch up to rounding. Like every interpolation of high degree, one through many sections may
    swing between them: parameters that are denser towards 0 and 1 help.

    Examples
    --------
    >>> from gtcad import Curve
    >>> sections = [Curve([[0, y, 0], [1, y, h], [2, y, 0]]) for y, h in ((0, 1), (1, 3), (2, 2))]
    >>> bool(np.allclose(Lofted(sections).evaluate(0.3, 0.5), sections[1].evaluate(0.3), rtol=0, atol=1e-14))
    True
    """

    sections: tuple[SeparableCurve, ...]
    parameters: tuple[float, ...]
    gamma_v: Gamma
    family_v: Family

    def __init__(
        self,
        sections: Sequence[SeparableCurve],
        parameters: Sequence[float] | None = None,
        gamma_v: Gamma = (0.0, 0.0),
        family_v: Family = GT,
    ) -> None:
        if isinstance(sections, SeparableCurve):
            raise InputError("sections must be several curves, got one")
        kept = tuple(sections)
        least = family_v.minimum_degree + 1
        if len(kept) < least:
            raise InputError(f"sections must be at least {least} for the family {family_v.name}, got {len(kept)}")
        checked_curves(**{f"sections[{k}]": section for k, section in enumerate(kept)})
        for index, section in enumerate(kept):
            if section.factors.key != kept[0].factors.key:
                kinds = f"{section.factors.key} and {kept[0].factors.key}"
                raise InputError(f"sections[{index}] and sections[0] must be of one kind, got {kinds}")
        object.__setattr__(self, "sections", kept)
        object.__setattr__(self, "parameters", _checked_parameters(parameters, len(kept)))
        object.__setattr__(self, "gamma_v", checked_gamma("gamma_v", gamma_v, family_v))
        object.__setattr__(self, "family_v", family_v)
        self._check_collocation()

    @property
    def _basis(self) -> Basis:
        return Basis(len(self.sections) - 1, self.gamma_v, self.family_v)

    def _check_collocation(self) -> None:
        condition = 1 / float(np.linalg.cond(self._collocation()))
        if condition < _LEAST_CONDITION:
            degree = len(self.sections) - 1
            raise InputError(
                f"functions of degree {degree} with gamma_v = {self.gamma_v} do not determine a patch through sections "
                f"at {self.parameters}: reciprocal condition {condition:.1g}, at least {_LEAST_CONDITION} is needed"
            )

    def _collocation(self) -> Array:
        """Values f_j(v_k), shape (sections, sections)."""
        return self._basis.evaluate(np.array(self.parameters))

    def _built(self) -> SurfaceOfTerms:
        through = np.stack([section.coefficients for section in self.sections])
        rows = np.linalg.solve(self._collocation(), through.reshape(len(through), -1)).reshape(through.shape)
        return SurfaceOfTerms(self.sections[0].factors, self._basis, rows.swapaxes(0, 1))

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Lofted:
        """The affine image: points x become ``matrix @ x + translation``."""
        sections = [section.transformed(matrix, translation) for section in self.sections]
        return Lofted(sections, self.parameters, self.gamma_v, self.family_v)


def _checked_parameters(parameters: Sequence[float] | None, count: int) -> tuple[float, ...]:
    if parameters is None:
        return tuple(np.linspace(0.0, 1.0, count).tolist())
    try:
        values = np.asarray(parameters, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (count,):
        raise InputError(f"parameters must be one number for each of {count} sections, got {parameters!r}")
    if not (values[0] >= 0 and values[-1] <= 1 and (np.diff(values) > 0).all()):
        raise InputError(f"parameters must increase within [0, 1], got {values.tolist()}")
    return tuple(values.tolist())
