"""What an exchange file holds, held against a model or against another file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from gtcad._entries import ModelShape
from gtcad.composite import Composite
from gtcad.converters.chain_check import Joint, check_chain
from gtcad.converters.figures import Figure, Piece, figure_of, figure_of_part
from gtcad.converters.matching import UNITS, Matches, Named, matched
from gtcad.converters.part import Part
from gtcad.converters.quilt_check import check_quilt
from gtcad.converters.verdicts import Row, compared_parts, joined
from gtcad.errors import InputError
from gtcad.quilt import Quilt
from gtcad.solid import Solid


@dataclass(frozen=True)
class Report:
    """What was found.

    Attributes
    ----------
    rows
        In the order of the model: one for each shape, and for each piece of a chain.
    extra
        The names of parts that no shape claims.
    joints
        Of the chains, in order.
    """

    rows: tuple[Row, ...]
    extra: tuple[str, ...]
    joints: tuple[Joint, ...] = ()


def check_parts(parts: Sequence[Part], shapes: Mapping[str, ModelShape], tolerance: float) -> Report:
    """Hold the parts of a file against the shapes of a model.

    Parameters
    ----------
    parts
        As read from the file, in mm.
    shapes
        By name, in mm.
    tolerance
        In mm, above 0.

    Returns
    -------
    Report
        Faces and edges are matched by where they lie, several of them to one shape where they cover it together; names
        decide where several fit, and where none does.

    Raises
    ------
    InputError
        When the tolerance is not above 0.
    """
    _check_tolerance(tolerance)
    pieces = [Piece(k, part, figure_of_part(part)) for k, part in enumerate(parts)]
    targets = [(name, target) for name, shape in shapes.items() for target in _targets(name, shape)]
    found = matched(_named(pieces), [target for _, target in targets], tolerance)
    places = {name: [k for k, (owner, _) in enumerate(targets) if owner == name] for name in shapes}
    rows: list[Row] = []
    joints: list[Joint] = []
    free = {piece.index: piece for piece in pieces if piece.index not in found.used}
    for name, shape in shapes.items():
        own = [targets[k][1].figure for k in places[name]]
        groups = [[pieces[p] for p in found.groups[k]] for k in places[name]]
        others = _others(name, shape, groups, list(free.values()))
        shape_rows, between, left = _checked(name, shape, own, groups, others, tolerance)
        joints += between
        for piece in others:
            del free[piece.index]
        free.update({piece.index: piece for piece in left})
        units = [found.units[k] for k in places[name] if k in found.units]
        rows += [_remarked(row, name, parts, shapes, units) for row in shape_rows]
    rows = [_explained(row, shapes, list(free.values())) for row in rows]
    extra = tuple(piece.part.name or f"no. {piece.index + 1}" for _, piece in sorted(free.items()))
    return Report(tuple(rows), extra, tuple(joints))


def _check_tolerance(tolerance: float) -> None:
    if not tolerance > 0:
        raise InputError(f"tolerance must be above 0, got {tolerance}")


def _named(pieces: Sequence[Piece]) -> list[Named]:
    return [Named(piece.part.name, piece.figure) for piece in pieces]


def _targets(name: str, shape: ModelShape) -> list[Named]:
    """What faces and edges are looked for."""
    if isinstance(shape, Quilt | Solid):
        quilt = shape.quilt if isinstance(shape, Solid) else shape
        pairs = zip(quilt.names, quilt.patches, strict=True)
        return [Named(f"{name}.{patch}", figure_of(surface)) for patch, surface in pairs]
    return [Named(name, figure_of(shape))]


def _others(name: str, shape: ModelShape, groups: Sequence[Sequence[Piece]], free: Sequence[Piece]) -> list[Piece]:
    """Faces that hold no patch, of the bodies that the patches' faces are of, or called after the shape."""
    if not isinstance(shape, Quilt | Solid):
        return []
    bodies = {id(piece.part.body) for group in groups for piece in group if piece.part.body is not None}
    return [
        piece
        for piece in free
        if piece.figure.variables == 2
        and (id(piece.part.body) in bodies or piece.part.name == name or piece.part.name.startswith(f"{name}."))
    ]


