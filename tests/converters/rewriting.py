"""What other CAD systems do to a file, done with the kernel: the same points, told otherwise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.iges import read_iges
from gtcad.converters.occt.compat import as_edge, as_face, kernel_module
from gtcad.converters.occt.exchange import items_of
from gtcad.converters.occt.geometry import from_geom_curve, from_geom_surface, to_geom_curve, to_geom_surface
from gtcad.converters.occt.pieces import pieces, subshapes
from gtcad.converters.occt.session import session, writing_iges, writing_step
from gtcad.converters.part import Part
from gtcad.converters.step import read_step

_BRep = kernel_module("BRep")
_BRepAlgoAPI = kernel_module("BRepAlgoAPI")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepLib = kernel_module("BRepLib").BRepLib
_BRepTools = kernel_module("BRepTools").BRepTools
_IGESControl = kernel_module("IGESControl")
_ShapeUpgrade = kernel_module("ShapeUpgrade")
_STEPControl = kernel_module("STEPControl")
_TopAbs = kernel_module("TopAbs")
_TopoDS = kernel_module("TopoDS")
_gp = kernel_module("gp")


# --- shapes and files -------------------------------------------------------------------------------------------------


def compound(shapes):
    builder, whole = _BRep.BRep_Builder(), _TopoDS.TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def shape_of(parts: Sequence[Part]):
    """The kernel's shapes of parts to be written, as one compound."""
    return compound(item.shape for item in items_of(parts))


def write_step_in(path: Path, shape, unit="MM"):
    """Without names, in any unit."""
    with session("rewriting", {**writing_step("AP214IS", 1e-7), "write.step.unit": unit}):
        writer = _STEPControl.STEPControl_Writer()
        writer.Transfer(shape, _STEPControl.STEPControl_AsIs)
        writer.Write(str(path))


def write_iges_in(path: Path, shape, unit="MM", bodies=False):
    with session("rewriting", {**writing_iges(1e-7, bodies=bodies), "write.iges.unit": unit}):
        writer = _IGESControl.IGESControl_Writer(unit, int(bodies))
        writer.AddShape(shape)
        writer.ComputeModel()
        writer.Write(str(path))


def through_step(folder: Path, shape, unit="MM") -> list[Part]:
    write_step_in(folder / "a.step", shape, unit)
    return read_step(folder / "a.step")


def through_iges(folder: Path, shape, unit="MM", bodies=False) -> list[Part]:
    write_iges_in(folder / "a.igs", shape, unit, bodies)
    return read_iges(folder / "a.igs")


# --- faces and edges, one by one --------------------------------------------------------------------------------------


def rebuilt(shape, change: Callable, wire: Callable | None = None):
    """A compound of faces made from changed spline surfaces, and of edges from changed spline curves."""
    made = []
    for piece in pieces(shape):
        if piece.ShapeType() == _TopAbs.TopAbs_FACE:
            surface = _BRep.BRep_Tool.Surface_s(as_face(piece))
            if type(surface).__name__ == "Geom_BSplineSurface":
                made += [make_face(one) for one in change(surface)]
                continue
        elif wire is not None:
            curve = _BRep.BRep_Tool.Curve_s(as_edge(piece), 0.0, 0.0)
            if type(curve).__name__ == "Geom_BSplineCurve":
                made += [_BRepBuilderAPI.BRepBuilderAPI_MakeEdge(one).Edge() for one in wire(curve)]
                continue
        made.append(piece)
    return compound(made)


def make_face(surface):
    if isinstance(surface, tuple):  # with bounds
        return _BRepBuilderAPI.BRepBuilderAPI_MakeFace(*surface, 1e-7).Face()
    return _BRepBuilderAPI.BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def copied(surface, change: Callable[[object], object]):
    copy = surface.Copy()
    change(copy)
    return copy


def transposed(shape):
    return rebuilt(shape, lambda s: [copied(s, lambda c: c.ExchangeUV())], lambda c: [c])


def turned(shape):
    return rebuilt(shape, lambda s: [copied(s, lambda c: c.UReverse())], lambda c: [copied(c, lambda d: d.Reverse())])


def elevated(shape):
    def surface(s):
        return [copied(s, lambda c: c.IncreaseDegree(min(s.UDegree() + 2, 20), min(s.VDegree() + 1, 20)))]

    return rebuilt(shape, surface, lambda c: [copied(c, lambda d: d.IncreaseDegree(min(c.Degree() + 2, 20)))])


