"""The bonnet of bonnet.json: six patches drawn from one shape, joined G2 along all their edges.

``python samples/bonnet.py samples/bonnet.json`` writes the model anew.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import gtcad
from gtcad.model import Model
from gtcad.patch_joins import joined_sheet
from gtcad.quilt import Quilt

Array = NDArray[np.float64]

DEGREE, GAMMA = 5, (0.2, 0.2)
LENGTHS = (0.0, 0.55, 1.0)  # from the windscreen to the nose, and where the patches meet
WIDTHS = (-1.0, -0.42, 0.42, 1.0)  # from the right to the left
NAMES = (("rear right", "rear middle", "rear left"), ("front right", "front middle", "front left"))


def drawn(along: ArrayLike, across: ArrayLike) -> Array:
    """The shape as the designer means it, in mm: x forwards, y to the left, z up."""
    p, q = np.broadcast_arrays(along, across)
    x = 60 + 1140 * p - q**2 * (60 - 50 * p + 250 * p**3)
    y = q * (735 - 100 * p**2)
    crown = 985 + 40 * p - 190 * p**3 - 70 * p**8
    bulge = 26 * (1 - p**2) * np.exp(-((q / 0.36) ** 4))
    return np.stack([x, y, crown + bulge - (45 + 20 * p) * q**2 - 40 * q**6], axis=-1)


def patch(lengths: tuple[float, float], widths: tuple[float, float]) -> gtcad.Surface:
    """The patch through points of the shape."""
    t = (1 - np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)) / 2
    through = np.linalg.inv(gtcad.Basis(DEGREE, GAMMA).evaluate(t))
    points = drawn(np.interp(t, (0, 1), lengths)[:, None], np.interp(t, (0, 1), widths)[None, :])
    return gtcad.Surface(np.einsum("ai,bj,ijd->abd", through, through, points), GAMMA, GAMMA)


def speeds(marks: tuple[float, ...]) -> list[tuple[float, float, float]]:
    """How much faster each strip runs than the one before."""
    steps = np.diff(marks)
    return [(float(after / before), 0.0, 0.0) for before, after in itertools.pairwise(steps)]


def bonnet() -> Quilt:
    """The patches nearest to the drawn ones that join G2."""
    pairs_u, pairs_v = (list(itertools.pairwise(marks)) for marks in (LENGTHS, WIDTHS))
    sheet = joined_sheet(
        [[patch(u, v) for v in pairs_v] for u in pairs_u],
        ["G2"] * (len(pairs_u) - 1),
        ["G2"] * (len(pairs_v) - 1),
        scales_u=speeds(LENGTHS),
        scales_v=speeds(WIDTHS),
    )
    names = [name for row in NAMES for name in row]
    return Quilt.recognised([one for row in sheet for one in row], names=names, order="G2")


if __name__ == "__main__":
    gtcad.dump_model(Model({"bonnet": bonnet()}, "mm", {"bonnet": "#c23b33"}), Path(sys.argv[1]))
