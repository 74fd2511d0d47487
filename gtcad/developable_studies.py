"""What the design variables do to a developable: the same control planes and bounds, side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from numpy.typing import ArrayLike

from gtcad.errors import SingularDevelopable
from gtcad.measure import area, length
from gtcad.patches._moving_frames import Unresolved
from gtcad.patches.developable import Enveloping, PlaneFamily, developability
from gtcad.protocol import SeparableCurve


@dataclass(frozen=True)
class GammaEffect:
    """The patch for one pair of design variables.

    Attributes
    ----------
    gamma
        The design variables.
    patch
        The patch, or None where it is refused.
    refused
        Why it is, or "".
    area, lengths
        Of the patch and of its boundaries a and b, in the model's unit; NaN where it is refused.
    regression_distance
        How far beyond the patch its edge of regression is where it comes nearest (see ``developability``).
    """

    gamma: tuple[float, float]
    patch: Enveloping | None
    refused: str
    area: float
    lengths: tuple[float, float]
    regression_distance: float


def gamma_effects(
    planes: PlaneFamily,
    bound_a: ArrayLike | SeparableCurve,
    bound_b: ArrayLike | SeparableCurve,
    gammas: Iterable[tuple[float, float]],
) -> tuple[GammaEffect, ...]:
    """Envelop the same control planes between the same bounds with other design variables.

    Parameters
    ----------
    planes
        The control planes; its own design variables do not matter.
    bound_a, bound_b
        As of ``PlaneFamily.enveloping``.
    gammas
        Pairs of design variables, each in [-1, 1].

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    First and last plane stay, so larger design variables draw the patch towards the planes between:

    >>> planes = PlaneFamily([[1, 0, 0, 20], [1, 1, 0, 24], [0, 1, 0, 20]])
    >>> effects = gamma_effects(planes, [0, 0, 1, 0], [0, 0, 1, 10], [(-0.5, -0.5), (0, 0), (0.5, 0.5)])
    >>> [round(effect.area, 2) for effect in effects]
    [276.46, 251.33, 236.62]
    """
    return tuple(_effect(planes.with_gamma(gamma), bound_a, bound_b) for gamma in gammas)


def _effect(
    planes: PlaneFamily, bound_a: ArrayLike | SeparableCurve, bound_b: ArrayLike | SeparableCurve
) -> GammaEffect:
    try:
        patch = planes.enveloping(bound_a, bound_b)
    except (SingularDevelopable, Unresolved) as error:
        nan = float("nan")
        return GammaEffect(planes.gamma, None, str(error), nan, (nan, nan), nan)
    lengths = float(length(patch.a)), float(length(patch.b))
    beyond = developability(patch).regression_distance
    return GammaEffect(planes.gamma, patch, "", float(area(patch)), lengths, beyond)
