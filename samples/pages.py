"""The command line of the scripts that draw the pictures of a page."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

from PIL import Image


def draw_pictures(page: str, pictures: Mapping[str, Callable[[Path], None]], colors: int = 128) -> None:
    """Draw the pictures that the command line names, or all, as PNG files of few colours: a third of the bytes."""
    parser = argparse.ArgumentParser(description=f"Draw the pictures of {page}.")
    parser.add_argument("--output", type=Path, required=True, help="the folder for the pictures")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(pictures)}; all when left out")
    given = parser.parse_args()
    if strangers := sorted(set(given.names).difference(pictures)):
        parser.error(f"no such picture: {', '.join(strangers)}")
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.names or pictures:
        path = given.output / f"{name}.png"
        pictures[name](path)
        with Image.open(path) as picture:
            small = picture.convert("RGB").quantize(colors)
        small.save(path, optimize=True)
        print(path)
