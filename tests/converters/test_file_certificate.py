"""Certificates: what they hold, and everything that must not be verified."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gtcad
from gtcad import Curve, Surface
from gtcad.continuity import check_join
from gtcad.converters.chain_check import Joint
from gtcad.converters.file_certificate import (
    CertifiedJoint,
    certificate_of,
    disagreements,
    model_beside,
    read_certificate,
    write_certificate,
)
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.outcome import Job, run_job
from gtcad.converters.step import write_step
from gtcad.errors import FileError, InputError

ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0))
ARCH = Curve([[0, 0, 0], [10, 30, 0], [40, 30, 5], [50, 0, 0]], (0.3, -0.5))
MODEL = {"roof": ROOF, "arch": ARCH}


def export(folder: Path, shapes=MODEL, tolerance=1e-4) -> Job:
    gtcad.dump_model(shapes, folder / "model.json")
    parts = parts_of(list(fit_shapes(shapes, {"tolerance": tolerance, "exact": False})), {}, shapes)
    write_step(folder / "a.step", parts, tolerance=tolerance, timestamp=datetime(2024, 2, 29))
    return Job(str(folder / "a.step"), "STEP", str(folder / "model.json"), "MODEL", tolerance)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A checked file with its certificate."""
    folder = tmp_path_factory.mktemp("certificate")
    outcome = run_job(export(folder))
    write_certificate(folder / "a.json", certificate_of(outcome))
    return folder, outcome


def test_it_says_what_was_found(folder):
    folder, outcome = folder
    found = read_certificate(folder / "a.json")
    assert found == certificate_of(outcome)
    assert found.proved
    assert [(shape.name, shape.verdict, tuple(shape.deviation)) for shape in found.shapes] == [
        (row.name, "proved", row.deviation) for row in outcome.report.rows
    ]
    assert (found.file.name, found.model.name, found.tolerance) == ("a.step", "model.json", 1e-4)
    assert str(folder) not in (folder / "a.json").read_text()
    assert model_beside(found, folder / "a.json") == str(folder / "model.json")
    assert disagreements(found, outcome) == ()


def test_another_file_or_model_is_not_verified(folder, tmp_path):
    certificate, job = read_certificate(folder[0] / "a.json"), export(tmp_path)
    assert disagreements(certificate, run_job(job)) == ()  # made again, from equal input, at another time
    moved = ROOF.control_points + np.array([0, 0, 1e-6])
    gtcad.dump_model(MODEL | {"roof": Surface(moved, ROOF.gamma_u)}, tmp_path / "model.json")
    problem, *_ = disagreements(certificate, run_job(job))
    assert problem.startswith("the model is not the one it is for: its SHA-256 is ")
    export(tmp_path, tolerance=1e-5)
    with open(tmp_path / "a.step", "ab") as file:
        file.write(b"\n")
    problems = disagreements(certificate, run_job(job))
    assert problems[0].startswith("the file is not the one it is for")


def forged(certificate, **changes):
    shape = certificate.shapes[0].model_copy(update=changes)
    return certificate.model_copy(update={"shapes": [shape, *certificate.shapes[1:]]})


def test_bounds_that_exclude_those_of_now_are_not_verified(folder):
    certificate, outcome = certificate_of(folder[1]), folder[1]
    low, high = certificate.shapes[0].deviation
    assert disagreements(forged(certificate, deviation=[0.0, high]), outcome) == ()
    for pair in ([0.0, 0.9 * low], [1.1 * high, 9.9e-5]):
        (problem,) = disagreements(forged(certificate, deviation=pair), outcome)
        assert "these exclude each other" in problem
    (problem,) = disagreements(forged(certificate, deviation=[low, 2e-4]), outcome)
    assert "above its tolerance" in problem


def test_everything_else_that_differs_is_said(folder):
    certificate, outcome = certificate_of(folder[1]), folder[1]
    rows = outcome.report.rows
    worse = replace(outcome, report=replace(outcome.report, rows=(replace(rows[0], verdict="estimated"), *rows[1:])))
    assert disagreements(certificate, worse) == ("shape 'roof': proved in the certificate, estimated now",)
    assert disagreements(forged(certificate, verdict="estimated"), worse) == ()
    less = replace(outcome, report=replace(outcome.report, rows=rows[1:]))
    assert disagreements(certificate, less) == ("shape 'roof' is not found now",)
    one = certificate.model_copy(update={"shapes": certificate.shapes[1:]})
    assert disagreements(one, outcome) == ("it says nothing of shape 'roof'",)
    assert "more than its" in disagreements(certificate, replace(outcome, tolerance=1e-3))[0]
    assert disagreements(certificate, replace(outcome, report=None, message="why")) == ("why",)


