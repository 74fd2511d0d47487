"""Bottle: GT meridians that join G2, turned and given a wall, with a ring of the host at the mouth. Builder mode."""

from build123d import BuildPart, Locations, Mode, Plane, Torus, export_step

from gtcad import Curve
from gtcad.continuity import join_curve
from gtcad.converters.build123d import GTRotation, GTSolid

WALL = 1.5

foot = Curve([[0, 0, 4], [24, 0, 4], [34, 0, -8], [33, 0, 40]])
body = join_curve(foot, 5, order="G2", scale=(2.2, 0.0, 0.0), rest=[[36, 0, 150], [12, 0, 130], [12, 0, 175]])

with BuildPart() as bottle:
    # the normals of a profile that runs upwards point to the axis: the wall grows outwards
    wall = GTSolid(
        GTRotation(foot, mode=Mode.PRIVATE), GTRotation(body, mode=Mode.PRIVATE), thickness=-WALL, label="bottle"
    )
    with Locations(Plane.XY.offset(171)):
        Torus(13, 1.5)

part = bottle.part
print(f"volume {part.volume:.1f} mm^3, wall {wall.volume:.2f} mm^3, {wall.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "bottle.step")
