"""A key cap: ruled sides between GT outlines and a dished GT top, one solid, hollowed for its stem."""

import cadquery as cq

from gtcad import BERNSTEIN, Curve
from gtcad.converters.cadquery import gtCoons, gtRuled, gtSolid

BASE, TOP, HEIGHT, DISH = 9.0, 6.5, 9.5, 1.6


def side(k: int, half: float, z: float, sag: float) -> Curve:
    """One side of a square of height z, its middle drawn down by the sag; the square is turned by k quarters."""
    points = [(-half, -half, z), (0, -half - 0.3, z - sag), (half, -half, z)]
    for _ in range(k):
        points = [(-y, x, height) for x, y, height in points]
    return Curve(points) if sag else Curve(points[::2], family=BERNSTEIN)


foot = [side(k, BASE, 0, 0) for k in range(4)]
rim = [side(k, TOP, HEIGHT, DISH) for k in range(4)]
walls = [gtRuled(low, high) for low, high in zip(foot, rim, strict=True)]
body = gtSolid([*walls, gtCoons(rim)], caps="planar")

core = cq.Workplane().rect(2 * BASE - 3, 2 * BASE - 3).workplane(offset=HEIGHT - 3.5).rect(9, 9).loft()
stem = cq.Workplane().circle(2.8).extrude(HEIGHT - 3).cut(cq.Workplane().rect(4, 1.2).rect(1.2, 4).extrude(4))
result = cq.Workplane(body).edges("|Z or %BSPLINE").edges(">Z").fillet(0.6).cut(core).union(stem)

if __name__ == "__main__":
    print(f"key cap: {result.val().Volume():.1f} mm^3")
