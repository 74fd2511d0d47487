"""Bracket with a GT profile: a rib that swings from the wall plate to the shelf plate. Algebra mode."""

from build123d import Box, Cylinder, GeomType, Plane, Pos, Rot, export_step, extrude, fillet

from gtcad import BERNSTEIN, Curve
from gtcad.converters.build123d import GTProfile

PLATE, REACH, RISE, WIDTH, RIB = 5.0, 60.0, 50.0, 30.0, 8.0

swing = Curve([[0, -RISE], [4, -18], [18, -4], [REACH, 0]], gamma=(0.4, 0.4))
back = Curve([[REACH, 0], [0, 0]], family=BERNSTEIN)
down = Curve([[0, 0], [0, -RISE]], family=BERNSTEIN)
profile = GTProfile(swing, back, down, tolerance=1e-4, label="rib")
rib = extrude(Plane.XZ * profile, RIB / 2, both=True)

shelf = Pos(REACH / 2 - PLATE / 2, 0, PLATE / 2) * Box(REACH + PLATE, WIDTH, PLATE)
wall = Pos(-PLATE / 2, 0, -RISE / 2) * Box(PLATE, WIDTH, RISE)
blank = rib + shelf + wall
holes = [Pos(x, y, PLATE / 2) * Cylinder(2.2, PLATE) for x in (15, 45) for y in (-10, 10)]
holes += [Pos(-PLATE / 2, y, -0.7 * RISE) * Rot(0, 90, 0) * Cylinder(2.2, PLATE) for y in (-10, 10)]
drilled = blank - holes

gt_edges = drilled.edges().filter_by(GeomType.BSPLINE)
part = fillet(gt_edges, radius=1.5)
part.label = "bracket"
print(f"volume {part.volume:.1f} mm^3, profile within {profile.deviation[1]:.1e} mm, {len(gt_edges)} GT edges rounded")

if __name__ == "__main__":
    export_step(part, "bracket.step")
