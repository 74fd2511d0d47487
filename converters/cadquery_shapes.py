"""What the functions for CadQuery return and take: shapes that carry their proof, and points, curves, patches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Generic, Literal, Self, TypeAlias, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN
from gtcad.composite import Composite
from gtcad.converters.design import Design
from gtcad.converters.fit import Degree
from gtcad.converters.hosts import AnyFit, Core, FaceDesign, Made
from gtcad.converters.sources import ShapeSource, SplineSource, source_of
from gtcad.curve import Curve
from gtcad.errors import ExtraMissing, InputError
from gtcad.patches._patch import in_space
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve
from gtcad.solid import Solid

try:
    import cadquery as cq
except ImportError as error:
    raise ExtraMissing(f"CadQuery is needed here: pip install 'gtcad[cadquery]' ({error})") from error

__all__ = [
    "CurveLike",
    "GtEdge",
    "GtFace",
    "GtShell",
    "GtSolid",
    "GtWire",
    "PointLike",
    "Settings",
    "SurfaceLike",
    "cq",
    "curve_of",
    "in_one_space",
    "point_of",
    "points_of",
    "quilt_of",
]

Exact = TypeVar("Exact", bound=Core)

PointLike: TypeAlias = cq.Vector | Sequence[float]
CurveLike: TypeAlias = SeparableCurve | cq.Edge | Sequence[PointLike]
"""A curve of gtcad, an edge of CadQuery, or control points: two make a line, more a GT curve."""
SurfaceLike: TypeAlias = SeparableSurface | cq.Face


class Settings(TypedDict, total=False):
    """What every function takes besides: ``tolerance`` in mm, 1e-3 unless given, and the options of the fit."""

    tolerance: float
    degree: Degree
    continuity: int | None
    end_order: int | tuple[int, int] | tuple[tuple[int, int], tuple[int, int]]
    exact: Literal["auto"] | bool
    max_spans: int
    max_degree: int
    adapt: bool


# --- shapes that carry their proof ------------------------------------------------------------------------------------


class Carrying(Generic[Exact]):
    """What the shapes of this module know beyond those of CadQuery.

    It stays with ``moved``, ``located``, ``copy``, ``move`` and ``locate``. Whatever comes out of any other operation
    is another shape: it carries nothing.
    """

    _made: Made[Exact] | None = None
    design: Design[Any] | FaceDesign | None = None
    """Of ``from_edge`` and ``from_face``: how far the exact shape is from what it was made for."""

    @classmethod
    def of(cls, made: Made[Exact]) -> Self:
        """The shape of CadQuery on a shape of the kernel."""
        shape = cls(made.shape)  # type: ignore[call-arg]
        shape._made = made
        return shape

    @property
    def made(self) -> Made[Exact]:
        """Everything that is known, where the shape was made.

        Raises
        ------
        InputError
            When the shape came out of an operation on one that carried it.
        """
        if self._made is None:
            raise InputError(
                "this shape came out of an operation (a boolean, a fillet, a rotation, ...) and carries no fit: "
                "ask the shape that went into it"
            )
        return self._made

    @property
    def exact(self) -> Exact:
        """The exact shape, moved to where this one is."""
        made, location = self.made.exact, self.wrapped.Location()  # type: ignore[attr-defined]
        return made if location.IsIdentity() else _moved(made, location)

    @property
    def fit(self) -> AnyFit:
        """What was fitted, where the shape was made."""
        return self.made.fit

    @property
    def deviation(self) -> tuple[float, float]:
        """(lower, upper) in mm of the distance from the exact shape; the upper one is proved where ``proved``."""
        return self.made.deviation

    @property
    def proved(self) -> bool:
        """Whether the upper bound is proved: always, but for the offset faces of walls, which are estimated."""
        return self.made.proved

    def moved(self, *args: Any, **kwargs: Any) -> Any:
        """As of ``cadquery.Shape``."""
        return self._carried(super().moved(*args, **kwargs))  # type: ignore[misc]

    def located(self, loc: cq.Location) -> Self:
        """As of ``cadquery.Shape``."""
        return self._carried(super().located(loc))  # type: ignore[misc, no-any-return]

    def copy(self, mesh: bool = False) -> Self:
        """As of ``cadquery.Shape``."""
        return self._carried(super().copy(mesh))  # type: ignore[misc, no-any-return]

    def _carried(self, other: Any) -> Any:
        if type(other) is type(self):
            other._made, other.design = self._made, self.design
        return other


def _moved(shape: Exact, location: Any) -> Exact:
    transformation = location.Transformation()
    rows = np.array([[transformation.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    matrix = rows[:, :3] @ np.eye(3, shape.dimension)  # a plane shape is lifted
    return shape.transformed(matrix, rows[:, 3])  # type: ignore[return-value]


class GtEdge(Carrying[SeparableCurve | Composite], cq.Edge):  # type: ignore[misc]
    """An edge with its exact curve."""


class GtWire(Carrying[SeparableCurve | Composite], cq.Wire):  # type: ignore[misc]
    """A wire with its exact chain."""


class GtFace(Carrying[SeparableSurface], cq.Face):  # type: ignore[misc]
    """A face with its exact patch."""


class GtShell(Carrying[Quilt], cq.Shell):  # type: ignore[misc]
    """A shell with its exact quilt."""


class GtSolid(Carrying[Solid], cq.Solid):  # type: ignore[misc]
    """A solid with its exact quilt, caps and thickness; ``made.body`` has volume, area and named faces."""


# --- what is given ----------------------------------------------------------------------------------------------------


def point_of(point: PointLike) -> tuple[float, ...]:
    """The coordinates of a point."""
    return tuple(point.toTuple()) if isinstance(point, cq.Vector) else tuple(point)


def points_of(name: str, points: Sequence[PointLike]) -> NDArray[np.float64]:
    """Points as rows, those of a plane and those of space mixed at will.

    Raises
    ------
    InputError
        When they are none.
    """
    try:
        rows = [point_of(point) for point in points]
        longest = max(map(len, rows))
        return np.array([[*row, *[0.0] * (longest - len(row))] for row in rows], dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be points of numbers, or a shape that is one, got {points!r}") from None


def curve_of(name: str, given: CurveLike, gamma: ArrayLike = (0.0, 0.0)) -> SeparableCurve:
    """The curve that is meant by points, an edge or a curve.

    Raises
    ------
    InputError
        When there is none, or the edge has no exact form in gtcad.
    """
    if isinstance(given, SeparableCurve):
        return given
    if isinstance(given, Carrying) and given._made is not None:
        if isinstance(given.exact, SeparableCurve):
            return given.exact
        raise InputError(f"{name} must be one curve, got an edge or wire made of a {type(given.exact).__name__}")
    if isinstance(given, cq.Shape):
        return _native(name, given)
    points = points_of(name, given)
    return Curve(points, family=BERNSTEIN) if len(points) == 2 else Curve(points, gamma)


def _native(name: str, edge: cq.Shape) -> SeparableCurve:
    """The exact curve of an edge that CadQuery made."""
    source, backwards = source_of(edge)
    if isinstance(source, ShapeSource):
        curve = source.curve
    elif isinstance(source, SplineSource) and len(source.spline.knots) == 2 and source.spline.weights is None:
        curve = Curve(source.spline.control_points, family=BERNSTEIN)
    else:
        raise InputError(f"{name} is a B-spline of several spans or a rational one: from_edge makes a GT curve for it")
    return RestrictedCurve(curve, (1.0, 0.0)) if backwards else curve


def in_one_space(curves: list[SeparableCurve]) -> list[SeparableCurve]:
    """Plane curves as they are when all are, else at z = 0."""
    return curves if all(curve.dimension == 2 for curve in curves) else [in_space(curve) for curve in curves]


def quilt_of(patches: Quilt | cq.Shell | Iterable[SurfaceLike]) -> Quilt:
    """The quilt that is meant by patches, faces or a shell; edges are shared where sides are equal curves."""
    if isinstance(patches, Quilt):
        return patches
    if isinstance(patches, GtShell):
        return patches.exact
    if isinstance(patches, SeparableSurface | cq.Shape):
        patches = [patches]
    return Quilt.recognised([_patch(f"patches[{k}]", patch) for k, patch in enumerate(patches)])


def _patch(name: str, given: SurfaceLike) -> SeparableSurface:
    if isinstance(given, SeparableSurface):
        return given
    if isinstance(given, GtFace):
        return given.exact
    raise InputError(f"{name} must be a patch of gtcad or a face made of one, got {type(given).__name__}")
