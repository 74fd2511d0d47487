"""Drawer handle: a round bar along a GT spine, on two feet of the host, its edges rounded. Algebra mode."""

from build123d import Cylinder, Pos, export_step, fillet

from gtcad import Curve
from gtcad.conics import circle
from gtcad.converters.build123d import GTSolid, GTSweep

RADIUS, FOOT = 5.0, 9.0

spine = Curve([[-60, 0, 0], [-60, 0, 45], [-25, 0, 30], [25, 0, 30], [60, 0, 45], [60, 0, 0]])
ring = circle([0, 0], RADIUS)
bar = GTSolid(*(GTSweep(piece, spine) for piece in ring.pieces), caps="planar", label="bar")
feet = [Pos(x, 0, -2) * Cylinder(FOOT, 4) for x in (-60, 60)]
blank = bar + feet

# where the bar meets a foot: an edge of a GT face and of a face of the host
meeting = [edge for edge in blank.edges() if abs(edge.center().Z) < 1e-6 and edge.bounding_box().size.X < 2.5 * RADIUS]
part = fillet(meeting, radius=1.0)
part = part - [Pos(x, 0, -4) * Cylinder(1.6, 16) for x in (-60, 60)]
part.label = "handle"
print(f"volume {part.volume:.1f} mm^3, bar {bar.volume:.2f} mm^3 within {bar.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "handle.step")
