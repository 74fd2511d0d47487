"""The CadQuery scripts of samples/ run; their bodies have the volumes that quadrature of their definitions gives."""

from __future__ import annotations

import contextlib
import io
import math
import re
import runpy
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, Basis, Curve

cq = pytest.importorskip("cadquery", reason="CadQuery only goes with OCCT 7.9")

from gtcad.converters.occt.faces import volume as volume_of  # noqa: E402 - needs the kernel

FOLDER = Path(__file__).parents[1] / "samples" / "cadquery"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py"))
DEVIATION = 1e-3  # what the scripts ask for, in mm

NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)
T, DT = (NODES + 1) / 2, WEIGHTS / 2


@cache
def run(name: str) -> tuple[dict[str, Any], str]:
    """What a script defines and prints; run once."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        names = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    return names, output.getvalue()


def result(name: str) -> Any:
    made = run(name)[0]["result"]
    return made.toCompound() if isinstance(made, cq.Assembly) else made.val()


def measured(shape) -> float:
    """The kernel's volume; what CadQuery says may be wrong by 1e-4 of it."""
    return sum(float(volume_of(solid.wrapped, rtol=1e-7)) for solid in shape.Solids())


# --- volumes by definition --------------------------------------------------------------------------------------------


def enclosed(curves) -> float:
    """The area inside curves in a plane, by Green's theorem."""
    total = 0.0
    for curve in curves:
        points, speeds = curve.evaluate(T), curve.derivative(T)
        total += float(DT @ (points[:, 0] * speeds[:, 1] - points[:, 1] * speeds[:, 0])) / 2
    return abs(total)


def curve_of(points, gamma=(0.0, 0.0)) -> Curve:
    return Curve(points, family=BERNSTEIN) if len(points) == 2 else Curve(points, gamma)


def turned(points) -> float:
    """pi times the integral of r^2 dz over a meridian."""
    curve = Curve(points)
    return math.pi * float(DT @ (curve.evaluate(T)[:, 0] ** 2 * curve.derivative(T)[:, 2]))


def normals(patch, u, v):
    return np.cross(patch.derivative(u, v, (1, 0)), patch.derivative(u, v, (0, 1)))


def flux(patch, field=lambda points: points) -> float:
    """The integral of a field over a patch."""
    u, v = np.meshgrid(T, T, indexing="ij")
    values = (field(patch.evaluate(u, v)) * normals(patch, u, v)).sum(axis=-1)
    return float(DT @ values @ DT)


def wall(patch, thickness: float) -> float:
    """The volume between a patch and its offset: of S + s n, by three slices that are exact for its cubic."""
    u, v = np.meshgrid(T, T, indexing="ij")
    step = 1e-5

    def normal(u, v):
        across = normals(patch, u, v)
        return across / np.linalg.norm(across, axis=-1, keepdims=True)

    n = normal(u, v)
    slopes = [(normal(u + a, v + b) - normal(u - a, v - b)) / (2 * step) for a, b in ((step, 0), (0, step))]
    sides = [patch.derivative(u, v, orders) for orders in ((1, 0), (0, 1))]
    areas = [
        float(DT @ (np.cross(*(side + s * slope for side, slope in zip(sides, slopes, strict=True))) * n).sum(-1) @ DT)
        for s in (0, thickness / 2, thickness)
    ]
    return abs(thickness) * abs(areas[0] + 4 * areas[1] + areas[2]) / 6


def sections_of(stations) -> float:
    """The volume of a blade whose sections, upper and lower side, lie in planes x = constant."""
    v, dv = T, DT
    basis = Basis(3).evaluate
    places = basis(np.linspace(0, 1, 4))
    slope = (basis(v + 1e-6) - basis(v - 1e-6)) / 2e-6
    nets = [np.linalg.solve(places, np.array([s[k].control_points for s in stations]).reshape(4, -1)) for k in (0, 1)]
    radius = np.linalg.solve(places, [s[0].control_points[0, 0] for s in stations])
    areas = []
    for row in basis(v):
        sides = [Curve((row @ net).reshape(4, 3)[:, 1:]) for net in nets]
        areas.append(enclosed([sides[0], sides[1].reversed()]))
    return float(dv @ (np.array(areas) * (slope @ radius)))


def swept(curve, area: Callable[[Any], Any]) -> float:
    """Areas across a plane spine through their centroid, times the length."""
    return float(DT @ (area(T) * np.linalg.norm(curve.derivative(T), axis=-1)))


def bernstein(values, t):
    n = len(values) - 1
    return sum(c * math.comb(n, k) * t**k * (1 - t) ** (n - k) for k, c in enumerate(values))


def bracket_web(names) -> float:
    arm, leg = names["ARM"], names["LEG"]
    curved = Curve([(arm, -12), (60, -14), (14, -30), (12, -leg)], gamma=(0.4, 0.4))
    lines = [[(0, 0), (arm, 0)], [(arm, 0), (arm, -12)], [(12, -leg), (0, -leg)], [(0, -leg), (0, 0)]]
    return names["THICK"] * enclosed([curved, *map(curve_of, lines)])


def lid_body(names) -> float:
    x, y, c = names["WIDTH"] / 2, names["LENGTH"] / 2, names["CORNER"]
    corner = Curve([(c * (1 - a), c * (1 - b)) for a, b in names["ways"]])
    lines = [curve_of(line) for line in ([(0, c), (0, 0)], [(0, 0), (c, 0)])]
    missing = 4 * (c**2 - enclosed([corner, *lines]))
    return names["HEIGHT"] * (4 * x * y - missing)


