"""Triangle meshes straight from the exact shapes, within a chordal tolerance that is proved, and their files.

Every vertex lies on its surface, and every triangle is no farther from it than the second derivatives allow
(``gtcad.converters.triangles``). Patches that are meshed together share the vertices of the sides they share.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._files import written_whole
from gtcad.converters.triangles import Bounds, densities, divided, triangulated
from gtcad.converters.welding import SAME, Welds, side_points, welded
from gtcad.errors import ExtraMissing, FileError, InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.protocol import SeparableSurface, checked_kind, checked_tolerance

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MAX_TRIANGLES = 2_000_000
_ROUNDS = 60  # of making the lines denser; two or three are usual
_STEP = 1.08  # at most in one round: a cell that is too long asks for more than its neighbours need
_SINGLE = 6e-8  # more than the rounding of single precision, which .stl and .glb have
_METRES = 1e-3
_FLAT = 1e-14  # of the square of the size: an area that is none


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in space.

    Parameters
    ----------
    vertices
        Shape (n, 3), in the shape's unit.
    triangles
        Three different indices of vertices each, shape (m, 3); counterclockwise seen from where the normals point.
    deviation
        Proved upper bound of the distance of the triangles from the surface and of the surface from the triangles,
        at equal parameters.
    """

    vertices: Array
    triangles: Indices
    deviation: float

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, deviation: float) -> None:
        object.__setattr__(self, "vertices", np.array(vertices, dtype=np.float64).reshape(-1, 3))
        object.__setattr__(self, "triangles", np.array(triangles, dtype=np.int64).reshape(-1, 3))
        object.__setattr__(self, "deviation", float(deviation))
        self.vertices.flags.writeable = self.triangles.flags.writeable = False

    @property
    def area(self) -> float:
        """Sum of the areas of the triangles."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    @property
    def volume(self) -> float:
        """Volume inside the triangles if they close a body, else of the cone over them from the origin."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return float(np.einsum("md,md->", a, np.cross(b, c)) / 6)


def mesh_surface(surface: SeparableSurface, *, tolerance: float, max_triangles: int = MAX_TRIANGLES) -> Mesh:
    """The mesh of one surface; that of `mesh_surfaces`, with its errors.

    Examples
    --------
    A flat square is divided once only: one point inside, four triangles.

    >>> from gtcad import BERNSTEIN, Surface
    >>> square = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> mesh = mesh_surface(square, tolerance=1e-3)
    >>> len(mesh.triangles), mesh.deviation < 1e-9, round(mesh.area, 12)
    (4, True, 1.0)
    """
    return mesh_surfaces({"surface": surface}, tolerance=tolerance, max_triangles=max_triangles)["surface"]


def mesh_surfaces(
    shapes: Mapping[str, SeparableSurface], *, tolerance: float, max_triangles: int = MAX_TRIANGLES
) -> dict[str, Mesh]:
    """Triangles within the tolerance of each surface, neighbours sharing the vertices of their common sides.

    Parameters
    ----------
    shapes
        Surfaces of the protocol by name, of dimension 2 or 3 (a plane one lies at z = 0).
    tolerance
        The chordal tolerance T > 0 in the shapes' unit: ``|S(u, v) - mesh| <= T`` at equal parameters.
    max_triangles
        Of all surfaces together.

    Returns
    -------
    dict
        A mesh for each name. Where two sides are one curve, run either way, with equal speed and up to rounding, the
        coordinates of their vertices are equal bit for bit. Triangles turn as u to v, but neighbours are turned so
        that they agree, and bodies that close so that normals point outwards.

    Raises
    ------
    InputError
        When an argument is out of its range, a shape is no surface, or one has no area.
    ToleranceNotMet
        When more than `max_triangles` would be needed.
    ToleranceBelowPrecision
        When rounding alone may exceed a part of the tolerance.

    Notes
    -----
    The proof bounds the second derivatives on blocks of the parameter square. The bound is usually less than three
    times the largest true distance at equal parameters. Sides that only overlap in part are not sewn.
    """
    surfaces = _checked(shapes, tolerance, max_triangles)
    if not surfaces:
        return {}
    mesher = _Mesher(surfaces, max_triangles)
    floor = max(mesher.floors)
    if tolerance < floor:
        raise ToleranceBelowPrecision(tolerance, floor)
    meshes, needed = mesher.meshes(tolerance)
    if not meshes:
        _refuse(mesher, tolerance, needed)
    for name, mesh in zip(shapes, meshes, strict=True):
        if not mesh.area > _FLAT * float(np.ptp(mesh.vertices, axis=0).max(initial=0.0)) ** 2:
            raise InputError(f"surface {name!r} has no area")
    turns = mesher.welds.turned([mesh.volume for mesh in meshes])
    return {
        name: Mesh(mesh.vertices, mesh.triangles[:, ::-1] if turn else mesh.triangles, mesh.deviation)
        for name, mesh, turn in zip(shapes, meshes, turns, strict=True)
    }


