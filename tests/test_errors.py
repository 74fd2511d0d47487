from __future__ import annotations

import copy
import inspect
import pickle

import pytest

from gtcad import errors
from gtcad.errors import (
    ExtraMissing,
    FileError,
    GtcadError,
    InputError,
    KernelError,
    KernelMissing,
    ModelError,
    NoFeasibleDesign,
    NotDevelopable,
    SingularDevelopable,
    SingularJoin,
    ToleranceBelowPrecision,
    ToleranceNotMet,
)

INSTANCES: list[tuple[GtcadError, type[Exception], dict[str, object], str]] = [
    (InputError("gamma[0] must lie in [-1, 1], got 1.25"), ValueError, {}, "gamma[0] must lie in [-1, 1], got 1.25"),
    (
        ModelError("a.json", ["shape 1: too few points", "unit: unknown"]),
        ValueError,
        {"path": "a.json", "problems": ("shape 1: too few points", "unit: unknown")},
        "a.json: shape 1: too few points\na.json: unit: unknown",
    ),
    (
        FileError("b.step", "is a folder"),
        OSError,
        {"path": "b.step", "reason": "is a folder"},
        "b.step: is a folder",
    ),
    (
        ToleranceNotMet(1e-6, 2.5e-5, 4096, "max_spans reached"),
        ArithmeticError,
        {"requested": 1e-6, "achieved": 2.5e-5, "spans": 4096},
        "tolerance 1e-06 not met: 2.5e-05 proved with 4096 spans; max_spans reached",
    ),
    (
        ToleranceBelowPrecision(1e-18, 3e-13),
        ValueError,
        {"requested": 1e-18, "floor": 3e-13},
        "tolerance 1e-18 is below 3e-13, the least that double precision allows for this piece",
    ),
    (
        SingularJoin("degree 2, gamma_1 = -1: no tangent at the start", 3e-17),
        ArithmeticError,
        {"reason": "degree 2, gamma_1 = -1: no tangent at the start", "conditioning": 3e-17},
        "degree 2, gamma_1 = -1: no tangent at the start",
    ),
    (
        SingularDevelopable("the planes stand still", 0.25),
        ValueError,
        {"reason": "the planes stand still", "t": 0.25},
        "the planes stand still at t = 0.25",
    ),
    (
        NotDevelopable("its tangent plane twists", twist_deg=45.0, parameter=0.25),
        ValueError,
        {"reason": "its tangent plane twists", "twist_deg": 45.0, "parameter": 0.25},
        "its tangent plane twists",
    ),
    (
        NoFeasibleDesign("length", 3000, 2.5),
        ArithmeticError,
        {"objective": "length", "designs": 3000, "excess": 2.5},
        "none of 3000 designs keeps the constraints while length is made least: the best is 2.5 beyond them",
    ),
    (KernelError("the kernel refused the face"), RuntimeError, {}, "the kernel refused the face"),
    (KernelMissing("install gtcad[cadquery]"), ImportError, {}, "install gtcad[cadquery]"),
    (ExtraMissing("install gtcad[mesh]"), ImportError, {}, "install gtcad[mesh]"),
]
by_name = pytest.mark.parametrize(
    ("error", "builtin", "numbers", "message"), INSTANCES, ids=[type(i[0]).__name__ for i in INSTANCES]
)


def test_every_error_is_tested() -> None:
    defined = {c for _, c in inspect.getmembers(errors, inspect.isclass) if issubclass(c, GtcadError)}
    assert defined == {GtcadError, *(type(instance[0]) for instance in INSTANCES)}


@by_name
def test_is_also_the_fitting_builtin(
    error: GtcadError, builtin: type[Exception], numbers: dict[str, object], message: str
) -> None:
    for caught in (GtcadError, builtin):
        with pytest.raises(caught):
            raise error


@by_name
def test_carries_its_numbers(
    error: GtcadError, builtin: type[Exception], numbers: dict[str, object], message: str
) -> None:
    assert str(error) == message
    assert {name: getattr(error, name) for name in numbers} == numbers


@by_name
def test_pickles(error: GtcadError, builtin: type[Exception], numbers: dict[str, object], message: str) -> None:
    for other in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert type(other) is type(error)
        assert str(other) == message
        assert {name: getattr(other, name) for name in numbers} == numbers
