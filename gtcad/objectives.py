"""What the shape of a curve or patch may be judged by: integrals over it, for one design or for many at once.

Of curves, of the dual curves of developables (their tangent planes (n, d), four numbers; prefix ``dual-``), of their
spine curves (edges of regression; prefix ``spine-``) and of the given geodesic (prefix ``geodesic-``):

    dirichlet             1/2 int |C'|^2 dt
    length                int |C'| dt
    energy                int |C''|^2 dt
    variation             int |C'''|^2 dt
    curvature-energy      int kappa^2 ds
    curvature-variation   int (d kappa / ds)^2 ds

Of patches, the last two of those that are straight in v, with boundaries a, b and r = b - a:

    dirichlet             1/2 int |S_u|^2 + |S_v|^2 du dv
    area                  int |S_u x S_v| du dv
    bending               int |S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2 du dv
    quasi-harmonic        int |S_uu + S_vv|^2 du dv
    developability        int (det(a', b', r) / (|a'| |b'| |r|))^2 du
    twist                 int (angle between the normals at both ends of a ruling)^2 du, in radians

kappa and its rate are those of a curve in a space of any dimension, so they hold for dual curves too. The numbers of a
dual curve mix directions and lengths, and change with the scale of the planes: they are of use for comparing designs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._design_space import AffineSamples, DesignSpace, Numbers, Sampler
from gtcad._extremal_space import ExtremalSpace
from gtcad._integrands import CURVE, PATCH, STRIP, Integrand, regression_jets
from gtcad.chebyshev import gauss_legendre
from gtcad.errors import GtcadError, InputError
from gtcad.measure import Estimate
from gtcad.patches.developable import (
    Developable,
    Enveloping,
    GeodesicDevelopable,
    PlaneFamily,
    QuasiDevelopable,
    SpineDevelopable,
)
from gtcad.protocol import SeparableCurve, SeparableSurface

Array = NDArray[np.float64]
Function = Callable[[Any], float]

NODES = {"curve": 64, "strip": 64, "patch": 24}  # of the first rule in each direction
_MOST_DOUBLINGS = 4
_SETTLED = 1e-9  # relative: what doubling the nodes may change
_ROUNDING = 1e-14
_STEP = 1e-30
PREFIXES = ("dual", "spine", "geodesic")
KNOWN: tuple[str, ...] = tuple(
    dict.fromkeys((*CURVE, *PATCH, *STRIP, *(f"{prefix}-{name}" for prefix in PREFIXES for name in CURVE)))
)
"""The names of all objectives."""

_STRAIGHT = 1e-9  # of the size: how far a ruling's middle may be from its ends' mean
_FIRST, _SECOND = ((1, 0), (0, 1)), ((2, 0), (1, 1), (0, 2))


@dataclass(frozen=True)
class Evaluator:
    """An objective over a space of designs, with a fixed rule.

    Attributes
    ----------
    values
        From designs, shape (count, d), to values, shape (count,); infinite where there is no such shape.
    gradient
        From a design to the exact gradient, or None.
    quick
        Whether thousands of values cost next to nothing.
    """

    values: Callable[[Array], Array]
    gradient: Callable[[Array], Array] | None
    quick: bool


@dataclass(frozen=True)
class _Subject:
    """What an integrand is applied to."""

    space: DesignSpace
    columns: tuple[int, ...]  # of a design: the variables that it depends on
    kind: str
    regression: bool = False


def objectives_of(shape: Any) -> tuple[str, ...]:
    """The names of the objectives that fit a shape.

    Examples
    --------
    >>> from gtcad import Curve
    >>> objectives_of(Curve([[0, 0], [1, 1], [2, 0]]))
    ('dirichlet', 'length', 'energy', 'variation', 'curvature-energy', 'curvature-variation')
    """
    if isinstance(shape, SeparableCurve):
        return tuple(CURVE)
    if isinstance(shape, PlaneFamily):
        return (*CURVE, *(f"spine-{name}" for name in CURVE))
    if not isinstance(shape, SeparableSurface):
        return ()
    names = tuple(PATCH) + (tuple(STRIP) if _is_straight(shape) else ())
    return names + tuple(f"{prefix}-{name}" for prefix in _carriers(shape) for name in CURVE)


def limited(shape: Any) -> bool:
    """Whether some objectives are looked at without making the patch, which there may not be."""
    return isinstance(shape, Developable) or (isinstance(shape, QuasiDevelopable) and shape.max_twist_deg is not None)


def carrier_of(shape: Any, objective: str) -> str | None:
    """The field of a developable that an objective of its dual curve, spine or geodesic looks at; None for others."""
    return _carriers(shape).get(objective.partition("-")[0]) if isinstance(shape, SeparableSurface) else None


def _is_straight(shape: SeparableSurface) -> bool:
    points = shape.evaluate(np.linspace(0, 1, 17)[:, None], np.array([[0.0, 0.25, 0.5, 1.0]]))
    first, quarter, middle, last = np.moveaxis(points, 1, 0)
    size = float(np.ptp(points.reshape(-1, shape.dimension), axis=0).max())
    off = np.stack([middle - (first + last) / 2, quarter - (3 * first + last) / 4])
    return shape.dimension == 3 and bool(np.abs(off).max() <= _STRAIGHT * size)


def _carriers(shape: SeparableSurface) -> dict[str, str]:
    """Of developables: the field that holds the curve of each prefix; planes have a dual and a spine curve."""
    if isinstance(shape, GeodesicDevelopable):
        return {"geodesic": "curve"}
    field = "family" if isinstance(shape, Enveloping) else "spine" if isinstance(shape, SpineDevelopable) else None
    if field is None:
        return {}
    return {"dual": field, "spine": field} if isinstance(getattr(shape, field), PlaneFamily) else {"spine": field}


def checked_objective(shape: Any, objective: str) -> str:
    """The name of an objective that fits a shape.

    Raises
    ------
    InputError
        When there is none of that name, or it is of no use for such a shape.
    """
    fitting = objectives_of(shape)
    if objective in fitting:
        return objective
    if not fitting:
        raise InputError(f"shape must be a curve, a patch or a family of planes, got {type(shape).__name__}")
    allowed = f"must be one of {', '.join(fitting)} for {type(shape).__name__}, got {objective!r}"
    if objective in KNOWN:
        raise InputError(f"objective {allowed}: that one does not fit the kind of the shape")
    raise InputError(f"objective {allowed}")


def measured(shape: Any, objective: str) -> Estimate:
    """The value of an objective for one shape, its error estimated by doubling the nodes of the quadrature.

    Parameters
    ----------
    shape
        A curve, a patch, or a family of planes.
    objective
        A name of ``objectives_of(shape)``.

    Raises
    ------
    InputError
        When the objective does not fit the shape.

    Examples
    --------
    The curvature of a circle does not vary, that of a quarter of radius 2 bends by pi / (2 r):

    >>> from gtcad import Curve
    >>> quarter = Curve([[2, 0], [2, 2], [0, 2]])
    >>> round(measured(quarter, "curvature-energy"), 12), round(measured(quarter, "curvature-variation"), 12)
    (0.785398163397, 0.0)
    """
    subject = _subject(DesignSpace(shape, ()), objective)
    return settled(lambda factor: float(_fixed(subject, objective, factor)))


def settled(value: Callable[[int], float]) -> Estimate:
    """A value by a rule of f times as many nodes, f doubled until it changes no more; the error is the last change."""
    last = value(1)
    error = math.inf
    for doubling in range(1, _MOST_DOUBLINGS + 1):
        found = value(2**doubling)
        error, last = abs(found - last), found
        if error <= _SETTLED * abs(found):
            break
    return Estimate(last, error + _ROUNDING * abs(last) if math.isfinite(last) else math.inf)


def _fixed(subject: _Subject, objective: str, factor: int) -> float:
    sample, weights, integrand = _rule(subject, objective, factor)
    return float(np.real(_integrated(sample(subject.space.shape)[None], weights, integrand)[0]))


def values_of(shape: Any, objective: str, designs: ArrayLike, *, variables: str | Sequence[str] | None = None) -> Array:
    """The values of an objective for many designs of one shape.

    Parameters
    ----------
    shape
        A curve, a patch, or a family of planes.
    objective
        A name of ``objectives_of(shape)``.
    designs
        Design variables, shape (count, d), in the order of the variables.
    variables
        Those that vary; all by default.

    Returns
    -------
    Array
        Shape (count,); infinite where there is no such shape.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    The chord is the shortest of all curves with one polygon:

    >>> from gtcad import Curve
    >>> values_of(Curve([[0, 0], [1, 1], [2, 0]]), "length", [[-1, -1], [0, 0]]).round(6).tolist()
    [2.0, 2.221441]
    """
    space = DesignSpace.of(shape, variables)
    rows = np.asarray(designs, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != space.dimension or not (np.abs(rows) <= 1).all():
        raise InputError(f"designs must be numbers in [-1, 1] of shape (count, {space.dimension}), got {designs!r}")
    return evaluator(space, objective).values(rows)


def evaluator(space: DesignSpace, objective: str, factor: int = 1) -> Evaluator:
    """An objective as a function of designs, with a rule of so many times the usual nodes.

    Raises
    ------
    InputError
        When the objective does not fit the shape.
    """
    subject = _subject(space, objective)
    if isinstance(space, ExtremalSpace) and objective == space.energy:
        return Evaluator(*space.energies(), quick=True)
    sample, weights, integrand = _rule(subject, objective, factor)
    affine = None if isinstance(space, ExtremalSpace) else AffineSamples.of(subject.space, sample)
    if affine is None:
        return Evaluator(lambda designs: _one_by_one(subject, designs, sample, weights, integrand), None, False)
    quadratic = integrand.form is not None and not subject.regression
    if quadratic:
        function = _quadratic(affine, weights, integrand)
    else:
        found: AffineSamples = affine

        def function(designs: Numbers) -> Numbers:
            return found.each_block(designs, lambda jets: _integrated(jets, weights, integrand))

    columns = list(subject.columns)

    def values(designs: Array) -> Array:
        return np.asarray(function(designs[:, columns]))

    def gradient(design: Array) -> Array:
        moved = design[columns] + 1j * _STEP * np.eye(len(columns))
        result = np.zeros(len(design))
        result[columns] = function(moved).imag / _STEP
        return result

    return Evaluator(values, gradient, quadratic or subject.kind != "patch")


def _quadratic(affine: AffineSamples, weights: Array, integrand: Integrand) -> Callable[[Numbers], Numbers]:
    """The integral of a sum of products: a quadratic form in the products of the design variables."""
    table = np.moveaxis(affine.samples, 1, 0)  # (derivatives, count, nodes, d)
    assert integrand.form is not None
    flat = table.reshape(*table.shape[:2], weights.size, -1)
    form = sum(
        factor * np.einsum("knd,lnd,n->kl", flat[i], flat[k], weights.ravel(), optimize=True)
        for factor, i, k in integrand.form
    )

    def values(designs: Numbers) -> Numbers:
        products = affine.weights(designs)
        return np.asarray(((products @ form) * products).sum(axis=1))

    return values


def _integrated(jets: Numbers, weights: Array, integrand: Integrand) -> Numbers:
    """Integrals of derivatives of shape (designs, derivatives, *nodes, d)."""
    with np.errstate(all="ignore"):
        values = integrand.values(np.moveaxis(jets, 1, 0))
        return np.asarray((values * weights).reshape(len(jets), -1).sum(axis=1))


def _one_by_one(subject: _Subject, designs: Array, sample: Sampler, weights: Array, integrand: Integrand) -> Array:
    result = np.full(len(designs), math.inf)
    for index, design in enumerate(designs[:, list(subject.columns)]):
        try:
            result[index] = _integrated(sample(subject.space.shape_at(design))[None], weights, integrand)[0]
        except GtcadError:  # the kind has no shape with these values
            continue
    return result


# --- what is sampled, and where ---------------------------------------------------------------------------------------


def _subject(space: DesignSpace, objective: str) -> _Subject:
    name = checked_objective(space.shape, objective)
    columns = tuple(range(space.dimension))
    if (field := carrier_of(space.shape, name)) is not None:
        carrier = getattr(space.shape, field)
        columns = tuple(k for k, (pair, _) in enumerate(space.singles) if pair == field)
        own = DesignSpace(carrier, tuple(("gamma", space.singles[k][1]) for k in columns))
        return _Subject(own, columns, "curve", isinstance(carrier, PlaneFamily) and name.startswith("spine-"))
    if isinstance(space.shape, QuasiDevelopable) and space.shape.max_twist_deg is not None:
        space = DesignSpace(replace(space.shape, max_twist_deg=None), space.singles)
    if isinstance(space.shape, SeparableSurface):
        return _Subject(space, columns, "patch" if name in PATCH else "strip")
    return _Subject(space, columns, "curve", name.startswith("spine-"))


def _rule(subject: _Subject, objective: str, factor: int) -> tuple[Sampler, Array, Integrand]:
    """How to sample derivatives, the weights of the nodes, and what is integrated."""
    x, w = gauss_legendre(NODES[subject.kind] * factor)
    t, weights = (x + 1) / 2, w / 2
    if subject.kind == "patch":
        integrand = PATCH[objective]
        orders = _FIRST + (_SECOND if integrand.highest == 2 else ())
        return _patch_sampler(t, orders), weights[:, None] * weights, integrand
    if subject.kind == "strip":
        return _strip_sampler(t), weights, STRIP[objective]
    prefix, _, rest = objective.partition("-")
    integrand = CURVE[rest if prefix in PREFIXES else objective]
    if not subject.regression:
        return _curve_sampler(t, range(1, integrand.highest + 1)), weights, integrand

    def along_edge(planes: Numbers) -> Numbers:
        return integrand.values(regression_jets(planes, integrand.highest))

    edge = Integrand(integrand.formula, integrand.highest + 2, along_edge)
    return _curve_sampler(t, range(integrand.highest + 3)), weights, edge


def _curve_sampler(t: Array, orders: Sequence[int]) -> Sampler:
    return lambda curve: np.stack([curve.derivative(t, order) for order in orders])


def _patch_sampler(t: Array, orders: Sequence[tuple[int, int]]) -> Sampler:
    return lambda patch: np.stack([patch.derivative(t[:, None], t[None, :], order) for order in orders])


def _strip_sampler(t: Array) -> Sampler:
    ends = np.array([[0.0, 1.0]])

    def sample(patch: SeparableSurface) -> Array:
        first, last = np.moveaxis(patch.evaluate(t[:, None], ends), 1, 0)
        slopes = np.moveaxis(patch.derivative(t[:, None], ends, (1, 0)), 1, 0)
        return np.stack([*slopes, last - first])

    return sample
