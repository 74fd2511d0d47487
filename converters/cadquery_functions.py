"""Functions that return shapes of CadQuery, in the manner of ``cadquery.func``."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from gtcad.basis import BERNSTEIN, GT
from gtcad.composite import Composite
from gtcad.conics import Arc
from gtcad.continuity import Scale, parsed_order
from gtcad.converters import hosts
from gtcad.converters.cadquery_shapes import (
    CurveLike,
    GtEdge,
    GtFace,
    GtShell,
    GtSolid,
    GtWire,
    PointLike,
    Settings,
    SurfaceLike,
    cq,
    curve_of,
    in_one_space,
    point_of,
    points_of,
    quilt_of,
)
from gtcad.converters.hosts import Core
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
from gtcad.solid import Solid
from gtcad.surface import Surface

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
    curve = points if isinstance(points, Composite) else curve_of("points", points, gamma)
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
    settings
        See ``Settings``.
    """
    if isinstance(pieces, Composite):
        return GtWire.of(hosts.made_wire(pieces, **settings))
    curves = in_one_space([curve_of(f"pieces[{k}]", piece) for k, piece in enumerate(pieces)])
    joints = (orders,) * (len(curves) - (not closed)) if isinstance(orders, str) else tuple(orders)
    return GtWire.of(hosts.made_wire(Composite(tuple(curves), joints, closed), **settings))


