"""What goes into an exchange file and what comes out of one: a piece of geometry with its name and colour."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.quadrics import Quadric, spatial
from gtcad.errors import InputError
from gtcad.measure import Estimate

Array = NDArray[np.float64]
Color = tuple[float, float, float]
MEETING = 1e-10  # mm: what still is one point
_SQUARE = 1e-9  # cosine of the axes' angle that still counts as a right angle
_TURN = 2 * np.pi * (1 + 1e-15)


@dataclass(frozen=True, eq=False)
class EllipseArc:
    r"""An arc of an ellipse, or of a circle when both axes have the same length.

    .. math:: p(\theta) = c + \cos(\theta)\, a + \sin(\theta)\, b, \qquad \theta \in [\text{start}, \text{end}]

    Parameters
    ----------
    center
        Shape (3,), in mm.
    axis_a, axis_b
        The two half axes as vectors, shape (3,), in mm, at right angles; either may be the longer one.
    start, end
        Angles in radians, start < end, at most a full turn apart.

    Raises
    ------
    InputError
        When an axis is zero, the axes are not at right angles, or the angles are out of order.

    Notes
    -----
    From a file it comes back with its longer axis as `axis_a` and with `start` in [0, 2 pi): the same points, but
    perhaps other numbers.

    Examples
    --------
    >>> EllipseArc([0, 0, 0], [2, 0, 0], [0, 1, 0], 0.0, 3.0).evaluate(0.0)
    array([2., 0., 0.])
    """

    center: Array
    axis_a: Array
    axis_b: Array
    start: float
    end: float

    def __init__(self, center: ArrayLike, axis_a: ArrayLike, axis_b: ArrayLike, start: float, end: float) -> None:
        object.__setattr__(self, "center", spatial("center", center))
        object.__setattr__(self, "axis_a", spatial("axis_a", axis_a))
        object.__setattr__(self, "axis_b", spatial("axis_b", axis_b))
        object.__setattr__(self, "start", float(start))
        object.__setattr__(self, "end", float(end))
        lengths = np.linalg.norm(self.axis_a), np.linalg.norm(self.axis_b)
        if min(lengths) == 0:
            raise InputError(f"the axes must not be zero, got lengths {lengths[0]} and {lengths[1]}")
        cosine = float(self.axis_a / lengths[0] @ (self.axis_b / lengths[1]))
        if abs(cosine) > _SQUARE:
            raise InputError(f"the axes must be at right angles, got an angle with cosine {cosine:.3g}")
        if not 0 < self.end - self.start <= _TURN:
            raise InputError(f"start < end <= start + 2 pi is needed, got {self.start} and {self.end}")

    @property
    def is_circle(self) -> bool:
        """Whether both axes have the same length, to 14 digits."""
        lengths = np.linalg.norm(self.axis_a), np.linalg.norm(self.axis_b)
        return bool(abs(lengths[0] - lengths[1]) <= 1e-14 * max(lengths))

    def evaluate(self, theta: ArrayLike) -> Array:
        """Points at the angles theta, shape theta.shape + (3,)."""
        angle = np.asarray(theta, dtype=np.float64)[..., None]
        points: Array = self.center + np.cos(angle) * self.axis_a + np.sin(angle) * self.axis_b
        return points


class Side(NamedTuple):
    """Places along a side of a face: points and normals, each (n, 3), and the mean curvature there, (n,)."""

    points: Array
    normals: Array
    mean: Array


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles of a face, for the eye or to sample it.

    Attributes
    ----------
    points, normals
        Corners on the face and its unit normals there, each (n, 3); NaN where there is no normal.
    triangles
        Three corners each, counterclockwise seen from where the normals point, shape (m, 3).
    mean, gaussian
        Curvatures at the corners, shape (n,): the mean one positive where the face bends towards its normal.
    sides
        Along its edges, all the way round.
    """

    points: Array
    triangles: NDArray[np.int64]
    normals: Array
    mean: Array
    gaussian: Array
    sides: tuple[Side, ...]


