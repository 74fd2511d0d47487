"""A shelf bracket: the curved side of its web is a GT profile, with two plates, holes and fillets of the host."""

import cadquery as cq

import gtcad.converters.cadquery  # noqa: F401 - adds the gt methods

ARM, LEG, THICK, PLATE = 120.0, 90.0, 8.0, 6.0

web = (
    cq.Workplane("XZ")
    .lineTo(ARM, 0)
    .lineTo(ARM, -12)
    .gtCurve([(60, -14), (14, -30), (12, -LEG)], gamma=(0.4, 0.4), includeCurrent=True)
    .lineTo(0, -LEG)
    .close()
    .extrude(THICK / 2, both=True)
)
curved = web.edges("%BSPLINE")
softened = curved.fillet(1.5)
top = cq.Workplane().box(ARM + 10, 40, PLATE, centered=(False, True, False))
back = cq.Workplane().box(PLATE, 40, LEG + 10, centered=(False, True, False)).translate((-PLATE, 0, PLATE - LEG - 10))
body = web.union(top).union(back)
result = (
    softened.union(top)
    .union(back)
    .faces(">Z")
    .workplane(origin=(0, 0, 0))
    .pushPoints([(40, 13), (40, -13), (100, 13), (100, -13)])
    .hole(5)
)

if __name__ == "__main__":
    print(f"bracket: {result.val().Volume():.1f} mm^3")
