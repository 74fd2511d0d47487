"""Checks of a model file's values that name every wrong place at once, in this project's words."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NoReturn

from pydantic import ValidationError, ValidationInfo
from pydantic_core import InitErrorDetails, PydanticCustomError

from gtcad._documents import Location, Problem, shown
from gtcad.basis import FAMILIES, MAX_DEGREE

MAX_NAME = 200
MAX_COORDINATE = 1e50  # curvature needs sixth powers of lengths, which must stay finite
MAX_ANGLE = 1e6  # degrees: more only loses digits
LEAST_TURN = 1e-7  # degrees, as in gtcad.conics
MIN_RANGE = 1e-9  # as in gtcad.protocol.domain_part
MESSAGE = "gtcad"  # the type under which pydantic carries our messages

Check = Callable[[Any, ValidationInfo], Any]


def refuse(problems: Iterable[Problem]) -> NoReturn:
    """Raise all the problems as one error, which pydantic merges with those of the other fields."""
    details = [
        InitErrorDetails(type=PydanticCustomError(MESSAGE, "{message}", {"message": message}), loc=location, input=None)
        for location, message in problems
    ]
    raise ValidationError.from_exception_data("model", details)


def _checked(value: Any, problems: Iterator[Problem]) -> Any:
    found = list(problems)
    if found:
        refuse(found)
    return value


def one_of(*allowed: str | int) -> Check:
    """A check that the value is one of these, and of the same type."""

    def check(value: Any, info: ValidationInfo) -> Any:
        if any(type(value) is type(entry) and value == entry for entry in allowed):
            return value
        wanted = f"one of {', '.join(map(str, allowed))}" if len(allowed) > 1 else str(allowed[0])
        refuse([((), f"must be {wanted}, got {shown(value)}")])

    return check


def optional(check: Check) -> Check:
    """The check, but null stands for leaving the field out."""
    return lambda value, info: None if value is None else check(value, info)


def name(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a printable text of 1 to 200 characters."""
    if not isinstance(value, str):
        refuse([((), f"must be a text, got {shown(value)}")])
    if not value.strip():
        refuse([((), f"must not be empty, got {shown(value)}")])
    if not value.isprintable():
        refuse([((), f"must consist of printable characters, got {shown(value)}")])
    if len(value) > MAX_NAME:
        refuse([((), f"must have at most {MAX_NAME} characters, got {len(value)}")])
    return value


