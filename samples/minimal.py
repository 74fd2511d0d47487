"""Pictures of docs/minimal.md: the minimal samples coloured by mean curvature, and the roof before and after.

``python samples/minimal.py --output docs/images`` draws them all anew; names after it draw only these.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")


from pages import draw_pictures

import gtcad
from gtcad.patches import Plateau, minimal_patch
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.surface_pictures import draw_surface

SAMPLES = Path(__file__).parent


def shape_of(sample: str) -> SeparableSurface | Quilt:
    """The shape of a sample that is no construction."""
    model = gtcad.load_model(SAMPLES / sample)
    [shape] = (model[name] for name in model if name not in model.construction)
    assert isinstance(shape, SeparableSurface | Quilt)
    return shape


def draw_tent(path: Path) -> None:
    draw_surface(shape_of("tent-roof.toml"), path, colour_by="mean curvature", title="Tent of four membranes", unit="m")


def draw_skew(path: Path) -> None:
    title = "Least area inside a skew quadrilateral"
    draw_surface(shape_of("skew-quadrilateral.toml"), path, colour_by="mean curvature", title=title)


def draw_bilinear(path: Path) -> None:
    """The Coons patch of the same four edges, which is also the Dirichlet extremal."""
    film = shape_of("skew-quadrilateral.toml")
    assert isinstance(film, Plateau)
    flat = minimal_patch(film.contour, degree=8)
    draw_surface(flat, path, colour_by="mean curvature", title="Least Dirichlet energy inside the same edges")


def draw_catenoid(path: Path) -> None:
    draw_surface(shape_of("catenoid-strip.json"), path, colour_by="mean curvature", title="Strip of a catenoid")


def draw_blend(path: Path) -> None:
    draw_surface(shape_of("handle-blend.toml"), path, colour_by="mean curvature", title="Blend of a handle: TB-Coons")


PICTURES: dict[str, Callable[[Path], None]] = {
    "tent-roof": draw_tent,
    "skew-quadrilateral": draw_skew,
    "skew-bilinear": draw_bilinear,
    "catenoid-strip": draw_catenoid,
    "handle-blend": draw_blend,
}


if __name__ == "__main__":
    draw_pictures("docs/minimal.md", PICTURES)
