"""Random bodies and sheets, fitted, written, read back and measured by the kernel.

Nothing that is made here meets itself, by construction:

* A box is the image of a cube under X + D, where X stretches each coordinate by itself, with slopes of g at least, and
  the derivative of D has half of g at most: |X(p) - X(q)| >= g |p - q| > |D(p) - D(q)|.
* The control points of a tube lie at angles that increase around its axis, the same at all heights, and at heights that
  increase along it. Hence (the bases are totally positive) each section is seen from the axis in one piece, in its
  plane of constant height.
* A profile runs upwards on one side of the axis.
* Sheets are graphs over a plane, or nearly so: drawn flat, and joined by moves that are small against their size.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, GT, Basis, Curve, Surface
from gtcad.continuity import Thresholds
from gtcad.converters.check import check_parts
from gtcad.converters.iges import read_iges, write_iges
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.occt.exchange import iges_items, step_items
from gtcad.converters.occt.guards import file_bytes
from gtcad.converters.occt.pieces import ShapeKey, subshapes
from gtcad.converters.occt.shells import edge_uses
from gtcad.converters.step import read_step, write_step
from gtcad.patch_joins import joined_sheet
from gtcad.patches import Rotation
from gtcad.quilt import Quilt, Use
from gtcad.restricted import Restricted
from gtcad.solid import Solid

TOLERANCE = 1e-3
LIMITS = Thresholds(gap=1e-7, angle_deg=1e-6, curvature=1e-6, curvature_rate=1e-4)
COLOURS = ("#102030", "#fe0180", "#00ff00")
FORMATS = {
    "step": (write_step, read_step, lambda path: step_items(file_bytes(path))),
    "igs": (write_iges, read_iges, lambda path: iges_items(str(path))),
}


def random_basis(rng, least=2, most=6):
    if rng.random() < 0.2:
        return Basis(int(rng.integers(max(least, 1), most + 1)), (0.0, 0.0), BERNSTEIN)
    return Basis(int(rng.integers(max(least, 2), most + 1)), rng.uniform(-0.7, 1, 2).tolist(), GT)


def surface(net, u, v):
    return Surface(net, u.gamma, v.gamma, u.family, v.family)


def turned(rng, patch):
    """The same patch with another parametrisation."""
    u, v = ((1, 0) if rng.random() < 0.5 else (0, 1) for _ in "uv")
    return patch if u == v == (0, 1) else Restricted(patch, (u, v))


def laid(rng, patches, size):
    """Of a size in mm, anywhere."""
    frame, place = size * np.linalg.qr(rng.normal(size=(3, 3)))[0], size * rng.normal(0, 2, 3)
    return [patch.transformed(frame, place) for patch in patches]


# --- three generators of closed bodies --------------------------------------------------------------------------------


def box(rng):
    bases = [random_basis(rng) for _ in range(3)]
    ticks = [np.linspace(0, 1, basis.count) for basis in bases]
    lattice = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    noise = rng.normal(size=lattice.shape)
    t = np.linspace(0, 1, 33)
    slope = min(float((basis.derivative(t) @ own).min()) for basis, own in zip(bases, ticks, strict=True))
    steepest = 0.0
    for axis in range(3):
        rows = [basis.derivative(t) if k == axis else basis.evaluate(t) for k, basis in enumerate(bases)]
        moved = np.einsum("ai,bj,ck,ijkd->abcd", *rows, noise, optimize=True)
        steepest += float((moved**2).sum(axis=-1).max())
    net = lattice + 0.5 * slope / math.sqrt(steepest) * noise
    faces = []
    for axis, end in itertools.product(range(3), (0, -1)):
        first, second = (bases[k] for k in range(3) if k != axis)
        faces.append(surface(net.take(end, axis=axis), first, second))
    return Solid(Quilt.recognised(laid(rng, [turned(rng, face) for face in faces], size_of(rng))))


def tube(rng):
    sectors = int(rng.integers(3, 6))
    along = random_basis(rng, 1)
    around = [random_basis(rng) for _ in range(sectors)]
    places = np.cumsum([0, *(basis.degree for basis in around)])
    angles = 2 * math.pi * (np.arange(places[-1]) + rng.uniform(-0.2, 0.2, places[-1])) / places[-1]
    radii = rng.uniform(0.7, 1.4, (places[-1], along.count))
    heights = np.cumsum(rng.uniform(0.3, 1.0, along.count))
    net = np.stack([radii * np.cos(angles)[:, None], radii * np.sin(angles)[:, None], heights + 0 * radii], axis=-1)
    net = np.concatenate([net, net[:1]])
    patches = [
        surface(net[a : b + 1], basis, along) for basis, (a, b) in zip(around, itertools.pairwise(places), strict=True)
    ]
    return Solid(Quilt.recognised(laid(rng, [turned(rng, patch) for patch in patches], size_of(rng))), "planar")


def turning(rng):
    """With a pole at both ends, at one or at none; in one patch with a seam, or in quarters."""
    basis = random_basis(rng)
    points = np.zeros((basis.count, 3))
    points[:, 0] = rng.uniform(0.5, 1.5, basis.count)
    points[:, 2] = np.cumsum(rng.uniform(0.2, 1.0, basis.count))
    poles = rng.random(2) < 0.5
    points[[0, -1], 0] *= ~poles
    whole = Rotation(
        Curve(points, basis.gamma, basis.family), [0, 0, 0], [0, 0, 1], 360 if rng.random() < 0.5 else -360,
        rng.uniform(0, 360),
    )  # fmt: skip
    patches = laid(rng, whole.quarters() if rng.random() < 0.5 else (whole,), size_of(rng))
    return Solid(Quilt.recognised([turned(rng, patch) for patch in patches]), "none" if poles.all() else "planar")


def size_of(rng):
    return float(10 ** rng.uniform(0.5, 2))


GENERATORS = {"box": box, "tube": tube, "turning": turning}


def random_bodies(name, count, seed):
    rng = np.random.default_rng(seed)
    return {f"{name} {k}": GENERATORS[name](rng) for k in range(count)}


# --- what a file has of them ------------------------------------------------------------------------------------------


def exported(folder, shapes):
    """For each format: parts as fitted, parts as read back, and the kernel's bodies in their order."""
    fits = list(fit_shapes(shapes, {"tolerance": TOLERANCE}))
    assert not [fit.error for fit in fits if fit.geometry is None]
    parts = parts_of(fits, {name: COLOURS[k % 3] for k, name in enumerate(shapes)})
    for suffix, (write, read, items) in FORMATS.items():
        path = folder / f"a.{suffix}"
        write(path, parts)
        bodies = list({ShapeKey(item.body): item.body for item in items(path)}.values())
        yield suffix, parts, read(path), bodies


