"""A bottle: two GT meridians turned about an axis, one taken out of the other, and a neck ring of the host."""

import cadquery as cq

from gtcad.converters.cadquery import gtRotation, gtSolid

meridian = [(28, 0, 0), (42, 0, 25), (40, 0, 80), (14, 0, 95), (11, 0, 105), (12, 0, 150)]
body = gtSolid(gtRotation(meridian), caps="planar")
assert body.deviation[1] <= 1e-3

inside = gtSolid(gtRotation([(x - 1.5, y, z + 2) for x, y, z in meridian]), caps="planar")
hollow = cq.Workplane(body).cut(cq.Workplane(inside))
ring = cq.Workplane(origin=(0, 0, 138)).circle(15).circle(11.5).extrude(4)
result = hollow.union(ring.edges().fillet(0.8))

if __name__ == "__main__":
    print(f"bottle: {result.val().Volume():.1f} mm^3 of glass, holds {inside.Volume() / 1000:.0f} ml")
