"""Translational sweeps."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from gtcad.factors import SurfaceOfTerms, constant_term
from gtcad.patches._patch import Patch, checked_curves
from gtcad.protocol import SeparableCurve


@dataclass(frozen=True)
class Swept(Patch):
    """The translational sweep ``S(u, v) = C(u) + T(v)``: the profile moved along the trajectory without turning.

    Of two GT curves it is the tensor-product surface with the control points ``P_ij = C_i + T_j``.

    Parameters
    ----------
    profile
        C.
    trajectory
        T, of the same dimension. Its points are displacements: where it starts at the origin, the profile is the
        boundary "v0".

    Raises
    ------
    InputError
        When one is no curve, or the dimensions differ.

    Examples
    --------
    >>> from gtcad import Curve
    >>> arch, rail = Curve([[0, 0, 0], [1, 0, 2], [2, 0, 0]]), Curve([[0, 0, 0], [0, 3, 1], [0, 6, 0]])
    >>> Swept(arch, rail).evaluate(1.0, 1.0).tolist()
    [2.0, 6.0, 0.0]
    """

    profile: SeparableCurve
    trajectory: SeparableCurve

    def __post_init__(self) -> None:
        checked_curves(profile=self.profile, trajectory=self.trajectory)

    def _built(self) -> SurfaceOfTerms:
        one_u, weights_u = constant_term(self.profile.factors)
        one_v, weights_v = constant_term(self.trajectory.factors)
        return SurfaceOfTerms.summed(
            [
                (self.profile.factors, one_v, self.profile.coefficients[:, None] * weights_v[:, None]),
                (one_u, self.trajectory.factors, weights_u[:, None, None] * self.trajectory.coefficients),
            ]
        )

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Swept:
        """The affine image: points x become ``matrix @ x + translation``, and displacements ``matrix @ x``."""
        return Swept(self.profile.transformed(matrix, translation), self.trajectory.transformed(matrix))
