"""What is global in the kernel and must not leak: its messages and its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

from gtcad.converters.occt.compat import kernel_guard, kernel_module, listed
from gtcad.errors import KernelError

_IGESControl = kernel_module("IGESControl").IGESControl_Controller
_Message = kernel_module("Message").Message
_Static = kernel_module("Interface").Interface_Static
_STEPCAFControl = kernel_module("STEPCAFControl").STEPCAFControl_Controller
_UnitsMethods = kernel_module("UnitsMethods").UnitsMethods
_STEPControl = kernel_module("STEPControl").STEPControl_Controller

Settings = Mapping[str, str | int | float]


@contextmanager
def quiet() -> Iterator[None]:
    """Keep the kernel's messages, which it prints on the standard output, from being printed."""
    messenger = _Message.DefaultMessenger_s()
    printers = list(listed(messenger.Printers()))
    for printer in printers:
        messenger.RemovePrinter(printer)
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


@contextmanager
def statics(settings: Settings) -> Iterator[None]:
    """Set parameters of the kernel's Interface_Static, which is global to the process, and restore them.

    Parameters
    ----------
    settings
        A text sets by name, an integer by number, a float a real parameter.

    Raises
    ------
    KernelError
        When the kernel does not know a parameter or refuses its value.
    """
    _STEPControl.Init_s()
    _STEPCAFControl.Init_s()
    _IGESControl.Init_s()
    before = {name: _get_static(name, value) for name, value in settings.items()}
    try:
        for name, value in settings.items():
            _set_static(name, value)
        yield
    finally:
        for name, value in before.items():
            _set_static(name, value)


def _get_static(name: str, like: str | int | float) -> str | int | float:
    if isinstance(like, str):
        return str(_Static.CVal_s(name))
    return float(_Static.RVal_s(name)) if isinstance(like, float) else int(_Static.IVal_s(name))


def _set_static(name: str, value: str | int | float) -> None:
    if isinstance(value, str):
        done = _Static.SetCVal_s(name, value)
    elif isinstance(value, float):
        done = _Static.SetRVal_s(name, value)
    else:
        done = _Static.SetIVal_s(name, value)
    if not done:
        raise KernelError(f"the kernel refuses the parameter {name} = {value!r}")


@contextmanager
def _millimetres() -> Iterator[None]:
    """The kernel's own length unit, global too; its readers and writers set it and leave it."""
    before = _UnitsMethods.GetCasCadeLengthUnit_s()
    _UnitsMethods.SetCasCadeLengthUnit_s(1.0)
    try:
        yield
    finally:
        _UnitsMethods.SetCasCadeLengthUnit_s(before)


@contextmanager
def session(action: str, settings: Settings) -> Iterator[None]:
    """Silence, parameters that do not leak, and the kernel's exceptions as KernelError."""
    with ExitStack() as stack:
        stack.enter_context(kernel_guard(action))
        stack.enter_context(quiet())
        stack.enter_context(_millimetres())
        stack.enter_context(statics(settings))
        yield


def _writing(tolerance: float) -> Settings:
    return {
        "xstep.cascade.unit": "MM",
        "write.precision.mode": 2,  # the value below, not an average over the shapes
        "write.precision.val": float(tolerance),
        "write.surfacecurve.mode": 1,
    }


def writing_step(schema: str, tolerance: float) -> Settings:
    """Every parameter that the STEP writer looks at; the tolerance, in mm, becomes the file's UNCERTAINTY."""
    return {
        **_writing(tolerance),
        "write.step.schema": schema,
        "write.step.unit": "MM",
        "write.step.assembly": 2,
        "write.step.tessellated": 2,
        "write.step.vertex.mode": 0,
        "write.step.nonmanifold": 0,
        "write.step.product.name": "gtcad",
        "write.stepcaf.subshapes.name": 0,
    }


def writing_iges(tolerance: float, *, bodies: bool) -> Settings:
    """Every parameter that the IGES writer looks at; the tolerance, in mm, becomes the file's resolution.

    With bodies, faces are those of boundary representations; without, trimmed surfaces, which more readers know.
    """
    return {
        **_writing(tolerance),
        "write.iges.unit": "MM",
        "write.iges.brep.mode": int(bodies),
        "write.convertsurface.mode": 0,
        "write.iges.plane.mode": 0,
        "write.iges.offset.mode": 0,
    }


_READING: Settings = {
    "xstep.cascade.unit": "MM",
    "read.precision.mode": 0,
    "read.maxprecision.mode": 0,
    "read.maxprecision.val": 1.0,
    "read.stdsameparameter.mode": 0,
    "read.surfacecurve.mode": 0,
    "read.encoderegularity.angle": 0.01,
}

READING_STEP: Settings = {
    **_READING,
    "read.step.product.mode": 1,
    "read.step.product.context": 1,
    "read.step.shape.repr": 1,
    "read.step.assembly.level": 1,
    "read.step.shape.relationship": 1,
    "read.step.shape.aspect": 1,
    "read.step.constructivegeom.relationship": 0,
    "read.step.all.shapes": 0,
    "read.step.ideas": 0,
    "read.step.nonmanifold": 0,
    "read.step.tessellated": 1,
    "read.step.root.transformation": 1,
    "read.step.codepage": "UTF8",
    "read.stepcaf.subshapes.name": 1,
    "step.angleunit.mode": 0,
}

READING_IGES: Settings = {
    **_READING,
    "read.iges.bspline.continuity": 0,
    "read.iges.bspline.approxd1.mode": 0,
    "read.iges.faulty.entities": 0,
    "read.iges.onlyvisible": 0,
}
