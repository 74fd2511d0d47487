"""A spoon: the bowl is one GT surface with a wall of 1.2 mm, the handle a swept bar of the host along a GT curve."""

import cadquery as cq

from gtcad.converters.cadquery import gtCurve, gtSolid, gtSurface

outer = [((-20, 21), 15), ((14, 23), 17), ((30, 5), 2)]
net = [[(x, y * s, -z * deep) for s, z in ((-1, 0), (-0.6, 1), (0.6, 1), (1, 0))] for (x, y), deep in outer]
net.insert(0, [(-32, y, 0) for y in (-2, -0.7, 0.7, 2)])
bowl = gtSurface(net)
body = gtSolid([bowl], thickness=1.2)

spine = gtCurve([(29, 0, -0.5), (55, 0, 2), (80, 0, 22), (125, 0, 14), (150, 0, 16)])
bar = cq.Workplane(cq.Plane(origin=(29, 0, -0.5), normal=spine.tangentAt(0))).ellipse(1.4, 4.5).sweep(spine)
result = cq.Workplane(body).union(bar)

if __name__ == "__main__":
    print(f"spoon: {result.val().Volume():.1f} mm^3, offset within {body.deviation[1]:.1e} mm (estimated)")
