"""The kinds of minimal patches that a model file can hold."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo

from gtcad import _checks as checks
from gtcad import patches
from gtcad._curve_kinds import CurveField, curve_data
from gtcad._documents import Problem, shown
from gtcad._entries import DesignVariables, FamilyName, Shapes, basis_fields, gamma_fields
from gtcad._patch_kinds import PatchEntry
from gtcad.basis import FAMILIES, MAX_DEGREE, is_whole
from gtcad.errors import InputError
from gtcad.patches.minimal_study import FUNCTIONALS
from gtcad.patches.tb_coons import BOUNDARIES
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.surface import Surface

_SETTINGS = ("free boundary", "fixed contour")


def _boundary_net(value: Any, info: ValidationInfo) -> Any:
    """Check a net as one of a surface, but for its interior, which may be empty and is not read."""
    if not isinstance(value, list) or not all(isinstance(row, list) for row in value):
        return checks.net(value, info)
    last = len(value) - 1
    filled = [
        [row[0] if 0 < i < last and 0 < j < len(row) - 1 else point for j, point in enumerate(row)]
        for i, row in enumerate(value)
    ]
    return checks.net(filled, info)


def _degrees(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a degree or two of them."""
    pair = value if isinstance(value, list) else [value, value]
    if len(pair) != 2 or not all(is_whole(one) and 2 <= one <= MAX_DEGREE for one in pair):
        checks.refuse([((), f"must be a whole number in [2, {MAX_DEGREE}], or two of them, got {shown(value)}")])
    return [int(one) for one in pair]


def _rows(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not rows of any points, equally long."""
    if not isinstance(value, list) or not value:
        checks.refuse([((), f"must be a list of rows of points, got {shown(value)}")])
    lengths = [len(row) if isinstance(row, list) else 0 for row in value]
    problems: list[Problem] = [
        ((index,), f"must be a row of {lengths[0] or 'some'} points, got {shown(value[index])}")
        for index, length in enumerate(lengths)
        if not length or length != lengths[0]
    ]
    if problems:
        checks.refuse(problems)
    return value


def _free(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of pairs of a boundary and a number."""
    if not isinstance(value, list):
        checks.refuse([((), f"must be a list of pairs such as ['c0', 1], got {shown(value)}")])
    problems: list[Problem] = [
        ((index,), f"must be a pair of one of {', '.join(BOUNDARIES)} and a whole number from 1, got {shown(pair)}")
        for index, pair in enumerate(value)
        if not (
            isinstance(pair, list) and len(pair) == 2 and pair[0] in BOUNDARIES and type(pair[1]) is int and pair[1] > 0
        )
    ]
    if problems:
        checks.refuse(problems)
    return [tuple(pair) for pair in value]


BoundaryRow = Annotated[list[Annotated[list[float], Field(max_length=3)]], Field(min_length=2, max_length=61)]
Degree = Annotated[int, Field(ge=2, le=MAX_DEGREE)]
DegreePair = Annotated[list[Degree], Field(min_length=2, max_length=2)]
InteriorRow = list[Annotated[list[float], Field(min_length=2, max_length=3), BeforeValidator(checks.point(2, 3))]]


class PlateauEntry(PatchEntry):
    """The patch of least energy or area inside boundary control points or four boundary curves."""

    kind: Literal["plateau"]
    family: FamilyName = Field(default="GT", description="The basis of the interior, and of a net's boundary curves.")
    gamma_u: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family")))] = Field(
        default=None, description="Design variables of u; (0, 0) when left out; none for bernstein."
    )
    gamma_v: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family")))] = Field(
        default=None, description="Design variables of v; (0, 0) when left out; none for bernstein."
    )
    control_points: Annotated[list[BoundaryRow] | None, BeforeValidator(checks.optional(_boundary_net))] = Field(
        default=None,
        description="Rows of points as of a surface; of the interior, which is solved for, points are not read and may "
        "be [].",
        max_length=61,
    )
    c0: CurveField | None = Field(default=None, description="The boundary at v = 0, along u.")
    c1: CurveField | None = Field(default=None, description="The boundary at v = 1, along u.")
    d0: CurveField | None = Field(default=None, description="The boundary at u = 0, along v.")
    d1: CurveField | None = Field(default=None, description="The boundary at u = 1, along v.")
    functional: Annotated[
        Literal["dirichlet", "quasi-harmonic", "bending", "area"] | None,
        BeforeValidator(checks.optional(checks.one_of(*FUNCTIONALS))),
    ] = Field(default=None, description="What is made least; dirichlet when left out.")
    setting: Annotated[
        Literal["free boundary", "fixed contour"] | None, BeforeValidator(checks.optional(checks.one_of(*_SETTINGS)))
    ] = Field(
        default=None,
        description="free boundary, of control points; fixed contour, of curves or of the boundary of control points.",
    )
    degree: Annotated[Degree | DegreePair | None, BeforeValidator(checks.optional(_degrees))] = Field(
        default=None, description="Of the interior functions of a fixed contour, a number from 2 or two of them."
    )
    interior: Annotated[list[InteriorRow] | None, BeforeValidator(checks.optional(_rows))] = Field(
        default=None,
        description="The interior as solved before, displacements from the Coons patch: nothing is solved.",
    )

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        none = (0.0, 0.0)
        basis: dict[str, Any] = {"gamma_u": self.gamma_u or none, "gamma_v": self.gamma_v or none}
        basis["family"] = FAMILIES[self.family]
        missing = [field for field in BOUNDARIES if getattr(self, field) is None]
        if (self.control_points is None) == (len(missing) == len(BOUNDARIES)):
            raise InputError("a plateau has control_points, or the curves c0, c1, d0 and d1")
        if self.control_points is not None:
            return self._inside_net(basis)
        if missing:
            raise InputError(f"{' and '.join(missing)} missing: a fixed contour has the curves c0, c1, d0 and d1")
        if self.setting == "free boundary":
            raise InputError("setting: a free boundary is given by control_points, not by curves")
        return self._inside_curves([self.found(shapes, field) for field in BOUNDARIES], None, basis)

    def _inside_net(self, basis: dict[str, Any]) -> SeparableSurface:
        assert self.control_points is not None
        if self.setting == "fixed contour":
            whole = Surface(self.control_points, basis["gamma_u"], basis["gamma_v"], basis["family"], basis["family"])
            return self._inside_curves(
                [whole.boundary(side) for side in ("v0", "v1", "u0", "u1")], whole.degrees, basis
            )
        for field in ("degree", "interior"):
            if getattr(self, field) is not None:
                raise InputError(f"{field} belongs to a fixed contour, and this boundary is free")
        return patches.minimal_patch(self.control_points, self.functional or "dirichlet", **basis)

    def _inside_curves(
        self, curves: list[SeparableCurve], degrees: tuple[int, int] | None, basis: dict[str, Any]
    ) -> SeparableSurface:
        if self.interior is not None:
            if self.functional is not None or self.degree is not None:
                raise InputError("an interior that is given has its own degree and makes no functional least")
            return patches.Plateau(curves[0], curves[1], curves[2], curves[3], self.interior, **basis)
        degree = self.degree or degrees
        if degree is None:
            raise InputError("degree is missing: that of the interior functions, a number from 2 or two of them")
        return patches.minimal_patch(curves, self.functional or "dirichlet", degree=degree, **basis)