def combined(meshes: Mapping[str, Mesh]) -> Mesh:
    """All triangles in one mesh, vertices that are equal bit for bit being one."""
    vertices = np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes.values())]) + 0.0
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes.values())])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes.values(), starts, strict=False)]
    kept, place = np.unique(vertices, axis=0, return_inverse=True)
    every = np.concatenate([np.zeros((0, 3), np.int64), *triangles])
    return Mesh(kept, place.reshape(-1)[every], max((mesh.deviation for mesh in meshes.values()), default=0.0))


def _checked(shapes: Mapping[str, Any], tolerance: float, max_triangles: int) -> list[SeparableSurface]:
    checked_tolerance(tolerance)
    if max_triangles < 4:
        raise InputError(f"max_triangles must be at least 4, got {max_triangles}")
    for name, shape in shapes.items():
        if not isinstance(shape, SeparableSurface):
            raise InputError(f"shape {name!r} must be a surface, got {type(shape).__name__}")
    return [shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2)) for shape in shapes.values()]


def _refuse(mesher: _Mesher, tolerance: float, needed: int) -> None:
    """Raise with what the triangles allowed can prove."""
    coarser = tolerance
    for _ in range(_ROUNDS):
        coarser *= max(1.3, needed / mesher.most)
        meshes, needed = mesher.meshes(coarser)
        if meshes:
            proved = max(mesh.deviation for mesh in meshes)
            limit = f"max_triangles = {mesher.most} reached"
            raise ToleranceNotMet(tolerance, proved, sum(len(mesh.triangles) for mesh in meshes) // 2, limit)
    raise InputError(f"max_triangles must be at least {needed} for {len(mesher.surfaces)} surfaces, got {mesher.most}")


class _Divisions(NamedTuple):
    """Parameters on each edge, from 0 to 1, and the numbers that their vertices begin with, after the corners."""

    parameters: list[Array]
    starts: Indices


class _Mesher:
    """Surfaces with what is known of them before a tolerance is given."""

    def __init__(self, surfaces: Sequence[SeparableSurface], most: int) -> None:
        self.surfaces = surfaces
        self.most = most
        self.welds: Welds = welded(surfaces)
        self.least = self.welds.least_divisions()
        self.bounds = [Bounds.of(surface) for surface in surfaces]
        size = max(float(np.abs(surface.coefficients).max()) for surface in surfaces)
        self.floors = [8 * (bound.rounding + SAME * size) for bound in self.bounds]

    def meshes(self, tolerance: float) -> tuple[list[Mesh], int]:
        """Meshes within the tolerance; none, and about how many triangles they would need, if there are too many."""
        dense = [densities(bound, tolerance - floor / 2) for bound, floor in zip(self.bounds, self.floors, strict=True)]
        found: list[Mesh | None] = [None] * len(dense)
        for _ in range(_ROUNDS):
            needed = 2 * sum(max(2, int(u.mean())) * max(2, int(v.mean())) for u, v in dense)
            if needed > 2 * self.most:
                return [], needed
            divisions = self._divided(dense)
            meshes = [
                old or self._mesh(index, dense[index], divisions)  # an old one is None where something has changed
                for index, old in enumerate(found)
            ]
            needed = sum(len(mesh.triangles) for mesh in meshes)
            if needed > self.most:
                return [], needed
            excess = np.array([mesh.deviation / tolerance for mesh in meshes])
            if excess.max() <= 1:
                return meshes, needed
            for index in np.flatnonzero(excess > 1).tolist():
                factor = min(max(1.01, excess[index] ** 0.5), _STEP)
                dense[index] = dense[index][0] * factor, dense[index][1] * factor
            edges = self.welds.edge.reshape(-1, 4)
            changed = np.asarray(np.isin(edges, edges[excess > 1]).any(axis=1))
            found = [None if new else mesh for mesh, new in zip(meshes, changed, strict=True)]
        raise ToleranceNotMet(tolerance, float(excess.max()) * tolerance, needed // 2, "lines made denser too often")

    def _divided(self, dense: Sequence[tuple[Array, Array]]) -> _Divisions:
        """The parameters on each edge, as dense as its densest patch wants them."""
        wanted = [np.zeros_like(dense[0][0]) for _ in self.welds.leaders]
        for side, (edge, back) in enumerate(zip(self.welds.edge, self.welds.backwards, strict=True)):
            own = dense[side // 4][1 if side % 4 < 2 else 0]
            wanted[edge] = np.maximum(wanted[edge], own[::-1] if back else own)
        parameters = [divided(density, int(least)) for density, least in zip(wanted, self.least, strict=True)]
        sizes = [len(self.welds.points), *map(len, parameters)]
        return _Divisions(parameters, np.cumsum(sizes))

    def _mesh(self, index: int, dense: tuple[Array, Array], divisions: _Divisions) -> Mesh:
        surface, bounds = self.surfaces[index], self.bounds[index]
        edges = self.welds.edge[4 * index : 4 * index + 4]
        least = 3 if edges[0] == edges[1] else 2, 3 if edges[2] == edges[3] else 2  # closed: no line meets itself
        u, v = (divided(density, parts)[1:-1] for density, parts in zip(dense, least, strict=True))
        sides, points, numbers, mismatch = [], [], [], 0.0
        for side in range(4):
            t, edge_points, names = self._side(4 * index + side, divisions)
            sides.append(t)
            points.append(edge_points)
            numbers.append(names)
            gaps = np.linalg.norm(side_points(surface, side, t) - edge_points, axis=1)
            mismatch = max(mismatch, float(gaps.max()))
        inner = surface.evaluate(u[:, None], v[None, :])
        grid = triangulated(u, v, (sides[0], sides[1], sides[2], sides[3]), inner)
        numbers.append(divisions.starts[-1] + np.arange(u.size * v.size))
        points.append(inner.reshape(-1, 3))
        deviation = float(bounds.deviation(grid.parameters[grid.triangles]).max()) + mismatch + 2 * bounds.rounding
        _, first, place = np.unique(np.concatenate(numbers), return_index=True, return_inverse=True)
        triangles = place.reshape(-1)[grid.triangles]
        a, b, c = triangles.T
        return Mesh(np.concatenate(points)[first], triangles[(a != b) & (b != c) & (c != a)], deviation)

    def _side(self, side: int, divisions: _Divisions) -> tuple[Array, Array, Indices]:
        """Parameters, points and numbers of the vertices of a side, in its own direction."""
        welds, edge = self.welds, int(self.welds.edge[side])
        t, leader = divisions.parameters[edge], int(welds.leaders[edge])
        first, last = welds.corners[edge].tolist()
        if welds.collapsed[edge]:
            points, numbers = np.tile(welds.points[first], (t.size, 1)), np.full(t.size, first)
        else:
            points = side_points(self.surfaces[leader // 4], leader % 4, t)
            points[0], points[-1] = welds.points[first], welds.points[last]
            numbers = divisions.starts[edge] + np.arange(t.size)
            numbers[0], numbers[-1] = first, last
        return (1 - t[::-1], points[::-1], numbers[::-1]) if welds.backwards[side] else (t, points, numbers)


def file_rounding(path: str | os.PathLike[str], mesh: Mesh | SeparableSurface) -> float:
    """Bound of how far a file moves the vertices: .stl and .glb hold single precision, .3mf all digits."""
    if Path(path).suffix.lower() == ".3mf":
        return 0.0
    if isinstance(mesh, Mesh):
        return _SINGLE * float(np.linalg.norm(mesh.vertices, axis=1).max(initial=0.0))
    sums = mesh.factors_u.derivative_bound(0) * mesh.factors_v.derivative_bound(0)
    return _SINGLE * sums * float(np.linalg.norm(mesh.coefficients, axis=-1).max())


def write_mesh(
    path: str | os.PathLike[str], meshes: Mapping[str, Mesh], *, colors: Mapping[str, str] | None = None
) -> None:
    """Write meshes in mm to a file, whole or not at all.

    Parameters
    ----------
    path
        .stl: binary, one body without names, in mm; .glb: in metres as its standard asks, with names and colours,
        axes as they are; .3mf: in millimetres with names.
    meshes
        By name, at least one.
    colors
        "#rrggbb" by name.

    Raises
    ------
    InputError
        When there is no triangle, or the suffix is none of the three.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When trimesh, or what it needs for the format, is not installed.
    """
    form = Path(path).suffix.lower()
    if form not in (".stl", ".glb", ".3mf"):
        raise InputError(f"the file of a mesh must end in .stl, .glb or .3mf, got {os.fspath(path)!r}")
    checked_kind("meshes", meshes, Mapping, "a mapping of names to meshes")
    if not any(len(mesh.triangles) for mesh in meshes.values()):
        raise InputError("a file needs at least one triangle")
    try:
        data = _encoded(form, meshes, colors or {})
    except ImportError as error:
        raise ExtraMissing(f"writing {form} needs more packages ({error}): pip install 'gtcad[mesh]'") from error
    with written_whole(path) as temporary:
        try:
            temporary.write_bytes(data)
        except OSError as error:
            raise FileError(str(path), f"cannot be written: {error.strerror}") from error


def _encoded(form: str, meshes: Mapping[str, Mesh], colors: Mapping[str, str]) -> bytes:
    trimesh: Any = importlib.import_module("trimesh")  # typed in part only

    if form == ".stl":
        whole = combined(meshes)
        return bytes(trimesh.Trimesh(whole.vertices, whole.triangles, process=False).export(file_type="stl"))
    if form == ".3mf":
        for module in ("lxml.etree", "networkx"):  # trimesh says nothing clear when one of them is missing
            importlib.import_module(module)
    scene = trimesh.Scene()
    for name, mesh in meshes.items():
        scale = _METRES if form == ".glb" else 1.0
        body = trimesh.Trimesh(mesh.vertices * scale, mesh.triangles, process=False)
        if name in colors:
            body.visual = _material(name, colors[name])
        scene.add_geometry(body, geom_name=name, node_name=f"{name} ")  # two names: 3MF numbers objects by them
    return bytes(scene.export(file_type=form[1:]))


def _material(name: str, color: str) -> Any:
    """A material of that colour: glTF holds linear intensities, "#rrggbb" sRGB."""
    visual: Any = importlib.import_module("trimesh.visual")
    srgb = np.frombuffer(bytes.fromhex(color[1:]), np.uint8) / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    factor = [*linear.tolist(), 1.0]
    material = visual.material.PBRMaterial(name=name, baseColorFactor=factor, doubleSided=True)
    return visual.TextureVisuals(material=material)