def color(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not written as ``#rrggbb``."""
    if not isinstance(value, str) or not re.fullmatch("#[0-9a-fA-F]{6}", value):
        refuse([((), f"must be a text like '#1f77b4' (red, green, blue), got {shown(value)}")])
    return value


def gamma(*family_fields: str) -> Check:
    """A check of a pair of design variables, given the fields that may hold the family, the strongest first."""

    def check(value: Any, info: ValidationInfo) -> Any:
        family = family_of(info.data, *family_fields)
        if family is not None and not FAMILIES[family].takes_gamma:
            refuse([((), f"the family {family} takes no design variables: leave it out, got {shown(value)}")])
        return tuple(_checked(value, _interval_problems(value, "two design variables", -1, 1)))

    return check


def family_of(data: dict[str, Any], *fields: str) -> str | None:
    """The family that the fields give, the strongest first; None when one of them is wrong."""
    if any(field not in data for field in fields):
        return None
    return next((data[field] for field in fields if data[field] is not None), None)


def interval(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a pair of different parameters in [0, 1]."""
    return tuple(_checked(value, _range_problems(value, ())))


def rectangle(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not two pairs of parameters, the range of u and that of v."""
    return tuple(tuple(side) for side in _checked(value, _rectangle_problems(value)))


def _rectangle_problems(value: Any) -> Iterator[Problem]:
    if not isinstance(value, list) or len(value) != 2:
        yield (), f"must be two ranges, one for u and one for v, got {shown(value)}"
        return
    for index, side in enumerate(value):
        yield from _range_problems(side, (index,))


def _range_problems(value: Any, location: Location) -> Iterator[Problem]:
    problems = list(_interval_problems(value, "two parameters", 0, 1, location))
    yield from problems
    if not problems and abs(value[1] - value[0]) < MIN_RANGE:
        yield location, f"must be two different parameters, got [{value[0]}, {value[1]}]"


def _interval_problems(value: Any, what: str, low: float, high: float, location: Location = ()) -> Iterator[Problem]:
    if not isinstance(value, list) or len(value) != 2:
        yield location, f"must be {what} in [{low}, {high}], got {shown(value)}"
        return
    for index, entry in enumerate(value):
        problem = _number_problem(entry)
        if problem is None and not low <= entry <= high:
            problem = f"must lie in [{low}, {high}], got {shown(entry)}"
        if problem is not None:
            yield (*location, index), problem


def _number_problem(value: Any) -> str | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f"must be a number, got {shown(value)}"
    if isinstance(value, float) and not math.isfinite(value):
        return f"must be finite, got {shown(value)}"
    if not -MAX_COORDINATE <= value <= MAX_COORDINATE:
        return f"must be at most {MAX_COORDINATE:g} in size, got {shown(value)}"
    return None


def curve_points(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of points of one dimension, as many as some degree of the family needs."""
    return _checked(value, _curve_problems(value, family_of(info.data, "family")))


def _curve_problems(value: Any, family: str | None) -> Iterator[Problem]:
    if not isinstance(value, list):
        yield (), f"must be a list of points, got {shown(value)}"
        return
    yield from _count_problems(len(value), family, "points", "")
    points = [((index,), point) for index, point in enumerate(value)]
    yield from _point_problems(points, (2, 3))
    good = [(location, len(point)) for location, point in points if isinstance(point, list) and len(point) in (2, 3)]
    for location, size in good:
        if size != good[0][1]:
            yield location, f"must have {good[0][1]} coordinates like the points before, got {size}"


def net(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of equally long rows of points, as many as some degrees of the families need."""
    families = [family_of(info.data, field, "family") for field in ("family_u", "family_v")]
    return _checked(value, _net_problems(value, families))


def _net_problems(value: Any, families: Sequence[str | None]) -> Iterator[Problem]:
    if not isinstance(value, list):
        yield (), f"must be a list of rows of points, got {shown(value)}"
        return
    yield from _count_problems(len(value), families[0], "rows", " in u")
    for index, row in enumerate(value):
        if not isinstance(row, list):
            yield (index,), f"must be a row, a list of points, got {shown(row)}"
    rows = [(index, row) for index, row in enumerate(value) if isinstance(row, list)]
    if rows:
        yield from _row_length_problems(rows, families[1])
    points = [((index, column), point) for index, row in rows for column, point in enumerate(row)]
    yield from _point_problems(points, (3,))


def _row_length_problems(rows: list[tuple[int, list[Any]]], family: str | None) -> Iterator[Problem]:
    usual = Counter(len(row) for _, row in rows).most_common(1)[0][0]
    model = next(index for index, row in rows if len(row) == usual)
    yield from _count_problems(usual, family, "points in each row", " in v")
    for index, row in rows:
        if len(row) != usual:
            yield (index,), f"row {index} has {len(row)} points, row {model} has {usual}: all rows must be equally long"


def _count_problems(count: int, family: str | None, what: str, direction: str) -> Iterator[Problem]:
    least = 1 if family is None else FAMILIES[family].minimum_degree
    if count < least + 1:
        basis = "" if family is None else f" of the family {family}"
        yield (), f"must have at least {least + 1} {what} (degree {least}{direction}{basis}), got {count}"
    if count > MAX_DEGREE + 1:
        yield (), f"must have at most {MAX_DEGREE + 1} {what} (degree {MAX_DEGREE}{direction}), got {count}"


def _point_problems(points: Sequence[tuple[Location, Any]], sizes: tuple[int, ...]) -> Iterator[Problem]:
    wanted = " or ".join(map(str, sizes))
    found = {len(point) if isinstance(point, list) else -1 for _, point in points}
    uniform = len(points) > 1 and len(found) == 1 and found.isdisjoint((*sizes, -1))
    if uniform:  # one mistake, not one for each point
        yield (), f"points must have {wanted} coordinates, got {found.pop()} in each"
    for location, point in points:
        if not isinstance(point, list):
            yield location, f"must be a point, a list of {wanted} numbers, got {shown(point)}"
            continue
        if len(point) not in sizes and not uniform:
            yield location, f"must have {wanted} coordinates, got {len(point)}"
        for index, coordinate in enumerate(point):
            problem = _number_problem(coordinate)
            if problem is not None:
                yield (*location, index), problem


def yes_or_no(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is neither true nor false."""
    if not isinstance(value, bool):
        refuse([((), f"must be true or false, got {shown(value)}")])
    return value


def point(*sizes: int) -> Check:
    """A check of one point or vector."""
    return lambda value, info: _checked(value, _point_problems([((), value)], sizes))


def positive(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a number above 0."""
    problem = _number_problem(value)
    if problem is None and not value > 0:
        problem = f"must be above 0, got {shown(value)}"
    if problem is not None:
        refuse([((), problem)])
    return value


def triangle(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not three points of one dimension."""
    return _checked(value, _triangle_problems(value))


def _triangle_problems(value: Any) -> Iterator[Problem]:
    if not isinstance(value, list) or len(value) != 3:
        yield (), f"must be three points, got {shown(value)}"
    else:
        yield from _curve_problems(value, None)


def angles(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a pair of different angles at most a full turn apart."""
    pair = tuple(_checked(value, _interval_problems(value, "two angles in degrees", -MAX_ANGLE, MAX_ANGLE)))
    if not LEAST_TURN <= abs(pair[1] - pair[0]) <= 360:
        refuse([((), f"must be {LEAST_TURN:g} to 360 degrees apart, got {shown(pair[0])} and {shown(pair[1])}")])
    return pair


def orders(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not an order of continuity, or a list of them."""
    return _checked(value, _order_problems(value))


def _order_problems(value: Any) -> Iterator[Problem]:
    wanted = "must be one of C0 to C3 and G0 to G3"
    if not isinstance(value, str | list):
        yield (), f"{wanted}, or a list of them, got {shown(value)}"
        return
    entries: list[tuple[Location, Any]] = [((), value)]
    if isinstance(value, list):
        entries = [((k,), entry) for k, entry in enumerate(value)]
    for location, entry in entries:
        if not (isinstance(entry, str) and re.fullmatch("[CG][0-3]", entry)):
            yield location, f"{wanted}, got {shown(entry)}"


def places(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of pairs of whole numbers from 0."""
    return [tuple(pair) for pair in _checked(value, _place_problems(value))]


def _place_problems(value: Any) -> Iterator[Problem]:
    if not isinstance(value, list):
        yield (), f"must be a list of pairs [piece, control point], got {shown(value)}"
        return
    for index, pair in enumerate(value):
        whole = isinstance(pair, list) and len(pair) == 2 and all(type(entry) is int and entry >= 0 for entry in pair)
        if not whole:
            yield (index,), f"must be a pair of whole numbers from 0, got {shown(pair)}"


def number(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a finite number."""
    problem = _number_problem(value)
    if problem is not None:
        refuse([((), problem)])
    return value


def numbers(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of finite numbers."""
    if not isinstance(value, list):
        refuse([((), f"must be a list of numbers, got {shown(value)}")])
    return _checked(value, (((k,), found) for k, entry in enumerate(value) if (found := _number_problem(entry))))


def placement(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not three rows of four numbers."""
    return _checked(value, _placement_problems(value))


def _placement_problems(value: Any) -> Iterator[Problem]:
    if not isinstance(value, list) or len(value) != 3:
        yield (), f"must be three rows of four numbers, got {shown(value)}"
        return
    for row, entries in enumerate(value):
        if not isinstance(entries, list) or len(entries) != 4:
            yield (row,), f"must be a row of four numbers, got {shown(entries)}"
            continue
        for column, entry in enumerate(entries):
            problem = _number_problem(entry)
            if problem is not None:
                yield (row, column), problem


def order(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not an order of continuity."""
    if isinstance(value, list):
        refuse([((), f"must be one of C0 to C3 and G0 to G3, got {shown(value)}")])
    return _checked(value, _order_problems(value))


def side(value: Any, info: ValidationInfo) -> Any:
    """Refuse what does not name a side of a patch."""
    if not (isinstance(value, str) and re.fullmatch(r".+\.[uv][01]", value)):
        refuse([((), f"must be a patch and a side, such as 'roof.u1' (u0, u1, v0 or v1), got {shown(value)}")])
    return value


def not_negative(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a number from 0."""
    problem = _number_problem(value)
    if problem is None and value < 0:
        problem = f"must not be negative, got {shown(value)}"
    if problem is not None:
        refuse([((), problem)])
    return value
