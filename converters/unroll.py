"""Every developable shape of a model as flat patterns, side by side."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gtcad._entries import ModelShape
from gtcad._markings import Marking
from gtcad.composite import Composite
from gtcad.converters.flat_outline import Sheet, draw_pattern
from gtcad.errors import InputError, NotDevelopable, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.flat_curves import FlatCurve
from gtcad.flat_pattern import FlatPattern, develop
from gtcad.flat_strip import FlatStrip, develop_strip
from gtcad.model import Model
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid


@dataclass(frozen=True, eq=False)
class Unrolled:
    """A shape of a model as a flat pattern.

    Attributes
    ----------
    name
        Its name in the model.
    sheet
        As it is drawn; None when it cannot be unrolled.
    facts
        Plain data of the pattern: patches, areas, twist, strain, estimated error.
    error
        Why there is no sheet; empty when there is one.
    """

    name: str
    sheet: Sheet | None
    facts: Mapping[str, Any]
    error: str = ""

    def as_data(self) -> dict[str, Any]:
        """Plain data, for tables and JSON; lengths in mm."""
        if self.sheet is None:
            return {"name": self.name, "error": self.error}
        low, high = self.sheet.box
        crossing = self.sheet.overlap
        return {
            "name": self.name,
            **self.facts,
            "size": (high - low).tolist(),
            "outline": self.sheet.cut[0].length,
            "holes": len(self.sheet.cut) - 1,
            "marks": len(self.sheet.mark),
            "bend_lines": len(self.sheet.bend),
            "deviation": self.sheet.deviation,
            "overlap": None if crossing is None else list(crossing.point),
        }


def unroll_model(
    model: Model, *, tolerance: float, bend_lines: int = 0, twist_deg: float = 1e-6, only: Collection[str] = ()
) -> Iterator[Unrolled]:
    """The flat patterns of the surfaces and quilts of a model one by one, going on where one cannot be unrolled.

    Parameters
    ----------
    model
        Curves and shapes for construction are left out.
    tolerance
        The largest distance of the drawing from the development, in mm.
    bend_lines, twist_deg
        As of ``draw_pattern`` and ``develop``.
    only
        Names of the shapes that are meant; all when empty.

    Raises
    ------
    InputError
        When there is no shape of such a name, or it is for construction; when a marking leaves its patch, or cannot be
        cut out.
    """
    shapes = model.in_millimetres()
    for name in only:
        if name in model.construction:
            raise InputError(f"the shape {name!r} is for construction: it is not unrolled")
        if name not in shapes:
            raise InputError(f"the model has no shape {name!r} to unroll; it has {', '.join(map(repr, shapes))}")
    for name, shape in shapes.items():
        if (only and name not in only) or isinstance(shape, SeparableCurve | Composite):
            continue
        try:
            yield _unrolled(model, name, shape, tolerance, bend_lines, twist_deg)
        except NotDevelopable as error:
            yield Unrolled(name, None, {}, error.reason)
        except (ToleranceNotMet, ToleranceBelowPrecision) as error:
            yield Unrolled(name, None, {}, str(error))


def curves_of(model: Model, only: Collection[str] = ()) -> list[str]:
    """The names of the curves that are left out."""
    shapes = model.in_millimetres()
    return [
        name
        for name, shape in shapes.items()
        if isinstance(shape, SeparableCurve | Composite) and (not only or name in only)
    ]


def idle_markings(model: Model) -> list[Marking]:
    """The markings on shapes for construction, which are not unrolled."""
    return [
        marking
        for marking in model.markings
        if any(marking.on == name or _patch_of(marking, name, model) for name in model.construction)
    ]


def _patch_of(marking: Marking, quilt: str, model: Model) -> str:
    """The name of the patch of a quilt that a marking is on; empty when it is on none of it."""
    on = marking.on
    return on.removeprefix(f"{quilt}.") if on not in model.shapes and on.startswith(f"{quilt}.") else ""


def _unrolled(
    model: Model, name: str, shape: ModelShape, tolerance: float, bend_lines: int, twist_deg: float
) -> Unrolled:
    if isinstance(shape, Solid):
        raise NotDevelopable("it is a solid; a quilt of the patches that share rulings can be unrolled")
    pattern: FlatPattern | FlatStrip
    if isinstance(shape, Quilt):
        pattern = develop_strip(shape, twist_deg=twist_deg)
    else:
        assert isinstance(shape, SeparableSurface)
        pattern = develop(shape, twist_deg=twist_deg)
    holes, marks = (_markings(model, name, pattern, hole) for hole in (True, False))
    try:
        sheet = draw_pattern(pattern, tolerance=tolerance, name=name, bend_lines=bend_lines, holes=holes, marks=marks)
    except InputError as error:
        raise InputError(f"shape {name!r}: {error}") from error
    return Unrolled(name, sheet, _facts(pattern))


def _facts(pattern: FlatPattern | FlatStrip) -> dict[str, Any]:
    parts = pattern.patterns if isinstance(pattern, FlatStrip) else (pattern,)
    losses = [part.loss for part in parts]
    worst = max(losses, key=lambda loss: loss.twist_deg)
    return {
        "patches": len(parts),
        "area": float(pattern.area),
        "surface_area": math.fsum(loss.area[1] for loss in losses),
        "twist_deg": worst.twist_deg,
        "twist_at": worst.twist_at,
        "strain": max(loss.strain for loss in losses),
        "pattern_error": pattern.error,
    }


def _markings(model: Model, name: str, pattern: FlatPattern | FlatStrip, hole: bool) -> Sequence[FlatCurve]:
    """The curves that the model states on a shape, in the plane."""
    found = []
    for marking in model.markings:
        patch = _patch_of(marking, name, model) if isinstance(pattern, FlatStrip) else ""
        if marking.hole is not hole or not (patch or marking.on == name):
            continue
        curve = model[marking.curve]
        assert isinstance(curve, SeparableCurve | Composite)
        try:
            found.append(pattern.image(patch, curve) if isinstance(pattern, FlatStrip) else pattern.image(curve))
        except InputError as error:
            raise InputError(f"shape {name!r}: marking {marking.curve!r} on {marking.on!r}: {error}") from error
    return found
