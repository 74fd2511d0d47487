"""Solids as a designer means them: what closes a quilt, and how thick its wall is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms
from gtcad.measure import Estimate
from gtcad.patches._patch import handedness
from gtcad.patches.ruled import Ruled
from gtcad.protocol import SeparableSurface
from gtcad.quilt import SAME, Quilt, Use, connected

Array = NDArray[np.float64]
Caps = Literal["none", "planar"]

_SIMILAR = 1e-12  # of the scale: how far a matrix may be from a similarity by rounding
_PARAMETERS = np.arange(17) / 16


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

    Examples
    --------
    A tube of radius 1 and height 2 with planar caps:

    >>> from gtcad.patches import Rotation
    >>> tube = Rotation(Curve([[1, 0, 0], [1, 0, 2]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1])
    >>> can = Solid(Quilt.recognised([tube]), caps="planar")
    >>> round(can.closed.volume() / math.pi, 9), round(can.closed.area() / math.pi, 9)
    (2.0, 6.0)
    """

    quilt: Quilt
    caps: Caps = "none"
    thickness: float | None = None

    def __post_init__(self) -> None:
        if self.caps not in ("none", "planar"):
            raise InputError(f'caps must be "none" or "planar", got {self.caps!r}')
        if self.quilt.dimension != 3:
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

    @cached_property
    def loops(self) -> tuple[tuple[Use, ...], ...]:
        """The free sides of the quilt, those together that meet at their ends: one cap closes each loop."""
        free = self.quilt.free
        ends = {use: _points(self.quilt.patches[use.patch], use.side)[[0, -1]] for use in free}
        near = SAME * max((float(np.abs(patch.coefficients).max()) for patch in self.quilt.patches), default=0.0)
        links = [
            (one, other, False)
            for k, one in enumerate(free)
            for other in free[k + 1 :]
            if np.linalg.norm(ends[one][:, None] - ends[other], axis=-1).min() <= 4 * near
        ]
        return tuple(tuple(part) for part in connected(free, links))

    @cached_property
    def closed(self) -> Quilt:
        """The quilt around the full body: where caps are planar, each loop is closed by straight lines to its middle.

        For plane loops these are the caps, whatever their form; ``volume`` of it is exact then, and ``area`` where all
        of each cap is seen from the middle of its loop.
        """
        if self.caps == "none" or not self.loops:
            return self.quilt
        fans: list[SeparableSurface] = []
        for loop in self.loops:
            sides = [(self.quilt.patches[use.patch], use.side) for use in loop]
            middle = np.mean([_points(*side) for side in sides], axis=(0, 1))
            tip = Curve(np.stack([middle, middle]), family=BERNSTEIN)
            fans += [Ruled(_boundary(*side), tip) for side in sides]
        names = [str(k) for k in range(len(self.quilt.patches) + len(fans))]
        return Quilt.recognised([*self.quilt.patches, *fans], names=names, stated=self.quilt.edges, gap=math.inf)

    def volume(self) -> Estimate | None:
        """Volume of the full body, in the cube of the model's unit; None of a wall, or where loops have gaps.

        Caps are taken for plane, as a conversion makes sure that they are.
        """
        return self.closed.volume() if self.thickness is None and self.closed.closed else None

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
        hand = handedness(linear, _SIMILAR)
        if not hand:
            raise InputError("a wall can only be moved by a similarity: anything else makes its thickness uneven")
        scale = math.sqrt(float(np.trace(linear.T @ linear)) / 3)
        return Solid(quilt, self.caps, (1 if self.quilt.closed else hand) * scale * self.thickness)


def _points(patch: SeparableSurface, side: str) -> Array:
    fixed = np.full_like(_PARAMETERS, float(side[1]))
    u, v = (fixed, _PARAMETERS) if side[0] == "u" else (_PARAMETERS, fixed)
    return np.asarray(patch.evaluate(u, v))


def _boundary(patch: SeparableSurface, side: str) -> CurveOfTerms:
    across, along = (patch.factors_u, patch.factors_v) if side[0] == "u" else (patch.factors_v, patch.factors_u)
    row = across.rows(np.array([float(side[1])]))[:, 0]
    return CurveOfTerms(along, np.tensordot(row, patch.coefficients, (0, 0 if side[0] == "u" else 1)))
