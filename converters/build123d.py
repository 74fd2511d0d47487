"""GT shapes as objects of build123d, in builder and in algebra mode, and joined to what build123d made.

All lengths are in mm. Objects are genuine ``Edge``, ``Wire``, ``Face``, ``Sketch`` and ``Part``; each has ``fit`` (its
``deviation`` is proved), ``exact`` (the shape of gtcad where the object is) and ``made``.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from typing import Any, Literal, TypedDict, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Family
from gtcad.composite import Composite
from gtcad.conics import Arc, hyperbola, parabola
from gtcad.continuity import Scale
from gtcad.converters.design import Design
from gtcad.converters.fit import Degree
from gtcad.converters.host_designs import (
    DEFAULT_TOLERANCE,
    FaceDesign,
    curve_on_edge,
    design_from_edge,
    design_from_face,
    patch_on_face,
)
from gtcad.converters.hosts import AnyFit, Core, Made, made_edge, made_face, made_shell, made_solid, made_wire
from gtcad.curve import Curve
from gtcad.edge_check import EdgeReport
from gtcad.errors import ExtraMissing, InputError
from gtcad.model import Model
from gtcad.patches import Coons, Lofted, Rotation, Ruled, Sweep, Swept, Swung
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Caps, Solid
from gtcad.surface import Surface

try:
    import build123d as host
    from build123d.build_common import BaseObject, flatten_sequence
except ImportError as error:
    raise ExtraMissing(f"build123d is needed here: pip install 'gtcad[build123d]' ({error})") from error

Array = NDArray[np.float64]
GeometricOrder = Literal["G0", "G1", "G2", "G3"]
Frame = Literal["rotation-minimising", "frenet", "fixed"]
Kind = TypeVar("Kind", bound="type[Any]")

_SUBSHAPES = {"EDGE": "edges", "WIRE": "wires", "FACE": "faces", "SHELL": "shells", "SOLID": "solids"}


class LineOptions(TypedDict, total=False):
    """What every line object takes.

    Attributes
    ----------
    tolerance
        Largest distance from the exact curve, in mm; 1e-3 unless given.
    degree
        Of the B-spline, 3 to 25 or "auto"; 5 unless given.
    mode
        ``Mode`` of the builder.
    label, color
        As of any shape.
    """

    tolerance: float
    degree: Degree
    mode: host.Mode
    label: str
    color: host.Color | None


class FaceOptions(LineOptions, total=False):
    """What every face object takes: as a line object, and where it goes.

    Attributes
    ----------
    rotation
        Angles about X, Y and Z in degrees.
    align
        ``Align`` of MIN, CENTER or MAX to the origin, one or three; None (as drawn) unless given.
    """

    rotation: host.Rotation | tuple[float, float, float]
    align: host.Align | tuple[host.Align, host.Align, host.Align] | None


# --- what all objects have --------------------------------------------------------------------------------------------


class GTObject:
    """What gtcad knows of an object of build123d."""

    made: Made[Any]
    """The shape as it was made, before ``align``, ``rotation`` and locations."""

    @property
    def fit(self) -> AnyFit:
        """What was fitted: ``fit.deviation`` is (lower, upper) in mm, the upper one proved."""
        return self.made.fit

    @property
    def deviation(self) -> tuple[float, float]:
        """(lower, upper) in mm of the whole object; ``made.proved`` says whether the upper one is proved."""
        return self.made.deviation

    @property
    def exact(self) -> Any:
        """The exact shape where the object is; of an object at several locations where the first one is."""
        return _moved(self.made.exact, *self._place())

    def _place(self) -> tuple[Array, Array]:
        kind = str(self.made.shape.ShapeType()).rsplit("_", 1)[-1]
        first = getattr(self, _SUBSHAPES[kind])()[0]
        trsf = first.wrapped.Location().Transformation()
        rows = np.array([[trsf.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
        return rows[:, :3], rows[:, 3]


def _moved(exact: Any, matrix: Array, translation: Array) -> Any:
    if (matrix == np.eye(3)).all() and not translation.any():
        return exact
    return exact.transformed(matrix[:, : exact.dimension], translation)


def _labelled(shape: Any, made: Made[Any], label: str, color: Any) -> None:
    shape.made = made
    shape.label = label
    if color is not None:
        shape.color = color if isinstance(color, host.Color) else host.Color(color)


def _curve(given: Any, name: str) -> SeparableCurve:
    """A curve of gtcad from one, or from a line object where it is."""
    found = given.exact if isinstance(given, GTObject) else given
    if not isinstance(found, SeparableCurve):
        raise InputError(f"{name} must be a curve of gtcad or an object with one, got {type(given).__name__}")
    return found


def _patch(given: Any, name: str) -> SeparableSurface:
    found = given.exact if isinstance(given, GTObject) else given
    if not isinstance(found, SeparableSurface):
        raise InputError(f"{name} must be a patch of gtcad or an object with one, got {type(given).__name__}")
    return found


def _points(points: Iterable[Any]) -> list[tuple[float, float, float]]:
    return [tuple(host.Vector(one)) for one in flatten_sequence(*points)]


# --- lines ------------------------------------------------------------------------------------------------------------


class _EdgeObject(GTObject, host.BaseEdgeObject):  # type: ignore[misc]
    def __init__(
        self,
        curve: SeparableCurve | Composite,
        *,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = 5,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Any,
    ) -> None:
        made = made_edge(curve, tolerance=tolerance, degree=degree, **settings)
        super().__init__(host.Edge(made.shape), mode=mode)
        _labelled(self, made, label, color)


class GTBezier(_EdgeObject):
    """Line object: the GT-Bezier curve of control points.

    Parameters
    ----------
    points
        At least three points of the host (tuples, vectors, vertices), in mm.
    gamma
        The design variables, each in [-1, 1].
    options
        See ``LineOptions``.

    Raises
    ------
    InputError
        When an argument is out of its range; it is a ValueError.
    ToleranceNotMet, ToleranceBelowPrecision, KernelError
        As ``hosts.made_edge``.

    Notes
    -----
    A line or an arc of an ellipse becomes that; any other curve a B-spline within the tolerance.

    Examples
    --------
    >>> GTBezier((1, 0), (1, 1), (0, 1)).geom_type.name
    'CIRCLE'
    """

    def __init__(self, *points: Any, gamma: Sequence[float] = (0.0, 0.0), **options: Unpack[LineOptions]) -> None:
        super().__init__(Curve(_points(points), (float(gamma[0]), float(gamma[1]))), **options)


class GTCurve(_EdgeObject):
    """Line object: any curve of gtcad as one edge.

    Parameters
    ----------
    curve
        A ``Curve``, a part of one, or a chain that is one edge.
    options
        See ``LineOptions``.
    """

    def __init__(self, curve: SeparableCurve | Composite, **options: Unpack[LineOptions]) -> None:
        super().__init__(curve, **options)


class GTConic(_EdgeObject):
    """Line object: an exact arc of an ellipse ``c + cos(theta) a + sin(theta) b``, or all of it.

    Parameters
    ----------
    center
        c, a point of the host.
    axis_a, axis_b
        Two conjugate half diameters, not parallel; at right angles they are the half axes.
    start_angle, end_angle
        In degrees, at most 360 apart; end < start runs backwards.
    options
        See ``LineOptions``.

    Examples
    --------
    >>> round(GTConic((0, 0), (2, 0), (0, 2), 0, 90).length, 6)
    3.141593
    """

    def __init__(
        self,
        center: Any,
        axis_a: Any,
        axis_b: Any,
        start_angle: float = 0.0,
        end_angle: float = 360.0,
        **options: Unpack[LineOptions],
    ) -> None:
        center, axis_a, axis_b = _points((center, axis_a, axis_b))
        super().__init__(Arc(center, axis_a, axis_b, start_angle, end_angle), **options)


class GTParabola(_EdgeObject):
    """Line object: the parabola from p0 to p2 whose tangents there meet in p1."""

    def __init__(self, p0: Any, p1: Any, p2: Any, **options: Unpack[LineOptions]) -> None:
        super().__init__(parabola(*_points((p0, p1, p2))), **options)


class GTHyperbola(_EdgeObject):
    """Line object: ``c + cosh(s) a + sinh(s) b`` for s from start to end."""

    def __init__(
        self, center: Any, axis_a: Any, axis_b: Any, start: float, end: float, **options: Unpack[LineOptions]
    ) -> None:
        center, axis_a, axis_b = _points((center, axis_a, axis_b))
        super().__init__(hyperbola(center, axis_a, axis_b, start, end), **options)


class GTJoin(_EdgeObject):
    """Line object: the GT curve that continues an edge of build123d, joined G1 to G3.

    Parameters
    ----------
    edge
        Any edge.
    points
        The control points after those that the join gives (k + 1 of them), at least one.
    order
        "G0" to "G3".
    at
        Where on the edge, by its parameter: 1 at its end, going on; 0 at its start, going back.
    gamma, scale
        See ``hosts.curve_on_edge``.
    options
        See ``LineOptions``. The B-spline has the curve's derivatives 0..k where it starts.

    Examples
    --------
    >>> line = host.Edge.make_line((0, 0, 0), (10, 0, 0))
    >>> bend = GTJoin(line, (15, 5), (15, 10), order="G2")
    >>> tuple(round(x, 6) for x in bend % 0)
    (1.0, 0.0, 0.0)
    """

    def __init__(
        self,
        edge: Any,
        *points: Any,
        order: GeometricOrder = "G1",
        at: float = 1.0,
        gamma: Sequence[float] = (0.0, 0.0),
        scale: Scale | None = None,
        **options: Unpack[LineOptions],
    ) -> None:
        curve = curve_on_edge(edge, _points(points), order=order, at=at, gamma=gamma, scale=scale)
        super().__init__(curve, end_order=(int(order[1]), 0), **options)


class GTComposite(GTObject, host.BaseLineObject):  # type: ignore[misc]
    """Line object: a chain of GT curves as one wire; pieces joined C1 to C3 share an edge.

    Parameters
    ----------
    pieces
        A ``Composite``; or curves of gtcad and line objects, each beginning where the one before ends.
    orders
        Of the joints, all "C0" unless given; one more for a closed chain.
    closed
        Whether the last piece ends where the first begins.
    options
        See ``LineOptions``.
    """

    def __init__(
        self,
        *pieces: Any,
        orders: Sequence[str] | None = None,
        closed: bool = False,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = 5,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
    ) -> None:
        made = made_wire(_chain(pieces, orders, closed), tolerance=tolerance, degree=degree)
        super().__init__(host.Wire(made.shape), mode=mode)
        _labelled(self, made, label, color)


def _chain(pieces: Sequence[Any], orders: Sequence[str] | None, closed: bool) -> Composite:
    only = pieces[0].exact if len(pieces) == 1 and isinstance(pieces[0], GTObject) else pieces[0] if pieces else None
    if isinstance(only, Composite) and len(pieces) == 1:
        if orders is not None or closed:
            raise InputError("orders and closed are those of the chain itself: give none")
        return only
    if not pieces:
        raise InputError("a chain needs at least one piece")
    curves = tuple(_curve(piece, f"pieces[{k}]") for k, piece in enumerate(pieces))
    joints = len(curves) - (0 if closed else 1)
    return Composite(curves, ("C0",) * joints if orders is None else tuple(orders), closed)


# --- sketches ---------------------------------------------------------------------------------------------------------


class GTProfile(GTObject, host.BaseSketchObject):  # type: ignore[misc]
    """Sketch object: the plane face inside a closed chain, or a patch in the plane.

    Parameters
    ----------
    pieces
        As of ``GTComposite``, in the plane z = 0, all around; or one patch with plane control points.
    orders
        Of the joints, the last one included.
    rotation
        In degrees.
    align
        One ``Align`` or two; None leaves it as drawn.
    options
        See ``LineOptions``.
    """

    def __init__(
        self,
        *pieces: Any,
        orders: Sequence[str] | None = None,
        rotation: float = 0,
        align: host.Align | tuple[host.Align, host.Align] | None = None,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = 5,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
    ) -> None:
        made: Made[Any]
        if len(pieces) == 1 and isinstance(pieces[0], SeparableSurface) and pieces[0].dimension == 2:
            made = made_face(pieces[0], tolerance=tolerance, degree=degree)
            face = host.Face(made.shape)
        else:
            whole = len(pieces) == 1 and isinstance(pieces[0], Composite | GTComposite | GTConic)
            made = made_wire(_chain(pieces, orders, not whole), tolerance=tolerance, degree=degree)
            face = _inside(host.Wire(made.shape))
        super().__init__(face, rotation, align, mode)
        _labelled(self, made, label, color)


def _inside(wire: Any) -> Any:
    if not wire.is_closed:
        raise InputError("a profile needs a closed chain, this one is open")
    height = max(abs(vertex.Z) for vertex in wire.vertices())
    if height > 1e-7:
        raise InputError(f"a profile must lie in the plane z = 0, this one reaches z = {height:.3g} mm")
    face = host.Face(wire)
    return face if face.normal_at().Z > 0 else -face


# --- faces ------------------------------------------------------------------------------------------------------------


class GTFace(GTObject, host.Face, BaseObject):  # type: ignore[misc]
    """Face object: any patch of gtcad. In a BuildPart it is a pending face, in a BuildSketch it must be plane.

    Parameters
    ----------
    patch
        Of any kind.
    tolerance, degree, rotation, align, mode, label, color
        See ``FaceOptions``.

    Raises
    ------
    InputError, ToleranceNotMet, ToleranceBelowPrecision, KernelError
        As ``hosts.made_face``.
    """

    _applies_to = [host.BuildPart._tag, host.BuildSketch._tag]  # noqa: RUF012 - the host's own way

    def __init__(
        self,
        patch: SeparableSurface,
        *,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = 5,
        rotation: host.Rotation | tuple[float, float, float] = (0, 0, 0),
        align: Any = None,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Any,
    ) -> None:
        made = made_face(patch, tolerance=tolerance, degree=degree, **settings)
        face = host.Face(made.shape)
        if align is not None:
            each = align if isinstance(align, tuple) else (align,) * 3
            face.move(host.Location(face.bounding_box().to_align_offset(each)))
        turn = host.Rotation(*rotation) if isinstance(rotation, tuple) else rotation
        self.rotation, self.mode = turn, mode
        super().__init__(face.moved(turn).wrapped)
        _labelled(self, made, label, color)


class GTSurface(GTFace):
    """Face object: the tensor-product GT patch of a net of control points, shape (n + 1, m + 1, 3)."""

    def __init__(
        self,
        control_points: ArrayLike,
        gamma_u: Sequence[float] = (0.0, 0.0),
        gamma_v: Sequence[float] = (0.0, 0.0),
        **options: Unpack[FaceOptions],
    ) -> None:
        super().__init__(Surface(control_points, gamma_u, gamma_v), **options)


class GTRuled(GTFace):
    """Face object: straight lines between two curves."""

    def __init__(self, a: Any, b: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Ruled(_curve(a, "a"), _curve(b, "b")), **options)


class GTSwept(GTFace):
    """Face object: a profile moved along a trajectory without turning."""

    def __init__(self, profile: Any, trajectory: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Swept(_curve(profile, "profile"), _curve(trajectory, "trajectory")), **options)


class GTSwung(GTFace):
    """Face object: a profile in the plane y = 0 swung along a trajectory in the plane z = 0."""

    def __init__(self, profile: Any, trajectory: Any, factor: float = 1.0, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Swung(_curve(profile, "profile"), _curve(trajectory, "trajectory"), factor), **options)


class GTRotation(GTFace):
    """Face object: a profile turned about an axis, by degrees."""

    def __init__(
        self,
        profile: Any,
        axis: host.Axis = host.Axis.Z,
        revolution_arc: float = 360.0,
        start_angle: float = 0.0,
        **options: Unpack[FaceOptions],
    ) -> None:
        point, direction = tuple(axis.position), tuple(axis.direction)
        super().__init__(Rotation(_curve(profile, "profile"), point, direction, revolution_arc, start_angle), **options)


class GTLofted(GTFace):
    """Face object: the patch through sections of one kind, at least three."""

    def __init__(
        self,
        sections: Iterable[Any],
        parameters: Sequence[float] | None = None,
        gamma_v: tuple[float, float] = (0.0, 0.0),
        family_v: Family = GT,
        **options: Unpack[FaceOptions],
    ) -> None:
        curves = [_curve(section, f"sections[{k}]") for k, section in enumerate(sections)]
        super().__init__(Lofted(curves, parameters, gamma_v, family_v), **options)


class GTCoons(GTFace):
    """Face object: the patch of four boundaries, v = 0, v = 1, u = 0 and u = 1."""

    def __init__(self, c0: Any, c1: Any, d0: Any, d1: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Coons(_curve(c0, "c0"), _curve(c1, "c1"), _curve(d0, "d0"), _curve(d1, "d1")), **options)


class GTSweep(GTFace):
    """Face object: a profile carried along a spine in its frame, turned and scaled; see ``patches.Sweep``."""

    def __init__(
        self,
        profile: Any,
        spine: Any,
        *,
        frame: Frame = "rotation-minimising",
        start_normal: Any = None,
        scale: ArrayLike = 1.0,
        twist: float = 0.0,
        closed: bool = False,
        **options: Unpack[FaceOptions],
    ) -> None:
        normal = None if start_normal is None else tuple(host.Vector(start_normal))
        curves = _curve(profile, "profile"), _curve(spine, "spine")
        sweep = Sweep(*curves, frame=frame, start_normal=normal, scale=scale, twist_deg=twist, closed=closed)
        super().__init__(sweep, **options)


class GTJoinPatch(GTFace):
    """Face object: the GT patch from an edge of a face of build123d to a curve, joined G1 or G2 along the edge.

    Parameters
    ----------
    face, edge
        Any face, and one of its edges that is a whole side of its surface.
    curve
        The opposite side.
    order
        "G0" to "G2".
    reach
        How fast the patch leaves the face, in mm; see ``hosts.patch_on_face``.
    options
        See ``FaceOptions``. The edge is met within the tolerance, with an edge of its own.

    Attributes
    ----------
    report
        Of the join, by ``check_edge``: figures of samples.
    """

    report: EdgeReport

    def __init__(
        self,
        face: Any,
        edge: Any,
        curve: Any,
        *,
        order: Literal["G0", "G1", "G2"] = "G1",
        reach: float | None = None,
        **options: Unpack[FaceOptions],
    ) -> None:
        tolerance = options.get("tolerance", DEFAULT_TOLERANCE)
        joined = patch_on_face(face, edge, _curve(curve, "curve"), order=order, reach=reach, tolerance=tolerance)
        super().__init__(joined.surface, end_order=((int(order[1]), 0), (0, 0)), **options)
        self.report = joined.report


# --- parts ------------------------------------------------------------------------------------------------------------


class GTSolid(GTObject, host.BasePartObject):  # type: ignore[misc]
    """Part object: the body inside patches, one closed by plane caps, or a wall along them.

    Parameters
    ----------
    patches
        Patches of gtcad or face objects, which share their edges; or one ``Quilt`` or ``Solid``.
    caps
        "planar": each loop of free edges is closed by a plane face; "none": the patches close, or get a thickness.
    thickness
        Of a wall in mm, positive along the normals; None for a full body.
    rotation
        Angles about X, Y and Z in degrees.
    align
        ``Align`` of MIN, CENTER or MAX to the origin, one or three; None leaves it as drawn.
    options
        See ``LineOptions``.

    Raises
    ------
    InputError, ToleranceNotMet, ToleranceBelowPrecision, KernelError
        As ``hosts.made_solid``.
    """

    def __init__(
        self,
        *patches: Any,
        caps: Caps = "none",
        thickness: float | None = None,
        rotation: host.Rotation | tuple[float, float, float] = (0, 0, 0),
        align: Any = None,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = 5,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
    ) -> None:
        made = made_solid(_solid(patches, caps, thickness), tolerance=tolerance, degree=degree)
        super().__init__(host.Solid(made.shape), rotation=rotation, align=align, mode=mode)
        _labelled(self, made, label, color)

    def named_face(self, name: str) -> Any:
        """The face of a patch, cap or offset by its name: "patch 1", "cap 1", ...; see ``names``.

        Raises
        ------
        InputError
            When there is no such face.
        """
        faces = self.made.body.faces  # type: ignore[union-attr]
        if name not in faces:
            raise InputError(f"name must be one of {', '.join(map(repr, faces))}, got {name!r}")
        return host.Face(faces[name].Moved(self.solids()[0].wrapped.Location()))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the faces."""
        return tuple(self.made.body.faces)  # type: ignore[union-attr]


