"""Bonnet of a car: a GT patch that the host thickens, a flange joined G2, a scoop cut by the host. Builder mode."""

from build123d import Box, BuildPart, Locations, Mode, Rot, export_step, thicken

from gtcad import Curve, Surface
from gtcad.converters.build123d import GTFace, GTJoinPatch

SHEET = 2.0

rows = [
    [[0, -700, 40], [0, -350, 130], [0, 350, 130], [0, 700, 40]],
    [[350, -720, 70], [350, -360, 175], [350, 360, 175], [350, 720, 70]],
    [[700, -710, 90], [700, -350, 200], [700, 350, 200], [700, 710, 90]],
    [[1000, -690, 120], [1000, -340, 240], [1000, 340, 240], [1000, 690, 120]],
]
with BuildPart() as bonnet:
    panel = GTFace(Surface(rows, gamma_v=(0.3, 0.3)), label="panel")
    thicken(amount=SHEET)
    sheet = bonnet.part
    with Locations((520, 0, 170)):
        Box(160, 260, 120, rotation=Rot(0, -4, 0), mode=Mode.SUBTRACT)

front = panel.edges().sort_by(lambda edge: (edge @ 0.5).X)[0]
lip = Curve([[-25, -705, 5], [-60, -350, 60], [-60, 350, 60], [-25, 705, 5]])
flange = GTJoinPatch(panel, front, lip, order="G2", reach=40.0, label="flange")
part = bonnet.part
print(f"volume {part.volume:.0f} mm^3, panel within {panel.deviation[1]:.1e} mm, flange {flange.report.order}")

if __name__ == "__main__":
    export_step(part, "bonnet.step")
