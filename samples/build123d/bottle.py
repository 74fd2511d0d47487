"""Bottle: GT meridians that join G2, turned to a solid, hollowed from the mouth. Builder mode."""

from build123d import Axis, BuildPart, GeomType, Locations, Plane, Torus, export_step, offset

from gtcad import Curve
from gtcad.continuity import join_curve
from gtcad.converters.build123d import GTRotation, GTSolid

WALL = 1.5

foot = Curve([[24, 0, 0], [31, 0, 1], [33, 0, 12], [32, 0, 40]])
body = join_curve(foot, 5, order="G2", scale=(2.2, 0.0, 0.0), rest=[[36, 0, 150], [12, 0, 130], [12, 0, 175]])

with BuildPart() as bottle:
    full = GTSolid(GTRotation(foot), GTRotation(body), caps="planar", label="bottle")
    offset(amount=-WALL, openings=bottle.faces().filter_by(GeomType.PLANE).sort_by(Axis.Z)[-1])
    with Locations(Plane.XY.offset(168)):
        Torus(12.5, 1.5)

part = bottle.part
print(f"volume {part.volume:.0f} mm^3, filled {full.volume / 1e6:.4f} l, within {full.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "bottle.step")
