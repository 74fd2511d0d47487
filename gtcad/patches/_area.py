"""The area of surfaces with a fixed boundary as a function of their interior, with its exact derivatives.

    A = int |X| du dv,    X = S_u x S_v,    N = X / |X|
    dA(p) = int p_u . (S_v x N) + p_v . (N x S_u) du dv

and the product of the second derivative with p is the derivative of these vectors along p, with
``dN = (dX - N (N . dX)) / |X|`` and ``dX = p_u x S_v + S_u x p_v``. The integrals are sums over one Gauss-Legendre
rule, of which these are the exact derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gtcad.patches._trial import Trial, tensor

Array = NDArray[np.float64]

_TINY = 1e-300


@dataclass(frozen=True)
class AreaFunctional:
    """The area as a function of the coordinates ``z = y / scale`` of a trial space, flat.

    In them half the sum of squares is the Dirichlet energy, which area follows to first order: steps of equal length
    matter about equally.

    Attributes
    ----------
    trial
        In space, d = 3.
    """

    trial: Trial

    @cached_property
    def _base(self) -> tuple[Array, Array]:
        return self.trial.derivative_of_base((1, 0)), self.trial.derivative_of_base((0, 1))

    @cached_property
    def _weights(self) -> Array:
        return np.multiply.outer(self.trial.u.weights, self.trial.v.weights)

    def _slopes(self, z: Array) -> tuple[Array, Array]:
        """The derivatives of ``sum phi_i psi_j y_ij``."""
        y = z.reshape(self.trial.shape) * self.trial.scale
        return self.trial.combined(y, (1, 0)), self.trial.combined(y, (0, 1))

    def _gathered(self, along_u: Array, along_v: Array) -> Array:
        """The transpose of ``_slopes`` on vectors at the nodes, with the weights of the rule."""
        u, v = self.trial.u.values, self.trial.v.values
        weights = self._weights[..., None]
        forces = tensor(u[1].T, v[0].T, weights * along_u) + tensor(u[0].T, v[1].T, weights * along_v)
        return np.asarray(forces * self.trial.scale).reshape(-1)

    def _frame(self, z: Array) -> tuple[Array, Array, Array, Array]:
        """S_u, S_v, X and |X| at the nodes; the latter analytic in z where it is not 0."""
        slopes = self._slopes(z)
        s_u, s_v = (base + slope for base, slope in zip(self._base, slopes, strict=True))
        crossed = np.cross(s_u, s_v)
        sizes = np.sqrt(np.einsum("uvd,uvd->uv", crossed, crossed))
        return s_u, s_v, crossed, np.where(sizes == 0, _TINY, sizes)  # a fold has one of many subgradients: 0

    def value(self, z: Array) -> float:
        """A."""
        return np.einsum("uv,uv", self._weights, self._frame(z)[3])[()]  # type: ignore[no-any-return]

    def gradient(self, z: Array) -> Array:
        """The derivatives of A."""
        s_u, s_v, crossed, sizes = self._frame(z)
        normal = crossed / sizes[..., None]
        return self._gathered(np.cross(s_v, normal), np.cross(normal, s_u))

    def value_and_gradient(self, z: Array) -> tuple[float, Array]:
        """Both at the cost of one."""
        s_u, s_v, crossed, sizes = self._frame(z)
        normal = crossed / sizes[..., None]
        total = float(np.einsum("uv,uv", self._weights, sizes))
        return total, self._gathered(np.cross(s_v, normal), np.cross(normal, s_u))

    def product(self, z: Array, direction: Array) -> Array:
        """The second derivative of A times a direction."""
        s_u, s_v, crossed, sizes = self._frame(z)
        normal = crossed / sizes[..., None]
        p_u, p_v = self._slopes(direction)
        change = np.cross(p_u, s_v) + np.cross(s_u, p_v)
        along = np.einsum("uvd,uvd->uv", normal, change)[..., None]
        turn = (change - normal * along) / sizes[..., None]
        return self._gathered(np.cross(p_v, normal) + np.cross(s_v, turn), np.cross(turn, s_u) + np.cross(normal, p_u))
