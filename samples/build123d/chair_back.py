"""Chair back: a wall along one GT patch, with slots of the host cut through. Builder mode."""

from build123d import Align, Box, BuildPart, GridLocations, Mode, export_step

from gtcad import Surface
from gtcad.converters.build123d import GTSolid

THICKNESS = 8.0

rows = [
    [[-180, 10, 0], [-70, -28, 0], [70, -28, 0], [180, 10, 0]],
    [[-205, 30, 140], [-70, -30, 140], [70, -30, 140], [205, 30, 140]],
    [[-200, 70, 290], [-70, 30, 290], [70, 30, 290], [200, 70, 290]],
    [[-160, 110, 400], [-70, 95, 415], [70, 95, 415], [160, 110, 400]],
]
with BuildPart() as chair:
    back = GTSolid(Surface(rows, gamma_u=(0.3, 0.3)), thickness=THICKNESS, label="back", color="peru")
    whole = chair.part
    with GridLocations(45, 0, 5, 1):
        Box(14, 400, 180, align=(Align.CENTER, Align.CENTER, Align.MIN), mode=Mode.SUBTRACT)

part = chair.part
print(f"volume {part.volume:.0f} mm^3, whole {back.volume:.1f} mm^3 within {back.deviation[1]:.1e} mm")

if __name__ == "__main__":
    export_step(part, "chair_back.step")
