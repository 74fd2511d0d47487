"""Lid of a phone case: an outline of curvature-continuous corners, extruded, rounded, hollowed. Builder mode."""

from build123d import (
    Axis,
    BuildLine,
    BuildPart,
    BuildSketch,
    Kind,
    Line,
    Locations,
    Mode,
    Plane,
    SlotOverall,
    export_step,
    extrude,
    fillet,
    make_face,
    mirror,
    offset,
)

from gtcad.converters.build123d import GTBezier

LENGTH, WIDTH, HEIGHT, CORNER, WALL = 146.0, 71.0, 9.0, 18.0, 1.6

with BuildPart() as lid:
    with BuildSketch() as outline:
        with BuildLine():
            x, y = LENGTH / 2, WIDTH / 2
            # three control points on the continuation of each line: the curvature is 0 where the corner begins
            corner = GTBezier(
                (x - CORNER, y),
                (x - 0.7 * CORNER, y),
                (x - 0.25 * CORNER, y),
                (x, y - 0.25 * CORNER),
                (x, y - 0.7 * CORNER),
                (x, y - CORNER),
            )
            Line((0, y), corner @ 0)
            Line(corner @ 1, (x, 0))
            mirror(about=Plane.YZ)
            mirror(about=Plane.XZ)
        make_face()
    extrude(amount=HEIGHT)
    blank = lid.part
    fillet(lid.faces().sort_by(Axis.Z)[0].edges(), radius=2.0)
    rounded = lid.part
    offset(amount=-WALL, openings=lid.faces().sort_by(Axis.Z)[-1], kind=Kind.INTERSECTION)
    with BuildSketch() as camera:  # noqa: SIM117 - one context a line reads better
        with Locations((-LENGTH / 2 + 22, WIDTH / 2 - 20)):
            SlotOverall(30, 18)
    extrude(amount=2 * WALL, mode=Mode.SUBTRACT)

part = lid.part
print(f"volume {part.volume:.1f} mm^3, outline within {corner.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "phone_lid.step")
