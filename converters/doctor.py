"""What is installed, whether the CAD kernel works, and how to repair it when it does not.

`cadquery-ocp` and `cadquery-ocp-novtk` write the same folder ``OCP``: laid over each other in different versions they
leave a kernel that does not import, or worse, one that does. This shows in the metadata, so it is found without
importing anything; the import itself is tried in a process of its own, which may crash or hang.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import gtcad

FULL, SLIM, PROXY = "cadquery-ocp", "cadquery-ocp-novtk", "cadquery-ocp-proxy"
KERNELS = (FULL, SLIM)
HOSTS = ("build123d", "cadquery", "ocpsvg", "ocp-gordon")  # whatever states which kernel it needs
LISTED = ("numpy", "scipy", "pydantic", *KERNELS, PROXY, "build123d", "cadquery")
PROBE_SECONDS = 120.0
_COMPARE = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


@dataclass(frozen=True)
class Distribution:
    """An installed distribution: its normalized name, its version, and what it requires, as its metadata say."""

    name: str
    version: str
    requires: tuple[str, ...] = ()


@dataclass(frozen=True)
class Probe:
    """What importing the kernel in a process of its own gave.

    Parameters
    ----------
    version
        The version of OCCT, or None when the import failed.
    error
        Why the import or the making of a face failed; empty when both went well.
    """

    version: str | None
    error: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """The state of an installation.

    Parameters
    ----------
    versions
        Version by name; None for what is not installed.
    kernel
        What trying the kernel gave; None when there is none.
    problems
        What is wrong, one sentence each.
    repair
        The commands that repair it, or that install a kernel when there is none.
    """

    versions: dict[str, str | None]
    kernel: Probe | None
    problems: tuple[str, ...]
    repair: tuple[str, ...]

    def as_data(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        return asdict(self)


def diagnose_installation(timeout: float = PROBE_SECONDS) -> Diagnosis:
    """Examine the running Python's environment; the kernel gets `timeout` seconds to answer."""
    found = installed_distributions()
    has_kernel = any(d.name in KERNELS for d in found) or importlib.util.find_spec("OCP") is not None
    probe = probe_kernel(timeout) if has_kernel else None
    versions: dict[str, str | None] = {"python": platform.python_version(), "gtcad": gtcad.__version__}
    versions |= {name: _version_of(name, found) for name in LISTED}
    problems = examine(found, probe)
    repair = repair_commands(found) if problems or probe is None else []
    return Diagnosis(versions, probe, tuple(problems), tuple(repair))


def installed_distributions() -> list[Distribution]:
    """Every distribution that the running Python can see, with normalized names."""
    found = []
    for item in importlib.metadata.distributions():
        name = item.metadata["Name"]
        if name:  # an interrupted installation leaves metadata without one
            found.append(Distribution(normalized(name), item.version, tuple(item.requires or ())))
    return found


def normalized(name: str) -> str:
    """A distribution's name in the form in which names are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def examine(distributions: Iterable[Distribution], probe: Probe | None) -> list[str]:
    """What is wrong with these distributions and this answer of the kernel.

    Parameters
    ----------
    distributions
        All that is installed.
    probe
        What trying the kernel gave; None when there is none to try.
    """
    found = list(distributions)
    if probe is None and not any(d.name in KERNELS for d in found):
        return []
    problems = [*_overlaid(found), *_misfits(found)]
    if probe is not None and probe.error:
        problems.append(f"the kernel does not work: {probe.error}")
    return problems


def _overlaid(found: Sequence[Distribution]) -> list[str]:
    kernels = sorted({(d.name, d.version) for d in found if d.name in KERNELS})
    problems = []
    if len({version for _, version in kernels}) > 1:
        names = " and ".join(f"{name} {version}" for name, version in kernels)
        problems.append(f"{names} write the same folder OCP and lie over each other")
    for proxy in sorted({d.version for d in found if d.name == PROXY}):
        if kernels and proxy not in {version for _, version in kernels}:
            names = " and ".join(f"{name} {version}" for name, version in kernels)
            problems.append(f"{PROXY} {proxy} does not belong to {names}")
    return problems


def _misfits(found: Sequence[Distribution]) -> list[str]:
    problems = []
    for host in found:
        if host.name not in HOSTS:
            continue
        for requirement in host.requires:
            name, specifier = parsed_requirement(requirement)
            # the full kernel holds all that the slim one does, not the other way round
            able = {FULL: (FULL,), SLIM: KERNELS, PROXY: (PROXY,)}.get(name, ())
            versions = sorted({d.version for d in found if d.name in able})
            if able and not any(satisfies(version, specifier) for version in versions):
                has = f"{' and '.join(versions)} is installed" if versions else "it is not installed"
                problems.append(f"{host.name} {host.version} needs {name}{specifier}, but {has}")
    return problems


def parsed_requirement(requirement: str) -> tuple[str, str]:
    """The normalized name and the version specifier of a requirement; two empty texts when it is an extra's."""
    text, _, marker = requirement.partition(";")
    match = re.match(r"\s*([A-Za-z0-9._-]+)\s*(?:\[[^]]*\])?\s*\(?([^()]*)\)?\s*$", text)
    if match is None or "extra" in marker:
        return "", ""
    return normalized(match[1]), match[2].replace(" ", "")


