"""Line objects of build123d from GT curves, and what all objects of gtcad there have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from gtcad.composite import Composite
from gtcad.conics import Arc, hyperbola, parabola
from gtcad.continuity import Scale
from gtcad.converters.fit import Degree
from gtcad.converters.host_designs import DEFAULT_DEGREE, DEFAULT_TOLERANCE
from gtcad.converters.host_joins import curve_on_edge
from gtcad.converters.hosts import AnyFit, Made, made_edge, made_wire
from gtcad.curve import Curve
from gtcad.errors import ExtraMissing, InputError
from gtcad.protocol import SeparableCurve, SeparableSurface

try:
    import build123d as host
    from build123d.build_common import BaseObject, flatten_sequence
except ImportError as error:
    raise ExtraMissing(f"build123d is needed here: pip install 'gtcad[build123d]' ({error})") from error

Array = NDArray[np.float64]

__all__ = [
    "BaseObject",
    "FaceOptions",
    "FitOptions",
    "GTBezier",
    "GTComposite",
    "GTConic",
    "GTCurve",
    "GTHyperbola",
    "GTJoin",
    "GTObject",
    "GTParabola",
    "LineOptions",
    "chain_of",
    "curve_of",
    "host",
    "labelled",
    "patch_of",
    "points_of",
]

GeometricOrder = Literal["G0", "G1", "G2", "G3"]

_SUBSHAPES = {"EDGE": "edges", "WIRE": "wires", "FACE": "faces", "SHELL": "shells", "SOLID": "solids"}


class FitOptions(TypedDict, total=False):
    """The other arguments of ``fit_curve`` and ``fit_surface``, which every object takes too."""

    continuity: int | None
    end_order: int | tuple[int, int] | tuple[tuple[int, int], tuple[int, int]]
    exact: Literal["auto"] | bool
    max_spans: int
    max_degree: int
    adapt: bool


class LineOptions(FitOptions, total=False):
    """What every line object takes, besides ``FitOptions``.

    Attributes
    ----------
    tolerance
        Largest distance from the exact curve, in mm; 1e-3 unless given.
    degree
        Of the B-spline, 3 to 25, or "auto" unless given: what needs the fewest poles.
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


def labelled(shape: Any, made: Made[Any], label: str, color: Any) -> None:
    """Give a shape of the host what it was made from, a label and a colour."""
    shape.made = made
    shape.label = label
    if color is not None:
        shape.color = color if isinstance(color, host.Color) else host.Color(color)


def curve_of(given: Any, name: str) -> SeparableCurve:
    """A curve of gtcad from one, or from a line object where it is."""
    found = given.exact if isinstance(given, GTObject) else given
    if not isinstance(found, SeparableCurve):
        raise InputError(f"{name} must be a curve of gtcad or an object with one, got {type(given).__name__}")
    return found


def patch_of(given: Any, name: str) -> SeparableSurface:
    """A patch of gtcad from one, or from a face object where it is."""
    found = given.exact if isinstance(given, GTObject) else given
    if not isinstance(found, SeparableSurface):
        raise InputError(f"{name} must be a patch of gtcad or an object with one, got {type(given).__name__}")
    return found


def points_of(points: Iterable[Any]) -> list[tuple[float, float, float]]:
    """Points from points of the host: tuples, vectors, vertices, and sequences of these."""
    return [tuple(host.Vector(one)) for one in flatten_sequence(*points)]


# --- lines ------------------------------------------------------------------------------------------------------------


class EdgeObject(GTObject, host.BaseEdgeObject):  # type: ignore[misc]
    def __init__(
        self,
        curve: SeparableCurve | Composite,
        *,
        tolerance: float = DEFAULT_TOLERANCE,
        degree: Degree = DEFAULT_DEGREE,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Any,
    ) -> None:
        made = made_edge(curve, tolerance=tolerance, degree=degree, **settings)
        super().__init__(host.Edge(made.shape), mode=mode)
        labelled(self, made, label, color)


class GTBezier(EdgeObject):
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
        super().__init__(Curve(points_of(points), (float(gamma[0]), float(gamma[1]))), **options)


class GTCurve(EdgeObject):
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


class GTConic(EdgeObject):
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
        center, axis_a, axis_b = points_of((center, axis_a, axis_b))
        super().__init__(Arc(center, axis_a, axis_b, start_angle, end_angle), **options)


class GTParabola(EdgeObject):
    """Line object: the parabola from p0 to p2 whose tangents there meet in p1."""

    def __init__(self, p0: Any, p1: Any, p2: Any, **options: Unpack[LineOptions]) -> None:
        super().__init__(parabola(*points_of((p0, p1, p2))), **options)


class GTHyperbola(EdgeObject):
    """Line object: ``c + cosh(s) a + sinh(s) b`` for s from start to end."""

    def __init__(
        self, center: Any, axis_a: Any, axis_b: Any, start: float, end: float, **options: Unpack[LineOptions]
    ) -> None:
        center, axis_a, axis_b = points_of((center, axis_a, axis_b))
        super().__init__(hyperbola(center, axis_a, axis_b, start, end), **options)


class GTJoin(EdgeObject):
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
        See ``LineOptions``. The B-spline has the curve's derivatives 0..k where it starts, or what ``end_order`` says.

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
        curve = curve_on_edge(edge, points_of(points), order=order, at=at, gamma=gamma, scale=scale)
        options.setdefault("end_order", (int(order[1]), 0))
        super().__init__(curve, **options)


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
        degree: Degree = DEFAULT_DEGREE,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Unpack[FitOptions],
    ) -> None:
        made = made_wire(chain_of(pieces, orders, closed), tolerance=tolerance, degree=degree, **settings)
        super().__init__(host.Wire(made.shape), mode=mode)
        labelled(self, made, label, color)


def chain_of(pieces: Sequence[Any], orders: Sequence[str] | None, closed: bool) -> Composite:
    """A chain from one, or from its pieces."""
    only = pieces[0].exact if len(pieces) == 1 and isinstance(pieces[0], GTObject) else pieces[0] if pieces else None
    if isinstance(only, Composite) and len(pieces) == 1:
        if orders is not None or closed:
            raise InputError("orders and closed are those of the chain itself: give none")
        return only
    if not pieces:
        raise InputError("a chain needs at least one piece")
    curves = tuple(curve_of(piece, f"pieces[{k}]") for k, piece in enumerate(pieces))
    joints = len(curves) - (0 if closed else 1)
    return Composite(curves, ("C0",) * joints if orders is None else tuple(orders), closed)
