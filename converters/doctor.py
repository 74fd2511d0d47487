"""What is installed, whether the CAD kernel and its hosts work, and how to repair what does not. It repairs nothing.

`cadquery-ocp` and `cadquery-ocp-novtk` write the same folder ``OCP``: laid over each other in different versions they
leave a kernel that does not import, or worse, one that does. This shows in the metadata, so it is found without
importing anything; the kernel and each host are then tried in a process of their own, which may crash or hang.
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
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import Any

import gtcad
from gtcad.errors import KernelError

FULL, SLIM, PROXY = "cadquery-ocp", "cadquery-ocp-novtk", "cadquery-ocp-proxy"
KERNELS = (FULL, SLIM)
HOSTS = ("build123d", "cadquery")
USERS = (*HOSTS, "ocpsvg", "ocp-gordon")  # whatever states which kernel it needs
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
    """What importing the kernel or a host in a process of its own gave.

    Parameters
    ----------
    version
        The version of OCCT or of the host, or None when the import failed.
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
    hosts
        What trying each host that is installed gave.
    """

    versions: dict[str, str | None]
    kernel: Probe | None
    problems: tuple[str, ...]
    repair: tuple[str, ...]
    hosts: dict[str, Probe] = field(default_factory=dict)

    def as_data(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        return asdict(self)


def diagnose_installation(timeout: float = PROBE_SECONDS) -> Diagnosis:
    """Examine the running Python's environment; the kernel and the hosts get `timeout` seconds each to answer."""
    found = installed_distributions()
    has_kernel = any(d.name in KERNELS for d in found) or importlib.util.find_spec("OCP") is not None
    probe = probe_kernel(timeout) if has_kernel else None
    versions: dict[str, str | None] = {"python": platform.python_version(), "gtcad": gtcad.__version__}
    versions |= {name: _version_of(name, found) for name in LISTED}
    hosts = try_hosts(found, probe, timeout)
    problems = examine(found, probe)
    repair = repair_commands(found) if problems or probe is None else host_repairs(found, hosts)
    return Diagnosis(versions, probe, (*problems, *_host_problems(hosts)), tuple(repair), hosts)


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
        if host.name not in USERS:
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


def host_repairs(found: Sequence[Distribution], hosts: Mapping[str, Probe]) -> list[str]:
    """The commands that install anew, in its own version, each host that fails on a kernel that works."""
    python, commands = shlex.quote(sys.executable or "python"), []
    for name, probe in hosts.items():
        if probe.error:
            wanted = shlex.quote(f"{name}=={_version_of(name, found)}")
            commands.append(f"{python} -m pip install --force-reinstall --no-deps {wanted}")
            commands.append(f"{python} -m pip install {wanted}")  # what it needs and is missing
    return commands


# --- trying -----------------------------------------------------------------------------------------------------------

_UNTRIED = "not tried: the kernel does not work"


def try_hosts(found: Sequence[Distribution], kernel: Probe | None, timeout: float = PROBE_SECONDS) -> dict[str, Probe]:
    """Make a GT face in each host that is installed, unless the kernel itself does not work."""
    names = [name for name in HOSTS if any(d.name == name for d in found)]
    if not names:
        return {}
    if kernel is None or kernel.error:
        return {name: Probe(None, _UNTRIED) for name in names}
    with ThreadPoolExecutor(len(names)) as pool:
        return dict(zip(names, pool.map(lambda name: probe_host(name, timeout), names), strict=True))


def _host_problems(hosts: Mapping[str, Probe]) -> list[str]:
    failed = {name: probe.error for name, probe in hosts.items() if probe.error not in ("", _UNTRIED)}
    return [f"{name} does not work: {error}" for name, error in failed.items()]


def probe_kernel(timeout: float = PROBE_SECONDS) -> Probe:
    """Import the kernel and make a face with it, in a process of its own."""
    return _probe("answer_probe()", timeout)


def probe_host(name: str, timeout: float = PROBE_SECONDS) -> Probe:
    """Import a host and make a GT face with it, in a process of its own."""
    return _probe(f"answer_host({name!r})", timeout)


def _probe(call: str, timeout: float) -> Probe:
    paths = os.pathsep.join(path for path in sys.path if path)
    command = [sys.executable, "-P", "-c", f"from gtcad.converters import doctor; doctor.{call}"]
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
    """The answer of a process that ran `answer_probe` or `answer_host`."""
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
    _answer(_make_face, "OCP")


def answer_host(name: str) -> None:
    """Import a host, make a small GT face in it, and print a `Probe` as JSON."""
    _answer({"build123d": _make_build123d_face, "cadquery": _make_cadquery_face}[name], name)


def _answer(make: Callable[[], None], module: str) -> None:
    error = ""
    try:
        make()
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    version = getattr(sys.modules.get(module), "__version__", None)
    print("\n" + json.dumps({"version": version, "error": error}))


def _make_face() -> None:
    from gtcad.converters.bspline import BSplineSurface
    from gtcad.converters.occt.topology import make_face

    make_face(BSplineSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], [0, 1], [2, 2], 1, [0, 1], [2, 2], 1))


_NET = [[[0, 0, 0], [0, 1, 1], [0, 2, 0]], [[1, 0, 1], [1, 1, 2], [1, 2, 1]], [[2, 0, 0], [2, 1, 1], [2, 2, 0]]]


def _make_build123d_face() -> None:
    from gtcad.converters.build123d import GTSurface
    from gtcad.converters.build123d_lines import host

    face = GTSurface(_NET)
    _check_face(isinstance(face, host.Face) and face.is_valid, face.area)


def _make_cadquery_face() -> None:
    from gtcad.converters.cadquery import gtSurface
    from gtcad.converters.cadquery_shapes import cq

    face = gtSurface(_NET)
    _check_face(isinstance(face, cq.Face) and face.isValid(), face.Area())


def _check_face(valid: bool, area: float) -> None:
    from gtcad.measure import area as exact_area
    from gtcad.surface import Surface

    if not valid:
        raise KernelError("its own check calls a GT face invalid")
    exact = float(exact_area(Surface(_NET)))
    if not abs(area - exact) <= 0.01 * exact:
        raise KernelError(f"it measures {area:.6g} mm^2 for a GT face of {exact:.6g} mm^2")
