"""Lamp: a shade that is a wall along a surface of rotation, and a foot of the host. Algebra mode."""

from build123d import Align, Cone, Cylinder, Pos, Sphere, export_step

from gtcad import Curve
from gtcad.converters.build123d import GTRotation, GTSolid

WALL = 2.0

meridian = Curve([[20, 0, 250], [70, 0, 240], [40, 0, 190], [110, 0, 160]], gamma=(0.2, -0.3))
shade = GTSolid(GTRotation(meridian), thickness=-WALL, label="shade", color="#f4e3c1")

down = (Align.CENTER, Align.CENTER, Align.MIN)
foot = Cylinder(60, 6, align=down) + Pos(0, 0, 6) * Cone(14, 5, 30, align=down) + Cylinder(5, 252, align=down)
bar = Pos(0, 0, 249) * Cylinder(20.5, 3)
part = foot + bar + shade - Pos(0, 0, 252) * Sphere(3)
part.label = "lamp"
print(f"volume {part.volume:.0f} mm^3, shade {shade.volume:.1f} mm^3, {shade.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "lamp.step")
