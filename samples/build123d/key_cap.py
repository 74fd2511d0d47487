"""Key cap: ruled sides, a dished GT top, a pocket and a stem of the host. Builder mode."""

from build123d import Align, Box, BuildPart, Cylinder, Mode, export_step, fillet

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.converters.build123d import GTRuled, GTSolid

LOW, HIGH, BASE, TOP, DISH = 0.0, 8.0, 9.1, 6.4, 1.2

dish = [[[x, y, HIGH - (DISH if abs(x) + abs(y) < TOP else 0)] for y in (-TOP, 0, TOP)] for x in (-TOP, 0, TOP)]
top = Surface(dish)
rims = {side: top.boundary(side) for side in ("u0", "u1", "v0", "v1")}


def below(rim: Curve) -> Curve:
    """The straight edge at the bottom, with the parameter of the rim."""
    a, b = ([point[0] * BASE / TOP, point[1] * BASE / TOP, LOW] for point in rim.control_points[[0, -1]])
    return Curve([a, b], family=BERNSTEIN)


sides = [GTRuled(below(rim), rim, mode=Mode.PRIVATE) for rim in rims.values()]
with BuildPart() as cap:
    outside = GTSolid(top, *sides, caps="planar", tolerance=1e-4, label="key cap")
    blank = cap.part
    Box(14, 14, 2 * 5.0, mode=Mode.SUBTRACT)
    Cylinder(2.75, 6, align=(Align.CENTER, Align.CENTER, Align.MIN))
    Box(4.0, 1.2, 8, mode=Mode.SUBTRACT)
    Box(1.2, 4.0, 8, mode=Mode.SUBTRACT)
    corners = [edge for edge in cap.edges() if (edge @ 0.5).Z > 1 and abs((edge @ 0).Z - (edge @ 1).Z) > 7]
    fillet(corners, radius=0.8)

part = cap.part
print(f"volume {part.volume:.2f} mm^3, blank {blank.volume:.3f} mm^3 within {outside.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "key_cap.step")
