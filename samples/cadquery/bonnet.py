"""A bonnet: one GT surface with a wall of 0.8 mm, trimmed by a drawn outline, and a scoop cut in."""

import cadquery as cq

from gtcad.converters.cadquery import gtSolid, gtSurface

rows = [(0, 20, 60), (330, 90, 110), (760, 150, 175), (1150, 205, 230)]
net = [[(x, w * 720, high - (high - low) * w * w) for w in (-1, -0.45, 0.45, 1)] for x, low, high in rows]
skin = gtSurface(net, gammaU=(0.2, -0.1), gammaV=(0.3, 0.3))
body = gtSolid([skin], thickness=0.8)

outline = (
    cq.Workplane()
    .moveTo(60, -560)
    .gtCurve([(500, -660), (1080, -640)], includeCurrent=True)
    .lineTo(1080, 640)
    .gtCurve([(500, 660), (60, 560)], includeCurrent=True)
    .gtCurve([(10, 200), (10, -200), (60, -560)], includeCurrent=True)
    .close()
    .extrude(400)
)
scoop = cq.Workplane().center(800, 0).slot2D(320, 60, 90).extrude(400)
result = cq.Workplane(body).intersect(outline).cut(scoop)

if __name__ == "__main__":
    print(f"bonnet: {result.val().Volume() / 1000:.1f} cm^3")
