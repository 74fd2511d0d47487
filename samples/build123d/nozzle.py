"""Rocket nozzle: the GT contour of the throat, revolved by the host, with a flange and bolt holes. Builder mode."""

from build123d import (
    Axis,
    BuildLine,
    BuildPart,
    BuildSketch,
    Hole,
    Line,
    Plane,
    PolarLocations,
    Polyline,
    chamfer,
    export_step,
    make_face,
    revolve,
)

from gtcad.converters.build123d import GTBezier, GTJoin

with BuildPart() as nozzle:
    with BuildSketch(Plane.XZ) as section:
        with BuildLine():
            throat = GTBezier((30, 0), (30, 22), (10, 22), (10, 40), gamma=(0.3, 0.3), tolerance=1e-4)
            bell = GTJoin(throat, (14, 70), (30, 100), order="G2", tolerance=1e-4)
            Polyline(bell @ 1, (33, 100), (33, 8), (50, 8), (50, 0))
            Line((50, 0), throat @ 0)
        make_face()
    revolve(axis=Axis.Z)
    blank = nozzle.part
    with PolarLocations(42, 8):
        Hole(2.75)
    chamfer(nozzle.edges().group_by(Axis.Z)[-1], 0.5)

part = nozzle.part
print(f"volume {part.volume:.1f} mm^3, contour within {max(throat.deviation[1], bell.deviation[1]):.1e} mm")

if __name__ == "__main__":
    export_step(part, "nozzle.step")