@dataclass(frozen=True, eq=False)
class Region:
    """The part of a surface that a face is.

    Attributes
    ----------
    rectangle
        First and last u, first and last v of the part's spline, where the face is that rectangle; None where it is
        trimmed otherwise.
    inside
        From parameters of the part's spline, shape (n, 2), to whether they are those of a point of the face.
    sampled
        From a number of lines to points of the face, shape (n, 3): its boundary, and those of a grid that lie inside.
    feet
        From points, shape (n, 3), to the nearest points of the face: those of the kernel.
    """

    rectangle: tuple[tuple[float, float], tuple[float, float]] | None
    inside: Callable[[Array], NDArray[np.bool_]]
    sampled: Callable[[int], Array]
    feet: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class TrimmedFace:
    """What is known of a face that is less than all of its surface.

    Attributes
    ----------
    distances
        From points, shape (n, 3), to their distances from the face, shape (n,), in mm: those of the kernel.
    area
        In mm^2.
    facets
        Divides it into triangles that the eye takes for it; None when nothing can.
    region
        What of its surface it is; None where that is not known.
    """

    distances: Callable[[Array], Array]
    area: float
    facets: Callable[[], Facets] | None = None
    region: Region | None = None


@dataclass(frozen=True, eq=False)
class Wire:
    """Curves end to end: they become the edges of one wire and share its vertices.

    Parameters
    ----------
    edges
        In mm, in space, each beginning where the one before ends, to the last digit for splines.

    Raises
    ------
    InputError
        When there are none, or two do not meet.
    """

    edges: tuple[BSplineCurve | EllipseArc, ...]

    def __post_init__(self) -> None:
        if not self.edges:
            raise InputError("a wire needs at least one edge")
        for k, (a, b) in enumerate(itertools.pairwise(self.edges)):
            gap = float(np.linalg.norm(ends_of(a)[1] - ends_of(b)[0]))
            if gap > MEETING:
                raise InputError(f"edges {k} and {k + 1} of a wire must meet, they are {gap:.3g} mm apart")

    @property
    def closed(self) -> bool:
        """Whether the last edge ends where the first begins."""
        return bool(np.linalg.norm(ends_of(self.edges[-1])[1] - ends_of(self.edges[0])[0]) <= MEETING)


def ends_of(edge: BSplineCurve | EllipseArc) -> Array:
    """The first and the last point of an edge in space, shape (2, 3)."""
    if isinstance(edge, EllipseArc):
        return edge.evaluate(np.array([edge.start, edge.end]))
    points = edge.control_points[[0, -1]]
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


@dataclass(frozen=True, eq=False)
class BodyFacts:
    """What is known of the shell or solid that a face was read from.

    Attributes
    ----------
    kind
        "shell" or "solid".
    closed
        Whether each edge is in two faces, or a seam, or one point.
    valid
        The verdict of the kernel's BRepCheck.
    volume
        Measures it, in mm^3, with an estimate of the error.
    """

    kind: str
    closed: bool
    valid: bool
    volume: Callable[[], Estimate]


@dataclass(frozen=True)
class Measured:
    """What the kernel measures of faces, and of the solid that they bound.

    Attributes
    ----------
    area, centroid
        Of the faces together, in mm^2 and mm.
    volume, volume_centroid
        Of the solid, in mm^3 and mm; None when the faces do not bound one.
    """

    area: float
    centroid: tuple[float, float, float]
    volume: float | None
    volume_centroid: tuple[float, float, float] | None


