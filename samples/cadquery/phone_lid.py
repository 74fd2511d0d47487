"""The lid of a phone case: an outline whose GT corners leave the straight sides with curvature 0."""

import cadquery as cq

import gtcad.converters.cadquery  # noqa: F401 - adds the gt methods

WIDTH, LENGTH, HEIGHT, CORNER, WALL = 72.0, 148.0, 9.0, 16.0, 1.4

x, y = WIDTH / 2, LENGTH / 2
outline = []
for sx, sy, turned in ((1, 1, False), (-1, 1, True), (-1, -1, False), (1, -1, True)):
    # four points on the sides, two at each end on one line: no jump of curvature where the corner begins
    ways = [(0, 1), (0, 0.55), (0, 0.1), (0.1, 0), (0.55, 0), (1, 0)]
    corner = [(sx * (x - a * CORNER), sy * (y - b * CORNER)) for a, b in ways]
    outline.append(corner[::-1] if turned else corner)
pieces = []
for before, after in zip(outline[-1:] + outline[:-1], outline):
    pieces += [[before[-1], after[0]], after]

body = cq.Workplane().gtChain(pieces, closed=True).extrude(HEIGHT)
hollow = body.faces(">Z").shell(-WALL).faces("<Z").edges().fillet(1.2)
camera = cq.Workplane().center(-x + 16, y - 28).slot2D(34, 18, 90).extrude(2 * WALL)
result = hollow.cut(camera)

if __name__ == "__main__":
    print(f"lid: {result.val().Volume():.1f} mm^3 of plastic")