def from_edge(
    edge: cq.Edge, *, tolerance: float = hosts.DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> GtEdge | GtWire:
    """The GT curve nearest to an edge, or a chain of them where one is not enough, within a tolerance of the edge.

    Lines, circles, ellipses and their arcs come out exactly, unless a degree is given.

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
    one = not isinstance(design.curve, Composite) or isinstance(design.curve, Arc)
    make = gtCurve if one else gtChain
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
        As of ``gtcad.converters.hosts.curve_on_edge``: at 1 from its end, at 0 from its start. The fit keeps the join
        unless ``end_order`` says else.
    """
    rest = [point_of(point) for point in points]
    curve = hosts.curve_on_edge(edge, rest, order=order, at=at, gamma=gamma, scale=scale)
    settings.setdefault("end_order", (parsed_order(order)[1], 0))
    return gtCurve(curve, **settings)


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
        Design variables of a surface from points, two in [-1, 1] each.
    settings
        See ``Settings``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``gtcad.converters.fit_surface``. All functions that make faces do, and take the same settings.
    """
    if not isinstance(net, SeparableSurface):
        rows = [points_of(f"net[{k}]", row) for k, row in enumerate(net)]
        if len({row.shape for row in rows}) != 1:
            raise InputError(f"net must be rows of as many points each, got rows of {[len(row) for row in rows]}")
        families = [BERNSTEIN if count == 2 else GT for count in (len(rows), len(rows[0]))]
        net = Surface(np.stack(rows), gammaU, gammaV, *families)
    return GtFace.of(hosts.made_face(net, **settings))


def gtRuled(a: CurveLike, b: CurveLike, **settings: Unpack[Settings]) -> GtFace:
    """The ruled face between two curves; ``gtcad.patches.Ruled``.

    Parameters
    ----------
    a, b
        The boundaries at v = 0 and v = 1, each control points in mm, an edge of CadQuery, or a curve of gtcad.
    """
    return gtSurface(Ruled(*in_one_space([curve_of("a", a), curve_of("b", b)])), **settings)


def gtSwept(profile: CurveLike, trajectory: CurveLike, **settings: Unpack[Settings]) -> GtFace:
    """The face of a profile that moves without turning, profile(u) + trajectory(v); ``gtcad.patches.Swept``.

    Parameters
    ----------
    profile, trajectory
        Each control points in mm, an edge of CadQuery, or a curve of gtcad.
    """
    curves = in_one_space([curve_of("profile", profile), curve_of("trajectory", trajectory)])
    return gtSurface(Swept(*curves), **settings)


def gtSwung(profile: CurveLike, trajectory: CurveLike, factor: float = 1.0, **settings: Unpack[Settings]) -> GtFace:
    """The face of a profile (x, z) that a trajectory (X, Y) turns and stretches; ``gtcad.patches.Swung``.

    Parameters
    ----------
    profile
        In the plane y = 0: control points in mm, an edge of CadQuery, or a curve of gtcad.
    trajectory
        In the plane z = 0: the same.
    factor
        a of (a x X, a x Y, z), not 0.
    """
    return gtSurface(Swung(curve_of("profile", profile), curve_of("trajectory", trajectory), factor), **settings)


def gtRotation(
    profile: CurveLike,
    angleDegrees: float = 360.0,
    axisStart: PointLike = (0.0, 0.0, 0.0),
    axisEnd: PointLike = (0.0, 0.0, 1.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The face of a profile that turns about an axis; ``gtcad.patches.Rotation``.

    Parameters
    ----------
    profile
        Control points in mm, an edge of CadQuery, or a curve of gtcad.
    angleDegrees
        From -360 to 360, not 0; counterclockwise seen against the axis. A full turn closes.
    axisStart, axisEnd
        Two points of the axis, in mm; the z axis unless given.
    """
    start, end = (np.resize([*point_of(point), 0.0], 3) for point in (axisStart, axisEnd))
    return gtSurface(Rotation(curve_of("profile", profile), start, end - start, angleDegrees), **settings)


def gtLofted(
    sections: Sequence[CurveLike],
    parameters: Sequence[float] | None = None,
    gamma: tuple[float, float] = (0.0, 0.0),
    **settings: Unpack[Settings],
) -> GtFace:
    """The face through sections; ``gtcad.patches.Lofted``, ruled through two.

    Parameters
    ----------
    sections
        Of equal degree and design variables, each control points in mm, an edge of CadQuery, or a curve of gtcad.
    parameters
        The v of each section, rising in [0, 1]; at equal distances unless given.
    gamma
        Design variables of the functions of v.
    """
    curves = in_one_space([curve_of(f"sections[{k}]", one) for k, one in enumerate(sections)])
    family = BERNSTEIN if len(curves) == 2 else GT
    return gtSurface(Lofted(curves, parameters, gamma, family), **settings)


def gtCoons(curves: Sequence[CurveLike], **settings: Unpack[Settings]) -> GtFace:
    """The face inside a loop of four curves, in either direction, of any kind that ``gtRuled`` takes.

    ``gtcad.patches.Coons``.
    """
    loop = in_one_space([curve_of(f"curves[{k}]", curve) for k, curve in enumerate(curves)])
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
    """The face of a profile that a spine carries along in its frame; ``gtcad.patches.Sweep``.

    Parameters
    ----------
    profile
        Across the spine, (x, y): control points in mm, an edge of CadQuery, or a curve of gtcad.
    spine
        The same, in space.
    frame
        "rotation-minimising", "frenet" or "fixed".
    startNormal
        The direction of the profile's x at the start; chosen unless given.
    scale
        Of the profile: one number, or the Bernstein coefficients of a law along the spine.
    twistDegrees
        Degrees that the profile turns about the spine.
    closed
        Whether it is turned so much more that it closes with a closed spine.
    """
    swept = Sweep(
        curve_of("profile", profile),
        curve_of("spine", spine),
        frame=frame,
        start_normal=None if startNormal is None else point_of(startNormal),
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
) -> GtFace | GtShell:
    """The GT patch of least degrees within a tolerance of a face, or a shell of patches where one is not enough.

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
    GtFace or GtShell
        Its ``exact`` is the design, and its ``design`` says how far that is from the face.
    """
    design = hosts.design_from_face(face, tolerance=tolerance / 2, max_degree=maxDegree, untrimmed=untrimmed)
    made: GtFace | GtShell
    if isinstance(design.surface, Quilt):
        made = gtShell(design.surface, tolerance=tolerance / 2)
    else:
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
        As of ``gtcad.converters.hosts.patch_on_face``. The fit keeps the join unless ``end_order`` says else.
    """
    tolerance = settings.get("tolerance", hosts.DEFAULT_TOLERANCE)
    opposite = in_space(curve_of("curve", curve))
    join = hosts.patch_on_face(face, edge, opposite, order=order, reach=reach, tolerance=tolerance)
    settings.setdefault("end_order", ((parsed_order(order)[1], 0), (0, 0)))
    return gtSurface(join.surface, **settings)


# --- shells, solids, assemblies ---------------------------------------------------------------------------------------


def gtShell(patches: Quilt | cq.Shell | Iterable[SurfaceLike], **settings: Unpack[Settings]) -> GtShell:
    """The shell of patches that share edges, found where sides are equal curves; patches as of ``gtSolid``."""
    return GtShell.of(hosts.made_shell(quilt_of(patches), **settings))


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
    settings
        See ``Settings``.
    """
    solid = patches if isinstance(patches, Solid) else Solid(quilt_of(patches), caps, thickness)
    return GtSolid.of(hosts.made_solid(solid, **settings))


def gtShape(shape: Core, **settings: Unpack[Settings]) -> GtEdge | GtWire | GtFace | GtShell | GtSolid:
    """The edge, wire, face, shell or solid of a curve, chain, patch, quilt or solid of gtcad, in mm."""
    if isinstance(shape, Solid):
        return gtSolid(shape, **settings)
    if isinstance(shape, Quilt):
        return gtShell(shape, **settings)
    if isinstance(shape, Composite):
        return gtChain(shape, **settings)
    return gtCurve(shape, **settings) if isinstance(shape, SeparableCurve) else gtSurface(shape, **settings)


def gtAssembly(model: Model | Mapping[str, Core], **settings: Unpack[Settings]) -> cq.Assembly:
    """The assembly of a model's shapes with their names and colours; of a mapping of names to shapes, in mm."""
    shapes = model.in_millimetres() if isinstance(model, Model) else model
    colors = model.colors if isinstance(model, Model) else {}
    assembly = cq.Assembly()
    for name, shape in shapes.items():
        color = cq.Color(*(channel / 255 for channel in bytes.fromhex(colors[name][1:]))) if name in colors else None
        assembly.add(gtShape(shape, **settings), name=name, color=color)
    return assembly


def show(*objects: Any, **options: Any) -> Any:
    """Show shapes in the viewer of ocp_vscode when it is installed, else in CadQuery's own window.

    Parameters
    ----------
    objects
        Anything the viewer takes, and shapes of gtcad.
    options
        Of the viewer's own ``show``.
    """
    viewer = "ocp_vscode" if importlib.util.find_spec("ocp_vscode") else "cadquery.vis"
    core = SeparableCurve | SeparableSurface | Composite | Quilt | Solid
    shapes = [gtShape(one) if isinstance(one, core) else one for one in objects]
    return importlib.import_module(viewer).show(*shapes, **options)
