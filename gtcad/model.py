"""Model files: shapes by name in JSON or TOML, read with errors that name every wrong place at once.

A model file in TOML; the same keys make the JSON one::

    gtcad = 1                # version of the format
    unit = "mm"              # mm (default), cm, m, in, ft

    [[shape]]
    name = "arch"
    kind = "curve"           # or "surface"
    color = "#1f77b4"        # optional
    gamma = [0.2, -0.3]      # surfaces: gamma_u, gamma_v
    range = [0.0, 0.75]      # optional: a part of the domain; surfaces: [[0.0, 1.0], [0.25, 0.75]]
    control_points = [
      [0.0, 0.0],
      [50.0, 80.0],
      [100.0, 0.0]
    ]

``family = "bernstein"`` (``family_u``, ``family_v`` for one direction of a surface) asks for the
classical Bezier basis. Other kinds are listed in docs/model-files.md; those that are made of other shapes spell them
out or name them.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import ValidationError

from gtcad import _checks as checks
from gtcad._curve_kinds import CurveFields
from gtcad._documents import Location, Problem, document_text, model_suffix, read_document, shown
from gtcad._entries import TAG, ModelShape, ShapeEntry, Strict
from gtcad._files import written_whole
from gtcad._kinds import ENTRIES, MILLIMETRES, VERSION, ModelFile, entry_of
from gtcad._markings import Marking, MarkingFields, marking_problems
from gtcad._quilt_kinds import EdgeFields
from gtcad.errors import InputError, ModelError, SingularJoin
from gtcad.protocol import checked_kind
from gtcad.quilt import Quilt
from gtcad.solid import Solid

MAX_PROBLEMS = 50  # more lines than this help nobody


@dataclass(frozen=True, eq=False)
class Model(Mapping[str, ModelShape]):
    """Shapes by name, in the order of their file, with control points in the model's unit.

    Parameters
    ----------
    shapes
        The shapes by name.
    unit
        mm, cm, m, in or ft.
    colors
        The names that have a colour, and the colour as "#rrggbb".
    construction
        The names of shapes that only serve others: they are neither exported nor checked.
    markings
        Curves on shapes, for their flat patterns.

    Raises
    ------
    InputError
        When a model file could not hold it.

    Examples
    --------
    >>> from gtcad import Curve
    >>> model = Model({"arch": Curve([[0, 0], [1, 2], [2, 0]])}, unit="in")
    >>> model.in_millimetres()["arch"].evaluate(1.0).tolist()
    [50.8, 0.0]
    """

    shapes: Mapping[str, ModelShape]
    unit: str = "mm"
    colors: Mapping[str, str] = field(default_factory=dict)
    construction: frozenset[str] = frozenset()
    markings: tuple[Marking, ...] = ()

    def __post_init__(self) -> None:
        checked_kind("shapes", self.shapes, Mapping, "a mapping of names to shapes")
        object.__setattr__(self, "shapes", MappingProxyType(dict(self.shapes)))
        object.__setattr__(self, "colors", MappingProxyType(dict(self.colors)))
        object.__setattr__(self, "construction", frozenset(self.construction))
        object.__setattr__(self, "markings", tuple(self.markings))
        self.document()

    def __getitem__(self, name: str) -> ModelShape:
        return self.shapes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.shapes)

    def __len__(self) -> int:
        return len(self.shapes)

    def __eq__(self, other: object) -> bool:
        """Whether unit, colours and shapes are equal, in the same order."""
        if not isinstance(other, Model):
            return NotImplemented
        mine, others = ((m.unit, m.colors, m.construction, m.markings, list(m.items())) for m in (self, other))
        return mine == others

    def __hash__(self) -> int:
        return hash((self.unit, tuple(self.shapes)))

    def in_millimetres(self) -> dict[str, ModelShape]:
        """The shapes that are meant for export by name, in millimetres; the very same objects when the unit is mm."""
        factor = MILLIMETRES[self.unit]
        shapes = {name: shape for name, shape in self.items() if name not in self.construction}
        if factor == 1:
            return shapes
        return {name: shape.transformed(factor * np.eye(shape.dimension)) for name, shape in shapes.items()}

    def document(self) -> dict[str, Any]:
        """The plain data of the model's file.

        Raises
        ------
        InputError
            When a model file could not hold it.
        """
        for argument, names in (("colors", self.colors), ("construction", sorted(self.construction))):
            strangers = [name for name in names if name not in self.shapes]
            if strangers:
                raise InputError(f"{argument} names a shape that the model does not have: {strangers[0]!r}")
        for _, message in _face_name_problems(self.shapes, self.construction):
            raise InputError(message)
        for (_, index, part), message in marking_problems(self.markings, self.shapes):
            raise InputError(f"markings[{index}].{part} {message}")
        entries = [
            entry_of(name, shape, self.colors.get(name), construction=name in self.construction)
            for name, shape in self.items()
        ]
        markings = {"marking": [marking.data() for marking in self.markings]} if self.markings else {}
        data = {"gtcad": VERSION, "unit": self.unit, **markings, "shape": entries}
        try:
            ModelFile.model_validate(data)
        except ValidationError as error:
            raise InputError("\n".join(_lines(data, _translated(data, error)))) from None
        return data


def load_model(path: str | os.PathLike[str]) -> Model:
    """Read a model file, JSON or TOML by its suffix.

    Parameters
    ----------
    path
        A file that ends in ``.json`` or ``.toml``.

    Returns
    -------
    Model
        The shapes by name, in the model's unit.

    Raises
    ------
    FileError
        When the file is missing, unreadable, or has another suffix.
    ModelError
        When it is not a model; ``problems`` names all that is wrong with it, at most fifty.
    """
    data, problems = read_document(path)
    problems += _name_problems(data)
    try:
        content = ModelFile.model_validate(data)
    except ValidationError as error:
        raise ModelError(str(path), _lines(data, problems + _translated(data, error))) from None
    shapes = _built(content.shape, problems)
    construction = frozenset(entry.name for entry in content.shape if entry.construction)
    places = {entry.name: index for index, entry in enumerate(content.shape)}
    problems += [(("shape", places[name]), message) for name, message in _face_name_problems(shapes, construction)]
    markings = tuple(fields.marking() for fields in content.marking)
    if not problems:
        problems += marking_problems(markings, shapes)
    if problems:
        raise ModelError(str(path), _lines(data, problems))
    colors = {entry.name: entry.color for entry in content.shape if entry.color is not None}
    return Model(shapes, content.unit, colors, construction, markings)


def _built(entries: Sequence[ShapeEntry], problems: list[Problem]) -> dict[str, ModelShape]:
    """The shapes of all entries in their order; each is built after those that it refers to."""
    places = {entry.name: index for index, entry in enumerate(entries)}
    shapes: dict[str, ModelShape] = {}
    failed: set[str] = set()

    def build(index: int, path: tuple[str, ...]) -> None:
        entry = entries[index]
        if entry.name in shapes or entry.name in failed:
            return
        path = (*path, entry.name)
        count = len(problems)
        for location, name in entry.references():
            where = ("shape", index, *location)
            if name not in places:
                close = difflib.get_close_matches(name, places, n=1)
                meant = f"; did you mean {shown(close[0])}?" if close else ""
                problems.append((where, f"there is no shape of the name {shown(name)}{meant}"))
            elif name in path:
                circle = " -> ".join(map(shown, (*path[path.index(name) :], name)))
                problems.append((where, f"a shape cannot be made of itself: {circle}"))
            else:
                build(places[name], path)
        if len(problems) > count or any(name not in shapes for _, name in entry.references()):
            failed.add(entry.name)
            return
        try:
            shapes[entry.name] = entry.build(shapes)
        except (InputError, SingularJoin) as error:
            problems.append((("shape", index), str(error)))
            failed.add(entry.name)

    for index in range(len(entries)):
        build(index, ())
    return {entry.name: shapes[entry.name] for entry in entries if entry.name in shapes}


def dump_model(
    model: Mapping[str, ModelShape],
    path: str | os.PathLike[str],
    *,
    unit: str | None = None,
    colors: Mapping[str, str] | None = None,
) -> None:
    """Write shapes to a model file, JSON or TOML by its suffix, so that reading it gives back equal ones, bit for bit.

    Parameters
    ----------
    model
        A `Model`, or shapes by name.
    path
        A file that ends in ``.json`` or ``.toml``.
    unit
        The unit that the control points are in: mm by default, and always that of a `Model`.
    colors
        Colours by name, "#rrggbb"; those of a `Model` by default.

    Raises
    ------
    InputError
        When a model file cannot hold the shapes.
    FileError
        When the file cannot be written or has another suffix.
    """
    suffix = model_suffix(path)
    if isinstance(model, Model):
        if unit not in (None, model.unit):
            raise InputError(f"unit must be that of the model, {model.unit}, got {unit!r}")
        unit, colors = model.unit, model.colors if colors is None else colors
    construction = model.construction if isinstance(model, Model) else frozenset()
    markings = model.markings if isinstance(model, Model) else ()
    document = Model(model, unit or "mm", colors or {}, construction, markings).document()
    with written_whole(path) as temporary:
        temporary.write_text(document_text(document, suffix), encoding="utf-8", newline="\n")


def schema() -> dict[str, Any]:
    """The JSON Schema of model files, which holds for TOML ones too."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **ModelFile.model_json_schema()}