@dataclass(frozen=True, eq=False)
class Properties:
    """What a file states of a shape besides the shape, for readers to compare: validation properties.

    Attributes
    ----------
    area
        Of all faces, in mm^2; None when it is not stated.
    volume
        Of a solid, in mm^3; None when it is not stated.
    centroid
        In mm: of the volume of a solid, else of the area; None when it is not stated.
    points
        On the faces, shape (n, 3), in mm; none when they are not stated.
    measured
        Measures the same of what the file holds; None in what is to be written.
    name
        Of the shape; empty in what is to be written.
    """

    area: float | None
    volume: float | None
    centroid: tuple[float, float, float] | None
    points: Array
    measured: Callable[[], Measured] | None = None
    name: str = ""


@dataclass(frozen=True, eq=False)
class Built:
    """A shell or a solid that the kernel holds already.

    Attributes
    ----------
    kind
        "shell" or "solid".
    shape
        The kernel's, in mm.
    face_names
        One for each of its faces, in their order.
    splines
        The surfaces of those faces that are splines of patches.
    """

    kind: str
    shape: Any
    face_names: tuple[str, ...]
    splines: tuple[BSplineSurface, ...]


Single = BSplineCurve | BSplineSurface | EllipseArc | Quadric
Geometry = Single | Wire | Built


@dataclass(frozen=True, eq=False)
class Part:
    """One curve or surface of an exchange file.

    Parameters
    ----------
    name
        Any text, or empty.
    geometry
        A curve becomes an edge, a surface a face bounded by its whole parameter rectangle. In mm. What is read is never
        a `Wire` or `Built`: each edge is a part of the wire's name, each face one of its own name.
    color
        Red, green and blue in [0, 1], the numbers that a colour picker shows (sRGB), or None. Files keep six decimals.
    source
        Read parts: the kind of geometry in the file, in the words of Part 21 whatever the format: "B_SPLINE_CURVE",
        "B_SPLINE_SURFACE", "BEZIER_CURVE", "BEZIER_SURFACE", "LINE", "CIRCLE", "ELLIPSE", "PARABOLA", "HYPERBOLA",
        "PLANE", "CYLINDRICAL_SURFACE", "CONICAL_SURFACE", "SPHERICAL_SURFACE", "TOROIDAL_SURFACE",
        "SURFACE_OF_LINEAR_EXTRUSION", "SURFACE_OF_REVOLUTION". Empty in parts to be written.
    trimmed
        Read faces: whether the face is less than all of `geometry`, which then reaches beyond the face.
    reversed
        Read parts: whether the face's normal, or the edge's direction, is opposite to that of `geometry`.
    valid
        Read parts: the verdict of the kernel's BRepCheck.
    face
        Read faces that are trimmed: what only the kernel can measure of them.
    body
        Read faces: the shell or solid that they belong to, one object for all its faces; None for faces that stand
        alone.
    properties
        What the file is to state, or states, of the shape: in STEP files of AP242 and AP214. Of faces of one product,
        one object for all.

    Raises
    ------
    InputError
        When the name is not a text, the geometry of none of these kinds, or a colour out of range.
    """

    name: str
    geometry: Geometry
    color: Color | None = None
    source: str = ""
    trimmed: bool = False
    reversed: bool = False
    valid: bool = True
    face: TrimmedFace | None = None
    body: BodyFacts | None = None
    properties: Properties | None = None

    def __post_init__(self) -> None:
        name: object = self.name
        geometry: object = self.geometry
        if not isinstance(name, str):
            raise InputError(f"name must be a text, got {name!r}")
        if not isinstance(geometry, BSplineCurve | BSplineSurface | EllipseArc | Quadric | Wire | Built):
            kinds = "a BSplineCurve, BSplineSurface, EllipseArc, Quadric, Wire or Built"
            raise InputError(f"geometry must be {kinds}, got {type(geometry).__name__}")
        if self.color is not None:
            object.__setattr__(self, "color", _checked_color(self.color))


def _checked_color(color: Color) -> Color:
    values = tuple(float(value) for value in color)
    if len(values) != 3 or not all(0 <= value <= 1 for value in values):
        raise InputError(f"color must be three numbers in [0, 1], got {color}")
    return values[0], values[1], values[2]
