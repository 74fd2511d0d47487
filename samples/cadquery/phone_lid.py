"""The lid of a phone case: an outline whose GT corners leave the straight sides with curvature 0."""

import cadquery as cq

import gtcad.converters.cadquery  # noqa: F401 - adds the gt methods

WIDTH, LENGTH, HEIGHT, CORNER, WALL = 72.0, 148.0, 9.0, 16.0, 1.4

x, y = WIDTH / 2, LENGTH / 2
# of the six points of a corner three lie on each side: no jump of curvature where it begins
ways = [(0, 1), (0, 0.55), (0, 0.1), (0.1, 0), (0.55, 0), (1, 0)]
outline = cq.Workplane().moveTo(x, y - CORNER)
for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
    corner = [(sx * (x - a * CORNER), sy * (y - b * CORNER)) for a, b in ways]
    start, *rest = corner if sx == sy else corner[::-1]
    if (sx, sy) != (1, 1):
        outline = outline.lineTo(*start)
    outline = outline.gtCurve(rest, includeCurrent=True, degree=5)  # the kernel's shell fails at high degrees

body = outline.close().extrude(HEIGHT)
hollow = body.faces("<Z").edges().fillet(2.0).faces(">Z").shell(-WALL)
camera = cq.Workplane().center(-x + 16, y - 28).slot2D(34, 18, 90).extrude(2 * WALL)
result = hollow.cut(camera)

if __name__ == "__main__":
    print(f"lid: {result.val().Volume():.1f} mm^3 of plastic")
