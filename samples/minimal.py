"""Pictures of docs/minimal.md: the minimal samples coloured by mean curvature, and the roof before and after.

``python samples/minimal.py --output docs/images`` draws them all anew; names after it draw only these.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

from PIL import Image

import gtcad
from gtcad.patches import Plateau, minimal_patch
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.surface_pictures import draw_surface

SAMPLES = Path(__file__).parent
COLORS = 128


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


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the pictures of docs/minimal.md.")
    parser.add_argument("--output", type=Path, required=True, help="the folder for the pictures")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(PICTURES)}; all when left out")
    given = parser.parse_args()
    if strangers := sorted(set(given.names).difference(PICTURES)):
        parser.error(f"no such picture: {', '.join(strangers)}")
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.names or PICTURES:
        path = given.output / f"{name}.png"
        PICTURES[name](path)
        with Image.open(path) as picture:
            small = picture.convert("RGB").quantize(COLORS)
        small.save(path, optimize=True)
        print(path)


if __name__ == "__main__":
    main()
