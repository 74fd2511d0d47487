"""A boat's hull: one GT side and its mirror image, a plane stern, a ruled deck, and a cockpit of the host."""

import cadquery as cq

from gtcad import Surface
from gtcad.converters.cadquery import gtRuled, gtSolid

stations = [
    [(0, 110, 0), (0, 105, -42), (0, 50, -64), (0, 0, -65)],
    [(180, 135, 0), (180, 130, -52), (180, 60, -76), (180, 0, -78)],
    [(390, 105, 20), (390, 95, -48), (390, 42, -72), (390, 0, -76)],
    [(560, 0, 30), (550, 0, -18), (530, 0, -48), (500, 0, -64)],
]
port = Surface(stations)
starboard = port.transformed([[1, 0, 0], [0, -1, 0], [0, 0, 1]])
deck = gtRuled(port.boundary("v0"), starboard.boundary("v0"))
body = gtSolid([port, starboard, deck], caps="planar")
assert body.deviation[1] <= 1e-3

cockpit = cq.Workplane(origin=(130, 0, -30)).slot2D(200, 110).extrude(100)
result = cq.Workplane(body).cut(cockpit)

if __name__ == "__main__":
    print(f"hull: {result.val().Volume() / 1e6:.3f} litres")
