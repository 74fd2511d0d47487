"""A nozzle: a throat between two GT meridians, and a flange with bolt holes of the host."""

import cadquery as cq

from gtcad.converters.cadquery import gtRotation, gtSolid

INNER = [(20, 0, 0), (20, 0, 22), (6, 0, 25), (8, 0, 45), (15, 0, 70)]
WALL = 3.0

channel = gtRotation(INNER)
outside = gtRotation([(x + WALL, 0, z) for x, _, z in INNER])
body = gtSolid([outside], caps="planar").cut(gtSolid([channel], caps="planar"))
flange = cq.Workplane().circle(36).circle(20.5).extrude(5).faces(">Z").workplane().polarArray(30, 0, 360, 6).hole(4)
result = cq.Workplane(body).union(flange).faces(">Z").edges().fillet(0.5)

if __name__ == "__main__":
    print(f"nozzle: {result.val().Volume():.1f} mm^3")
