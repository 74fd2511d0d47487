"""Spoon: a bowl that is a wall along a GT patch, and a handle that the host sweeps along a GT path. Builder mode."""

from build123d import BuildLine, BuildPart, BuildSketch, Cylinder, Ellipse, Locations, Mode, Plane, export_step, sweep

from gtcad import Surface
from gtcad.converters.build123d import GTBezier, GTSolid

WALL = 1.2

net = [
    [[2, -12, 2], [0, -6, -3], [0, 0, -4], [0, 6, -3], [2, 12, 2]],
    [[16, -26, 2], [16, -14, -12], [16, 0, -15], [16, 14, -12], [16, 26, 2]],
    [[44, -22, 2], [44, -12, -9], [44, 0, -11], [44, 12, -9], [44, 22, 2]],
    [[60, -8, 2], [60, -4, 0], [60, 0, -0.5], [60, 4, 0], [60, 8, 2]],
]
with BuildPart() as spoon:
    bowl = GTSolid(Surface(net), thickness=-WALL, label="bowl")
    with BuildLine(Plane.XZ) as path:
        spine = GTBezier((55, -1), (80, 6), (110, 26), (175, 12), gamma=(0.2, 0.5))
    with BuildSketch(Plane(origin=path.line @ 0, z_dir=path.line % 0)):
        Ellipse(1.6, 4.0)
    sweep(path=path.line)
    with Locations((168, 0, 13)):
        Cylinder(2, 20, mode=Mode.SUBTRACT)

part = spoon.part
print(f"volume {part.volume:.1f} mm^3, bowl {bowl.volume:.2f} mm^3 within {bowl.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "spoon.step")
