from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, Composite, Curve
from gtcad.combs import Comb, comb
from gtcad.continuity import join_curve
from gtcad.converters.occt.compat import as_edge, kernel_module
from gtcad.converters.occt.lines import comb_edges
from gtcad.converters.occt.pieces import is_valid, subshapes
from gtcad.measure import length

PLANE = Curve([[0, 0], [20, 80], [80, -60], [100, 20]], (0.8, -0.7))
SPACE = Curve([[0, 0, 0], [30, 70, 20], [70, -20, 60], [100, 30, 80]], (-0.6, 0.4))
CHAIN = Composite((PLANE, join_curve(PLANE, 3, order="G1", scale=(1.3, 0.0, 0.0), rest=[[150, 0], [160, 10]])), ("G1",))


def ends(edge: Any) -> np.ndarray:
    """First and last point of an edge, shape (2, 3), as the kernel evaluates it."""
    adaptor = kernel_module("BRepAdaptor").BRepAdaptor_Curve(as_edge(edge))
    return np.array([adaptor.Value(t).Coord() for t in (adaptor.FirstParameter(), adaptor.LastParameter())])


def teeth(shape: Any) -> np.ndarray:
    """Feet and tips of the edges outside wires, shape (n, 2, 3)."""
    return np.array([ends(edge) for edge in subshapes(shape, "EDGE", "WIRE")]).reshape(-1, 2, 3)


def wire_length(wire: Any) -> float:
    return sum(math.dist(*ends(edge)) for edge in subshapes(wire, "EDGE"))


def in_space(points: np.ndarray) -> np.ndarray:
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


@pytest.mark.parametrize("curve", [PLANE, SPACE, CHAIN], ids=["plane", "space", "chain"])
def test_every_tooth_is_an_edge_and_the_envelope_a_wire(curve: Any) -> None:
    found = comb(curve, teeth=40)
    shape = comb_edges(found)
    assert is_valid(shape)
    lines = teeth(shape)
    assert lines[:, 0] == pytest.approx(in_space(found.points), abs=1e-9)
    assert lines[:, 1] == pytest.approx(in_space(found.tips), abs=1e-9)
    (wire,) = subshapes(shape, "WIRE")
    assert wire_length(wire) == pytest.approx(np.linalg.norm(np.diff(found.envelope, axis=0), axis=1).sum(), rel=1e-9)
    assert len(subshapes(wire, "VERTEX")) == len(subshapes(wire, "EDGE")) + 1


def test_the_comb_of_a_closed_chain_is_a_closed_wire() -> None:
    corners = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    quarters = [
        Curve([a, (a[0] + b[0], a[1] + b[1]), b]) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    found = comb(Composite(tuple(quarters), ("G2",) * 4, closed=True), teeth=400, scale=1.0)
    (wire,) = subshapes(comb_edges(found), "WIRE")
    assert wire_length(wire) == pytest.approx(4 * math.pi, rel=1e-4)  # a circle of radius 2
    assert len(subshapes(wire, "VERTEX")) == len(subshapes(wire, "EDGE"))


def test_a_straight_line_leaves_nothing() -> None:
    shape = comb_edges(comb(Curve([[0, 0], [1, 1], [5, 5]])))
    assert not subshapes(shape, "EDGE")


def test_a_straight_part_has_neither_teeth_nor_envelope() -> None:
    line = Curve([[-50, 0], [-20, 0], [0, 0]])
    bent = Curve([[0, 0], [20, 0], [40, 30]])
    found = comb(Composite((line, bent), ("G1",)), teeth=60)
    shape = comb_edges(found)
    curved = int((found.curvature != 0).sum())
    assert 10 < curved < 50
    assert len(teeth(shape)) == curved
    (wire,) = subshapes(shape, "WIRE")
    points = np.concatenate([ends(edge) for edge in subshapes(wire, "EDGE")])
    assert points[:, 0].min() == pytest.approx(0.0, abs=1e-9)  # from the joint, where the tooth begins to stand


def test_a_missing_tip_parts_the_envelope() -> None:
    whole = comb(Curve([[0, 0], [10, 20], [30, 0]]), teeth=21)
    tips = np.array(whole.tips)
    tips[10] = np.nan
    shape = comb_edges(Comb(whole.parameters, whole.arc_lengths, whole.points, tips, whole.curvature, whole.scale, ()))
    assert len(teeth(shape)) == 20
    assert [len(subshapes(wire, "EDGE")) for wire in subshapes(shape, "WIRE")] == [9, 9]


def test_a_cusp_is_left_out() -> None:
    cusp = Curve([[0, 0], [0, 0], [1 / 3, 0], [1, 1]], family=BERNSTEIN)
    assert len(teeth(comb_edges(comb(cusp, teeth=20)))) == 19


def test_an_envelope_seen_by_the_kernel_is_as_long_as_the_concentric_arc() -> None:
    arc = Curve([[20, 0], [20, 20], [0, 20]])
    shape = comb_edges(comb(arc, teeth=300, scale=100.0))
    (wire,) = subshapes(shape, "WIRE")
    properties = kernel_module("GProp").GProp_GProps()
    kernel_module("BRepGProp").BRepGProp.LinearProperties_s(wire, properties)
    assert properties.Mass() == pytest.approx(length(arc) * 25 / 20, rel=1e-5)


def test_a_comb_goes_through_an_exchange_file(tmp_path: Path) -> None:
    found = comb(SPACE, teeth=12)
    control = kernel_module("STEPControl")
    writer, reader = control.STEPControl_Writer(), control.STEPControl_Reader()
    writer.Transfer(comb_edges(found), control.STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "comb.step"))
    reader.ReadFile(str(tmp_path / "comb.step"))
    reader.TransferRoots()
    tops = {tuple(np.round(point, 6)) for edge in subshapes(reader.OneShape(), "EDGE") for point in ends(edge)}
    assert {tuple(np.round(tip, 6)) for tip in found.tips} <= tops
