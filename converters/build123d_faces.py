"""Sketch, face and part objects of build123d from GT patches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal, Unpack

from numpy.typing import ArrayLike

from gtcad.basis import GT, Family
from gtcad.composite import Composite
from gtcad.converters.build123d_lines import (
    BaseObject,
    FaceOptions,
    FitOptions,
    GTComposite,
    GTConic,
    GTObject,
    chain_of,
    curve_of,
    host,
    labelled,
    patch_of,
)
from gtcad.converters.fit import Degree
from gtcad.converters.host_designs import DEFAULT_DEGREE, DEFAULT_TOLERANCE
from gtcad.converters.host_joins import patch_on_face
from gtcad.converters.hosts import Made, made_face, made_solid, made_wire
from gtcad.edge_check import EdgeReport
from gtcad.errors import InputError
from gtcad.patches import Coons, Lofted, Rotation, Ruled, Sweep, Swept, Swung
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Caps, Solid
from gtcad.surface import Surface

Frame = Literal["rotation-minimising", "frenet", "fixed"]

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
        degree: Degree = DEFAULT_DEGREE,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Unpack[FitOptions],
    ) -> None:
        made: Made[Any]
        if len(pieces) == 1 and isinstance(pieces[0], SeparableSurface) and pieces[0].dimension == 2:
            made = made_face(pieces[0], tolerance=tolerance, degree=degree, **settings)
            face = host.Face(made.shape)
        else:
            whole = len(pieces) == 1 and isinstance(pieces[0], Composite | GTComposite | GTConic)
            made = made_wire(chain_of(pieces, orders, not whole), tolerance=tolerance, degree=degree, **settings)
            face = _inside(host.Wire(made.shape))
        super().__init__(face, rotation, align, mode)
        labelled(self, made, label, color)


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
        degree: Degree = DEFAULT_DEGREE,
        rotation: host.Rotation | tuple[float, float, float] = (0, 0, 0),
        align: Any = None,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Unpack[FitOptions],
    ) -> None:
        made = made_face(patch, tolerance=tolerance, degree=degree, **settings)
        face = host.Face(made.shape)
        if align is not None:
            each = align if isinstance(align, tuple) else (align,) * 3
            face.move(host.Location(face.bounding_box().to_align_offset(each)))
        turn = host.Rotation(*rotation) if isinstance(rotation, tuple) else rotation
        self.rotation, self.mode = turn, mode
        super().__init__(face.moved(turn).wrapped)
        labelled(self, made, label, color)


class GTSurface(GTFace):
    """Face object: the tensor-product GT patch of a net of control points.

    Parameters
    ----------
    control_points
        Shape (n + 1, m + 1, 3), in mm; u runs from row to row, v along a row.
    gamma_u, gamma_v
        Design variables of each direction, two in [-1, 1].
    options
        See ``FaceOptions``.
    """

    def __init__(
        self,
        control_points: ArrayLike,
        gamma_u: Sequence[float] = (0.0, 0.0),
        gamma_v: Sequence[float] = (0.0, 0.0),
        **options: Unpack[FaceOptions],
    ) -> None:
        super().__init__(Surface(control_points, gamma_u, gamma_v), **options)


class GTRuled(GTFace):
    """Face object: straight lines between two curves.

    Parameters
    ----------
    a, b
        The boundaries at v = 0 and v = 1: curves of gtcad, or line objects; in mm.
    options
        See ``FaceOptions``.
    """

    def __init__(self, a: Any, b: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Ruled(curve_of(a, "a"), curve_of(b, "b")), **options)


class GTSwept(GTFace):
    """Face object: a profile moved along a trajectory without turning, profile(u) + trajectory(v).

    Parameters
    ----------
    profile, trajectory
        Curves of gtcad, or line objects; in mm.
    options
        See ``FaceOptions``.
    """

    def __init__(self, profile: Any, trajectory: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Swept(curve_of(profile, "profile"), curve_of(trajectory, "trajectory")), **options)


class GTSwung(GTFace):
    """Face object: a profile (x, z) that a trajectory (X, Y) turns about the z axis and stretches, (a x X, a x Y, z).

    Parameters
    ----------
    profile
        In the plane y = 0: a curve of gtcad, or a line object; in mm.
    trajectory
        In the plane z = 0: the same.
    factor
        a, not 0.
    options
        See ``FaceOptions``.
    """

    def __init__(self, profile: Any, trajectory: Any, factor: float = 1.0, **options: Unpack[FaceOptions]) -> None:
        super().__init__(Swung(curve_of(profile, "profile"), curve_of(trajectory, "trajectory"), factor), **options)


class GTRotation(GTFace):
    """Face object: a profile turned about an axis.

    Parameters
    ----------
    profile
        A curve of gtcad, or a line object; in mm.
    axis
        The z axis unless given; turning is counterclockwise seen against its direction.
    revolution_arc
        From -360 to 360 degrees, not 0. A full turn closes.
    start_angle
        Where the turn begins, in degrees.
    options
        See ``FaceOptions``.
    """

    def __init__(
        self,
        profile: Any,
        axis: host.Axis = host.Axis.Z,
        revolution_arc: float = 360.0,
        start_angle: float = 0.0,
        **options: Unpack[FaceOptions],
    ) -> None:
        point, direction = tuple(axis.position), tuple(axis.direction)
        super().__init__(
            Rotation(curve_of(profile, "profile"), point, direction, revolution_arc, start_angle), **options
        )


class GTLofted(GTFace):
    """Face object: the patch through sections.

    Parameters
    ----------
    sections
        Curves of gtcad, or line objects, of equal degree and design variables; three at least. In mm.
    parameters
        The v of each section, rising in [0, 1]; at equal distances unless given.
    gamma_v, family_v
        Design variables and family of the functions of v.
    options
        See ``FaceOptions``.
    """

    def __init__(
        self,
        sections: Iterable[Any],
        parameters: Sequence[float] | None = None,
        gamma_v: tuple[float, float] = (0.0, 0.0),
        family_v: Family = GT,
        **options: Unpack[FaceOptions],
    ) -> None:
        curves = [curve_of(section, f"sections[{k}]") for k, section in enumerate(sections)]
        super().__init__(Lofted(curves, parameters, gamma_v, family_v), **options)


class GTCoons(GTFace):
    """Face object: the Coons patch of four boundaries.

    Parameters
    ----------
    c0, c1
        The boundaries at v = 0 and v = 1: curves of gtcad, or line objects; in mm.
    d0, d1
        Those at u = 0 and u = 1; they begin on c0 and end on c1.
    options
        See ``FaceOptions``.
    """

    def __init__(self, c0: Any, c1: Any, d0: Any, d1: Any, **options: Unpack[FaceOptions]) -> None:
        super().__init__(
            Coons(curve_of(c0, "c0"), curve_of(c1, "c1"), curve_of(d0, "d0"), curve_of(d1, "d1")), **options
        )


class GTSweep(GTFace):
    """Face object: a profile carried along a spine in its frame, turned and scaled; see ``patches.Sweep``.

    Parameters
    ----------
    profile
        Across the spine, (x, y): a curve of gtcad, or a line object; in mm.
    spine
        The same, in space.
    frame
        "rotation-minimising", "frenet" or "fixed".
    start_normal
        The direction of the profile's x at the start; chosen unless given.
    scale
        Of the profile: one number, or the Bernstein coefficients of a law along the spine.
    twist
        Degrees that the profile turns about the spine.
    closed
        Whether it is turned so much more that it closes with a closed spine.
    options
        See ``FaceOptions``.
    """

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
        curves = curve_of(profile, "profile"), curve_of(spine, "spine")
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
        joined = patch_on_face(face, edge, curve_of(curve, "curve"), order=order, reach=reach, tolerance=tolerance)
        options.setdefault("end_order", ((int(order[1]), 0), (0, 0)))
        super().__init__(joined.surface, **options)
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
        degree: Degree = DEFAULT_DEGREE,
        mode: host.Mode = host.Mode.ADD,
        label: str = "",
        color: Any = None,
        **settings: Unpack[FitOptions],
    ) -> None:
        made = made_solid(_solid(patches, caps, thickness), tolerance=tolerance, degree=degree, **settings)
        super().__init__(host.Solid(made.shape), rotation=rotation, align=align, mode=mode)
        labelled(self, made, label, color)

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
    return Quilt.recognised([patch_of(one, f"patches[{k}]") for k, one in enumerate(patches)])