def refined(shape):
    """Knots inserted that are not there."""

    def surface(s):
        def insert(copy):
            u0, u1, v0, v1 = s.Bounds()
            copy.InsertUKnot(u0 + 0.377 * (u1 - u0), 1, 1e-9)
            copy.InsertVKnot(v0 + 0.613 * (v1 - v0), 2, 1e-9)

        return [copied(s, insert)]

    def curve(c):
        first, last = c.FirstParameter(), c.LastParameter()
        return [copied(c, lambda d: d.InsertKnot(first + 0.377 * (last - first), 1, 1e-9))]

    return rebuilt(shape, surface, curve)


def stretched(shape):
    """Other parameters, affine to those that were."""

    def surface(s):
        spline = from_geom_surface(s)
        return [to_geom_surface(with_knots(spline, 3 * spline.knots_u - 7, 0.25 * spline.knots_v + 11))]

    def curve(c):
        spline = from_geom_curve(c)
        knots = 5 * spline.knots + 2
        return [
            to_geom_curve(
                BSplineCurve(spline.control_points, knots, spline.multiplicities, spline.degree, spline.weights)
            )
        ]

    return rebuilt(shape, surface, curve)


def with_knots(spline: BSplineSurface, knots_u, knots_v) -> BSplineSurface:
    u, v = (spline.multiplicities_u, spline.degree_u), (spline.multiplicities_v, spline.degree_v)
    return BSplineSurface(spline.control_points, knots_u, *u, knots_v, *v, spline.weights)


def split(shape, at=(0.31, 0.64), segments=False):
    """At parameter lines, in four faces: of the same surface, or each with its own part of it."""

    def surface(s):
        u0, u1, v0, v1 = s.Bounds()
        u, v = u0 + at[0] * (u1 - u0), v0 + at[1] * (v1 - v0)
        for a, b in ((u0, u), (u, u1)):
            for c, d in ((v0, v), (v, v1)):
                yield copied(s, lambda k, e=(a, b, c, d): k.Segment(*e)) if segments else (s, a, b, c, d)

    def curve(c):
        first, last = c.FirstParameter(), c.LastParameter()
        middle = first + at[0] * (last - first)
        for a, b in ((first, middle), (middle, last)):
            yield copied(c, lambda k, e=(a, b): k.Segment(*e))

    return rebuilt(shape, surface, curve)


def reversed_faces(shape):
    return compound(piece.Reversed() for piece in pieces(shape))


def reordered(shape, seed=0):
    found = pieces(shape)
    return compound(found[k] for k in np.random.default_rng(seed).permutation(len(found)))


def cut_by_plane(shape, normal=(1.0, 0.4, 0.2)):
    """Each face cut in two by a plane through the middle of its box, at a slant."""
    made = []
    for piece in pieces(shape):
        if piece.ShapeType() != _TopAbs.TopAbs_FACE:
            made.append(piece)
            continue
        surface, (u0, u1, v0, v1) = _BRep.BRep_Tool.Surface_s(as_face(piece)), _BRepTools.UVBounds_s(as_face(piece))
        middle = surface.Value((u0 + u1) / 2, (v0 + v1) / 2)
        plane = _gp.gp_Pln(middle, _gp.gp_Dir(*normal))
        tool = _BRepBuilderAPI.BRepBuilderAPI_MakeFace(plane, -1e3, 1e3, -1e3, 1e3).Face()
        made += split_by(piece, tool)
    return compound(made)


def split_by(piece, tool):
    lists = kernel_module("TopTools")
    kind = getattr(lists, "TopTools_ListOfShape", None) or kernel_module("collections").List_TopoDS_Shape
    arguments, tools = kind(), kind()
    arguments.Append(piece)
    tools.Append(tool)
    splitter = _BRepAlgoAPI.BRepAlgoAPI_Splitter()
    splitter.SetArguments(arguments)
    splitter.SetTools(tools)
    splitter.Build()
    return subshapes(splitter.Shape(), "FACE")


# --- wrong, or only slipped, on purpose -------------------------------------------------------------------------------


