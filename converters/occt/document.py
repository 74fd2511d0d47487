"""The kernel's document, which gives names and colours to shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from gtcad.converters.occt.compat import LabelSequence, kernel_module, listed
from gtcad.converters.occt.originals import Spline
from gtcad.converters.occt.pieces import ShapeKey, bodies, pieces
from gtcad.converters.part import Color, Properties

_Quantity = kernel_module("Quantity")
_gp = kernel_module("gp")
_TCollection = kernel_module("TCollection")
_TDataStd = kernel_module("TDataStd")
_TDF = kernel_module("TDF")
_TDocStd = kernel_module("TDocStd")
_TopLoc = kernel_module("TopLoc")
_XCAFDoc = kernel_module("XCAFDoc")

_COLOR_DIGITS = 6  # the kernel keeps colours in single precision


@dataclass(frozen=True)
class Item:
    """A shape with the name and the colour that a file gives it, and perhaps names for its faces in their order.

    `originals` holds the B-splines that the file spells out, when the kernel may have moved the last bits of this one;
    `body` is the solid, or else the shell of several faces, that a face belongs to; `product` is the name of the shape
    in the document that it is a piece of, unless that was moved.
    """

    shape: Any
    name: str
    color: Color | None = None
    face_names: tuple[str, ...] = ()
    originals: tuple[Spline, ...] = ()
    body: Any = None
    properties: Properties | None = None
    product: str = ""


class Document:
    """An XCAF document in mm; it must outlive its labels."""

    def __init__(self) -> None:
        self.data = _TDocStd.TDocStd_Document(_TCollection.TCollection_ExtendedString("gtcad"))
        _XCAFDoc.XCAFDoc_DocumentTool.SetLengthUnit_s(self.data, 0.001)
        self.shapes = _XCAFDoc.XCAFDoc_DocumentTool.ShapeTool_s(self.data.Main())
        self.colors = _XCAFDoc.XCAFDoc_DocumentTool.ColorTool_s(self.data.Main())

    def add(self, item: Item) -> Any:
        """The label of a new top-level shape, with no more of its name than ASCII and without its colour."""
        label = self.shapes.AddShape(item.shape, False)
        name = item.name.encode("ascii", "ignore").decode().strip() or "part"
        _TDataStd.TDataStd_Name.Set_s(label, _TCollection.TCollection_ExtendedString(name))
        if item.properties is not None:
            _set_properties(label, item.properties)
        return label

    def items(self) -> Iterator[Item]:
        """Every face, and every edge that belongs to no face, with its name and colour."""
        labels = LabelSequence()
        self.shapes.GetFreeShapes(labels)
        for label in listed(labels):
            yield from self._items(label, _TopLoc.TopLoc_Location(), Item(None, ""))

    def _items(self, label: Any, location: Any, outer: Item) -> Iterator[Item]:
        name, color = self._name(label) or outer.name, self._color(label) or outer.color
        inherited = Item(None, name, color, product=name)
        if self.shapes.IsReference_s(label):
            referred = _TDF.TDF_Label()
            self.shapes.GetReferredShape_s(label, referred)
            yield from self._items(referred, location.Multiplied(self.shapes.GetLocation_s(label)), inherited)
        elif self.shapes.IsAssembly_s(label):
            components = LabelSequence()
            self.shapes.GetComponents_s(label, components)
            for component in listed(components):
                yield from self._items(component, location, inherited)
        else:
            yield from self._pieces(label, location, inherited)

    def _pieces(self, label: Any, location: Any, inherited: Item) -> Iterator[Item]:
        shape = self.shapes.GetShape_s(label)
        own, around = self._named_pieces(label), bodies(shape)
        for piece in pieces(shape):
            found, body = own.get(ShapeKey(piece), inherited), around.get(ShapeKey(piece))
            name, color = found.name or inherited.name, found.color or inherited.color
            item = Item(piece.Moved(location), name, color, body=body)
            if location.IsIdentity():  # properties are stated before a shape is moved into its place
                item = replace(item, product=inherited.product)
            yield item

    def _named_pieces(self, label: Any) -> dict[ShapeKey, Item]:
        """Names and colours of faces and free edges, the narrower sub-shape's before the wider one's."""
        labels = LabelSequence()
        self.shapes.GetSubShapes_s(label, labels)
        found: dict[ShapeKey, Item] = {}
        subs = [(self.shapes.GetShape_s(sub), self._name(sub), self._color(sub)) for sub in listed(labels)]
        for shape, name, color in sorted(subs, key=lambda sub: int(sub[0].ShapeType())):
            for piece in pieces(shape):
                wider = found.get(ShapeKey(piece), Item(None, ""))
                found[ShapeKey(piece)] = Item(None, name or wider.name, color or wider.color)
        return found

    def _name(self, label: Any) -> str:
        # not label.FindAttribute: its result is freed memory
        attributes = _TDF.TDF_AttributeIterator(label)
        while attributes.More():
            value = attributes.Value()
            if type(value).__name__ == "TDataStd_Name":
                return str(value.Get().ToExtString())
            attributes.Next()
        return ""

    def _color(self, label: Any) -> Color | None:
        color = _Quantity.Quantity_Color()
        for kind in (_XCAFDoc.XCAFDoc_ColorSurf, _XCAFDoc.XCAFDoc_ColorCurv, _XCAFDoc.XCAFDoc_ColorGen):
            if self.colors.GetColor_s(label, kind, color):
                red, green, blue = (round(value, _COLOR_DIGITS) for value in color.Values(_Quantity.Quantity_TOC_sRGB))
                return red, green, blue
        return None


def _set_properties(label: Any, properties: Properties) -> None:
    if properties.area is not None:
        _XCAFDoc.XCAFDoc_Area.Set_s(label, properties.area)
    if properties.volume is not None:
        _XCAFDoc.XCAFDoc_Volume.Set_s(label, properties.volume)
    if properties.centroid is not None:
        _XCAFDoc.XCAFDoc_Centroid.Set_s(label, _gp.gp_Pnt(*properties.centroid))
