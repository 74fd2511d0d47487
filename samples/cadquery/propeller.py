"""A propeller of three blades: GT sections of growing pitch, lofted, capped to a solid and joined to a hub."""

import math

import cadquery as cq

from gtcad import Curve
from gtcad.converters.cadquery import gtLofted, gtSolid

HUB, HEIGHT, RADIUS, BLADES = 9.0, 12.0, 60.0, 3


def section(radius: float, chord: float, thick: float, pitch_deg: float) -> tuple[Curve, Curve]:
    """The upper and the lower side of a section across the blade, which runs along x."""
    sides = []
    for side in (1.0, -0.25):
        flat = [(-0.5, 0.0), (-0.5, 0.7 * side), (0.1, 1.3 * side), (0.5, 0.0)]
        c, s = math.cos(math.radians(pitch_deg)), math.sin(math.radians(pitch_deg))
        points = [(radius, chord * a * c - thick * b * s, chord * a * s + thick * b * c) for a, b in flat]
        sides.append(Curve(points))
    return sides[0], sides[1]


stations = [section(6, 9, 3.0, 42), section(26, 16, 2.4, 30), section(46, 15, 1.6, 20), section(RADIUS, 8, 0.8, 14)]
upper, lower = (gtLofted(sides) for sides in zip(*stations, strict=True))
blade = gtSolid([upper, lower], caps="planar")
assert blade.proved
assert blade.deviation[1] <= 1e-3

hub = cq.Workplane().circle(HUB).extrude(HEIGHT / 2, both=True)
result = hub
for k in range(BLADES):
    result = result.union(cq.Workplane(blade.rotate((0, 0, 0), (0, 0, 1), 360 * k / BLADES)))
result = result.faces(">Z").workplane().hole(5).faces(">Z").edges("%CIRCLE").edges(">X").fillet(1.5)

if __name__ == "__main__":
    print(f"propeller: {result.val().Volume():.1f} mm^3, blades within {blade.deviation[1]:.1e} mm")
