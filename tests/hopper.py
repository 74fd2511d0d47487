"""A hopper from a rectangle to a circle: triangles between sides and points, cones between corners and arcs."""

from __future__ import annotations

from typing import Any

from gtcad import BERNSTEIN, Curve
from gtcad.patches import Ruled, cone

LENGTH, WIDTH, HEIGHT, RADIUS = 400.0, 300.0, 300.0, 100.0


def line(a: Any, b: Any) -> Curve:
    """A line segment."""
    return Curve([a, b], family=BERNSTEIN)


def hopper() -> list[Ruled]:
    """The nine patches, the seam in the middle of one side."""
    x, y, z, r = LENGTH / 2, WIDTH / 2, HEIGHT, RADIUS
    corners = [(x, -y, 0), (x, y, 0), (-x, y, 0), (-x, -y, 0)]
    points = [(0, -r, z), (r, 0, z), (0, r, z), (-r, 0, z)]
    between = [(r, -r, z), (r, r, z), (-r, r, z), (-r, -r, z)]
    seam = (0, -y, 0)
    patches = [cone(line(seam, corners[0]), points[0])]
    for k in range(4):
        following = points[(k + 1) % 4]
        patches.append(cone(Curve([points[k], between[k], following]), corners[k]))
        if k < 3:
            patches.append(cone(line(corners[k], corners[k + 1]), following))
    patches.append(cone(line(corners[3], seam), points[0]))
    return patches
