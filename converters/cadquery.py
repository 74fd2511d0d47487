"""GT shapes for CadQuery: free functions in the manner of ``cadquery.func``, and methods of ``Workplane``.

The functions return shapes of CadQuery, in mm, each with its exact shape and its proof. Importing the module adds the
methods to ``cadquery.Workplane``; importing it again changes nothing.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Concatenate, Generic, Literal, ParamSpec, Self, TypeAlias, TypedDict, TypeVar, Unpack

import cadquery as cq
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, GT
from gtcad.composite import Composite
from gtcad.continuity import Scale
from gtcad.converters import hosts
from gtcad.converters.design import Design
from gtcad.converters.fit import Degree
from gtcad.converters.hosts import AnyFit, Core, FaceDesign, Made
from gtcad.converters.sources import ShapeSource, SplineSource, source_of
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.model import Model
from gtcad.patches._moving_frames import FrameKind
from gtcad.patches._patch import in_space
from gtcad.patches.coons import coons_from_loop
from gtcad.patches.lofted import Lofted
from gtcad.patches.rotation import Rotation
from gtcad.patches.ruled import Ruled
from gtcad.patches.sweep import Sweep
from gtcad.patches.swept import Swept
from gtcad.patches.swung import Swung
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve
from gtcad.solid import Solid
from gtcad.surface import Surface

Exact = TypeVar("Exact", bound=Core)
P = ParamSpec("P")
W = TypeVar("W", bound=cq.Workplane)

PointLike: TypeAlias = cq.Vector | Sequence[float]
CurveLike: TypeAlias = SeparableCurve | cq.Edge | Sequence[PointLike]
"""A curve of gtcad, an edge of CadQuery, or control points: two make a line, more a GT curve."""
SurfaceLike: TypeAlias = SeparableSurface | cq.Face
CombineMode: TypeAlias = bool | Literal["cut", "a", "s"]

__all__ = [
    "GtEdge",
    "GtFace",
    "GtShell",
    "GtSolid",
    "GtWire",
    "Workplane",
    "from_edge",
    "from_face",
    "gtAssembly",
    "gtChain",
    "gtCoons",
    "gtCurve",
    "gtCurveOn",
    "gtLofted",
    "gtRotation",
    "gtRuled",
    "gtShape",
    "gtShell",
    "gtSolid",
    "gtSurface",
    "gtSurfaceOn",
    "gtSweep",
    "gtSwept",
    "gtSwung",
]


class Settings(TypedDict, total=False):
    """What every function takes besides: ``tolerance`` in mm, 1e-3 unless given, and the options of the fit."""

    tolerance: float
    degree: Degree
    continuity: int | None
    end_order: int
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


# --- edges and wires --------------------------------------------------------------------------------------------------


def gtCurve(points: CurveLike | Composite, gamma: ArrayLike = (0.0, 0.0), **settings: Unpack[Settings]) -> GtEdge:
    """The edge of a GT curve.

    Parameters
    ----------
    points
        Control points, in mm: two make a line, more a GT curve of degree one less. Or any curve of gtcad, or an edge.
    gamma
        Design variables of a curve from points, each in [-1, 1].
    settings
        See ``Settings``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``gtcad.converters.fit_curve``.
    """
    curve = points if isinstance(points, Composite) else _curve("points", points, gamma)
    return GtEdge.of(hosts.made_edge(curve, **settings))


def gtChain(
    pieces: Composite | Sequence[CurveLike],
    orders: str | Sequence[str] = "C0",
    closed: bool = False,
    **settings: Unpack[Settings],
) -> GtWire:
    """The wire of curves that meet; their joints keep their order.

    Parameters
    ----------
    pieces
        Curves in order, or a chain of gtcad.
    orders
        Of all joints, or of each: "C0" to "C3", "G1" to "G3". They are checked.
    closed
        Whether the last piece ends where the first begins.
    """
    if isinstance(pieces, Composite):
        return GtWire.of(hosts.made_wire(pieces, **settings))
    curves = _in_one_space([_curve(f"pieces[{k}]", piece) for k, piece in enumerate(pieces)])
    joints = (orders,) * (len(curves) - (not closed)) if isinstance(orders, str) else tuple(orders)
    return GtWire.of(hosts.made_wire(Composite(tuple(curves), joints, closed), **settings))


def from_edge(
    edge: cq.Edge, *, tolerance: float = hosts.DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> GtEdge | GtWire:
    """The GT curve nearest to an edge, or a chain of them where one is not enough, within a tolerance of the edge.

    Parameters
    ----------
    edge
        Any edge of CadQuery.
    tolerance
        Largest distance of the new edge from the old one, in mm: half for the GT curve, half for its B-spline.
    degree
        Of the one curve, or of the chain's pieces; the least up to 8 for one curve, 5 for a chain unless given.
    order
        Of the chain's joints.

    Returns
    -------
    GtEdge or GtWire
        Its ``exact`` is the design, and its ``design`` says how far that is from the edge.
    """
    design = hosts.design_from_edge(edge, tolerance=tolerance / 2, degree=degree, order=order)
    make = gtChain if isinstance(design.curve, Composite) else gtCurve
    made: GtEdge | GtWire = make(design.curve, tolerance=tolerance / 2)
    made.design = design
    return made


def gtCurveOn(
    edge: cq.Edge,
    points: Sequence[PointLike],
    *,
    order: str = "G1",
    at: float = 1.0,
    gamma: Sequence[float] = (0.0, 0.0),
    scale: Scale | None = None,
    **settings: Unpack[Settings],
) -> GtEdge:
    """The edge of the GT curve that goes on from an edge with G^k continuity.

    Parameters
    ----------
    edge
        Any edge of CadQuery.
    points
        The control points after those that the join gives (k + 1 of them).
    order, at, gamma, scale
        As of ``gtcad.converters.hosts.curve_on_edge``: at 1 from its end, at 0 from its start.
    """
    rest = [_point(point) for point in points]
    return GtEdge.of(
        hosts.made_edge(hosts.curve_on_edge(edge, rest, order=order, at=at, gamma=gamma, scale=scale), **settings)
    )


# --- faces ------------------------------------------------------------------------------------------------------------


def gtSurface(
    net: SeparableSurface | Sequence[Sequence[PointLike]],
    gammaU: ArrayLike = (0.0, 0.0),
    gammaV: ArrayLike = (0.0, 0.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The face of a GT surface.

    Parameters
    ----------
    net
        Control points, in mm; the first index goes with u. Two points in a direction make it straight. Or any patch of
        gtcad.
    gammaU, gammaV
        Design variables of a surface from points.
    """
    if not isinstance(net, SeparableSurface):
        rows = [[_point(point) for point in row] for row in net]
        families = [BERNSTEIN if len(some) == 2 else GT for some in (rows, rows[0] if rows else ())]
        net = Surface(rows, gammaU, gammaV, *families)
    return GtFace.of(hosts.made_face(net, **settings))


