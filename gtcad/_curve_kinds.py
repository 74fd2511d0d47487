"""The kinds of curves and chains of curves that a model file can hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from gtcad import _checks as checks
from gtcad import conics
from gtcad._documents import Location, shown
from gtcad._entries import (
    INLINE,
    NAMED,
    CurvePoint,
    DesignVariables,
    FamilyName,
    Interval,
    PointField,
    ShapeEntry,
    Shapes,
    Strict,
    SurfacePoint,
    Yes,
    basis_fields,
    gamma_fields,
    inline_or_named,
)
from gtcad.basis import FAMILIES
from gtcad.composite import Composite, checked_places
from gtcad.continuity import Thresholds
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import Restricted, RestrictedCurve

Order = Annotated[str, Field(pattern="^[CG][0-3]$")]
Index = Annotated[int, Field(ge=0)]
Angle = Annotated[float, Field(ge=-checks.MAX_ANGLE, le=checks.MAX_ANGLE)]
Length = Annotated[float, Field(gt=0)]
Normal = Annotated[SurfacePoint | None, BeforeValidator(checks.optional(checks.point(3)))]
_MET = Thresholds(gap=1e-10)  # in the model's unit: below 1e-7 mm in every unit


class CurveFields(Strict):
    """A GT-Bezier or Bezier curve, or a part of one."""

    family: FamilyName = Field(default="GT", description="The basis: generalized trigonometric, or classical Bezier.")
    gamma: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family")))] = Field(
        default=None, description="Design variables gamma_1, gamma_2; (0, 0) when left out; none for bernstein."
    )
    range: Annotated[Interval | None, BeforeValidator(checks.optional(checks.interval))] = Field(
        default=None,
        description="The part of the parameter interval [0, 1] that is meant; from a to b, also backwards.",
    )
    control_points: Annotated[list[CurvePoint], BeforeValidator(checks.curve_points)] = Field(
        description="The degree + 1 points [x, y] or [x, y, z] in the file's unit; degree 2 to 60, bernstein from 1.",
        min_length=2,
        max_length=61,
    )

    def curve(self) -> SeparableCurve:
        """The curve, restricted to its range if it has one."""
        curve = Curve(self.control_points, self.gamma or (0.0, 0.0), FAMILIES[self.family])
        return curve if self.range is None else Restricted(curve, self.range)


CurveName = Annotated[str, Field(description="The name of another shape of this file."), Tag(NAMED)]
CurveField = Annotated[Annotated[CurveFields, Tag(INLINE)] | CurveName, Discriminator(inline_or_named)]


class CurveEntry(ShapeEntry, CurveFields):
    """A GT-Bezier or Bezier curve, or a part of one."""

    kind: Literal["curve"]

    def build(self, shapes: Shapes) -> SeparableCurve:
        """The curve."""
        return self.curve()


class CompositeEntry(ShapeEntry):
    """A chain of curves, open or closed, joined in the wanted orders."""

    kind: Literal["composite"]
    pieces: list[CurveField] = Field(
        description="The curves in order, spelled out or the names of curves of this file.", min_length=1
    )
    orders: Annotated[Order | list[Order], BeforeValidator(checks.orders)] = Field(
        description="The wanted order at each joint, C0 to C3 or G0 to G3; one text for all joints."
    )
    closed: Yes = Field(default=False, description="Whether the last piece ends where the first begins.")
    fixed: Annotated[list[tuple[Index, Index]], BeforeValidator(checks.places)] = Field(
        default=[], description="Pairs [piece, control point], from 0, that stay where they are."
    )

    def references(self) -> Iterator[tuple[Location, str]]:
        """The named pieces."""
        for index, piece in enumerate(self.pieces):
            if isinstance(piece, str):
                yield ("pieces", index), piece

    def build(self, shapes: Shapes) -> Composite:
        """The chain; control points are moved, as little as possible, when the joints do not meet their orders yet."""
        pieces: list[SeparableCurve] = []
        for index, entry in enumerate(self.pieces):
            piece = shapes[entry] if isinstance(entry, str) else entry.curve()
            if not isinstance(piece, SeparableCurve):
                kind = "a chain" if isinstance(piece, Composite) else "a surface"
                raise InputError(f"pieces[{index}] must be a curve, {shown(entry)} is {kind}")
            pieces.append(piece)
        joints = len(pieces) - (0 if self.closed else 1)
        orders = [self.orders] * joints if isinstance(self.orders, str) else self.orders
        drawn = Composite(tuple(pieces), tuple(orders), self.closed)
        fixed = checked_places("fixed", pieces, self.fixed)
        problem = drawn.unmet(thresholds=_MET)
        if not problem:
            return drawn
        curves = [piece for piece in pieces if isinstance(piece, Curve)]
        if len(curves) < len(pieces):
            raise InputError(f"{problem}; only pieces without a range have control points that can be moved")
        chain = Composite.solved(curves, orders, closed=self.closed, fixed=fixed)
        if problem := chain.unmet(thresholds=_MET):
            raise InputError(f"{problem}, and moving control points as little as possible does not change that")
        return chain


class ParabolaEntry(ShapeEntry):
    """An arc of a parabola."""

    kind: Literal["parabola"]
    control_points: Annotated[list[CurvePoint], BeforeValidator(checks.triangle)] = Field(
        description="Its first point, the point where its end tangents meet, and its last point.",
        min_length=3,
        max_length=3,
    )

    def build(self, shapes: Shapes) -> Curve:
        """The arc, a GT-Bezier curve of degree 2."""
        return conics.parabola(*self.control_points)


class CircleEntry(ShapeEntry):
    """A circle."""

    kind: Literal["circle"]
    center: PointField = Field(description="[x, y] or [x, y, z] in the file's unit.")
    radius: Annotated[Length, BeforeValidator(checks.positive)] = Field(description="In the file's unit.")
    normal: Normal = Field(default=None, description="Of its plane in space; the direction of z when left out.")

    def build(self, shapes: Shapes) -> Composite:
        """The circle as a closed chain of quarters."""
        return conics.circle(self.center, self.radius, self.normal)


class EllipseEntry(ShapeEntry):
    """An ellipse."""

    kind: Literal["ellipse"]
    center: PointField = Field(description="[x, y] or [x, y, z] in the file's unit.")
    axis_a: PointField = Field(description="A half axis as a vector: the ellipse begins at its tip.")
    axis_b: PointField = Field(description="The other half axis, or any conjugate half diameter.")

    def build(self, shapes: Shapes) -> Composite:
        """The ellipse as a closed chain of quarters."""
        return conics.ellipse(self.center, self.axis_a, self.axis_b)


class ArcEntry(ShapeEntry):
    """An arc of a circle or an ellipse."""

    kind: Literal["arc"]
    center: PointField = Field(description="[x, y] or [x, y, z] in the file's unit.")
    radius: Annotated[Length | None, BeforeValidator(checks.optional(checks.positive))] = Field(
        default=None, description="Of an arc of a circle, in the file's unit."
    )
    normal: Normal = Field(
        default=None, description="Of the circle's plane in space; the direction of z when left out."
    )
    axis_a: Annotated[CurvePoint | None, BeforeValidator(checks.optional(checks.point(2, 3)))] = Field(
        default=None, description="Of an arc of an ellipse: the half axis at 0 degrees, as a vector."
    )
    axis_b: Annotated[CurvePoint | None, BeforeValidator(checks.optional(checks.point(2, 3)))] = Field(
        default=None, description="The half axis, or conjugate half diameter, at 90 degrees."
    )
    angles: Annotated[tuple[Angle, Angle], BeforeValidator(checks.angles)] = Field(
        description="The first and the last angle in degrees, at most 360 apart; the greater one first runs backwards."
    )

    def build(self, shapes: Shapes) -> Composite:
        """The arc as a chain of quarters, the last one a part of a quarter."""
        if self.radius is not None:
            if self.axis_a is not None or self.axis_b is not None:
                raise InputError("an arc has a radius, or axis_a and axis_b, not both")
            return conics.arc(self.center, self.radius, *self.angles, self.normal)
        if self.axis_a is None or self.axis_b is None or self.normal is not None:
            raise InputError("an arc has a radius and perhaps a normal, or axis_a and axis_b")
        return conics.Arc(self.center, self.axis_a, self.axis_b, *self.angles)


def curve_data(curve: SeparableCurve) -> dict[str, Any] | None:
    """The fields of a curve, or None when a model file cannot hold it."""
    whole = curve.shape if isinstance(curve, RestrictedCurve) else curve
    if not isinstance(whole, Curve):
        return None
    fields = basis_fields("family", whole.family) | gamma_fields("gamma", whole.gamma, whole.family)
    if isinstance(curve, RestrictedCurve):
        fields["range"] = list(curve.range)
    return fields | {"control_points": whole.control_points.tolist()}


def chain_data(chain: Composite) -> tuple[str, dict[str, Any]] | None:
    """The kind and the fields of a chain, or None when a model file cannot hold it.

    Raises
    ------
    InputError
        When a joint does not meet its order.
    """
    if isinstance(chain, conics.Arc):
        fields: dict[str, Any] = {key: getattr(chain, key).tolist() for key in ("center", "axis_a", "axis_b")}
        if (chain.start_deg, chain.end_deg) == (0.0, 360.0):
            return "ellipse", fields
        return "arc", fields | {"angles": [chain.start_deg, chain.end_deg]}
    pieces = [curve_data(piece) for piece in chain.pieces]
    if any(piece is None for piece in pieces):
        return None
    if problem := chain.unmet(thresholds=_MET):
        raise InputError(f"{problem}: solve the chain first, with Composite.solved")
    return "composite", {"orders": list(chain.orders), **({"closed": True} if chain.closed else {}), "pieces": pieces}
