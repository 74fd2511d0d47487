"""Validation properties in STEP files: what they state of their shapes besides the shapes.

The kernel writes areas, volumes and centres, but no points that lie on the shapes; it reads them too, but takes any
point for a centre. So points are written and everything is read here, by the names in the Recommended Practices for
Geometric and Assembly Validation Properties of the CAx Implementor Forum, release 4.4, 2016. Readers built on the
kernel take the last point of a file for the centre: ours come first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.document import Item
from gtcad.converters.part import Properties

_STEPConstruct = kernel_module("STEPConstruct")

Array = NDArray[np.float64]

_PROPERTY = "geometric validation property"
_AREA, _VOLUME, _CENTRE, _POINTS = "surface area", "volume", "centroid", "smooth sampling points"
_DIMENSIONS = {_AREA: 2, _VOLUME: 3, _CENTRE: 1, _POINTS: 1}  # powers of the unit of length
_LINKS = "StepRepr_PropertyDefinitionRepresentation"


def point_entities(model: Any, items: Sequence[Item], first: int) -> list[str]:
    """The entities that state the points of items, to be added to the printed file.

    Parameters
    ----------
    model
        In which the areas of the items that have properties are stated, in their order.
    items
        Those without points, or whose area is not stated, get none.
    first
        The number of the first entity.
    """
    kept = list(_entities(model))  # alive, an entity is always the same object here
    numbers = {id(entity): number for number, entity in enumerate(kept, start=1)}
    stating = [item for item in items if item.properties is not None and item.properties.area is not None]
    areas = [link for link in _links(model) if _text(link.UsedRepresentation().Name()) == _AREA]
    lines: list[str] = []
    for item, link in zip(stating, areas, strict=True):
        assert item.properties is not None
        if len(item.properties.points):
            target = numbers[id(_definition(link).Definition().Value())]
            context = numbers[id(link.UsedRepresentation().ContextOfItems())]
            lines += _stated(item.properties.points, target, context, first + len(lines))
    return lines


def _stated(points: Array, target: int, context: int, first: int) -> Iterator[str]:
    numbers = range(first, first + len(points))
    for number, point in zip(numbers, points.tolist(), strict=True):
        yield f"#{number} = CARTESIAN_POINT('sampling point',({','.join(f'{value:.16E}' for value in point)}));"
    listed = ",".join(f"#{number}" for number in numbers)
    last = numbers.stop
    yield f"#{last} = REPRESENTATION('{_POINTS}',({listed}),#{context});"
    yield f"#{last + 1} = PROPERTY_DEFINITION('{_PROPERTY}','{_POINTS}',#{target});"
    yield f"#{last + 2} = PROPERTY_DEFINITION_REPRESENTATION(#{last + 1},#{last});"


def stated_properties(model: Any) -> dict[str, Properties]:
    """What a file states, in mm, by the names of the products; nothing of products that share a name."""
    found: dict[str, dict[str, list[Array]]] = {}
    for link in _links(model):
        product, representation = _product(_definition(link)), link.UsedRepresentation()
        if product is not None and (dimension := _DIMENSIONS.get(_text(representation.Name()))):
            values = _values(representation) * _length(representation.ContextOfItems()) ** dimension
            own = found.setdefault(_text(product.Name()), {})
            own.setdefault(_text(representation.Name()), []).append(values)
    names = [_text(entity.Name()) for entity in _entities(model) if type(entity).__name__ == "StepBasic_Product"]
    return {name: _properties(name, stated) for name, stated in found.items() if names.count(name) == 1}


def _properties(name: str, stated: Mapping[str, Sequence[Array]]) -> Properties:
    """The one area, volume and centre that are stated; several, of parts of a product, say nothing of the whole."""

    def only(quantity: str, size: int) -> list[float] | None:
        values = stated.get(quantity, ())
        return values[0].reshape(-1).tolist() if len(values) == 1 and values[0].size == size else None

    area, volume, centre = only(_AREA, 1), only(_VOLUME, 1), only(_CENTRE, 3)
    points = [values.reshape(-1, 3) for values in stated.get(_POINTS, ()) if values.size % 3 == 0]
    return Properties(
        None if area is None else area[0],
        None if volume is None else volume[0],
        None if centre is None else (centre[0], centre[1], centre[2]),
        np.concatenate([np.empty((0, 3)), *points]),
        name=name,
    )


def _entities(model: Any) -> Iterable[Any]:
    return (model.Entity(number) for number in range(1, model.NbEntities() + 1))


def _links(model: Any) -> Iterator[Any]:
    """The entities that tie a validation property of geometry to its representation."""
    for entity in _entities(model):
        if type(entity).__name__ == _LINKS and entity.UsedRepresentation() is not None:
            definition = _definition(entity)
            if definition is not None and _text(definition.Name()) == _PROPERTY:
                yield entity


def _definition(link: Any) -> Any:
    return link.Definition().PropertyDefinition()


def _product(definition: Any) -> Any:
    """The product whose shape, or an aspect of whose shape, has the property; None of anything else."""
    about = definition.Definition()
    aspect = about.ShapeAspect()
    shape = about.ProductDefinitionShape() if aspect is None else aspect.OfShape()
    if shape is None:
        return None
    version = shape.Definition().ProductDefinition()
    return None if version is None else version.Formation().OfProduct()


def _values(representation: Any) -> Array:
    """The numbers of all measures and points of a representation, in its own units."""
    items = [representation.ItemsValue(k) for k in range(1, representation.NbItems() + 1)]
    values: list[float] = []
    for item in items:
        if type(item).__name__ == "StepGeom_CartesianPoint":
            values += (item.CoordinatesValue(axis) for axis in range(1, item.NbCoordinates() + 1))
        elif hasattr(item, "Measure"):
            values.append(item.Measure().ValueComponent())
    return np.array(values)


def _length(context: Any) -> float:
    """The unit of length of a context, in mm."""
    units = context.GlobalUnitAssignedContext() if hasattr(context, "GlobalUnitAssignedContext") else None
    if units is None:
        return 1.0
    found = _STEPConstruct.STEPConstruct_UnitContext()
    found.ComputeFactors(units)
    return float(found.LengthFactor())


def _text(value: Any) -> str:
    return "" if value is None else str(value.ToCString())
