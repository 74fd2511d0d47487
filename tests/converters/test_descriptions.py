from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gtcad
from gtcad import Surface
from gtcad.converters import BSplineSurface, jobs
from gtcad.converters.descriptions import box_of, describe_parts
from gtcad.converters.outcome import MODEL, Job, run_job
from gtcad.converters.part import BodyFacts, EllipseArc, Part
from gtcad.measure import Estimate

PLANE = BSplineSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], [0, 1], [2, 2], 1, [0, 1], [2, 2], 1)


def test_the_box_of_an_arc_is_that_of_its_points() -> None:
    arc = EllipseArc([10, 0, 0], [3, 0, 0], [0, 2, 0], -7.0, -3.0)
    box = box_of([Part("", arc, source="ELLIPSE")])
    points = arc.evaluate(np.linspace(-7.0, -3.0, 100_001))
    assert box is not None
    assert np.allclose([box["least"], box["most"]], [points.min(axis=0), points.max(axis=0)], atol=1e-8)
    assert box_of([]) is None


def test_the_faces_of_a_body_are_one_row_whose_volume_is_measured_once() -> None:
    body, measured = counted_body()
    parts = [Part(f"box.{side}", PLANE, body=body) for side in ("left", "lid", "right")]
    (row,) = describe_parts(parts, "STEP")["bodies"]
    assert (row["name"], row["faces"], row["volume"]) == ("box", 3, 7.0)
    assert len(measured) == 1


def test_a_check_of_a_body_measures_no_volume_to_see_how_far_out_it_reaches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    body, measured = counted_body()
    monkeypatch.setattr(jobs, "read_parts", lambda path, form: [Part("lid", PLANE, body=body)])
    (tmp_path / "a.brep").write_text("its parts are given")
    gtcad.dump_model(
        {"lid": Surface(PLANE.control_points, family_u=gtcad.BERNSTEIN, family_v=gtcad.BERNSTEIN)}, tmp_path / "m.json"
    )
    outcome = run_job(Job(str(tmp_path / "a.brep"), "BREP", str(tmp_path / "m.json"), MODEL, 1e-6))
    assert (outcome.code, len(measured)) == (0, 0)


def counted_body() -> tuple[BodyFacts, list[int]]:
    """A solid that notes each time its volume is measured."""
    measured: list[int] = []

    def volume() -> Estimate:
        measured.append(1)
        return Estimate(7.0, 0.0)

    return BodyFacts("solid", True, True, volume), measured