def in_chunks(shapes, size=10) -> Iterator[dict[str, Any]]:
    names = list(shapes)
    for k in range(0, len(names), size):
        yield {name: shapes[name] for name in names[k : k + size]}


def assert_named_and_coloured(parts, read, suffix):
    names = [
        f"{part.name}.{face}" if suffix == "step" else part.name for part in parts for face in part.geometry.face_names
    ]
    assert [part.name for part in read] == names
    colours = {part.name: tuple(round(value, 6) for value in part.color) for part in parts}
    assert all(part.color == colours[part.name.partition(".")[0]] for part in read)


def assert_checked(read, shapes):
    report = check_parts(read, shapes, TOLERANCE)
    assert [(row.name, row.verdict, row.remark) for row in report.rows if row.verdict != "proved"] == []
    assert [joint.name for joint in report.joints if not joint.kept] == []
    assert report.extra == ()
    return report


def assert_bodies(folder, shapes):
    for chunk in in_chunks(shapes):
        for suffix, parts, read, bodies in exported(folder, chunk):
            assert_named_and_coloured(parts, read, suffix)
            report = assert_checked(read, chunk)
            assert len(report.joints) == sum(len(shape.quilt.edges) for shape in chunk.values())
            facts = list({id(part.body): part.body for part in read}.values())
            for shape, body, fact in zip(chunk.values(), bodies, facts, strict=True):
                assert (fact.kind, fact.closed, fact.valid) == ("solid", True, True)
                held, exact = fact.volume(), shape.volume()
                assert exact > 0
                assert abs(held - exact) <= TOLERANCE * shape.closed.area() + held.error + exact.error
                assert_edges_in_two_faces(shape, body)


def assert_edges_in_two_faces(shape, body):
    uses = edge_uses(body)
    seams = sum(edge.first.patch == edge.second.patch for edge in shape.quilt.edges)
    caps = len(shape.loops)
    assert (uses.free, uses.wrong, uses.seams) == (0, 0, seams)
    assert uses.shared == len(shape.quilt.edges) - seams + len(shape.quilt.free)
    assert uses.degenerate == len(shape.quilt.collapsed)
    assert len(subshapes(body, "FACE")) == len(shape.quilt.patches) + caps


@pytest.mark.parametrize("name", GENERATORS)
def test_random_bodies_are_closed_valid_and_of_their_volume(tmp_path, name):
    assert_bodies(tmp_path, random_bodies(name, 2, 1))


