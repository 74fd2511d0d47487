"""Curves on shapes of a model: what to cut out of their flat patterns, and what to draw on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from gtcad._documents import Problem, shown
from gtcad._entries import ModelShape, Strict, Yes
from gtcad.composite import Composite
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt

Name = Annotated[str, Field(min_length=1)]


@dataclass(frozen=True)
class Marking:
    """A curve on a patch.

    Parameters
    ----------
    on
        The name of a surface, or of a quilt and of one of its patches: "hull.bow".
    curve
        The name of a plane curve or chain: its points are (u, v).
    hole
        Whether the flat pattern is cut along it; else it is only drawn.
    """

    on: str
    curve: str
    hole: bool = False

    def data(self) -> dict[str, Any]:
        """The fields in a model file."""
        return {"on": self.on, "curve": self.curve} | ({"hole": True} if self.hole else {})


class MarkingFields(Strict):
    """A curve on a surface, for its flat pattern."""

    on: Name = Field(description="The name of a surface, or of a quilt and a patch of it: quilt.patch.")
    curve: Name = Field(description="The name of a plane curve of this file, whose coordinates are u and v.")
    hole: Yes = Field(default=False, description="Whether it is cut out; it is only drawn when left out.")

    def marking(self) -> Marking:
        """The marking."""
        return Marking(self.on, self.curve, self.hole)


def marking_problems(markings: Sequence[Marking], shapes: Mapping[str, ModelShape]) -> Iterator[Problem]:
    """What is wrong with markings of a model with these shapes."""
    for index, marking in enumerate(markings):
        if not _patch_named(marking.on, shapes):
            yield ("marking", index, "on"), f"must name a surface, or a patch of a quilt, got {shown(marking.on)}"
        curve = shapes.get(marking.curve)
        if not isinstance(curve, SeparableCurve | Composite) or curve.dimension != 2:
            yield ("marking", index, "curve"), f"must name a plane curve of this file, got {shown(marking.curve)}"


def _patch_named(name: str, shapes: Mapping[str, ModelShape]) -> bool:
    if name in shapes:
        return isinstance(shapes[name], SeparableSurface)
    quilts = {quilt: shape for quilt, shape in shapes.items() if isinstance(shape, Quilt)}
    return any(f"{quilt}.{patch}" == name for quilt, shape in quilts.items() for patch in shape.names)
