"""A drawer handle: a GT section carried along a GT spine, feet of the host, and a fillet where they meet."""

import cadquery as cq

from gtcad import Curve
from gtcad.conics import ellipse
from gtcad.converters.cadquery import gtSolid
from gtcad.patches import Sweep

spine = Curve([(-60, 0, 0), (-60, 0, 34), (0, 0, 42), (60, 0, 34), (60, 0, 0)], gamma=(0.3, 0.3))
quarters = ellipse([0, 0], [4, 0], [0, 7]).pieces
skin = [Sweep(quarter, spine, start_normal=[1, 0, 0], scale=(1, 1.5, 1)) for quarter in quarters]
body = gtSolid(skin, caps="planar")

feet = cq.Workplane().pushPoints([(-60, 0), (60, 0)]).circle(11).extrude(-4)
joined = feet.union(cq.Workplane(body))
result = joined.edges(cq.selectors.BoxSelector((-80, -20, -1), (80, 20, 1))).edges("%BSPLINE or %ELLIPSE").fillet(1.5)

if __name__ == "__main__":
    print(f"handle: {result.val().Volume():.1f} mm^3")
