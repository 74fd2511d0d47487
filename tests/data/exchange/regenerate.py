"""Write the exchange files that both kernels must read: run this once in each environment.

``.venv/bin/python tests/data/exchange/regenerate.py`` writes occt7.*, the same with ``.venv-occt8`` occt8.*. The
splines are those of splines.json, which is made from model.toml when it is missing: so both kernels write equal ones.
"""

from __future__ import annotations

import json
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gtcad
from gtcad.converters import BSplineCurve, BSplineSurface, fit_curve, fit_surface, write_brep, write_iges, write_step
from gtcad.converters.part import Part
from gtcad.protocol import SeparableCurve

FOLDER = Path(__file__).parent
MODEL, SPLINES = FOLDER / "model.toml", FOLDER / "splines.json"
WRITTEN = datetime(2024, 5, 31, 12)
TOLERANCE = 1e-2  # few poles


def fitted() -> dict[str, dict[str, Any]]:
    """The fields of the spline of each shape, as JSON keeps them."""
    model = gtcad.load_model(MODEL)
    fits = {
        name: (fit_curve if isinstance(shape, SeparableCurve) else fit_surface)(shape, tolerance=TOLERANCE)
        for name, shape in model.items()
    }
    return {name: {key: plain(value) for key, value in vars(fit.spline).items()} for name, fit in fits.items()}


def plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def parts() -> list[Part]:
    """The parts that every exchange file here holds."""
    colors = gtcad.load_model(MODEL).colors
    entries = json.loads(SPLINES.read_text()).items()
    return [Part(name, spline(fields), color=rgb(colors.get(name))) for name, fields in entries]


def spline(fields: dict[str, Any]) -> BSplineCurve | BSplineSurface:
    return BSplineCurve(**fields) if "degree" in fields else BSplineSurface(**fields)


def rgb(color: str | None) -> tuple[float, float, float] | None:
    if color is None:
        return None
    red, green, blue = bytes.fromhex(color[1:])
    return red / 255, green / 255, blue / 255


def write_all(stem: Path) -> None:
    """Write the parts to stem.step, stem.igs and stem.brep."""
    write_step(stem.with_suffix(".step"), parts(), tolerance=TOLERANCE, timestamp=WRITTEN)
    write_iges(stem.with_suffix(".igs"), parts(), tolerance=TOLERANCE, timestamp=WRITTEN)
    write_brep(stem.with_suffix(".brep"), parts())


def main() -> None:
    if not SPLINES.exists():
        SPLINES.write_text(json.dumps(fitted(), ensure_ascii=False) + "\n", encoding="utf-8")
    write_all(FOLDER / f"occt{version('cadquery-ocp-novtk').partition('.')[0]}")


if __name__ == "__main__":
    main()
