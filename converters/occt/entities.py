"""What is set by hand in the entities of a STEP or IGES model before it is written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

import gtcad
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.document import Item
from gtcad.converters.occt.originals import protect
from gtcad.converters.part import Color
from gtcad.errors import KernelError

_APIHeaderSection = kernel_module("APIHeaderSection")
_IGESGraph = kernel_module("IGESGraph")
_StepBasic = kernel_module("StepBasic")
_TCollection = kernel_module("TCollection")


_ALONE = ("StepShape_AdvancedFace", "StepShape_GeometricCurveSet")
_BODIES = ("StepShape_ManifoldSolidBrep", "StepShape_BrepWithVoids", "StepShape_ShellBasedSurfaceModel")


def _text(value: str) -> Any:
    return _TCollection.TCollection_HAsciiString(value)


# --- STEP -------------------------------------------------------------------------------------------------------------


def finish_step_entities(
    entities: Iterable[Any], items: Sequence[Item], timestamp: datetime
) -> tuple[list[str], list[str]]:
    """Name what carries a name, and keep out what the kernel takes from the clock, the machine and the user.

    Parameters
    ----------
    entities
        All of a model, in which each item begins with its product and has its faces in order.
    items
        With their colours, and the names of the faces of shells and solids.
    timestamp
        Goes into creation dates.

    Returns
    -------
    styles
        The entities that give the items their colours, to be added to the printed file.
    names
        What the marks ``@000000000@``, ``@000000001@``, ... that were set as names stand for.

    Raises
    ------
    KernelError
        When a shell or solid has not as many faces as names.
    """
    part, number = -1, 0
    names = [item.name for item in items]
    face_names: list[list[str]] = [list(item.face_names) for item in items]
    targets: dict[int, tuple[int, bool]] = {}
    contexts: dict[int, int] = {}
    for number, entity in enumerate(entities, start=1):
        kind = type(entity).__name__
        part += kind == "StepBasic_Product"
        protect(entity)
        mark = part
        if kind == "StepShape_AdvancedFace" and items[part].face_names:
            if not face_names[part]:
                raise KernelError(f"{items[part].name!r} has more faces than names")
            mark = len(names)
            names.append(face_names[part].pop(0))
        _finish_step_entity(entity, kind, f"@{mark:09d}@", timestamp)
        if kind in (_BODIES if part >= 0 and items[part].face_names else _ALONE):
            targets.setdefault(part, (number, kind != "StepShape_GeometricCurveSet"))
        elif kind.endswith("_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx"):
            contexts[part] = number
    if any(face_names):
        raise KernelError("a shape has fewer faces than names")
    styles: list[str] = []
    for i, item in enumerate(items):
        if item.color is not None:
            styles += _style(number + len(styles) + 1, *targets[i], contexts[i], item.color)
    return styles, names


def _style(first: int, target: int, is_face: bool, context: int, color: Color) -> list[str]:
    """The entities, numbered from `first`, that colour the target in its context."""
    if is_face:
        kinds = [
            "SURFACE_STYLE_USAGE(.BOTH.,{next})",
            "SURFACE_SIDE_STYLE('',({next}))",
            "SURFACE_STYLE_FILL_AREA({next})",
            "FILL_AREA_STYLE('',({next}))",
            "FILL_AREA_STYLE_COLOUR('',{next})",
        ]
    else:
        kinds = [
            "CURVE_STYLE('',{next},POSITIVE_LENGTH_MEASURE(1.0000000000000001E-01),{after})",
            "DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous')",
        ]
    kinds = [
        f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({{next}}),#{context})",
        f"STYLED_ITEM('color',({{next}}),#{target})",
        "PRESENTATION_STYLE_ASSIGNMENT(({next}))",
        *kinds,
        f"COLOUR_RGB('',{','.join(f'{value:.16E}' for value in color)})",
    ]
    return [f"#{i} = {kind.format(next=f'#{i + 1}', after=f'#{i + 2}')};" for i, kind in enumerate(kinds, start=first)]


def with_entities(data: bytes, first: Sequence[str], last: Sequence[str]) -> bytes:
    """The printed file with more entities at the beginning and at the end of its data."""
    before, start, middle = data.partition(b"DATA;\n")
    middle, end, after = middle.rpartition(b"ENDSEC;")
    added = ("".join(f"{line}\n" for line in lines).encode("ascii") for lines in (first, last))
    return b"".join((before, start, next(added), middle, next(added), end, after))


def with_names(data: bytes, names: Sequence[str]) -> bytes:
    """The printed file with the names in their places.

    They are not there from the beginning because the kernel breaks long ones over lines, within an escape sequence too.
    """
    return re.sub(rb"@(\d{9})@", lambda match: part21_text(names[int(match[1])]).encode("ascii"), data)


def part21_text(text: str) -> str:
    """A text as Part 21 writes it between apostrophes: ASCII, anything else as an escape sequence."""
    outer = {0, len(text) - 1}  # the kernel's reader drops spaces at the ends
    return "".join(_part21_letter(letter, i in outer) for i, letter in enumerate(text))


def _part21_letter(letter: str, outer: bool) -> str:
    code = ord(letter)
    if letter == "'":
        return "''"
    if 32 <= code < 127 and letter != "\\" and not (outer and letter == " "):
        return letter
    return f"\\X2\\{code:04X}\\X0\\" if code < 65536 else f"\\X4\\{code:08X}\\X0\\"


def _finish_step_entity(entity: Any, kind: str, name: str, timestamp: datetime) -> None:
    utc = timestamp if timestamp.tzinfo is None else timestamp.astimezone(UTC)
    match kind:
        case "StepBasic_Product":
            entity.SetId(_text(name))
            entity.SetName(_text(name))
        case "StepShape_AdvancedFace" | "StepGeom_TrimmedCurve":
            entity.SetName(_text(name))
        case "StepBasic_CalendarDate":
            entity.SetYearComponent(utc.year)
            entity.SetMonthComponent(utc.month)
            entity.SetDayComponent(utc.day)
        case "StepBasic_LocalTime":
            entity.SetHourComponent(utc.hour)
            entity.SetMinuteComponent(utc.minute)
        case "StepBasic_CoordinatedUniversalTimeOffset":
            entity.SetHourOffset(0)
            entity.UnSetMinuteOffset()
            entity.SetSense(_StepBasic.StepBasic_AheadOrBehind.StepBasic_aobExact)
        case "StepBasic_Person":
            entity.SetId(_text(""))
            entity.SetLastName(_text(""))
            entity.SetFirstName(_text(""))
        case "StepBasic_Organization":
            entity.SetId(_text(""))
            entity.SetName(_text(""))


def set_step_header(model: Any, timestamp: datetime) -> None:
    """Fill the header; nothing in it comes from the clock, the machine or the user."""
    header = _APIHeaderSection.APIHeaderSection_MakeHeader(model)
    header.SetName(_text("gtcad"))
    header.SetTimeStamp(_text(timestamp.isoformat(timespec="seconds")))
    header.SetAuthorValue(1, _text(""))
    header.SetOrganizationValue(1, _text(""))
    header.SetPreprocessorVersion(_text(f"gtcad {gtcad.__version__}"))
    header.SetOriginatingSystem(_text("gtcad"))
    header.SetAuthorisation(_text(""))
    header.SetDescriptionValue(1, _text("gtcad"))
    header.Apply(model)


# --- IGES -------------------------------------------------------------------------------------------------------------


def set_iges_names(entities: Iterable[Any], name: str) -> None:
    """Give all name properties among the entities of a part its name, in UTF-8; readers drop spaces at the ends."""
    for entity in entities:
        if type(entity).__name__ == "IGESBasic_Name":
            entity.Init(1, _text(name.strip()))


def set_iges_color(model: Any, top: Any, color: Color) -> None:
    """Give the top entity of a part its colour; to be called after ComputeModel, which drops those of ellipses."""
    entity = _IGESGraph.IGESGraph_Color()
    entity.Init(*(100 * value for value in color), _text(""))
    model.AddEntity(entity)
    top.InitColor(entity, 0)


def set_global_section(model: Any, timestamp: datetime) -> None:
    """Fill the global section; nothing in it comes from the clock, the machine or the user."""
    section = model.GlobalSection()
    date = _text(timestamp.strftime("%Y%m%d.%H%M%S"))
    section.SetDate(date)
    section.SetLastChangeDate(date)
    section.SetFileName(_text("gtcad"))
    section.SetSendName(_text("gtcad"))
    section.SetReceiveName(_text(""))
    section.SetSystemId(_text("gtcad"))
    section.SetInterfaceVersion(_text(f"gtcad {gtcad.__version__}"))
    section.SetAuthorName(_text(""))
    section.SetCompanyName(_text(""))
    model.SetGlobalSection(section)
