"""Offsets of shapes with creases by the kernel, in a process of their own.

The kernel's offsets (BRepOffset) end the whole process on some shapes, for instance on spheres, so they get one to
end. What comes back is checked: by the kernel's own check, edge by edge, and by distances.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import gtcad
from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import as_face, kernel_guard, kernel_module
from gtcad.converters.occt.faces import distances_to, volume
from gtcad.converters.occt.pieces import subshapes
from gtcad.converters.occt.shells import edge_uses, solid_between
from gtcad.converters.occt.topology import TOLERANCE, checked
from gtcad.errors import KernelError

_BRep = kernel_module("BRep")
_BRepMesh = kernel_module("BRepMesh")
_BRepOffset = kernel_module("BRepOffset")
_BRepTools = kernel_module("BRepTools").BRepTools
_GeomAbs = kernel_module("GeomAbs")
_TopAbs = kernel_module("TopAbs")
_TopLoc = kernel_module("TopLoc")
_TopoDS = kernel_module("TopoDS")

_SECONDS = 600  # after which an offset is given up
_MESH = 0.1  # of the thickness, and radians: how fine the samples of an offset lie
_MOST_SAMPLES = 120


def hollow_solid(solid: Any, thickness: float) -> tuple[Any, float]:
    """A solid made hollow inwards (thickness below 0), or clad outwards: gaps at edges are rounded.

    Parameters
    ----------
    solid
        With one shell, in mm.
    thickness
        In mm, positive along the normals.

    Returns
    -------
    solid
        The part between the given boundary and its offset.
    deviation
        Largest difference of the offset's distances from the thickness at its samples, in mm: an estimate.

    Raises
    ------
    KernelError
        When the kernel cannot make the offset, or makes one that its own check refuses.
    """
    offset = _offset(solid, thickness)
    before, after = (float(volume(body, rtol=1e-6)) for body in (solid, offset))
    if not (after - before) * thickness > 0 or after <= 0:
        raise KernelError(f"the kernel's offset by {thickness:g} mm turns {before:.6g} mm^3 into {after:.6g} mm^3")
    shells = [_only_shell(solid), _only_shell(offset)]
    outer, inner = reversed(shells) if thickness > 0 else shells
    with kernel_guard("making a hollow solid"):
        hollow = checked(solid_between([outer, inner.Reversed()]), "hollow solid")
    uses = edge_uses(hollow)
    if not uses.closed:
        raise KernelError(f"the hollow solid must have each edge in two faces, got {uses}")
    return hollow, _deviation(offset, solid, abs(thickness))


def _only_shell(solid: Any) -> Any:
    shells = subshapes(solid, "SHELL")
    if len(shells) != 1:
        raise KernelError(f"the kernel's offset should have one shell, it has {len(shells)}")
    return shells[0]


def _deviation(offset: Any, solid: Any, thickness: float) -> float:
    with kernel_guard("measuring an offset"):
        distances = distances_to(_only_shell(solid))(_samples(offset, _MESH * thickness))
    return float(np.abs(distances - thickness).max())


def _samples(shape: Any, deflection: float) -> Array:
    """Nodes of a mesh: they lie on the faces."""
    _BRepMesh.BRepMesh_IncrementalMesh(shape, deflection, False, _MESH, False)
    points = []
    for face in subshapes(shape, "FACE"):
        mesh = _BRep.BRep_Tool.Triangulation_s(as_face(face), _TopLoc.TopLoc_Location())
        if mesh is None:
            raise KernelError("the kernel cannot mesh a face of its offset")
        points += [mesh.Node(i).Coord() for i in range(1, mesh.NbNodes() + 1)]
    _BRepTools.Clean_s(shape)
    nodes = np.array(points)
    return np.asarray(nodes[:: -(-len(nodes) // _MOST_SAMPLES)])


# --- in a process of its own ------------------------------------------------------------------------------------------


def _offset(solid: Any, thickness: float) -> Any:
    environment = dict(os.environ)
    places = [str(Path(gtcad.__file__).parents[1]), environment.get("PYTHONPATH", "")]
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, places))
    command = [sys.executable, "-P", "-m", "gtcad.converters.occt.thickening", repr(float(thickness))]
    try:
        done = subprocess.run(
            command, input=_written(solid), capture_output=True, env=environment, timeout=_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise KernelError(f"the kernel's offset by {thickness:g} mm did not come to an end: {error}") from error
    if done.returncode != 0:
        reason = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise KernelError(f"the kernel cannot offset this solid by {thickness:g} mm: {reason or 'it crashed'}")
    return _read(done.stdout)


def _written(shape: Any) -> bytes:
    stream = io.BytesIO()
    _BRepTools.Write_s(shape, stream)
    return stream.getvalue()


def _read(data: bytes) -> Any:
    shape = _TopoDS.TopoDS_Shape()
    _BRepTools.Read_s(shape, io.BytesIO(data), _BRep.BRep_Builder())
    if shape.IsNull():
        raise KernelError("the kernel's offset cannot be read back")
    return shape


def _main() -> None:
    """Offset the shape of the standard input by the distance of the first argument, rounded at convex edges."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the kernel prints messages
    maker = _BRepOffset.BRepOffset_MakeOffset()
    skin, arc = _BRepOffset.BRepOffset_Mode.BRepOffset_Skin, _GeomAbs.GeomAbs_JoinType.GeomAbs_Arc
    solid, thickness = _read(sys.stdin.buffer.read()), float(sys.argv[1])
    maker.Initialize(solid, thickness, TOLERANCE, skin, False, False, arc, False, False)
    maker.MakeOffsetShape()
    if not maker.IsDone() or maker.Shape().IsNull():
        sys.exit("nothing is left of it" if maker.IsDone() else str(maker.Error()).rpartition("_")[2])
    with output:
        output.write(_written(maker.Shape()))


if __name__ == "__main__":
    _main()