def _name_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    first: dict[str, int] = {}
    for index, shape in enumerate(_shapes(data)):
        name = shape.get("name") if isinstance(shape, dict) else None
        if isinstance(name, str) and first.setdefault(name, index) != index:
            yield ("shape", index, "name"), f"is already the name of shape no. {first[name] + 1}"


def _face_name_problems(shapes: Mapping[str, ModelShape], construction: Collection[str]) -> Iterator[tuple[str, str]]:
    """Bodies of which a face would have the name of another shape, or of another body's face, in files."""
    meant = {name: shape for name, shape in shapes.items() if name not in construction}
    owners = {name: f"shape {shown(name)}" for name in meant}
    for name, shape in meant.items():
        if isinstance(shape, Quilt | Solid):
            for patch in (shape.quilt if isinstance(shape, Solid) else shape).names:
                face = f"{name}.{patch}"
                if face in owners:
                    message = f"patch {shown(patch)} would be called {shown(face)} in files, as {owners[face]} is"
                    yield name, message
                owners.setdefault(face, f"patch {shown(patch)} of shape {shown(name)}")


def _shapes(data: Mapping[str, Any]) -> Sequence[Any]:
    shapes = data.get("shape")
    return shapes if isinstance(shapes, list) else []


def _translated(data: Mapping[str, Any], error: ValidationError) -> list[Problem]:
    """What pydantic found, in the words of this project."""
    problems: list[Problem] = []
    for found in error.errors(include_url=False):
        location = tuple(found["loc"])
        if location[:1] == ("shape",) and location[2:3] and location[2] in ENTRIES:
            location = (*location[:2], *location[3:])  # pydantic names the kind there
        location = tuple(part for part in location if not str(part).startswith(TAG))
        problems.append(_in_our_words(data, location, found))
    return problems


