"""Every difference between OCCT 7.9 and 8.0, and what to say when there is no usable kernel.

The other modules of this package take the modules of OCP from `kernel_module` and never import OCP themselves.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.errors import KernelError, KernelMissing

_INSTALL = "pip install 'gtcad[cadquery]' (OCCT 7.9) or 'gtcad[build123d]' (OCCT 8.0)"
_REPAIR = f"'gtcad doctor' says how to repair it; or, in a fresh environment with gtcad, {_INSTALL}"
_DISTRIBUTIONS = ("cadquery-ocp", "cadquery-ocp-novtk")


def _installed_kernels() -> dict[str, str]:
    versions: dict[str, str] = {}
    for name in _DISTRIBUTIONS:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return versions


def _diagnosis(error: ImportError) -> str:
    kernels = _installed_kernels()
    found = " and ".join(f"{name} {version}" for name, version in kernels.items())
    if len(set(kernels.values())) > 1:
        return f"{found} write the same OCP folder and do not go together ({error}): {_REPAIR}"
    if kernels:
        return f"the CAD kernel of {found} is broken ({error}): {_REPAIR}"
    return f"no CAD kernel is installed ({error}): {_INSTALL}"


def kernel_module(name: str) -> Any:
    """The module OCP.<name>.

    Parameters
    ----------
    name
        For example "Geom".

    Raises
    ------
    KernelMissing
        When OCP is not installed, or when two distributions of it were laid over each other.
    """
    try:
        return importlib.import_module(f"OCP.{name}")
    except ImportError as error:
        if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):  # Ctrl-C while it was loading
            raise KeyboardInterrupt from error
        raise KernelMissing(_diagnosis(error)) from error


def _kernel_class(name: str, name_7_9: str) -> Any:
    """A collection: OCP.collections.<name> in OCCT 8.0, OCP.<package>.<class> ("package.class") in 7.9."""
    try:
        module = importlib.import_module("OCP.collections")
    except ImportError:
        package, name = name_7_9.split(".")
        module = kernel_module(package)
    if not hasattr(module, name):  # OCCT 8.0 keeps the modules of 7.9, empty
        raise KernelMissing(_diagnosis(ImportError(f"{module.__name__} has no {name}")))
    return getattr(module, name)


@contextmanager
def kernel_guard(action: str) -> Iterator[None]:
    """Turn the kernel's own exceptions, which share no base class in Python, into KernelError."""
    try:
        yield
    except Exception as error:
        if not type(error).__module__.startswith("OCP"):
            raise
        raise KernelError(f"{action}: {type(error).__name__} {error}".rstrip()) from error


_gp = kernel_module("gp")
_TopoDS = kernel_module("TopoDS").TopoDS

_PointRow = _kernel_class("Array1_gp_Pnt", "TColgp.TColgp_Array1OfPnt")
_PointGrid = _kernel_class("Array2_gp_Pnt", "TColgp.TColgp_Array2OfPnt")
_RealRow = _kernel_class("Array1_double", "TColStd.TColStd_Array1OfReal")
_RealGrid = _kernel_class("Array2_double", "TColStd.TColStd_Array2OfReal")
_IntegerRow = _kernel_class("Array1_int", "TColStd.TColStd_Array1OfInteger")
LabelSequence = _kernel_class("Sequence_TDF_Label", "TDF.TDF_LabelSequence")


def point(coordinates: Iterable[float]) -> Any:
    """A gp_Pnt from two or three coordinates; a missing z is 0."""
    x, y, z = (*(float(value) for value in coordinates), 0.0)[:3]
    return _gp.gp_Pnt(x, y, z)


def point_array(points: NDArray[np.float64]) -> Any:
    """The kernel's array of points from shape (n, d) or (nu, nv, d), d = 2 or 3; z = 0 when d = 2."""
    return _filled(_PointRow, _PointGrid, points.shape[:-1], lambda index: point(points[index]))


def real_array(values: NDArray[np.float64]) -> Any:
    """The kernel's array of reals from shape (n,) or (nu, nv)."""
    return _filled(_RealRow, _RealGrid, values.shape, lambda index: float(values[index]))


def integer_array(values: tuple[int, ...]) -> Any:
    """The kernel's array of integers."""
    return _filled(_IntegerRow, None, (len(values),), lambda index: values[index[0]])


def _filled(row: Any, grid: Any, shape: tuple[int, ...], value: Any) -> Any:
    array = row(1, shape[0]) if len(shape) == 1 else grid(1, shape[0], 1, shape[1])
    for index in np.ndindex(*shape):
        array.SetValue(*(i + 1 for i in index), value(index))
    return array


def as_face(shape: Any) -> Any:
    """The shape as a TopoDS_Face (7.9 also has the static Face_s, 8.0 only this)."""
    return _TopoDS.Face(shape)


def as_edge(shape: Any) -> Any:
    """The shape as a TopoDS_Edge."""
    return _TopoDS.Edge(shape)


def listed(sequence: Any) -> Iterator[Any]:
    """The elements of a kernel sequence, which counts from 1."""
    for i in range(1, sequence.Length() + 1):
        yield sequence.Value(i)


def check_complaints(analyzer: Any, subshapes: Iterable[Any]) -> list[str]:
    """What BRepCheck found wrong with each of the subshapes: the statuses in 7.9, only the kind of shape in 8.0.

    OCCT 8.0 cannot hand the list of statuses to Python.
    """
    complaints: dict[str, None] = {}
    for shape in subshapes:
        statuses = _statuses(analyzer.Result(shape))
        if statuses or not analyzer.IsValid(shape):
            kind = str(shape.ShapeType()).rsplit("_", 1)[-1].lower()
            complaints[" ".join([kind, *statuses])] = None
    return list(complaints)


def _statuses(result: Any) -> list[str]:
    """The statuses of a subshape by itself and on the shapes it belongs to."""
    try:
        statuses = list(result.Status())
        result.InitContextIterator()
        while result.MoreShapeInContext():
            statuses += result.StatusOnShape()
            result.NextShapeInContext()
    except TypeError:
        return []
    names = (str(status).rsplit("_", 1)[-1].partition(":")[0] for status in statuses)
    return list(dict.fromkeys(name for name in names if name != "NoError"))