def slipped_surface(surface, amount: float, seed: float, count=41, degree=7) -> BSplineSurface:
    """The points of a shape at parameters that slip along it, by interpolation in many points."""
    t = np.linspace(0.0, 1.0, count)
    u, v = np.meshgrid(t, t, indexing="ij")
    slid_u = u + amount * np.sin(np.pi * u) * np.cos(3 * v + seed) / np.pi
    slid_v = v + amount * np.sin(np.pi * v) * np.cos(2 * u - seed) / np.pi
    across = make_interp_spline(t, surface.evaluate(slid_u, slid_v), degree, axis=0)
    along = make_interp_spline(t, across.c, degree, axis=1)
    inner = across.t[degree + 1 : -degree - 1]
    knots = np.r_[0.0, inner, 1.0], [degree + 1, *[1] * len(inner), degree + 1], degree
    return BSplineSurface(along.c.swapaxes(0, 1), *knots, *knots)


def slipped_curve(curve, amount: float, count=97, degree=7) -> BSplineCurve:
    t = np.linspace(0.0, 1.0, count)
    spline = make_interp_spline(t, curve.evaluate(t + amount * np.sin(np.pi * t) / np.pi), degree)
    inner = spline.t[degree + 1 : -degree - 1]
    return BSplineCurve(spline.c, np.r_[0.0, inner, 1.0], [degree + 1, *[1] * len(inner), degree + 1], degree)


def pushed_surface(spline: BSplineSurface, rng: np.random.Generator, by: float) -> BSplineSurface:
    """One pole moved so that the surface moves along its normal by so much, where the pole's product is largest."""
    while True:
        i, j = (int(rng.integers(n)) for n in spline.control_points.shape[:2])
        (u, a), (v, b) = peak(spline.flat_knots_u, spline.degree_u, i), peak(spline.flat_knots_v, spline.degree_v, j)
        normal = np.cross(*spline.derivatives(u, v))
        if np.linalg.norm(normal) > 1e-9:
            points = np.array(spline.control_points)
            points[i, j] += rng.choice([-1, 1]) * by / (a * b) * normal / np.linalg.norm(normal)
            return spline.with_control_points(points)


def pushed_curve(spline: BSplineCurve, rng: np.random.Generator, by: float) -> BSplineCurve:
    """The same of a curve, across its tangent."""
    k = int(rng.integers(len(spline.control_points)))
    t, a = peak(spline.flat_knots, spline.degree, k)
    across = np.cross(spline.derivative(t), rng.normal(size=3))
    points = np.array(spline.control_points)
    points[k] += by / a * across / np.linalg.norm(across)
    return BSplineCurve(points, spline.knots, spline.multiplicities, spline.degree, spline.weights)


def peak(flat, degree, k):
    """Where a basis function is largest, and its value there."""
    t = np.linspace(flat[0], flat[-1], 2001)
    values = BSpline(flat, np.eye(len(flat) - degree - 1)[k], degree)(t)
    return float(t[values.argmax()]), float(values.max())


def scaled(shape, factor):
    transformation = _gp.gp_Trsf()
    transformation.SetScale(_gp.gp_Pnt(0, 0, 0), factor)
    return _BRepBuilderAPI.BRepBuilderAPI_Transform(shape, transformation, True).Shape()


def moved(shape, by):
    transformation = _gp.gp_Trsf()
    transformation.SetTranslation(_gp.gp_Vec(*by))
    return _BRepBuilderAPI.BRepBuilderAPI_Transform(shape, transformation, True).Shape()


# --- bodies -----------------------------------------------------------------------------------------------------------


def sewn(shape):
    """Faces as one shell, and a closed one as a solid that is not inside out."""
    sewing = _BRepBuilderAPI.BRepBuilderAPI_Sewing(1e-4)
    for piece in pieces(shape):
        sewing.Add(piece)
    sewing.Perform()
    (shell,) = subshapes(sewing.SewedShape(), "SHELL")
    if not _BRep.BRep_Tool.IsClosed_s(shell):
        return shell
    solid = _BRepBuilderAPI.BRepBuilderAPI_MakeSolid(_TopoDS.TopoDS.Shell(shell)).Solid()
    _BRepLib.OrientClosedSolid_s(solid)
    return solid


def as_nurbs(shape):
    return _BRepBuilderAPI.BRepBuilderAPI_NurbsConvert(shape, True).Shape()


def divided_where_closed(shape):
    tool = _ShapeUpgrade.ShapeUpgrade_ShapeDivideClosed(shape)
    tool.SetNbSplitPoints(2)
    tool.Perform()
    return tool.Result()