def gtRuled(a: CurveLike, b: CurveLike, **settings: Unpack[Settings]) -> GtFace:
    """The ruled face between two curves; ``gtcad.patches.Ruled``."""
    return gtSurface(Ruled(*_in_one_space([_curve("a", a), _curve("b", b)])), **settings)


def gtSwept(profile: CurveLike, trajectory: CurveLike, **settings: Unpack[Settings]) -> GtFace:
    """The face of a profile that moves without turning; ``gtcad.patches.Swept``."""
    curves = _in_one_space([_curve("profile", profile), _curve("trajectory", trajectory)])
    return gtSurface(Swept(*curves), **settings)


def gtSwung(profile: CurveLike, trajectory: CurveLike, factor: float = 1.0, **settings: Unpack[Settings]) -> GtFace:
    """The face of a profile (x, z) that a trajectory (X, Y) turns and stretches; ``gtcad.patches.Swung``."""
    return gtSurface(Swung(_curve("profile", profile), _curve("trajectory", trajectory), factor), **settings)


def gtRotation(
    profile: CurveLike,
    angleDegrees: float = 360.0,
    axisStart: PointLike = (0.0, 0.0, 0.0),
    axisEnd: PointLike = (0.0, 0.0, 1.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The face of a profile that turns about an axis; ``gtcad.patches.Rotation``."""
    start, end = (np.resize([*_point(point), 0.0], 3) for point in (axisStart, axisEnd))
    return gtSurface(Rotation(_curve("profile", profile), start, end - start, angleDegrees), **settings)


def gtLofted(
    sections: Sequence[CurveLike],
    parameters: Sequence[float] | None = None,
    gamma: tuple[float, float] = (0.0, 0.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The face through sections of one degree; ``gtcad.patches.Lofted``, ruled through two."""
    curves = _in_one_space([_curve(f"sections[{k}]", one) for k, one in enumerate(sections)])
    family = BERNSTEIN if len(curves) == 2 else GT
    return gtSurface(Lofted(curves, parameters, gamma, family), **settings)


def gtCoons(curves: Sequence[CurveLike], **settings: Unpack[Settings]) -> GtFace:
    """The face inside a loop of four curves, each in either direction; ``gtcad.patches.Coons``."""
    loop = _in_one_space([_curve(f"curves[{k}]", curve) for k, curve in enumerate(curves)])
    return gtSurface(coons_from_loop(loop), **settings)


def gtSweep(
    profile: CurveLike,
    spine: CurveLike,
    *,
    frame: FrameKind = "rotation-minimising",
    startNormal: PointLike | None = None,
    scale: ArrayLike = 1.0,
    twistDegrees: float = 0.0,
    closed: bool = False,
    **settings: Unpack[Settings],
) -> GtFace:
    """The face of a profile that a spine carries along in its frame; ``gtcad.patches.Sweep``."""
    swept = Sweep(
        _curve("profile", profile),
        _curve("spine", spine),
        frame=frame,
        start_normal=None if startNormal is None else _point(startNormal),
        scale=scale,
        twist_deg=twistDegrees,
        closed=closed,
    )
    return gtSurface(swept, **settings)


def from_face(
    face: cq.Face,
    *,
    tolerance: float = hosts.DEFAULT_TOLERANCE,
    maxDegree: int = 16,
    untrimmed: bool = False,
) -> GtFace:
    """The GT patch of least degrees within a tolerance of a face.

    Parameters
    ----------
    face
        Any face of CadQuery.
    tolerance
        Largest distance of the new face from the old one, in mm: half for the GT patch, half for its B-spline.
    maxDegree, untrimmed
        As of ``gtcad.converters.hosts.design_from_face``.

    Returns
    -------
    GtFace
        Its ``exact`` is the design, and its ``design`` says how far that is from the face.
    """
    design = hosts.design_from_face(face, tolerance=tolerance / 2, max_degree=maxDegree, untrimmed=untrimmed)
    made = gtSurface(design.surface, tolerance=tolerance / 2)
    made.design = design
    return made


def gtSurfaceOn(
    face: cq.Face,
    edge: cq.Edge,
    curve: CurveLike,
    *,
    order: str = "G1",
    reach: float | None = None,
    **settings: Unpack[Settings],
) -> GtFace:
    """The face that goes on from an edge of another one to a curve with G^k continuity.

    Parameters
    ----------
    face, edge
        Any face of CadQuery, and one of its edges: a whole side of its surface.
    curve
        The opposite side.
    order, reach
        As of ``gtcad.converters.hosts.patch_on_face``.
    """
    tolerance = settings.get("tolerance", hosts.DEFAULT_TOLERANCE)
    opposite = in_space(_curve("curve", curve))
    join = hosts.patch_on_face(face, edge, opposite, order=order, reach=reach, tolerance=tolerance)
    return gtSurface(join.surface, **settings)


# --- shells, solids, assemblies ---------------------------------------------------------------------------------------


def gtShell(patches: Quilt | cq.Shell | Iterable[SurfaceLike], **settings: Unpack[Settings]) -> GtShell:
    """The shell of patches that share edges, found where sides are equal curves."""
    return GtShell.of(hosts.made_shell(_quilt(patches), **settings))


def gtSolid(
    patches: Quilt | Solid | cq.Shell | Iterable[SurfaceLike],
    caps: Literal["none", "planar"] = "none",
    thickness: float | None = None,
    **settings: Unpack[Settings],
) -> GtSolid:
    """The solid inside patches that share edges, or the wall along them.

    Parameters
    ----------
    patches
        Patches of gtcad, faces of this module, or a shell or quilt of them.
    caps
        "planar": loops of free edges are closed by plane faces.
    thickness
        Of a wall, in mm: positive towards the side that normals point to.
    """
    solid = patches if isinstance(patches, Solid) else Solid(_quilt(patches), caps, thickness)
    return GtSolid.of(hosts.made_solid(solid, **settings))


def gtShape(shape: Core, **settings: Unpack[Settings]) -> GtEdge | GtWire | GtFace | GtShell | GtSolid:
    """The edge, wire, face, shell or solid of any shape of gtcad."""
    if isinstance(shape, Solid):
        return gtSolid(shape, **settings)
    if isinstance(shape, Quilt):
        return gtShell(shape, **settings)
    if isinstance(shape, Composite):
        return gtChain(shape, **settings)
    return gtCurve(shape, **settings) if isinstance(shape, SeparableCurve) else gtSurface(shape, **settings)


def gtAssembly(model: Model | Mapping[str, Core], **settings: Unpack[Settings]) -> cq.Assembly:
    """The assembly of a model's shapes with their names and colours; of a mapping, in mm."""
    shapes = model.in_millimetres() if isinstance(model, Model) else model
    colors = model.colors if isinstance(model, Model) else {}
    assembly = cq.Assembly()
    for name, shape in shapes.items():
        color = cq.Color(*(channel / 255 for channel in bytes.fromhex(colors[name][1:]))) if name in colors else None
        assembly.add(gtShape(shape, **settings), name=name, color=color)
    return assembly


# --- what is given ----------------------------------------------------------------------------------------------------


def _point(point: PointLike) -> tuple[float, ...]:
    return tuple(point.toTuple()) if isinstance(point, cq.Vector) else tuple(point)


def _points(name: str, points: Sequence[PointLike]) -> NDArray[np.float64]:
    try:
        rows = [_point(point) for point in points]
        longest = max(map(len, rows))
        return np.array([[*row, *[0.0] * (longest - len(row))] for row in rows], dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be points, an edge or a curve of gtcad, got {points!r}") from None


def _curve(name: str, given: CurveLike, gamma: ArrayLike = (0.0, 0.0)) -> SeparableCurve:
    if isinstance(given, SeparableCurve):
        return given
    if isinstance(given, Carrying) and given._made is not None:
        if isinstance(given.exact, SeparableCurve):
            return given.exact
        raise InputError(f"{name} must be one curve, got an edge or wire made of a chain")
    if isinstance(given, cq.Shape):
        return _native(name, given)
    points = _points(name, given)
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


def _in_one_space(curves: list[SeparableCurve]) -> list[SeparableCurve]:
    return curves if all(curve.dimension == 2 for curve in curves) else [in_space(curve) for curve in curves]


def _quilt(patches: Quilt | cq.Shell | Iterable[SurfaceLike]) -> Quilt:
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


# --- methods of Workplane ---------------------------------------------------------------------------------------------


def _at_points(make: Callable[P, Any]) -> Callable[Concatenate[W, P], W]:
    """The method that makes a shape in the plane's coordinates, and puts one at each point of the stack."""

    def method(self: W, /, *args: P.args, **kwargs: P.kwargs) -> W:
        return _placed(self, make(*args, **kwargs))

    signature = inspect.signature(make)
    own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    described: Any = method
    described.__signature__ = signature.replace(parameters=[own, *signature.parameters.values()])
    described.__name__, described.__doc__ = make.__name__, make.__doc__
    return method


def _placed(workplane: W, shape: Any, combine: CombineMode = False, clean: bool = False) -> W:
    """The shape at each point of the stack; cleaning would make another shape of it."""
    result: W = workplane.eachpoint(shape.moved, True, combine, clean)
    return result


def _drawn(workplane: W, shapes: list[Any], forConstruction: bool) -> W:
    """Shapes in the plane's coordinates as what was drawn last."""
    placed = [shape.moved(workplane.plane.location) for shape in shapes]
    if not forConstruction:
        for shape in placed:
            add = workplane._addPendingWire if isinstance(shape, cq.Wire) else workplane._addPendingEdge
            add(shape)
    result: W = workplane.newObject(placed)
    return result


class Workplane(cq.Workplane):  # type: ignore[misc]
    """``cadquery.Workplane`` with the methods of this module, which all of them have; this one tells editors so.

    Points and curves are in the plane's coordinates.
    """

    def gtCurve(
        self: W,
        points: CurveLike | Composite,
        gamma: ArrayLike = (0.0, 0.0),
        forConstruction: bool = False,
        includeCurrent: bool = False,
        makeWire: bool = False,
        **settings: Unpack[Settings],
    ) -> W:
        """Draw a GT curve, as ``bezier`` draws a Bezier curve.

        Parameters
        ----------
        points, gamma, settings
            As of the function ``gtCurve``.
        forConstruction, includeCurrent, makeWire
            As of ``Workplane.bezier``; the current point becomes the first control point.
        """
        if includeCurrent:
            if isinstance(points, SeparableCurve | Composite | cq.Shape):
                raise InputError("includeCurrent=True needs control points, got a whole curve")
            points = [self._findFromPoint(True), *points]
        curve = points if isinstance(points, Composite) else _curve("points", points, gamma)
        if makeWire:
            chain = curve if isinstance(curve, Composite) else Composite((curve,), ())
            return _drawn(self, [gtChain(chain, **settings)], forConstruction)
        return _drawn(self, [gtCurve(curve, **settings)], forConstruction)

    def gtChain(
        self: W,
        pieces: Composite | Sequence[CurveLike],
        orders: str | Sequence[str] = "C0",
        closed: bool = False,
        forConstruction: bool = False,
        **settings: Unpack[Settings],
    ) -> W:
        """Draw a chain: a closed one as a wire at each point of the stack, as ``circle``; an open one as edges.

        Parameters
        ----------
        pieces, orders, closed, settings
            As of the function ``gtChain``.
        forConstruction
            Whether it is left out of what is extruded.
        """
        wire = gtChain(pieces, orders, closed, **settings)
        wire.forConstruction = forConstruction
        return _placed(self, wire) if wire.IsClosed() else _drawn(self, wire.Edges(), forConstruction)

    def gtSolid(
        self: W,
        patches: Quilt | Solid | cq.Shell | Iterable[SurfaceLike],
        caps: Literal["none", "planar"] = "none",
        thickness: float | None = None,
        combine: CombineMode = True,
        clean: bool = True,
        **settings: Unpack[Settings],
    ) -> W:
        """Put a solid at each point of the stack, and combine it with the solid that is there, as ``box``.

        Parameters
        ----------
        patches, caps, thickness, settings
            As of the function ``gtSolid``.
        combine, clean
            As of ``Workplane.box``. One solid that there is nothing to combine with stays as it is, with its fit.
        """
        if len(self.objects) < 2 and self._findType((cq.Solid,), True, True) is None:
            combine = False
        return _placed(self, gtSolid(patches, caps, thickness, **settings), combine, clean and bool(combine))

    gtSurface = _at_points(gtSurface)
    gtRuled = _at_points(gtRuled)
    gtSwept = _at_points(gtSwept)
    gtSwung = _at_points(gtSwung)
    gtRotation = _at_points(gtRotation)
    gtLofted = _at_points(gtLofted)
    gtCoons = _at_points(gtCoons)
    gtSweep = _at_points(gtSweep)
    gtShell = _at_points(gtShell)


def register() -> None:
    """Add the methods to ``cadquery.Workplane``; done on import."""
    for name, method in vars(Workplane).items():
        if name.startswith("gt"):
            setattr(cq.Workplane, name, method)


register()