def _solid(patches: Sequence[Any], caps: Caps, thickness: float | None) -> Solid:
    if len(patches) == 1 and isinstance(patches[0], Solid):
        if caps != "none" or thickness is not None:
            raise InputError("caps and thickness are those of the solid itself: give none")
        return patches[0]
    return Solid(_quilt(patches), caps, thickness)


def _quilt(patches: Sequence[Any]) -> Quilt:
    if len(patches) == 1 and isinstance(patches[0], Quilt):
        return patches[0]
    return Quilt.recognised([_patch(one, f"patches[{k}]") for k, one in enumerate(patches)])


# --- functions --------------------------------------------------------------------------------------------------------


def to_edge(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Edge:
    """The ``Edge`` of a curve, or of a chain that is one edge; no builder takes it in. It has ``made``.

    Parameters
    ----------
    curve
        In mm.
    tolerance
        Largest distance from the curve, in mm.
    label, color
        Of the edge.
    settings
        The other arguments of ``fit_curve`` or ``fit_chain``.

    Raises
    ------
    InputError, ToleranceNotMet, ToleranceBelowPrecision, KernelError
        As ``hosts.made_edge``.
    """
    return _shape(host.Edge, made_edge(curve, tolerance=tolerance, **settings), label, color)


def to_wire(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Wire:
    """The ``Wire`` of a chain or a curve; see ``to_edge``."""
    return _shape(host.Wire, made_wire(curve, tolerance=tolerance, **settings), label, color)


def to_face(
    surface: SeparableSurface,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Face:
    """The ``Face`` of a patch; see ``to_edge``."""
    return _shape(host.Face, made_face(surface, tolerance=tolerance, **settings), label, color)


def to_shell(
    quilt: Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Shell:
    """The ``Shell`` of a quilt, neighbours sharing their edges; see ``to_edge``."""
    return _shape(host.Shell, made_shell(quilt, tolerance=tolerance, **settings), label, color)


def to_solid(
    solid: Solid | Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Solid:
    """The ``host.Solid`` of a solid, or of what a closed quilt encloses; see ``to_edge``."""
    return _shape(host.Solid, made_solid(solid, tolerance=tolerance, **settings), label, color)


def to_shape(
    shape: Core, *, tolerance: float = DEFAULT_TOLERANCE, label: str = "", color: Any = None, **settings: Any
) -> host.Shape:
    """The edge, wire, face, shell or solid of any shape of gtcad; see ``to_edge``."""
    made: Made[Any]
    if isinstance(shape, Composite):
        made = made_wire(shape, tolerance=tolerance, **settings)
        return _shape(host.Wire, made, label, color)
    if isinstance(shape, SeparableCurve):
        return _shape(host.Edge, made_edge(shape, tolerance=tolerance, **settings), label, color)
    if isinstance(shape, Quilt):
        return _shape(host.Shell, made_shell(shape, tolerance=tolerance, **settings), label, color)
    if isinstance(shape, Solid):
        return _shape(host.Solid, made_solid(shape, tolerance=tolerance, **settings), label, color)
    return _shape(host.Face, made_face(shape, tolerance=tolerance, **settings), label, color)


def to_compound(model: Model, *, tolerance: float = DEFAULT_TOLERANCE, **settings: Any) -> host.Compound:
    """The shapes of a model, with their names as labels and their colours; without what only serves construction."""
    meant = model.in_millimetres()
    children = [
        to_shape(shape, tolerance=tolerance, label=name, color=model.colors.get(name), **settings)
        for name, shape in meant.items()
        if name not in model.construction
    ]
    return host.Compound(children=children)


def _shape(kind: Kind, made: Made[Any], label: str, color: Any) -> Any:
    shape = kind(made.shape)
    _labelled(shape, made, label, color)
    return shape


def from_edge(
    edge: Any, *, tolerance: float = DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> Design[Any]:
    """The GT curve nearest to an edge, or a chain where one is not enough: ``curve`` and its proved ``deviation``.

    See ``hosts.design_from_edge``.
    """
    return design_from_edge(edge, tolerance=tolerance, degree=degree, order=order)


def from_face(
    face: Any, *, tolerance: float = DEFAULT_TOLERANCE, max_degree: int = 16, untrimmed: bool = False
) -> FaceDesign:
    """The GT patch nearest to a face: ``surface`` and its proved ``deviation``.

    See ``hosts.design_from_face``.
    """
    return design_from_face(face, tolerance=tolerance, max_degree=max_degree, untrimmed=untrimmed)


def show(*objects: Any, tolerance: float = DEFAULT_TOLERANCE, **options: Any) -> Any:
    """``show`` of ocp_vscode, which also takes shapes of gtcad then.

    Parameters
    ----------
    objects
        Shapes of build123d or of gtcad.
    tolerance
        Of the latter, in mm.
    options
        Those of ``ocp_vscode.show``.

    Raises
    ------
    ExtraMissing
        When ocp_vscode is not installed.
    """
    try:
        viewer = importlib.import_module("ocp_vscode").show
    except ImportError as error:
        raise ExtraMissing("show needs the viewer: pip install ocp-vscode") from error
    core = SeparableCurve | SeparableSurface | Composite | Quilt | Solid
    return viewer(*(to_shape(one, tolerance=tolerance) if isinstance(one, core) else one for one in objects), **options)
