"""Hull of a model boat: GT sections lofted on both sides, plane transom and deck, a well of the host. Algebra mode."""

from build123d import Box, Cylinder, Pos, Rot, export_step

from gtcad import Curve
from gtcad.converters.build123d import GTLofted, GTRuled, GTSolid

DECK, LENGTH = 60.0, 400.0
#            x, half beam, depth of the keel, fullness of the bilge
STATIONS = [(0.0, 55.0, 18.0, 0.9), (130.0, 70.0, 4.0, 1.0), (280.0, 58.0, 2.0, 0.7), (LENGTH, 0.0, 16.0, 0.0)]


def frame(x: float, beam: float, keel: float, full: float, side: int) -> Curve:
    """A section from the keel to the deck, on one side; at the stem a straight line."""
    points = [(0, keel), (full * beam, keel), (beam, keel + 0.4 * (DECK - keel)), (beam, DECK)]
    return Curve([[x, side * y, z] for y, z in points])


port, starboard = ([frame(*station, side) for station in STATIONS] for side in (1, -1))
hull = GTSolid(
    GTLofted(port), GTLofted(starboard), GTRuled(port[0], starboard[0]), caps="planar", tolerance=1e-3, label="hull"
)
well = Pos(150, 0, DECK) * Box(160, 80, 70)
shaft = Pos(0, 0, 30) * Rot(0, 80, 0) * Cylinder(3, 250)
part = hull - well - shaft
part.label, part.color = "hull", hull.color
print(f"volume {part.volume:.0f} mm^3, displaces {hull.volume / 1e6:.4f} l, within {hull.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "hull.step")