def nozzle_body(names) -> float:
    return turned([(x + names["WALL"], y, z) for x, y, z in names["INNER"]]) - turned(names["INNER"])


def handle_body(names) -> float:
    return swept(names["spine"], lambda t: math.pi * 4 * 7 * bernstein((1, 1.5, 1), t) ** 2)


def key_cap_body(names) -> float:
    patches = names["body"].exact.quilt.patches
    return sum(abs(flux(patch)) for patch in patches) / 3  # seen from the middle of the foot, which adds nothing


def hull_body(names) -> float:
    return 2 * abs(flux(names["port"], lambda points: points * [0, 1, 0]))  # deck and stern are along y


# the body of a script, and what its volume should be
BODIES: dict[str, tuple[Callable[[dict[str, Any]], Any], Callable[[dict[str, Any]], float]]] = {
    "bonnet": (lambda n: n["body"], lambda n: wall(n["skin"].exact, 0.8)),
    "bottle": (lambda n: n["body"], lambda n: turned(n["meridian"])),
    "bracket": (lambda n: n["web"].val(), bracket_web),
    "chair_back": (lambda n: n["body"], lambda n: wall(n["seat"].exact, 9.0)),
    "handle": (lambda n: n["body"], handle_body),
    "hull": (lambda n: n["body"], hull_body),
    "key_cap": (lambda n: n["body"], key_cap_body),
    "lamp": (lambda n: n["shade"], lambda n: 4 * wall(n["shade"].exact.quilt.patches[0], 1.5)),
    "nozzle": (lambda n: n["body"], nozzle_body),
    "phone_lid": (lambda n: n["body"].val(), lid_body),
    "propeller": (lambda n: n["blade"], lambda n: sections_of(n["stations"])),
    "spoon": (lambda n: n["body"], lambda n: wall(n["bowl"].exact, 1.2)),
}


def tetrahedra(shape) -> tuple[float, float]:
    """Volume and area of the triangles of a shape."""
    size = shape.BoundingBox().DiagonalLength
    points, triangles = shape.tessellate(size / 1000, 0.2)
    a, b, c = np.array([point.toTuple() for point in points])[np.array(triangles)].swapaxes(0, 1)
    across = np.cross(b - a, c - a)
    return float((a * across).sum()) / 6, float(np.linalg.norm(across, axis=-1).sum()) / 2


# --- tests ------------------------------------------------------------------------------------------------------------


def test_there_are_a_dozen_scripts_and_a_volume_for_each() -> None:
    assert len(SCRIPTS) == 12
    assert set(SCRIPTS) == set(BODIES)


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_are_short(name: str) -> None:
    assert 12 <= len((FOLDER / f"{name}.py").read_text().splitlines()) <= 60


@pytest.mark.parametrize("name", SCRIPTS)
def test_bodies_have_the_volume_of_their_definition(name: str) -> None:
    names = run(name)[0]
    body, volume = (of(names) for of in BODIES[name])
    assert body.isValid()
    assert abs(measured(body) - volume) <= DEVIATION * body.Area() + 1e-7 * volume


@pytest.mark.parametrize("name", SCRIPTS)
def test_results_are_valid_solids_with_the_volume_of_their_triangles(name: str) -> None:
    shape = result(name)
    assert shape.isValid()
    assert len(shape.Solids()) == (3 if name == "lamp" else 1)
    volume, area = tetrahedra(shape)
    assert volume > 0
    assert abs(volume - measured(shape)) <= area * shape.BoundingBox().DiagonalLength / 1000


@pytest.mark.parametrize("name", SCRIPTS)
def test_results_are_printed(name: str) -> None:
    names, printed = run(name)
    made = names["result"]
    shapes = [part.shapes[0] for part in made.children] if isinstance(made, cq.Assembly) else [made.val()]
    figures = [float(number) for number in re.findall(r": ([\d.]+)", printed)]
    units = {"cm^3": 1e3, "litres": 1e6}
    unit = next((size for word, size in units.items() if word in printed), 1.0)
    assert len(figures) == len(shapes)
    for figure, shape in zip(figures, shapes, strict=True):
        assert math.isclose(figure * unit, shape.Volume(), rel_tol=1e-3)


@pytest.mark.parametrize("name", SCRIPTS)
def test_results_come_back_from_step(name: str, tmp_path: Path) -> None:
    made, path = run(name)[0]["result"], tmp_path / f"{name}.step"
    made.export(str(path))
    read = cq.importers.importStep(str(path))
    before, after = (measured(shape) for shape in (result(name), cq.Compound.makeCompound(read.vals())))
    assert abs(after - before) <= 1e-5 * result(name).Area()  # mm: trimmed edges are found anew within their tolerance
    assert len(read.faces().vals()) == len(result(name).Faces())
    assert all(shape.isValid() for shape in read.solids().vals())


def test_the_lamp_keeps_names_and_colours(tmp_path: Path) -> None:
    lamp, path = run("lamp")[0]["result"], tmp_path / "lamp.step"
    lamp.export(str(path))
    read = {part.name: part.color.toTuple() for part in cq.Assembly.importStep(str(path)).children}
    assert list(read) == ["shade", "foot", "rod"]
    for part in lamp.children:
        np.testing.assert_allclose(read[part.name], part.color.toTuple(), rtol=0, atol=1e-6)
