"""What files state of their shapes: against known bodies, and as other readers find it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Surface, measure
from gtcad.converters import properties
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.occt import session
from gtcad.converters.occt.compat import LabelSequence, kernel_module, listed
from gtcad.converters.part import Part, Properties
from gtcad.converters.properties import stated
from gtcad.converters.step import read_step, write_step
from gtcad.patches import Ruled
from gtcad.quilt import Quilt
from gtcad.solid import Solid
from tests.converters import bodies
from tests.converters.test_step import STAMP, Plain

ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0))
CAN = Solid(Quilt.recognised([bodies.cylinder(2.0, 3.0)]), caps="planar")
XCAFDoc = kernel_module("XCAFDoc")


def prism(points, height=2.0):
    """Walls over a polygon, capped."""
    ends = zip(points, [*points[1:], points[0]], strict=True)
    floor = [Curve([(*a, 0.0), (*b, 0.0)], family=BERNSTEIN) for a, b in ends]
    walls = [Ruled(edge, edge.transformed(np.eye(3), (0, 0, height))) for edge in floor]
    return Solid(Quilt.recognised(walls), caps="planar")


def files(tmp_path, shapes, *, schema="AP242", tolerance=1e-4):
    parts = parts_of(list(fit_shapes(shapes, {"tolerance": tolerance})), {}, shapes)
    write_step(tmp_path / "a.step", parts, schema=schema, tolerance=tolerance, timestamp=STAMP)
    return tmp_path / "a.step"


def test_a_can():
    found = stated(CAN)
    assert found.area == pytest.approx(2 * math.pi * 2 * 3 + 2 * math.pi * 4, rel=1e-12)
    assert found.volume == pytest.approx(math.pi * 4 * 3, rel=1e-12)
    assert found.centroid == pytest.approx((0, 0, 1.5), abs=1e-12)
    assert np.abs(np.hypot(*found.points.T[:2]) - 2).max() < 1e-14
    assert found.points.shape == (9, 3)


def test_caps_that_are_not_seen_from_their_middle():
    """A thin C: the area of its caps is that of the polygon, not of a fan."""
    c = [(0, 0), (10, 0), (10, 1), (1, 1), (1, 9), (10, 9), (10, 10), (0, 10)]
    found = stated(prism(c))
    assert found.area == pytest.approx(2 * (10 + 8 + 10) + 2 * (10 + 1 + 9 + 8 + 9 + 1 + 10 + 10), rel=1e-12)
    assert found.volume == pytest.approx(2 * 28, rel=1e-12)
    assert found.centroid[:2] == pytest.approx(((5 * 20 + 0.5 * 8) / 28, 5), rel=1e-12)


def test_sheets_state_no_volume_and_walls_and_curves_nothing():
    found = stated(ROOF)
    assert found.volume is None
    assert found.area == pytest.approx(measure.area(ROOF), rel=1e-12)
    assert stated(Quilt.recognised([bodies.sphere(2.0)])).volume is None
    assert stated(Solid(CAN.quilt, caps="none", thickness=0.1)) is None
    assert stated(Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN)) is None
    plane = Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    assert stated(plane).centroid == pytest.approx((0.5, 0.5, 0), abs=1e-13)


@pytest.mark.parametrize("schema", ["AP242", "AP214"])
def test_what_is_stated_comes_back_bit_for_bit(tmp_path, schema):
    shapes = {"Dach 'ü' \\ 屋": ROOF, "can": CAN, "line": Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN)}
    back = read_step(files(tmp_path, shapes, schema=schema))
    assert len(back) == 5
    for part in back[:4]:
        wanted = stated(shapes[part.name.split(".")[0]])
        assert (part.properties.area, part.properties.volume, part.properties.centroid) == (
            wanted.area,
            wanted.volume,
            wanted.centroid,
        )
        assert part.properties.points.tobytes() == wanted.points.tobytes()
    assert back[1].properties is back[2].properties is back[3].properties
    assert back[4].properties is None


def test_the_oldest_schema_does_not_know_them(tmp_path):
    path = files(tmp_path, {"roof": ROOF}, schema="AP203")
    assert "validation" not in path.read_text()
    assert [part.properties for part in read_step(path)] == [None]


def test_readers_built_on_the_kernel_find_them(tmp_path):
    path = files(tmp_path, {"roof": ROOF, "can": CAN})
    with session.session("reading", session.READING_STEP):
        document = kernel_module("TDocStd").TDocStd_Document(
            kernel_module("TCollection").TCollection_ExtendedString("reader")
        )
        reader = kernel_module("STEPCAFControl").STEPCAFControl_Reader()
        reader.SetPropsMode(True)
        reader.ReadFile(str(path))
        reader.Transfer(document)
    tool = XCAFDoc.XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    labels = LabelSequence()
    tool.GetFreeShapes(labels)
    found = []
    for label in listed(labels):
        attributes, own = kernel_module("TDF").TDF_AttributeIterator(label), {}
        while attributes.More():
            value = attributes.Value()
            if type(value).__name__ in ("XCAFDoc_Area", "XCAFDoc_Volume", "XCAFDoc_Centroid"):
                got = value.Get()
                own[type(value).__name__[8:]] = got if isinstance(got, float) else got.Coord()
            attributes.Next()
        found.append(own)
    for own, shape in zip(found, (ROOF, CAN), strict=True):
        wanted = stated(shape)
        assert own["Area"] == pytest.approx(wanted.area, rel=1e-12)
        assert own["Centroid"] == pytest.approx(wanted.centroid, abs=1e-12)
        assert own.get("Volume") == (None if wanted.volume is None else pytest.approx(wanted.volume, rel=1e-12))


def test_an_independent_reader_finds_them(tmp_path):
    plain = Plain(files(tmp_path, {"can": CAN}))
    stating = {}
    for link in plain.all("PROPERTY_DEFINITION_REPRESENTATION"):
        definition, representation = (plain.entities[ref] for ref in link["PROPERTY_DEFINITION_REPRESENTATION"][:2])
        if definition.get("PROPERTY_DEFINITION", [""])[0] == "geometric validation property":
            items = [plain.entities[ref] for ref in representation["REPRESENTATION"][1]]
            stating[representation["REPRESENTATION"][0]] = items
    assert set(stating) == {"surface area", "volume", "centroid", "smooth sampling points"}
    (area,) = stating["surface area"]
    assert area["MEASURE_REPRESENTATION_ITEM"][1].param == pytest.approx(20 * math.pi, rel=1e-12)
    points = np.array([list(point["CARTESIAN_POINT"][1]) for point in stating["smooth sampling points"]])
    assert np.abs(np.hypot(*points.T[:2]) - 2).max() < 1e-14


def test_products_that_share_a_name_state_nothing(tmp_path):
    one, other = parts_of(list(fit_shapes({"a": ROOF, "b": CAN}, {"tolerance": 1e-4})), {}, {"a": ROOF, "b": CAN})
    write_step(tmp_path / "a.step", [one, replace(other, name="a")])
    assert [part.properties for part in read_step(tmp_path / "a.step")] == [None] * 4


def test_what_is_not_known_is_not_stated(tmp_path):
    part = parts_of(list(fit_shapes({"a": ROOF}, {"tolerance": 1e-4})), {})[0]
    half = Properties(None, None, (1.0, 2.0, 3.0), np.zeros((2, 3)))
    write_step(tmp_path / "a.step", [replace(part, properties=half), Part("b", part.geometry, properties=stated(ROOF))])
    first, second = read_step(tmp_path / "a.step")
    assert (first.properties.area, first.properties.centroid) == (None, (1.0, 2.0, 3.0))
    assert second.properties.points.shape == (9, 3)


@pytest.mark.parametrize(("unit", "factor"), [("INCH", 25.4), ("M", 1000.0)])
def test_units_of_other_files(tmp_path, unit, factor):
    """What a file in another unit states is converted."""
    path = files(tmp_path, {"can": CAN})
    text = path.read_text()
    milli = "LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.)"
    assert milli in text
    if unit == "M":
        text = text.replace(milli, "LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.)")
    else:
        inch = "CONVERSION_BASED_UNIT('INCH',#90001) LENGTH_UNIT() NAMED_UNIT(#90003)"
        more = (
            "#90001 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#90002);\n"
            f"#90002 = ( {milli} );\n#90003 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n"
        )
        text = text.replace(milli, inch).replace("DATA;\n", "DATA;\n" + more)
    path.write_text(text)
    found, wanted = read_step(path)[0].properties, stated(CAN)
    assert found.area == pytest.approx(wanted.area * factor**2, rel=1e-12)
    assert found.volume == pytest.approx(wanted.volume * factor**3, rel=1e-12)
    assert found.points == pytest.approx(wanted.points * factor, rel=1e-12)


@pytest.mark.parametrize(("error", "kept"), [(1e-6, True), (1e-4, False)])
def test_what_is_not_known_to_six_digits_is_not_stated(monkeypatch, error, kept):
    monkeypatch.setattr(properties, "area", lambda surface, rtol: measure.Estimate(50.0, error))
    found = stated(ROOF)
    assert found.area == (50.0 if kept else None)
    assert found.centroid is not None