@pytest.mark.stress
@pytest.mark.parametrize(("name", "count"), [("box", 66), ("tube", 67), ("turning", 67)])
def test_random_bodies_are_closed_valid_and_of_their_volume_stress(tmp_path, name, count):
    assert_bodies(tmp_path, random_bodies(name, count, 11))


def test_volumes_of_turned_profiles_are_those_of_the_integral_over_discs():
    """Exact volumes by another way, so that a factor that both share would show."""
    x, w = np.polynomial.legendre.leggauss(60)
    t = (x + 1) / 2
    for shape in random_bodies("turning", 6, 3).values():
        first = shape.quilt.patches[0]
        first = first.shape if hasattr(first, "range") else first
        profile, direction = first.profile, np.array(first.axis_direction) / np.linalg.norm(first.axis_direction)
        out = profile.evaluate(t) - first.axis_point
        height = out @ direction
        squares = (out**2).sum(axis=1) - height**2
        volume = abs(math.pi / 2 * w @ (squares * (profile.derivative(t) @ direction)))
        assert shape.volume() == pytest.approx(volume, rel=1e-9)


# --- sheets -----------------------------------------------------------------------------------------------------------

ORDERS = ("C0", "C1", "C2", "C3", "G1", "G2", "G3")


def random_sheet(rng):
    """m x n patches, with orders and (eta, psi, omega) for each line between them."""
    shape = rng.integers(1, 5, 2) + [1, 0]
    orders = [[str(rng.choice(ORDERS)) for _ in range(count - 1)] for count in shape]
    bases = []
    for own, count in zip(orders, shape, strict=True):
        needed = [int(order[1]) for order in own]
        least = [sum(needed[max(k - 1, 0) : k + 1]) + 1 for k in range(count)]
        bases.append([random_basis(rng, max(2, a), max(2, a) + 3) for a in least])
    scales = [
        [
            (float(np.exp(rng.normal(0, 0.15))), *rng.normal(0, 0.2, 2).tolist())
            if order[0] == "G"
            else (1.0, 0.0, 0.0)
            for order in own
        ]
        for own in orders
    ]
    drawn = []
    for i, u in enumerate(bases[0]):
        drawn.append([])
        for j, v in enumerate(bases[1]):
            net = rng.normal(0, 0.05, (u.count, v.count, 3))
            net[..., 0] += (i + np.linspace(0, 1, u.count))[:, None]
            net[..., 1] += j + np.linspace(0, 1, v.count)
            net[..., 2] += 0.2 * np.sin(net[..., 0]) * np.cos(net[..., 1])
            drawn[-1].append(surface(net, u, v))
    grid = joined_sheet(drawn, *orders, scales_u=scales[0], scales_v=scales[1])
    patches = laid(rng, [patch for row in grid for patch in row], size_of(rng))
    columns = int(shape[1])
    wanted = {Use(i * columns + j, "u1"): orders[0][i] for i in range(shape[0] - 1) for j in range(columns)}
    wanted |= {Use(i * columns + j, "v1"): orders[1][j] for i in range(shape[0]) for j in range(columns - 1)}
    names = [f"{i},{j}" for i in range(shape[0]) for j in range(columns)]
    return Quilt.recognised(patches, names=names, order=wanted)


def random_sheets(count, seed):
    rng = np.random.default_rng(seed)
    return {f"sheet {k}": random_sheet(rng) for k in range(count)}


def assert_sheets(folder, shapes):
    for chunk in in_chunks(shapes):
        for suffix, parts, read, bodies in exported(folder, chunk):
            assert_named_and_coloured(parts, read, suffix)
            report = assert_checked(read, chunk)
            assert len(report.joints) == sum(len(shape.edges) for shape in chunk.values())
            for shape, body in zip(chunk.values(), bodies, strict=True):
                uses = edge_uses(body)
                assert (uses.shared, uses.free) == (len(shape.edges), len(shape.free))
                assert uses.wrong == uses.seams == uses.degenerate == 0
            for joint in report.joints:
                assert_within_limits(joint.report, int(joint.wanted[1]))


def assert_within_limits(found, order):
    assert found.gap <= LIMITS.gap
    assert order < 1 or found.tangent_angle_deg <= LIMITS.angle_deg
    assert order < 2 or found.curvature_jump <= LIMITS.curvature
    assert order < 3 or found.curvature_rate_jump <= LIMITS.curvature_rate


def test_random_sheets_stay_joined_in_their_orders(tmp_path):
    assert_sheets(tmp_path, random_sheets(4, 2))


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(4))
def test_random_sheets_stay_joined_in_their_orders_stress(tmp_path, seed):
    assert_sheets(tmp_path, random_sheets(50, 12 + seed))