def satisfies(version: str, specifier: str) -> bool:
    """Whether a version such as "7.9.3.1.1" meets a specifier such as "<8.0,>=7.9": numbers only, no wildcards."""
    for clause in filter(None, specifier.split(",")):
        match = re.fullmatch(r"(<=|>=|==|!=|<|>)(.+)", clause)
        if match is None:
            continue  # a form that no kernel's host uses: not known to be unmet
        if not _COMPARE[match[1]](_numbers(version), _numbers(match[2])):
            return False
    return True


def _numbers(version: str) -> tuple[int, ...]:
    numbers = [int(part) for part in re.findall(r"\d+", version)]
    while numbers and numbers[-1] == 0:
        numbers.pop()  # 8.0 and 8.0.0 are equal
    return tuple(numbers)


def repair_commands(found: Sequence[Distribution]) -> list[str]:
    """The commands that leave one kernel, the one that fits CadQuery if that is installed, else build123d."""
    extra = "cadquery" if any(d.name == "cadquery" for d in found) else "build123d"
    python = shlex.quote(sys.executable or "python")
    installed = sorted({d.name for d in found if d.name in (*KERNELS, PROXY)})
    wanted = _pins(extra, found) or [f"gtcad[{extra}]"]
    commands = [f"{python} -m pip uninstall -y {' '.join(installed)}"] if installed else []
    return [*commands, f"{python} -m pip install {' '.join(map(shlex.quote, wanted))}"]


def _pins(extra: str, found: Sequence[Distribution]) -> list[str]:
    """The requirements of one of gtcad's own extras."""
    own = next((d.requires for d in found if d.name == "gtcad"), ())
    pins = [requirement.partition(";") for requirement in own]
    return [text.strip() for text, _, marker in pins if re.search(rf"extra\s*==\s*['\"]{extra}['\"]", marker)]


def _version_of(name: str, found: Sequence[Distribution]) -> str | None:
    versions = sorted({d.version for d in found if d.name == name})
    return " and ".join(versions) if versions else None


def probe_kernel(timeout: float = PROBE_SECONDS) -> Probe:
    """Import the kernel and make a face with it, in a process of its own."""
    paths = os.pathsep.join(path for path in sys.path if path)
    command = [sys.executable, "-P", "-c", "from gtcad.converters import doctor; doctor.answer_probe()"]
    try:
        child = subprocess.run(
            command,
            env=os.environ | {"PYTHONPATH": paths},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Probe(None, f"it did not answer within {timeout:g} s")
    except OSError as error:
        return Probe(None, f"no process could be started to try it: {error.strerror}")
    return read_answer(child.returncode, child.stdout, child.stderr)


def read_answer(returncode: int, stdout: str, stderr: str) -> Probe:
    """The answer of a process that ran `answer_probe`."""
    if returncode < 0:
        return Probe(None, f"it crashed (signal {-returncode})")
    try:
        answer = json.loads(stdout.splitlines()[-1])
        return Probe(answer["version"], answer["error"])
    except (IndexError, ValueError, TypeError, KeyError):
        last = stderr.strip().splitlines()[-1:] or [f"exit code {returncode}"]
        return Probe(None, last[0])


def answer_probe() -> None:
    """Import the kernel, make a small face, and print a `Probe` as JSON."""
    error = ""
    try:
        _make_face()
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    version = getattr(sys.modules.get("OCP"), "__version__", None)
    print("\n" + json.dumps({"version": version, "error": error}))


def _make_face() -> None:
    from gtcad.converters.bspline import BSplineSurface
    from gtcad.converters.occt.topology import make_face

    make_face(BSplineSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], [0, 1], [2, 2], 1, [0, 1], [2, 2], 1))
