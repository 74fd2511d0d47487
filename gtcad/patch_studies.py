"""What the design variables do to a patch: areas, volumes and curvatures over a grid of them, and their rates.

With D = dS/dg, the surface ``gtcad.design_variables.design_rate``, the rates of area A and volume V are integrals:

    X = S_u x S_v,   X' = D_u x S_v + S_u x D_v,
    dA/dg = int X . X' / |X| du dv,
    dV/dg = 1/3 int D . X + (S - origin) . X' du dv.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad.basis import Gamma
from gtcad.design_variables import STENCIL, design_rate, design_variables, weighted_sum, with_design_variables
from gtcad.differential import principal_curvatures
from gtcad.errors import InputError
from gtcad.measure import Estimate, area, over_square, volume
from gtcad.patches._patch import checked_vector
from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]
Pair = tuple[float, float]

_RTOL = 1e-9
_SAMPLES = 65  # in each direction, then windows around the best: 9 x 9 samples, each a quarter as wide
_WINDOWS = 9
_LEAST_AREA = (1e-4, 1e-3)  # of the largest |S_u x S_v|: curvatures are looked at where it is larger
_GROWTH = 1.5  # between both: curvatures that grow more have a pole
_SMALL = 1e-3  # of the largest curvature: no pole
_FLAT = 1e-9  # over the diagonal: a curvature that is rounding
_CANCELLED = 1e-13  # of the factors of a product: what is left is rounding
_STEP = 1e-3  # in a design variable: of differences of curvatures
_SIGNS = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])  # smallest and largest by turns
_FIGURES = ("area", "volume") + tuple(
    f"{which} {kind} curvature" for kind in ("Gaussian", "mean", "principal") for which in ("smallest", "largest")
)


# --- curvatures -------------------------------------------------------------------------------------------------------


class Curvatures(NamedTuple):
    """Smallest and largest curvatures of a patch, or what belongs to each.

    Attributes
    ----------
    gaussian
        In the inverse square of the unit.
    mean, principal
        In the inverse of the unit, positive where the patch bends towards its normal.
    """

    gaussian: Pair
    mean: Pair
    principal: Pair

    @classmethod
    def _of(cls, values: Array) -> Curvatures:
        a, b, c, d, e, f = (values + 0.0).tolist()
        return cls((a, b), (c, d), (e, f))


def curvature_range(surface: SeparableSurface) -> Curvatures:
    """Smallest and largest Gaussian, mean and principal curvatures, estimated.

    Parameters
    ----------
    surface
        Any surface; a plane one lies at z = 0.

    Returns
    -------
    Curvatures
        Of 65 x 65 samples and of finer ones around the best of these, where |S_u x S_v| is above 1e-4 of its largest
        value. Infinite where that seems to be a pole; NaN when there is no surface at all.

    Examples
    --------
    The hyperbolic paraboloid z = x y over [-1, 1]^2: K = -1 in the middle and -1/9 at the corners.

    >>> from gtcad import BERNSTEIN, Surface
    >>> saddle = [[[-1, -1, 1], [-1, 1, -1]], [[1, -1, -1], [1, 1, 1]]]
    >>> found = curvature_range(Surface(saddle, family_u=BERNSTEIN, family_v=BERNSTEIN))
    >>> [round(float(value), 9) for value in found.gaussian]
    [-1.0, -0.111111111]
    """
    return Curvatures._of(_extremes(_in_space(surface))[0])


def _in_space(surface: SeparableSurface) -> SeparableSurface:
    return surface if surface.dimension == 3 else surface.transformed(np.eye(3, 2))


def _signed(surface: SeparableSurface, u: Array, v: Array) -> Array:
    """-K, K, -H, H, -k2, k1, of which the largest are looked for: shape (6, ...)."""
    k1, k2 = np.moveaxis(principal_curvatures(surface, u, v), -1, 0)
    gaussian, mean = k1 * k2, (k1 + k2) / 2
    return np.stack([-gaussian, gaussian, -mean, mean, -k2, k1])


def _crossed(surface: SeparableSurface, u: Array, v: Array) -> Array:
    return np.cross(surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1)))


def _extremes(surface: SeparableSurface) -> tuple[Array, Array]:
    """The six extremes, shape (6,), and where they are, shape (2, 6)."""
    t = np.linspace(0, 1, _SAMPLES)
    u, v = t[:, None], t[None, :]
    sizes = norm(_crossed(surface, u, v))
    values = _signed(surface, u, v)
    least, more = (part * float(sizes.max()) for part in _LEAST_AREA)
    near = _refined(surface, values, sizes, least)
    if sizes.min() > more:
        return _SIGNS * near[0], near[1]
    far = _refined(surface, values, sizes, more)
    points = surface.evaluate(u, v)
    flat = _FLAT / max(float(norm(np.ptp(points, axis=(0, 1)))), np.finfo(float).tiny)
    most = max(float(far[0][4:].max()), flat)
    pole = near[0] > _GROWTH * np.maximum(far[0], _SMALL * most ** np.array([2, 2, 1, 1, 1, 1]))
    return _SIGNS * np.where(pole, np.inf, near[0]), near[1]


def _refined(surface: SeparableSurface, values: Array, sizes: Array, least: float) -> tuple[Array, Array]:
    """The largest of each row of samples and of finer ones around it, where |S_u x S_v| is more than that."""
    rows = np.arange(6)
    u, v = np.meshgrid(*[np.linspace(0, 1, _SAMPLES)] * 2, indexing="ij")
    places = np.tile(np.stack([u.ravel(), v.ravel()])[:, None], (1, 6, 1))
    values, sizes = values.reshape(6, -1), np.tile(sizes.ravel(), (6, 1))
    window = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 2)).reshape(2, 1, -1)
    best, found = np.full(6, -np.inf), np.zeros((2, 6))
    for k in range(_WINDOWS + 1):
        if k:
            places = np.clip(found[..., None] + window / ((_SAMPLES - 1) * 4 ** (k - 1)), 0, 1)
            values, sizes = _signed(surface, *places)[rows, rows], norm(_crossed(surface, *places))
        allowed = np.where(np.isfinite(values) & (sizes > least), values, -np.inf)
        first = allowed.argmax(axis=1)
        better = allowed[rows, first] > best
        best = np.where(better, allowed[rows, first], best)
        found = np.where(better, places[:, rows, first], found)
    return np.where(np.isfinite(best), best, np.nan), found


# --- studies ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PatchVariant:
    """A patch of a study and its figures.

    Attributes
    ----------
    patch
        The patch of the study with other design variables.
    area
        In the square of the unit.
    volume
        Signed, of the cone over the patch from the origin, as ``gtcad.measure.volume`` has it; 0 for a plane patch.
    curvatures
        As of ``curvature_range``: estimated.
    """

    patch: SeparableSurface
    area: Estimate
    volume: Estimate
    curvatures: Curvatures


@dataclass(frozen=True)
class PatchStudy:
    """Patches that differ by one or two design variables alone.

    Attributes
    ----------
    axes
        What varies: "profile[0]" a single variable, "profile" both of a pair alike.
    values
        Of each axis.
    variants
        One for each combination, the last axis running first.
    """

    axes: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]
    variants: tuple[PatchVariant, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """What the numbers of ``rows`` are."""
        return self.axes + _FIGURES

    def rows(self) -> list[tuple[float, ...]]:
        """A table: for each patch the numbers of ``columns``."""
        combinations = itertools.product(*self.values)
        return [
            (*values, v.area.value, v.volume.value, *itertools.chain(*v.curvatures))
            for values, v in zip(combinations, self.variants, strict=True)
        ]


def patch_study(
    patch: SeparableSurface,
    variables: str | Sequence[str] | None = None,
    *,
    values: Sequence[float] = (-1.0, 0.0, 1.0),
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> PatchStudy:
    """What design variables do to a patch: all combinations of the values, with the same control points.

    Parameters
    ----------
    patch
        Any surface of the protocol that has design variables. Those that are not varied stay.
    variables
        One or two of "profile[0]", a single one, or "profile", both of the pair alike, with names of
        ``design_variables``. One name alone, not in a sequence, stands for its two variables; by default that is the
        first name.
    values
        In [-1, 1], one or more, for each of them.
    origin
        Of the volumes.

    Raises
    ------
    InputError
        When an argument is out of its range, or the kind has no patch with some of the values.

    Examples
    --------
    gamma = (0, 0) makes this a quarter of a tube of radius 1 and length 2: area pi.

    >>> from gtcad import Curve
    >>> from gtcad.patches import Swept
    >>> tube = Swept(Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]]), Curve([[0, 0, 0], [0, 0, 1], [0, 0, 2]]))
    >>> study = patch_study(tube, "profile", values=[0])
    >>> study.columns[:4], [round(value, 9) for value in study.rows()[0][:4]]
    (('profile[0]', 'profile[1]', 'area', 'volume'), [0.0, 0.0, 3.141592654, 1.047197551])
    """
    axes = _axes(patch, variables)
    numbers = _checked_values(values)
    variants = []
    for chosen in itertools.product(numbers, repeat=len(axes)):
        try:
            variant = _set(patch, dict(zip(axes, chosen, strict=True)))
        except InputError as error:
            where = ", ".join(f"{axis} = {value:g}" for axis, value in zip(axes, chosen, strict=True))
            raise InputError(f"{where}: {error}") from None
        variants.append(_measured(variant, origin))
    return PatchStudy(axes, (numbers,) * len(axes), tuple(variants))


def _checked_values(values: ArrayLike) -> tuple[float, ...]:
    try:
        numbers = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.ndim != 1 or not numbers.size:
        raise InputError(f"values must be one number or more, got {values!r}")
    return tuple(numbers.tolist())


def _axes(patch: SeparableSurface, variables: str | Sequence[str] | None) -> tuple[str, ...]:
    names = tuple(design_variables(patch))
    if not names:
        raise InputError("the patch has no design variables: there is nothing to study")
    allowed = [axis for name in names for axis in (name, f"{name}[0]", f"{name}[1]")]
    chosen = names[0] if variables is None else variables
    if isinstance(chosen, str):
        chosen = (f"{chosen}[0]", f"{chosen}[1]") if chosen in names else (chosen,)
    chosen = tuple(chosen) if isinstance(chosen, Sequence) else (chosen,)
    if not set(chosen) <= set(allowed) or len(chosen) not in (1, 2):
        raise InputError(f"variables must be one or two of {', '.join(allowed)}, got {variables!r}")
    if len(chosen) == 2 and (chosen[0] in _singles(chosen[1]) or chosen[1] in _singles(chosen[0])):
        raise InputError(f"variables must be different ones, got {' and '.join(chosen)}")
    return chosen


def _singles(axis: str) -> tuple[str, ...]:
    return (axis, f"{axis}[0]", f"{axis}[1]")


def _set(patch: SeparableSurface, chosen: Mapping[str, float]) -> SeparableSurface:
    """The patch with these values on the axes."""
    changes: dict[str, Gamma] = {}
    for name, gamma in design_variables(patch).items():
        both = chosen.get(name)
        pair = [chosen.get(f"{name}[{k}]", g) if both is None else both for k, g in enumerate(gamma)]
        changes[name] = (pair[0], pair[1])
    return with_design_variables(patch, changes)


def _measured(patch: SeparableSurface, origin: ArrayLike) -> PatchVariant:
    shape = _in_space(patch)
    center = checked_vector("origin", origin)
    return PatchVariant(
        patch, area(shape, rtol=_RTOL), volume(shape, origin=center, rtol=_RTOL), Curvatures._of(_extremes(shape)[0])
    )


# --- rates ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sensitivity:
    """The rates of a patch's figures by one design variable.

    Attributes
    ----------
    variable, value
        Which, such as "profile[0]", and its value.
    area, volume
        dA/dg and dV/dg.
    curvatures
        Rates of the smallest and largest curvatures, estimated: NaN where these are not finite. Where several places
        share one, it has no one rate, and this is that of the first of them.
    """

    variable: str
    value: float
    area: Estimate
    volume: Estimate
    curvatures: Curvatures


@dataclass(frozen=True)
class Sensitivities:
    """The rates of a patch's figures by each of its design variables.

    Attributes
    ----------
    entries
        One for each single variable.
    """

    entries: tuple[Sensitivity, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """What ``rows`` hold: a variable, its value, and the derivatives of figures by it."""
        return ("variable", "value", *(f"rate of {figure}" for figure in _FIGURES))

    def rows(self) -> list[tuple[str | float, ...]]:
        """A table: for each variable what ``columns`` say."""
        return [
            (e.variable, e.value, e.area.value, e.volume.value, *itertools.chain(*e.curvatures)) for e in self.entries
        ]


def sensitivities(patch: SeparableSurface, *, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Sensitivities:
    """How fast area, volume and curvatures of a patch change with each of its design variables.

    Parameters
    ----------
    patch
        Any surface of the protocol that has design variables.
    origin
        Of the volume.

    Raises
    ------
    InputError
        When the patch has no design variables, or the origin is no point.

    Notes
    -----
    Rates of area and volume are integrals of ``design_rate``, with an estimate of the error of the quadrature; those of
    curvatures are differences of the fourth order along ``design_rate`` at the places that ``curvature_range`` finds.
    At the ends of [-1, 1] they are those of the affine continuation.

    Examples
    --------
    Control points in a plane give a plane patch: with the boundaries straight its area stays.

    >>> from gtcad import Surface
    >>> sheet = Surface([[[x, y, 0] for y in (0, 1, 2)] for x in (0, 1, 3)])
    >>> [round(entry.area, 9) + 0.0 for entry in sensitivities(sheet).entries]
    [0.0, 0.0, 0.0, 0.0]
    """
    found = design_variables(patch)
    if not found:
        raise InputError("the patch has no design variables: there are no rates")
    center, shape = np.array(checked_vector("origin", origin)), _in_space(patch)
    extremes = _extremes(shape)
    entries = []
    for name, gamma in found.items():
        for index, value in enumerate(gamma):
            variable = f"{name}[{index}]"
            rate = _in_space(design_rate(patch, variable))
            moved = _area_rate(shape, rate), _volume_rate(shape, rate, center)
            entries.append(Sensitivity(variable, value, *moved, _curvature_rates(shape, rate, extremes)))
    return Sensitivities(tuple(entries))


def _crossed_rate(surface: SeparableSurface, rate: SeparableSurface, u: Array, v: Array) -> tuple[Array, Array, float]:
    """X, X', and the largest of the products that X' is the sum of, where the rate is as large as the surface."""
    s_u, s_v = (surface.derivative(u, v, order) for order in ((1, 0), (0, 1)))
    d_u, d_v = (rate.derivative(u, v, order) for order in ((1, 0), (0, 1)))
    size = (norm(d_u) + norm(s_u)) * norm(s_v) + norm(s_u) * (norm(d_v) + norm(s_v))
    return np.cross(s_u, s_v), np.cross(d_u, s_v) + np.cross(s_u, d_v), float(size.max())


def _area_rate(surface: SeparableSurface, rate: SeparableSurface) -> Estimate:
    def integrand(u: Array, v: Array) -> Array:
        crossed, change, size = _crossed_rate(surface, rate, u, v)
        lengths = norm(crossed)[..., None]
        unit = np.where(lengths > 0, crossed / lengths, 0.0)
        return _without_rounding(np.einsum("uvd,uvd->uv", unit, change), size)

    return over_square(integrand, _RTOL)


def _volume_rate(surface: SeparableSurface, rate: SeparableSurface, center: Array) -> Estimate:
    def integrand(u: Array, v: Array) -> Array:
        crossed, change, size = _crossed_rate(surface, rate, u, v)
        points, moves = surface.evaluate(u, v) - center, rate.evaluate(u, v)
        total = np.einsum("uvd,uvd->uv", moves, crossed) + np.einsum("uvd,uvd->uv", points, change)
        return _without_rounding(total, size * float((norm(points) + norm(moves)).max())) / 3

    return over_square(integrand, _RTOL)


def _without_rounding(values: Array, size: float) -> Array:
    """0 where all has cancelled: the quadrature would go on to resolve what is left."""
    return np.where(np.abs(values) > _CANCELLED * size, values, 0.0)


def _curvature_rates(surface: SeparableSurface, rate: SeparableSurface, extremes: tuple[Array, Array]) -> Curvatures:
    values, (u, v) = extremes
    moved = [(weight / _STEP, weighted_sum((1.0, surface), (k * _STEP, rate))) for k, weight in STENCIL]
    rates = sum(weight * np.diagonal(_signed(one, u, v)) for weight, one in moved)
    return Curvatures._of(np.where(np.isfinite(values), _SIGNS * rates, np.nan))
