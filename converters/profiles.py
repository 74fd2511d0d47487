"""What a file must keep to be ready for CAM: criteria with their limits, each with its source, in named profiles."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from gtcad.errors import InputError

Level = Literal["error", "warning", "info"]
Sense = Literal["most", "least", "none"]

_OWN = "gtcad's own: no published figure could be confirmed"
_VDA = "VDA 4955, as PTC Creo ModelCHECK (GeomIntegrityCHECK) sets it by default"
_MIL = "MIL-STD-31000A, appendix C, automotive industry, manufacturing (quoted in PMC4904719, table 1)"
_MIL_DESIGN = "MIL-STD-31000A, appendix C, automotive industry, design (quoted in PMC4904719, table 1)"
_NO_NUMBER = "a yes or no, no number"


@dataclass(frozen=True)
class Limit:
    """One criterion of a profile.

    Attributes
    ----------
    name
        What ``--limit`` calls it.
    code
        That of SASIG-PDQ (ISO/PAS 26183), or one beginning with "gtcad-" where none could be confirmed.
    title
        In words.
    sense
        "most": values above the limit are findings; "least": values below it; "none": there is no number.
    value
        The limit; None when the criterion is switched off.
    unit
        "mm", "deg", "%" or "".
    level
        What a finding counts as: "error" fails the file.
    source
        Where the number is from.
    """

    name: str
    code: str
    title: str
    sense: Sense
    value: float | None
    unit: str
    level: Level
    source: str

    @property
    def active(self) -> bool:
        """Whether the criterion is looked at."""
        return self.value is not None

    def broken_by(self, value: float) -> bool:
        """Whether a value is a finding; not a number always is."""
        if self.value is None:
            return False
        if self.sense == "none" or math.isnan(value):
            return True
        return value > self.value if self.sense == "most" else value < self.value


@dataclass(frozen=True)
class Profile:
    """Criteria with their limits.

    Attributes
    ----------
    name
        What ``--profile`` calls it, with what was changed.
    limits
        By name.
    """

    name: str
    limits: Mapping[str, Limit]

    def __getitem__(self, name: str) -> Limit:
        return self.limits[name]

    def changed(self, values: Mapping[str, float | None]) -> Profile:
        """The profile with other limits; None switches a criterion off.

        Raises
        ------
        InputError
            When there is no such criterion, or a number is none that it can have.
        """
        limits = dict(self.limits)
        for name, value in values.items():
            if name not in limits:
                raise InputError(f"there is no limit {name!r}; they are {', '.join(limits)}")
            if value is not None and not 0 <= value < math.inf:
                raise InputError(f"limit {name} must be a finite number from 0, got {value}")
            limits[name] = replace(limits[name], value=value, source="given by the user")
        return Profile(self.name, limits)


# name, code, title, sense, unit, level, value in "cam"
_CRITERIA: tuple[tuple[str, str, str, Sense, str, Level, float], ...] = (
    ("valid", "gtcad-valid", "the kernel finds no fault (BRepCheck)", "none", "", "error", 0.0),
    ("closed", "gtcad-closed", "solids are closed", "none", "", "error", 0.0),
    ("free-edge", "gtcad-free-edge", "edges of shells that only one face uses", "none", "", "info", 0.0),
    ("overused-edge", "G-SH-NM", "faces that use an edge", "most", "", "error", 2.0),
    ("orientation", "gtcad-orientation", "faces of a shell agree on their outer side", "none", "", "error", 0.0),
    ("edge-gap", "G-FA-EG", "gap between an edge and the surface of its face", "most", "mm", "error", 0.01),
    ("vertex-gap", "G-CU-LG", "gap between a vertex and the end of its edge", "most", "mm", "error", 0.01),
    ("face-gap", "G-SH-LG", "gap between faces along an edge that they share, or should", "most", "mm", "error", 0.01),
    (
        "tangent-angle",
        "G-SU-NT",
        "angle between faces along a nearly smooth edge",
        "most",
        "deg",
        "warning",
        0.5,
    ),
    ("curvature-jump", "G-SU-NS", "jump of curvature across a tangent edge", "most", "%", "info", 10.0),
    ("sharp-angle", "gtcad-sharp", "angle from which an edge is meant to be sharp", "none", "deg", "info", 5.0),
    ("knot-angle", "G-CU-NT", "angle at a knot inside a curve or surface", "most", "deg", "warning", 0.5),
    ("tiny-edge", "G-CU-TI", "length of an edge", "least", "mm", "error", 0.005),
    ("tiny-face", "G-FA-TI", "square root of the area of a face", "least", "mm", "error", 0.01),
    ("narrow-face", "G-FA-NA", "mean width of a face", "least", "mm", "error", 0.01),
    ("loop-intersection", "G-LO-IS", "boundaries of faces do not cross themselves", "none", "", "error", 0.0),
    ("self-intersection", "G-SU-IS", "faces do not cross themselves or each other", "none", "", "error", 0.0),
    ("degree", "G-SU-HD", "degree of a curve or surface", "most", "", "warning", 11.0),
    ("knot-distance", "G-SU-IK", "distance in space between neighbouring knots", "least", "mm", "warning", 0.001),
    ("poles", "gtcad-poles", "control points of a curve or surface", "most", "", "warning", 10_000.0),
    (
        "stored-tolerance",
        "gtcad-tolerance",
        "tolerance that the kernel stores with a shape",
        "most",
        "mm",
        "warning",
        0.01,
    ),
)
_CAM_SOURCES = {
    "overused-edge": _MIL,
    "edge-gap": _MIL,
    "vertex-gap": _MIL,
    "face-gap": _MIL,
    "tiny-edge": _MIL,
    "narrow-face": _MIL,
    "degree": _VDA,
    "curvature-jump": _VDA,
}
_VDA_VALUES: Mapping[str, tuple[float, str]] = {
    "edge-gap": (0.02, _OWN),
    "vertex-gap": (0.02, _VDA),
    "face-gap": (0.02, _VDA),
    "tangent-angle": (0.1, _VDA),
    "curvature-jump": (10.0, _VDA),
    "knot-angle": (0.1, _VDA),
    "tiny-edge": (0.02, _VDA),
    "tiny-face": (0.02, _VDA),
    "narrow-face": (0.02, _OWN),
    "degree": (11.0, _VDA),
    "knot-distance": (0.02, _VDA),
    "stored-tolerance": (0.02, _OWN),
}
_SASIG_VALUES: Mapping[str, tuple[float, str]] = {
    "overused-edge": (2.0, _MIL),
    "edge-gap": (0.01, _MIL),
    "vertex-gap": (0.01, _MIL),
    "face-gap": (0.01, _MIL),
    "tangent-angle": (2.0, _MIL_DESIGN),
    "knot-angle": (2.0, _MIL_DESIGN),
    "tiny-edge": (0.005, _MIL),
    "tiny-face": (0.01, _OWN),
    "narrow-face": (0.01, _MIL),
}


def _profile(name: str, values: Mapping[str, tuple[float, str]]) -> Profile:
    limits = {}
    for key, code, title, sense, unit, level, value in _CRITERIA:
        number, source = values.get(key, (value, _NO_NUMBER if sense == "none" and not unit else _OWN))
        limits[key] = Limit(key, code, title, sense, number, unit, level, source)
    return Profile(name, limits)


_CAM_VALUES = {key: (value, _CAM_SOURCES[key]) for key, *_, value in _CRITERIA if key in _CAM_SOURCES}
PROFILES: Mapping[str, Profile] = {
    "cam": _profile("cam", _CAM_VALUES),
    "vda-4955": _profile("vda-4955", _VDA_VALUES),
    "sasig": _profile("sasig", _SASIG_VALUES),
}
_LENGTHS = {"": 1.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "cm": 10.0, "m": 1e3, "in": 25.4}
_ANGLES = {"": 1.0, "deg": 1.0, "rad": 180 / math.pi}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "mm": _LENGTHS,
    "deg": _ANGLES,
    "%": {"": 1.0, "%": 1.0},
    "": {"": 1.0},
}
_ASSIGNMENT = re.compile(r"\s*([a-z-]+)\s*=\s*(?:(off)|([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([a-z%]*))\s*", re.I)


def profile_of(name: str, changes: Mapping[str, float | None] | None = None) -> Profile:
    """The profile of a name, with changed limits.

    Raises
    ------
    InputError
        When there is no such profile or limit.
    """
    if name not in PROFILES:
        raise InputError(f"must be one of {', '.join(PROFILES)}, got {name!r}")
    return PROFILES[name].changed(changes or {})


def limit_of(text: str) -> tuple[str, float | None]:
    """The name and the value, in the criterion's unit, of a text such as "tiny-edge=0.01mm" or "degree=off".

    Raises
    ------
    InputError
        When the text is none of that kind, or the criterion has no such unit.
    """
    match = _ASSIGNMENT.fullmatch(text)
    if match is None:
        raise InputError(f"must be like tiny-edge=0.01mm, tangent-angle=0.5deg or degree=off, got {text!r}")
    name = match[1].lower()
    limits = PROFILES["cam"].limits
    if name not in limits:
        raise InputError(f"must name one of {', '.join(limits)}, got {name!r}")
    if match[2]:
        return name, None
    limit, unit = limits[name], match[4].lower()
    if limit.sense == "none" and not limit.unit:
        raise InputError(f"{name} takes no number, only off, got {text!r}")
    units = _UNITS[limit.unit]
    if unit not in units:
        allowed = ", ".join(filter(None, units)) or "no unit"
        raise InputError(f"{name} is measured in {allowed}, got {text!r}")
    value = float(match[3]) * units[unit]
    if not 0 <= value < math.inf:
        raise InputError(f"{name} must be a finite number from 0, got {text!r}")
    return name, value
