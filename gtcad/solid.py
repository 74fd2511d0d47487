"""Solids as a designer means them: what closes a quilt, and how thick its wall is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gtcad.errors import InputError
from gtcad.quilt import Quilt

Caps = Literal["none", "planar"]

_SIMILAR = 1e-12  # of the scale: how far a matrix may be from a similarity by rounding


@dataclass(frozen=True)
class Solid:
    """The body inside a quilt, or a wall along it.

    Parameters
    ----------
    quilt
        Its surface, in space.
    caps
        "planar": each loop of free edges is closed by a plane face; "none": the quilt is closed, or thickened.
    thickness
        Of a wall, in the model's unit: positive towards the side that normals point to (outwards of a closed quilt),
        negative to the other one. With caps the body is hollow. None for a full body.

    Raises
    ------
    InputError
        When an argument is out of its range.
    """

    quilt: Quilt
    caps: Caps = "none"
    thickness: float | None = None

    def __post_init__(self) -> None:
        if self.caps not in ("none", "planar"):
            raise InputError(f'caps must be "none" or "planar", got {self.caps!r}')
        if self.quilt.patches[0].dimension != 3:
            raise InputError("a solid needs patches in space, d = 3, got d = 2")
        if self.thickness is None and self.caps == "none" and self.quilt.free:
            free = ", ".join(map(self.quilt.label, self.quilt.free))
            raise InputError(f"the quilt must be closed, capped or thickened; these sides are free: {free}")
        if self.thickness is not None and not (math.isfinite(self.thickness) and self.thickness != 0):
            raise InputError(f"thickness must be a finite number other than 0, got {self.thickness}")

    @property
    def dimension(self) -> int:
        """Space dimension, 3."""
        return 3

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Solid:
        """The image under ``matrix @ x + translation``; of a wall only for similarities.

        Raises
        ------
        InputError
            When the shapes do not fit, or a wall would get an uneven thickness.
        """
        quilt = self.quilt.transformed(matrix, translation)
        if self.thickness is None:
            return Solid(quilt, self.caps)
        linear = np.asarray(matrix, dtype=np.float64)
        scale = math.sqrt(float(np.trace(linear.T @ linear)) / 3)
        if np.abs(linear.T @ linear - scale**2 * np.eye(3)).max() > _SIMILAR * scale**2:
            raise InputError("a wall can only be moved by a similarity: anything else makes its thickness uneven")
        mirror = 1.0 if np.linalg.det(linear) > 0 or self.quilt.closed else -1.0
        return Solid(quilt, self.caps, mirror * scale * self.thickness)