def _in_our_words(data: Mapping[str, Any], location: Location, found: Mapping[str, Any]) -> Problem:
    given = found["input"]
    match found["type"]:
        case checks.MESSAGE:
            message = found["ctx"]["message"]
        case "missing":
            message = "is missing" + (f" (this program reads version {VERSION})" if location == ("gtcad",) else "")
        case "extra_forbidden":
            message = "is not a field of this format" + _meant(data, location)
        case "union_tag_not_found":
            location, message = (*location, "kind"), f"is missing; must be one of {', '.join(ENTRIES)}"
        case "union_tag_invalid":
            location = (*location, "kind")
            message = f"must be one of {', '.join(ENTRIES)}, got {shown(given['kind'])}"
        case "list_type":
            message = f"must be a list of shapes, got {shown(given)}"
        case "too_short":
            message = f"must hold {found['ctx']['min_length']} at least, got {len(given)}"
        case "string_unicode":
            message = f"is not Unicode text: {shown(given)}"
        case _:
            message = f"must be an object with the fields of a shape, got {shown(given)}"
    return location, message


def _meant(data: Mapping[str, Any], location: Location) -> str:
    close = difflib.get_close_matches(str(location[-1]), _fields_at(data, location), n=1)
    return f"; did you mean {close[0]}?" if close else ""


def _fields_at(data: Mapping[str, Any], location: Location) -> Sequence[str]:
    """The fields of the mapping that a location lies in."""
    entry: type[Strict] = ModelFile
    value: Any = data
    for key in location[:-1]:
        value = value[key]
        if isinstance(value, dict):
            nested = EdgeFields if "edges" in location else MarkingFields if "marking" in location else CurveFields
            entry = ENTRIES[value["kind"]] if value.get("kind") in ENTRIES else nested
    return list(entry.model_fields)


def _lines(data: Mapping[str, Any], problems: Sequence[Problem]) -> list[str]:
    """One line for each problem, shape by shape; those that are too many are only counted."""
    ordered = sorted(
        problems, key=lambda problem: int(problem[0][1]) if problem[0][:1] == ("shape",) and len(problem[0]) > 1 else -1
    )
    lines = [_line(data, location, message) for location, message in ordered]
    if len(lines) > MAX_PROBLEMS:
        lines[MAX_PROBLEMS:] = [f"and {len(lines) - MAX_PROBLEMS} more problems"]
    return lines


def _line(data: Mapping[str, Any], location: Location, message: str) -> str:
    where = ""
    if location[:1] == ("shape",) and len(location) > 1:
        shape = _shapes(data)[int(location[1])]
        name = shape.get("name") if isinstance(shape, dict) else None
        number = int(location[1]) + 1
        where = f"shape {shown(name)} (no. {number})" if isinstance(name, str) else f"shape no. {number}"
        location = location[2:]
    path = ""
    for part in location:
        path += (
            f"[{part}]"
            if isinstance(part, int)
            else ("." if path else "") + (part if part.isidentifier() else shown(part))
        )
    where = ", ".join(filter(None, (where, path)))
    return f"{where}: {message}" if where else message
