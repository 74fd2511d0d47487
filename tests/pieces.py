"""The benchmark pieces, random shapes of every kind, and a few known ones."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from gtcad import BERNSTEIN, Composite, Curve, Surface

DATA = Path(__file__).parent / "data"


@cache
def curves() -> dict[str, Curve]:
    pieces = json.loads((DATA / "pieces.json").read_text())["curves"]
    return {piece["name"]: Curve(piece["control_points"], piece["gamma"]) for piece in pieces}


@cache
def surfaces() -> dict[str, Surface]:
    pieces = json.loads((DATA / "pieces.json").read_text())["surfaces"]
    return {piece["name"]: Surface(piece["control_points"], piece["gamma_u"], piece["gamma_v"]) for piece in pieces}


def random_gamma(rng: np.random.Generator) -> tuple[float, float]:
    """Design variables, now and then at the ends of their range or 0."""
    special = rng.choice([-1.0, 0.0, 1.0], 2)
    return tuple(np.where(rng.random(2) < 0.2, special, rng.uniform(-1, 1, 2)).tolist())


def random_curve(rng: np.random.Generator, degree: int, size: float, dimension: int = 3) -> Curve:
    """Control points that advance along x and scatter across it."""
    points = rng.normal(0, 0.4, (degree + 1, dimension))
    points[:, 0] = np.linspace(0, 1, degree + 1) + rng.normal(0, 0.1, degree + 1)
    return Curve(points * size, random_gamma(rng))


def random_surface(rng: np.random.Generator, degrees: tuple[int, int], size: float) -> Surface:
    """A net over a rectangle, scattered in all directions."""
    n, m = degrees
    points = rng.normal(0, 0.1, (n + 1, m + 1, 3))
    points[..., 0] += np.linspace(0, 1, n + 1)[:, None]
    points[..., 1] += np.linspace(0, 0.8, m + 1)
    points[..., 2] *= 2
    return Surface(points * size, random_gamma(rng), random_gamma(rng))


def ellipse(a: float = 3.0, b: float = 2.0) -> Composite:
    """Closed, of four quarters, run to the left from (a, 0)."""
    corners = [(a, 0), (a, b), (0, b), (-a, b), (-a, 0), (-a, -b), (0, -b), (a, -b), (a, 0)]
    return Composite(tuple(Curve(corners[k : k + 3]) for k in (0, 2, 4, 6)), ("G2",) * 4, True)


def graph(*heights: float) -> Curve:
    """The polynomial with these Bernstein coefficients over x in [-1, 1]."""
    return Curve(np.stack([np.linspace(-1, 1, len(heights)), heights], axis=1), family=BERNSTEIN)
