"""STEP, IGES and BREP through the kernel: parts to bytes, and files to parts."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import Any, Literal

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import LabelSequence, kernel_guard, kernel_module
from gtcad.converters.occt.document import Document, Item
from gtcad.converters.occt.entities import (
    finish_step_entities,
    set_global_section,
    set_iges_color,
    set_iges_names,
    set_step_header,
    with_entities,
    with_names,
)
from gtcad.converters.occt.faces import area, distances_to, measured, volume
from gtcad.converters.occt.facets import facets
from gtcad.converters.occt.geometry import halves, is_full_ellipse
from gtcad.converters.occt.guards import Unreadable, entities, refuse_failures, refuse_lost_faces
from gtcad.converters.occt.originals import Spline, iges_originals, protect, restored, step_originals
from gtcad.converters.occt.pieces import (
    ShapeKey,
    bodies,
    edge_geometry,
    face_geometry,
    is_periodic_spline,
    is_valid,
    pieces,
)
from gtcad.converters.occt.properties import point_entities, stated_properties
from gtcad.converters.occt.quadrics import is_analytic, make_quadric_face, quadric_of_face
from gtcad.converters.occt.regions import region_of
from gtcad.converters.occt.session import READING_IGES, READING_STEP, quiet, session, writing_iges, writing_step
from gtcad.converters.occt.shells import edge_uses
from gtcad.converters.occt.topology import TOLERANCE, make_edge, make_face, make_wire
from gtcad.converters.part import BodyFacts, Built, EllipseArc, Geometry, Part, Properties, Single, TrimmedFace, Wire
from gtcad.converters.quadrics import ENTITIES, Quadric
from gtcad.errors import FileError, InputError, KernelError
from gtcad.protocol import checked_kind

_BRep = kernel_module("BRep")
_BRepTools = kernel_module("BRepTools").BRepTools
_IFSelect = kernel_module("IFSelect")
_IGESCAFControl = kernel_module("IGESCAFControl")
_IGESData = kernel_module("IGESData")
_StepAP214 = kernel_module("StepAP214").StepAP214
_STEPCAFControl = kernel_module("STEPCAFControl")
_STEPControl = kernel_module("STEPControl")
_StepData = kernel_module("StepData")
_TopAbs = kernel_module("TopAbs")
_TopoDS = kernel_module("TopoDS")

Schema = Literal["AP242", "AP214", "AP203"]
SCHEMAS = {"AP242": "AP242DIS", "AP214": "AP214IS", "AP203": "AP203"}
_VOLUME = 1e-9  # relative: of the kernel's volumes
_REAL_FORMAT = "%.16E"  # 17 digits: every double comes back bit for bit


# --- writing ------------------------------------------------------------------------------------------------------


def step_bytes(items: Sequence[Item], *, schema: Schema, tolerance: float, timestamp: datetime) -> bytes:
    """A STEP file with one product for each item, in order.

    Parameters
    ----------
    items
        At least one.
    schema
        "AP242", "AP214" or "AP203".
    tolerance
        Goes into the file's UNCERTAINTY, in mm.
    timestamp
        Goes into the header and, in AP203, into the creation date.

    Raises
    ------
    KernelError
        When the kernel refuses to write.
    """
    with session("writing STEP", writing_step(SCHEMAS[schema], tolerance)):
        writer, document = _STEPCAFControl.STEPCAFControl_Writer(), Document()
        writer.SetColorMode(False)  # it orders colours by memory address: they are added below
        writer.SetPropsMode(schema != "AP203")  # which does not know them
        labels = LabelSequence()
        for item in items:
            labels.Append(document.add(item))
        if not writer.Transfer(labels, _STEPControl.STEPControl_AsIs):
            raise KernelError("the kernel cannot write these shapes to STEP")
        model = writer.ChangeWriter().Model()
        styles, names = finish_step_entities(entities(model, 0), items, timestamp)
        points = [] if schema == "AP203" else point_entities(model, items, model.NbEntities() + len(styles) + 1)
        set_step_header(model, timestamp)
        data = _printed(_StepData.StepData_StepWriter(model), _StepAP214.Protocol_s())
    return with_names(with_entities(data, points, styles), names)


def _printed(sender: Any, protocol: Any) -> bytes:
    sender.FloatWriter().SetFormat(_REAL_FORMAT, True)
    sender.FloatWriter().SetZeroSuppress(False)
    sender.SendModel(protocol)
    stream = io.BytesIO()
    if not sender.Print(stream):
        raise KernelError("the kernel cannot print the file")
    return stream.getvalue()


def iges_bytes(items: Sequence[Item], *, tolerance: float, timestamp: datetime) -> bytes:
    """An IGES file with one entity for each item, in order.

    Parameters
    ----------
    items
        At least one. Letters beyond ASCII, which IGES does not know, are written in UTF-8.
    tolerance
        Goes into the global section's minimum resolution, in mm.
    timestamp
        Goes into the global section.

    Raises
    ------
    KernelError
        When the kernel refuses to write.
    """
    bodies = any(item.face_names or is_analytic(item.shape) for item in items)
    with session("writing IGES", writing_iges(tolerance, bodies=bodies)):
        writer, document, done = _IGESCAFControl.IGESCAFControl_Writer(), Document(), 0
        writer.SetColorMode(False)
        tops = []
        model = writer.Model()
        for item in items:
            if not writer.Transfer(document.add(_in_shell(item) if is_analytic(item.shape) else item)):
                raise KernelError(f"the kernel cannot write {item.name!r} to IGES")
            tops.append(model.Entity(done + 1))
            set_iges_names(entities(model, done), item.name)
            done = model.NbEntities()
        writer.ComputeModel()
        for top, item in zip(tops, items, strict=True):
            if item.color is not None:
                set_iges_color(model, top, item.color)
        set_global_section(model, timestamp)
        return _printed(_IGESData.IGESData_IGESWriter(model), model.Protocol())


def _in_shell(item: Item) -> Item:
    """The item with its face as a shell: IGES knows no way round of a face, and no analytic surface, outside of one."""
    builder, shell = _BRep.BRep_Builder(), _TopoDS.TopoDS_Shell()
    builder.MakeShell(shell)
    builder.Add(shell, item.shape)
    return replace(item, shape=shell)


def brep_bytes(items: Sequence[Item]) -> bytes:
    """A BREP file: one compound of the shapes in order, without names and colours, which the format does not know."""
    with kernel_guard("writing BREP"), quiet():
        builder, compound = _BRep.BRep_Builder(), _TopoDS.TopoDS_Compound()
        builder.MakeCompound(compound)
        for item in items:
            builder.Add(compound, item.shape)
        stream = io.BytesIO()
        _BRepTools.Write_s(compound, stream)
        return stream.getvalue()


# --- reading ------------------------------------------------------------------------------------------------------


def step_items(data: bytes) -> list[Item]:
    """Every face and every free edge of a STEP file, in mm and in the order of the file.

    Raises
    ------
    Unreadable
        When the kernel cannot read it.
    """
    with session("reading STEP", READING_STEP):
        reader, document = _STEPCAFControl.STEPCAFControl_Reader(), Document()
        for mode in ("GDT", "Layer", "Mat", "Meta", "Props", "SHUO", "View"):
            getattr(reader, f"Set{mode}Mode")(False)
        if reader.ReadStream("gtcad", io.BytesIO(data)) != _IFSelect.IFSelect_RetDone:
            raise Unreadable("its syntax is wrong")
        work_session = reader.Reader().WS()
        for entity in entities(work_session.Model(), 0):
            protect(entity)
        _transfer(reader, work_session, document)
        refuse_lost_faces(work_session)
        items = _with_originals(document, step_originals(entities(work_session.Model(), 0)))
        stated = stated_properties(work_session.Model())
        return [replace(item, properties=stated.get(item.product)) for item in items]


def iges_items(path: str) -> list[Item]:
    """Every face and every free edge of an IGES file, in mm and in the order of the file.

    Raises
    ------
    Unreadable
        When the kernel cannot read it.
    """
    with session("reading IGES", READING_IGES):
        reader, document = _IGESCAFControl.IGESCAFControl_Reader(), Document()
        # from a path: ReadStream ends the process for IGES
        if reader.ReadFile(path) != _IFSelect.IFSelect_RetDone:
            raise Unreadable("its syntax is wrong")
        _transfer(reader, reader.WS(), document)
        return _with_originals(document, iges_originals(entities(reader.WS().Model(), 0)))


def _transfer(reader: Any, work_session: Any, document: Document) -> None:
    refuse_failures(work_session.Model(), work_session.ModelCheckList(False))
    if not reader.Transfer(document.data):
        raise Unreadable("the kernel finds no shape in it")
    refuse_failures(work_session.Model(), work_session.TransferReader().LastCheckList())


def _with_originals(document: Document, originals: Iterator[Spline]) -> list[Item]:
    items = list(document.items())
    if not any(is_periodic_spline(item.shape) for item in items):
        return items
    known = tuple(originals)
    return [replace(item, originals=known) for item in items]


def brep_items(data: bytes) -> list[Item]:
    """Every face and every free edge of a BREP file, in the order of the file, without names.

    Raises
    ------
    Unreadable
        When the kernel cannot read it.
    """
    with kernel_guard("reading BREP"), quiet():
        shape = _TopoDS.TopoDS_Shape()
        _BRepTools.Read_s(shape, io.BytesIO(data), _BRep.BRep_Builder())
        if shape.IsNull():
            raise Unreadable("its syntax is wrong")
        around = bodies(shape)
        return [Item(piece, "", body=around.get(ShapeKey(piece))) for piece in pieces(shape)]


# --- between files, parts and shapes ------------------------------------------------------------------------------


def items_of(parts: Sequence[Part], *, halved_ellipses: bool = False) -> list[Item]:
    """The edge, wire or face of each part; a whole ellipse as a wire of two halves if these are asked for.

    Raises
    ------
    InputError
        When there is no part, or a part is too small or too degenerate for the kernel.
    KernelError
        When the kernel refuses a shape.
    """
    checked_kind("parts", parts, Sequence, "a sequence of parts")
    if not parts:
        raise InputError("a file needs at least one part, got none")
    for i, part in enumerate(parts):
        checked_kind(f"parts[{i}]", part, Part, "a Part: a name and a spline")
    return [_item(i, part, halved_ellipses) for i, part in enumerate(parts)]


def _item(i: int, part: Part, halved_ellipses: bool) -> Item:
    geometry = part.geometry
    if halved_ellipses and isinstance(geometry, EllipseArc) and is_full_ellipse(geometry):
        geometry = Wire(halves(geometry))
    try:
        shape = _shape(geometry)
    except (InputError, KernelError) as error:
        raise type(error)(f"part {i} ({part.name!r}): {error}") from error
    names = tuple(f"{part.name}.{name}" for name in geometry.face_names) if isinstance(geometry, Built) else ()
    return Item(shape, part.name, part.color, names, properties=part.properties)


def _shape(geometry: Geometry) -> Any:
    if isinstance(geometry, Built):
        return geometry.shape
    if isinstance(geometry, Wire):
        return make_wire(geometry)
    if isinstance(geometry, Quadric):
        return make_quadric_face(geometry)
    return make_face(geometry) if isinstance(geometry, BSplineSurface) else make_edge(geometry)


def checked_tolerance(tolerance: float | None) -> float:
    """The tolerance, or that of the shapes for None.

    Raises
    ------
    InputError
        When it is not a positive number.
    """
    if tolerance is None:
        return TOLERANCE
    if not 0 < tolerance < math.inf:
        raise InputError(f"tolerance must be a positive number of mm, got {tolerance}")
    return float(tolerance)


def parts_of(path: str, kind: str, read: Callable[[], list[Item]]) -> list[Part]:
    """The parts of a file.

    Parameters
    ----------
    path, kind
        For messages: the file and the name of its format.
    read
        Reads the shapes.

    Raises
    ------
    FileError
        When it cannot be read or holds nothing.
    KernelError
        When a face or edge has no exact B-spline form.
    """
    try:
        items = read()
    except (Unreadable, KernelError) as error:
        raise FileError(path, f"is not a readable {kind} file: {error}") from error
    if not items:
        raise FileError(path, "holds neither faces nor edges")
    facts: dict[ShapeKey, BodyFacts] = {}
    for item in items:
        if item.body is not None and ShapeKey(item.body) not in facts:
            facts[ShapeKey(item.body)] = _facts(item.body)
    bodies_of = [None if item.body is None else facts[ShapeKey(item.body)] for item in items]
    stated = _measurable(items)
    return [
        replace(_part(path, i, item, body), properties=stated.get(id(item.properties)))
        for i, (item, body) in enumerate(zip(items, bodies_of, strict=True))
    ]


def _measurable(items: Sequence[Item]) -> dict[int, Properties]:
    """What the file states of products, by its identity, with the means to measure the same of their faces."""
    products: dict[int, list[Item]] = {}
    for item in items:
        if item.properties is not None:
            products.setdefault(id(item.properties), []).append(item)
    found = {}
    for own in products.values():
        faces = [item.shape for item in own if item.shape.ShapeType() == _TopAbs.TopAbs_FACE]
        bodies = {ShapeKey(item.body): item.body for item in own if item.body is not None}
        solids = [body for body in bodies.values() if body.ShapeType() == _TopAbs.TopAbs_SOLID]
        solid = solids[0] if len(solids) == len(bodies) == 1 else None
        assert own[0].properties is not None
        found[id(own[0].properties)] = replace(own[0].properties, measured=partial(measured, faces, solid))
    return found


def _facts(body: Any) -> BodyFacts:
    with kernel_guard("reading a body"):
        kind = "solid" if body.ShapeType() == _TopAbs.TopAbs_SOLID else "shell"
        return BodyFacts(kind, edge_uses(body).closed, is_valid(body), partial(volume, body, rtol=_VOLUME))


def _part(path: str, i: int, item: Item, body: BodyFacts | None) -> Part:
    is_face = item.shape.ShapeType() == _TopAbs.TopAbs_FACE
    geometry: Single
    trimmed = False
    try:
        with kernel_guard("reading a shape"):
            if is_face and (quadric := quadric_of_face(item.shape)) is not None:
                geometry, source = quadric, ENTITIES[quadric.kind]
            elif is_face:
                geometry, source, trimmed = face_geometry(item.shape)
            else:
                geometry, source = edge_geometry(item.shape)
            valid = is_valid(item.shape)
        if isinstance(geometry, BSplineCurve | BSplineSurface):
            geometry = restored(geometry, item.originals)
    except KernelError as error:
        raise KernelError(f"{path}: part {i} ({item.name!r}): {error}") from error
    except InputError as error:
        raise FileError(path, f"part {i} ({item.name!r}) is damaged: {error}") from error
    return Part(
        item.name,
        geometry,
        item.color,
        source=source,
        trimmed=trimmed,
        reversed=item.shape.Orientation() == _TopAbs.TopAbs_REVERSED,
        valid=valid,
        face=_trimmed_face(item.shape, geometry) if trimmed else None,
        body=body,
    )


def _trimmed_face(face: Any, geometry: Single) -> TrimmedFace:
    assert isinstance(geometry, BSplineSurface)
    with kernel_guard("reading a trimmed face"):
        region = region_of(face, geometry)
    return TrimmedFace(distances_to(face), area(face), partial(facets, face), region)