def test_joints_of_either_that_the_other_has_not_are_said(folder):
    certificate, outcome = certificate_of(folder[1]), folder[1]
    joint = CertifiedJoint(name="arch 1/2", wanted="G1", found="G2")
    stated = certificate.model_copy(update={"joints": [joint]})
    assert disagreements(stated, outcome) == ("joint 'arch 1/2': G2 by the certificate, nothing now",)
    found = Joint("arch 1/2", "G1", check_join(ARCH, ARCH))
    (problem,) = disagreements(certificate, replace(outcome, report=replace(outcome.report, joints=(found,))))
    assert problem.startswith("joint 'arch 1/2': nothing by the certificate, ")


def test_a_model_is_looked_for_beside_the_certificate_and_nowhere_else(folder, tmp_path):
    certificate = certificate_of(folder[1])
    (tmp_path / "inner").mkdir()
    (tmp_path / "other.json").write_text("{}")
    for name in ("../other.json", str(tmp_path / "other.json")):
        elsewhere = certificate.model_copy(update={"model": certificate.model.model_copy(update={"name": name})})
        with pytest.raises(FileError, match="is not beside it: name it with --against"):
            model_beside(elsewhere, tmp_path / "inner" / "a.json")


def test_only_checks_that_passed_have_one(folder):
    outcome = folder[1]
    with pytest.raises(InputError, match=r"did not pass: .* \(code 1\)"):
        certificate_of(replace(outcome, code=1))
    with pytest.raises(InputError, match="against a model"):
        certificate_of(replace(outcome, report=None))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gtcad_certificate": 2}, "gtcad_certificate: Input should be 1"),
        ({"tolerance": -1.0}, "tolerance: Input should be greater than 0"),
        ({"shapes": []}, "shapes: List should have at least 1 item"),
        ({"more": 1}, "more: Extra inputs are not permitted"),
        ({"file": {"name": "a", "sha256": "0"}}, r"file\.sha256: String should match"),
    ],
)
def test_bad_certificates(folder, tmp_path, change, message):
    document = json.loads((folder[0] / "a.json").read_text())
    (tmp_path / "c.json").write_text(json.dumps(document | change))
    with pytest.raises(FileError, match=f"is no certificate: {message}"):
        read_certificate(tmp_path / "c.json")


def test_bad_files(folder, tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_certificate(tmp_path / "c.json")
    (tmp_path / "c.json").write_bytes(b"\xff\xfe{")
    with pytest.raises(FileError, match="is no certificate: document: Invalid JSON"):
        read_certificate(tmp_path / "c.json")
    (tmp_path / "a.json").write_bytes((folder[0] / "a.json").read_bytes())
    with pytest.raises(FileError, match=r"its model 'model.json' is not beside it: name it with --against"):
        model_beside(read_certificate(tmp_path / "a.json"), tmp_path / "a.json")
    away = read_certificate(tmp_path / "a.json")
    away = away.model_copy(update={"model": away.model.model_copy(update={"name": "../a.json"})})
    with pytest.raises(FileError, match="is not beside it"):
        model_beside(away, tmp_path / "a.json")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_stands_in_it_it_is_read_or_refused(folder, tmp_path, data):
    """Any field, at any depth, replaced by anything; what is read still meets what certificates promise."""
    document = json.loads((folder[0] / "a.json").read_text())
    place = document
    while True:
        key = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place))))
        if not (isinstance(place[key], dict | list) and place[key] and data.draw(st.booleans())):
            break
        place = place[key]
    place[key] = data.draw(VALUES)
    (tmp_path / "c.json").write_text(json.dumps(document))
    try:
        found = read_certificate(tmp_path / "c.json")
    except FileError:
        return
    assert found.tolerance > 0
    for shape in found.shapes:
        assert shape.deviation is None or 0 <= shape.deviation[0] <= shape.deviation[1] < np.inf
    disagreements(found, folder[1])
