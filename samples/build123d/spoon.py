"""Spoon: a bowl that is a wall along a GT patch, and a handle that the host sweeps along a GT path. Builder mode."""

from build123d import BuildLine, BuildPart, BuildSketch, Cylinder, Ellipse, Locations, Mode, Plane, Rot, export_step
from build123d import sweep

from gtcad import Surface
from gtcad.converters.build123d import GTBezier, GTSolid

WALL = 1.2

net = [
    [[0, 0, 2]] * 5,
    [[2, -22, 2], [8, -16, -8], [8, 0, -12], [8, 16, -8], [2, 22, 2]],
    [[30, -26, 2], [28, -16, -14], [28, 0, -17], [28, 16, -14], [30, 26, 2]],
    [[56, -14, 2], [52, -8, -5], [52, 0, -6], [52, 8, -5], [56, 14, 2]],
    [[60, -4, 4], [60, -2, 4], [60, 0, 4], [60, 2, 4], [60, 4, 4]],
]
with BuildPart() as spoon:
    bowl = GTSolid(Surface(net[1:]), thickness=-WALL, label="bowl")
    with BuildLine(Plane.XZ) as path:
        spine = GTBezier((56, 1.5), (80, 6), (110, 26), (175, 12), gamma=(0.2, 0.5))
    with BuildSketch(Plane(origin=path.line @ 0, z_dir=path.line % 0)):
        Ellipse(1.6, 4.0)
    sweep(path=path.line)
    with Locations((168, 0, 13)):
        Cylinder(2, 20, mode=Mode.SUBTRACT)

part = spoon.part
print(f"volume {part.volume:.1f} mm^3, bowl {bowl.volume:.2f} mm^3 within {bowl.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "spoon.step")
