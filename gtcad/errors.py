"""Every error of gtcad: each is a GtcadError and also the fitting built-in, and carries its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial


class GtcadError(Exception):
    """Base of every error that gtcad raises on purpose."""


class InputError(GtcadError, ValueError):
    """An argument is out of its range or of the wrong shape; the message says what was given and what is allowed."""


class NotDevelopable(InputError):
    """A surface cannot be laid flat without stretching, or not at all.

    Parameters
    ----------
    reason
        What stands in the way, and where.
    twist_deg
        The largest twist of the tangent plane along a ruling in degrees, where that is the reason.
    parameter
        Where along the rulings; None where it is no matter of a place.
    """

    def __init__(self, reason: str, *, twist_deg: float | None = None, parameter: float | None = None) -> None:
        self.reason = reason
        self.twist_deg = twist_deg
        self.parameter = parameter
        super().__init__(reason)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), twist_deg=self.twist_deg, parameter=self.parameter), (self.reason,)


class ModelError(GtcadError, ValueError):
    """A model file is wrong.

    Parameters
    ----------
    path
        The file, as the caller named it.
    problems
        One line for each problem found: where it stands (shape, field), what was given, what is allowed.
    """

    def __init__(self, path: str, problems: Sequence[str]) -> None:
        self.path = path
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{path}: {problem}" for problem in self.problems))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.path, self.problems)


class FileError(GtcadError, OSError):
    """A file is missing, unreadable, or not what its name says.

    Parameters
    ----------
    path
        The file, as the caller named it.
    reason
        What is wrong with it.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(f"{path}: {reason}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.path, self.reason)


class ToleranceNotMet(GtcadError, ArithmeticError):
    """No spline within the limits keeps the tolerance.

    Parameters
    ----------
    requested
        The tolerance that was asked for.
    achieved
        The least proved deviation that was reached.
    spans
        The number of spans (curve) or of rectangles (surface) it was reached with.
    limit
        What stood in the way, for the message.
    """

    def __init__(self, requested: float, achieved: float, spans: int, limit: str) -> None:
        self.requested = requested
        self.achieved = achieved
        self.spans = spans
        self.limit = limit
        super().__init__(f"tolerance {requested:.3g} not met: {achieved:.3g} proved with {spans} spans; {limit}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.requested, self.achieved, self.spans, self.limit)


class ToleranceBelowPrecision(GtcadError, ValueError):
    """The tolerance is finer than double precision allows for coordinates of this size.

    Parameters
    ----------
    requested
        The tolerance that was asked for.
    floor
        The least tolerance that can be proved for this piece.
    """

    def __init__(self, requested: float, floor: float) -> None:
        self.requested = requested
        self.floor = floor
        super().__init__(
            f"tolerance {requested:.3g} is below {floor:.3g}, the least that double precision allows for this piece"
        )

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.requested, self.floor)


class KernelError(GtcadError, RuntimeError):
    """The CAD kernel refused or broke something that was valid on our side."""


class KernelMissing(GtcadError, ImportError):
    """No usable CAD kernel is installed; the message says how to get one."""


class ExtraMissing(GtcadError, ImportError):
    """A package that only some users need is not installed; the message says how to get it."""


class SingularJoin(GtcadError, ArithmeticError):
    """A join does not determine the control points, or so badly that no digit is left.

    Parameters
    ----------
    reason
        Which degree, design variable and order, or which end.
    conditioning
        Size of the coefficient that should have fixed the point, relative to the others of its row.
    """

    def __init__(self, reason: str, conditioning: float) -> None:
        self.reason = reason
        self.conditioning = conditioning
        super().__init__(reason)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.reason, self.conditioning)


class SingularDevelopable(InputError):
    """A developable patch is singular: it has no tangent plane somewhere, or none of its rulings ends there.

    Parameters
    ----------
    reason
        What happens there.
    t
        The first parameter where it does.
    """

    def __init__(self, reason: str, t: float) -> None:
        self.reason = reason
        self.t = t
        super().__init__(f"{reason} at t = {t:.12g}")

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.reason, self.t)


class NoFeasibleDesign(GtcadError, ArithmeticError):
    """No design that an optimisation looked at keeps its limits.

    Parameters
    ----------
    objective
        What was to be made small.
    designs
        How many designs were looked at.
    excess
        How far the best of them is beyond the limits; infinite when there was no such shape at all.
    """

    def __init__(self, objective: str, designs: int, excess: float) -> None:
        self.objective = objective
        self.designs = designs
        self.excess = excess
        super().__init__(
            f"none of {designs} designs keeps the constraints while {objective} is made least: "
            f"the best is {excess:.3g} beyond them"
        )

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.objective, self.designs, self.excess)
