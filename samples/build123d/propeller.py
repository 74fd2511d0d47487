"""Propeller: twisted blades lofted through GT sections, fused with a host's hub. Algebra mode."""

from math import cos, radians, sin

from build123d import Cylinder, PolarLocations, export_step

from gtcad import Curve
from gtcad.converters.build123d import GTLofted, GTSolid

BLADES, HUB, BORE = 3, 8.0, 2.5
#            radius, chord, pitch in degrees, thickness
STATIONS = [(5.0, 9.0, 48.0, 2.6), (22.0, 15.0, 34.0, 2.0), (40.0, 15.0, 24.0, 1.5), (60.0, 6.0, 17.0, 0.8)]


def side(radius: float, chord: float, pitch: float, height: float) -> Curve:
    """One side of a section, from the leading to the trailing edge, at right angles to the radius."""
    flat = [(-0.35, 0), (-0.35, height / chord), (0.15, 0.9 * height / chord), (0.65, 0)]
    c, s = cos(radians(pitch)), sin(radians(pitch))
    return Curve([[radius, chord * (c * x - s * z), chord * (s * x + c * z)] for x, z in flat])


upper = GTLofted([side(*station) for station in STATIONS])
lower = GTLofted([side(r, c, p, -0.3 * h) for r, c, p, h in STATIONS])
blade = GTSolid(upper, lower, caps="planar", label="blade")
hub = Cylinder(HUB, 14)
propeller = hub + [place * blade for place in PolarLocations(0, BLADES)]
part = propeller - Cylinder(BORE, 20)
part.label = "propeller"
print(f"volume {part.volume:.1f} mm^3, a blade {blade.volume:.2f} mm^3 within {blade.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "propeller.step")
