"""Statements of files: kept by what was sent, broken by what was changed on the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gtcad import Surface
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.part import Properties
from gtcad.converters.stated_check import check_statements
from gtcad.converters.step import read_step, write_step
from gtcad.quilt import Quilt
from gtcad.solid import Solid
from tests.converters import bodies

TOLERANCE = 1e-3
ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0.1))
CAN = Solid(Quilt.recognised([bodies.barrel()]), caps="planar")
BALL = Quilt.recognised([bodies.sphere(20.0)])
SHAPES = {"roof": ROOF, "can": CAN, "ball": BALL}


@pytest.fixture(scope="module")
def parts():
    """What is written of the shapes."""
    return parts_of(list(fit_shapes(SHAPES, {"tolerance": TOLERANCE})), {}, SHAPES)


def sent(folder, parts):
    write_step(folder / "a.step", parts, tolerance=TOLERANCE)
    return read_step(folder / "a.step")


def test_what_is_sent_is_kept(tmp_path, parts):
    found = check_statements(sent(tmp_path, parts), TOLERANCE)
    assert [(statement.name, statement.quantity) for statement in found] == [
        *((name, quantity) for name in ("roof",) for quantity in ("area", "centre of gravity", "points")),
        *(("can", quantity) for quantity in ("area", "volume", "centre of gravity", "points")),
        *(("ball", quantity) for quantity in ("area", "centre of gravity", "points")),
    ]
    assert all(statement.kept for statement in found)
    assert found[7].found == pytest.approx(4 * math.pi * 400, rel=1e-5)


def test_another_tolerance_is_not_kept(tmp_path, parts):
    """A coarse fit passes for its own tolerance, not for one a thousand times finer."""
    coarse = parts_of(list(fit_shapes({"roof": ROOF}, {"tolerance": 0.1, "exact": False})), {}, {"roof": ROOF})
    found = sent(tmp_path, coarse)
    assert all(statement.kept for statement in check_statements(found, 0.1))
    assert {s.quantity for s in check_statements(found, 1e-5) if not s.kept} >= {"points"}


@pytest.mark.parametrize(("factor", "quantities"), [(25.4, 4), (1.001, 4)])
def test_a_scaled_shape_breaks_all_statements(tmp_path, parts, factor, quantities):
    larger = list(fit_shapes({"can": CAN.transformed(factor * np.eye(3), (0, 0, 0.1))}, {"tolerance": TOLERANCE}))
    found = sent(tmp_path, [replace(parts_of(larger, {})[0], properties=parts[1].properties)])
    assert sum(not statement.kept for statement in check_statements(found, TOLERANCE)) == quantities


def test_a_lost_face_is_noticed(tmp_path, parts):
    """A reader that loses the caps finds no solid, less area, and another centre; the points are on what is left."""
    sheet = list(fit_shapes({"can": CAN.quilt}, {"tolerance": TOLERANCE}))
    found = sent(tmp_path, [replace(parts_of(sheet, {})[0], properties=parts[1].properties)])
    kept = {statement.quantity: statement.kept for statement in check_statements(found, TOLERANCE)}
    assert kept == {"area": False, "volume": False, "centre of gravity": False, "points": True}


def test_one_moved_point_is_noticed(tmp_path, parts):
    stated = parts[0].properties
    points = stated.points + np.eye(9, 3)[:, ::-1] * 2 * TOLERANCE
    moved = Properties(stated.area, None, stated.centroid, points)
    found = check_statements(sent(tmp_path, [replace(parts[0], properties=moved)]), TOLERANCE)
    assert [statement.kept for statement in found] == [True, True, False]
    assert found[2].found == pytest.approx(2 * TOLERANCE, rel=0.1)


def test_files_without_statements(tmp_path, parts):
    assert check_statements(sent(tmp_path, [replace(part, properties=None) for part in parts]), TOLERANCE) == ()
