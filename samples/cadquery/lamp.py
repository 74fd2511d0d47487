"""A lamp in three parts with names and colours: a swung shade of 1.5 mm, a turned foot, a rod of the host."""

import cadquery as cq

from gtcad import Curve
from gtcad.converters.cadquery import gtRotation, gtSolid, gtSwung

profile = Curve([(70, 150), (95, 190), (38, 215), (36, 250)])
waves = [Curve([(1, 0), (1, 0.45), (0.45, 1), (0, 1)], gamma=(0.2, 0.2))]
for _ in range(3):
    waves.append(waves[-1].transformed([[0, -1], [1, 0]]))
shade = gtSolid([gtSwung(profile, wave) for wave in waves], thickness=1.5)

foot = gtSolid(gtRotation([(55, 0, 0), (55, 0, 14), (10, 0, 8), (9, 0, 40)]), caps="planar")
socket = cq.Workplane(foot).cut(cq.Workplane(origin=(0, 0, 30)).circle(4).extrude(20))
rod = cq.Workplane(origin=(0, 0, 30)).circle(4).extrude(190)

result = cq.Assembly(name="lamp")
result.add(shade, name="shade", color=cq.Color(0.98, 0.9, 0.7))
result.add(socket, name="foot", color=cq.Color(0.2, 0.22, 0.25))
result.add(rod, name="rod", color=cq.Color(0.75, 0.6, 0.3))

if __name__ == "__main__":
    for part in result.children:
        print(f"{part.name}: {sum(s.Volume() for s in part.shapes):.1f} mm^3")
