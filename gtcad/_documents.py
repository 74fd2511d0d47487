"""Model files as text: JSON or TOML to plain data and back, before anything is known about shapes."""

from __future__ import annotations

import json
import math
import os
import stat
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gtcad.errors import FileError, ModelError

SUFFIXES = (".json", ".toml")
MAX_BYTES = 100_000_000  # a few hundred patches of degree 60; more would exhaust memory before it says what is wrong

Location = tuple[int | str, ...]
Problem = tuple[Location, str]


def shown(value: object) -> str:
    """A value from a file as a message names it: short, printable, and never a failure itself."""
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, int):
        return str(value) if value.bit_length() < 64 else f"an integer of {value.bit_length()} bits"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str):
        return repr(value if len(value) <= 40 else value[:37] + "...")
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "an object" if isinstance(value, dict) else f"a {type(value).__name__}"


def read_document(path: str | os.PathLike[str]) -> tuple[dict[str, Any], list[Problem]]:
    """The plain data of a JSON or TOML file, by suffix, and the fields that it gives more than once.

    Raises
    ------
    FileError
        When the file is missing, a folder, unreadable, too large, or has another suffix.
    ModelError
        When its text is empty, not UTF-8, nested absurdly deep, or not JSON or TOML.
    """
    suffix = model_suffix(path)
    text = _text(path)
    repeated: list[tuple[dict[str, Any], str]] = []
    try:
        data = _parse_json(text, repeated) if suffix == ".json" else tomllib.loads(text)
    except RecursionError:
        raise ModelError(str(path), ["is nested too deeply to be a model"]) from None
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise ModelError(str(path), [f"is not valid JSON: {_lower(error.msg)} (at {where})"]) from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(str(path), [f"is not valid TOML: {_lower(str(error))}"]) from None
    except ValueError:  # Python refuses to read integers of more than 4300 digits, or dates such as 31 February
        raise ModelError(str(path), ["holds a number or a date that is beyond all limits"]) from None
    if not isinstance(data, dict):
        raise ModelError(str(path), [f"must be an object with the fields gtcad, unit and shape, got {shown(data)}"])
    return data, [(_location(data, where, field), "is given more than once") for where, field in repeated]


def model_suffix(path: str | os.PathLike[str]) -> str:
    """The suffix in lower case, ``.json`` or ``.toml``.

    Raises
    ------
    FileError
        When it is another one.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FileError(str(path), f"a model file ends in {' or '.join(SUFFIXES)}, this one in {suffix!r}")
    return suffix


def _text(path: str | os.PathLike[str]) -> str:
    try:
        found = os.stat(path)
        if stat.S_ISDIR(found.st_mode):
            raise FileError(str(path), "is a folder")
        if not stat.S_ISREG(found.st_mode):
            raise FileError(str(path), "is not an ordinary file")
        if found.st_size > MAX_BYTES:
            raise FileError(str(path), f"has {found.st_size} bytes, a model at most {MAX_BYTES}")
        content = Path(path).read_bytes()
    except FileError:
        raise
    except OSError as error:
        raise FileError(str(path), f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # a path that no file can have, such as one with a null character
        raise FileError(str(path), f"cannot be read: {error}") from error
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 text: byte 0x{content[error.start]:02x} at position {error.start}"
        raise ModelError(str(path), [message]) from None
    if not text.strip():
        raise ModelError(str(path), ["is empty"])
    return text


def _parse_json(text: str, repeated: list[tuple[dict[str, Any], str]]) -> Any:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            counts = Counter(field for field, _ in pairs)
            repeated.extend((result, field) for field, count in counts.items() if count > 1)
        return result

    return json.loads(text, object_pairs_hook=unique)


def _location(data: dict[str, Any], where: dict[str, Any], field: str) -> Location:
    if where is data:
        return (field,)
    shapes = data.get("shape")
    for index, shape in enumerate(shapes if isinstance(shapes, list) else []):
        if where is shape:
            return ("shape", index, field)
    return (field,)


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:]


def document_text(document: Mapping[str, Any], suffix: str) -> str:
    """The text of a model file, one point a line; reading it gives back equal data, bit for bit.

    Parameters
    ----------
    document
        The fields of the file; ``shape`` last, a list of mappings whose values are strings, numbers, truth values,
        lists, or such mappings; other fields may be such lists too.
    suffix
        ``.json`` or ``.toml``.
    """
    *head, shapes = document.items()
    return _json_text(head, shapes[1]) if suffix == ".json" else _toml_text(head, shapes[1])


def _toml_text(head: list[tuple[str, Any]], shapes: list[dict[str, Any]]) -> str:
    lines = [f"{key} = {_value(value, '')}" for key, value in head if not _is_table(value)]
    tables = [(key, value) for key, value in head if _is_table(value)]
    for key, entries in [*tables, ("shape", shapes)]:
        for entry in entries:
            lines += ["", f"[[{key}]]", *_toml_table(entry, key)]
    return "\n".join(lines) + "\n"


def _toml_table(table: dict[str, Any], path: str) -> Iterator[str]:
    """The lines of a table, those of the tables in it last."""
    inner = {key: value for key, value in table.items() if _is_table(value)}
    yield from (f"{key} = {_value(value, '')}" for key, value in table.items() if key not in inner)
    for key, value in inner.items():
        heading = f"{path}.{key}"
        if isinstance(value, dict):
            yield from ("", f"[{heading}]", *_toml_table(value, heading))
        else:
            for entry in value:
                yield from ("", f"[[{heading}]]", *_toml_table(entry, heading))


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(entry, dict) for entry in value))


def _json_text(head: list[tuple[str, Any]], shapes: list[dict[str, Any]]) -> str:
    fields = "".join(f'  "{key}": {_value(value, "  ")},\n' for key, value in head)
    return "{\n" + fields + '  "shape": ' + _value(shapes, "  ") + "\n}\n"


def _value(value: Any, indent: str) -> str:
    """A value, written so that both JSON and TOML read it; mappings for JSON only."""
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    inner = indent + "  "
    if isinstance(value, dict):
        fields = (f'{inner}"{key}": {_value(entry, inner)}' for key, entry in value.items())
        return "{\n" + ",\n".join(fields) + f"\n{indent}}}"
    if not isinstance(value, list):
        if not math.isfinite(value):
            raise ValueError(f"{value} has no place in a model file")
        return repr(value)
    if not any(isinstance(entry, list | dict) for entry in value):
        return "[" + ", ".join(_value(entry, "") for entry in value) + "]"
    return "[\n" + ",\n".join(inner + _value(entry, inner) for entry in value) + f"\n{indent}]"