class TBCoonsEntry(PatchEntry):
    """The Boolean sum of four GT curves, of least energy in the control points that are free."""

    kind: Literal["tb_coons"]
    c0: CurveField = Field(description="The boundary at v = 0, along u.")
    c1: CurveField = Field(description="The boundary at v = 1, along u.")
    d0: CurveField = Field(description="The boundary at u = 0, along v.")
    d1: CurveField = Field(description="The boundary at u = 1, along v.")
    free: Annotated[list[tuple[Literal["c0", "c1", "d0", "d1"], int]], BeforeValidator(_free)] = Field(
        default=[], description="Pairs [boundary, control point], from 1, that are solved for; never corners, nor all."
    )
    functional: Annotated[
        Literal["dirichlet", "quasi-harmonic", "bending"], BeforeValidator(checks.one_of(*FUNCTIONALS[:3]))
    ] = Field(default="dirichlet", description="The energy that is made least in them.")

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        drawn = patches.TBCoons(*(self.found(shapes, field) for field in BOUNDARIES))
        return patches.tb_coons_extremal(drawn, self.free, self.functional)


MINIMAL_ENTRIES: dict[str, type[PatchEntry]] = {"plateau": PlateauEntry, "tb_coons": TBCoonsEntry}


def minimal_data(patch: SeparableSurface) -> tuple[str, dict[str, Any]] | None:
    """The kind and the fields of a minimal patch; None for other patches, and when a model file cannot hold it.

    What was solved for is spelled out: an interior, or control points; a free boundary makes an ordinary surface.
    """
    if not isinstance(patch, patches.Plateau | patches.TBCoons):
        return None
    fields: dict[str, Any] = {}
    if isinstance(patch, patches.Plateau):
        fields = basis_fields("family", patch.family)
        fields |= gamma_fields("gamma_u", patch.gamma_u, patch.family)
        fields |= gamma_fields("gamma_v", patch.gamma_v, patch.family)
    for name in BOUNDARIES:
        fields[name] = curve_data(getattr(patch, name))
    if isinstance(patch, patches.Plateau):
        fields["interior"] = patch.interior.tolist()
    kind = "plateau" if isinstance(patch, patches.Plateau) else "tb_coons"
    return None if None in fields.values() else (kind, fields)