def _checked(
    name: str,
    shape: ModelShape,
    figures: Sequence[Figure],
    groups: Sequence[Sequence[Piece]],
    others: Sequence[Piece],
    tolerance: float,
) -> tuple[list[Row], list[Joint], list[Piece]]:
    """The rows and joints of a shape, and those of its parts that stand for nothing."""
    if isinstance(shape, Composite):
        chain = figures[0].geometry
        assert isinstance(chain, Composite)
        return check_chain(name, chain, groups[0], tolerance)
    if isinstance(shape, Quilt | Solid):
        return *check_quilt(name, shape, figures, groups, others, tolerance), []
    return [compared_parts(name, figures[0], groups[0], tolerance)], [], []


# --- remarks ----------------------------------------------------------------------------------------------------------


def _remarked(
    row: Row, owner: str, parts: Sequence[Part], shapes: Mapping[str, ModelShape], units: Sequence[float]
) -> Row:
    """The row with what is to be said of names and units."""
    names = [parts[k].name for k in row.face]
    remarks = []
    if units and row.verdict not in ("proved", "estimated"):
        remarks.append(UNITS[units[0]])
    if any(not _is_own(name, owner) for name in names):
        remarks.append("matched by position")
    if len(row.face) == 1 and row.name.startswith(f"{owner}.") and names[0].startswith(f"{owner}."):
        remarks += [f"the file calls it {names[0]!r}"] if names[0] != row.name else []
    elif len(row.face) == 1 and names[0] in shapes and names[0] != owner:
        remarks.append(f"the file calls it {names[0]!r}")
    return replace(row, remark=joined(*remarks, row.remark))


def _is_own(name: str, owner: str) -> bool:
    return name == owner or name.startswith(f"{owner}.")


def _explained(row: Row, shapes: Mapping[str, ModelShape], free: Sequence[Piece]) -> Row:
    """The row of a missing shape with the remark that the file holds something of another kind by its name."""
    if row.verdict != "missing" or row.remark or row.name not in shapes or isinstance(shapes[row.name], Quilt | Solid):
        return row
    same = [piece for piece in free if piece.part.name == row.name]
    if not same:
        return row
    is_face = same[0].figure.variables == 2
    found, wanted = ("a face", "an edge") if is_face else ("an edge", "a face")
    return replace(row, remark=f"the file holds {found} of this name, not {wanted}")


# --- two files --------------------------------------------------------------------------------------------------------


def compare_parts(parts: Sequence[Part], others: Sequence[Part], tolerance: float) -> Report:
    """Hold the parts of a file against those of another one.

    Parameters
    ----------
    parts
        As read from the file, in mm.
    others
        Of the other file, which is the one to be kept to.
    tolerance
        In mm, above 0.

    Returns
    -------
    Report
        A row for each part of the other file, under its name or number. Splines with equal or affine parameters are
        proved, all else is estimated.

    Raises
    ------
    InputError
        When the tolerance is not above 0.
    """
    _check_tolerance(tolerance)
    pieces = [Piece(k, part, figure_of_part(part)) for k, part in enumerate(parts)]
    targets = [Named(part.name, figure_of_part(part)) for part in others]
    found = matched(_named(pieces), targets, tolerance)
    labels = _labels(others)
    rows = []
    for k, (label, target) in enumerate(zip(labels, targets, strict=True)):
        row = compared_parts(label, target.figure, [pieces[p] for p in found.groups[k]], tolerance)
        rows.append(_told(row, target.name, [parts[p].name for p in found.groups[k]], found, k))
    extra = [part.name or f"no. {k + 1}" for k, part in enumerate(parts) if k not in found.used]
    return Report(tuple(rows), tuple(extra))


def _labels(parts: Sequence[Part]) -> list[str]:
    """The names of parts, with their number where that alone tells them apart."""
    names = [part.name for part in parts]
    return [name if name and names.count(name) == 1 else f"{name} no. {k + 1}".strip() for k, name in enumerate(names)]


def _told(row: Row, wanted: str, names: Sequence[str], found: Matches, k: int) -> Row:
    remarks = []
    if k in found.units and row.verdict not in ("proved", "estimated"):
        remarks.append(UNITS[found.units[k]])
    if any(name != wanted for name in names):
        remarks.append("matched by position")
    return replace(row, remark=joined(*remarks, row.remark))
