"""Centres of gravity of surfaces and of the bodies that they close, with an estimate of the error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gtcad.differential import ParametricSurface
from gtcad.errors import InputError
from gtcad.measure import Estimate, area, domain_of, over_domain, volume

Array = NDArray[np.float64]


class Centroid(NamedTuple):
    """A centre of gravity.

    Attributes
    ----------
    point
        Shape (3,), in the model's unit.
    error
        Estimated distance from the true one, in the same unit.
    """

    point: Array
    error: float


def area_centroid(surfaces: ParametricSurface | Iterable[ParametricSurface], *, rtol: float = 1e-10) -> Centroid:
    """Centre of gravity of thin surfaces: ``int S dA / int dA``.

    Parameters
    ----------
    surfaces
        One surface in space or more; where one folds back the parts count twice.
    rtol
        Wanted error relative to the size, from 1e-14.

    Raises
    ------
    InputError
        When a surface is not in space, there is none, or they have no area.

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Surface
    >>> square = Surface([[[0, 0, 3], [0, 2, 3]], [[4, 0, 3], [4, 2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> area_centroid(square).point.round(12).tolist()
    [2.0, 1.0, 3.0]
    """
    every = _in_space(surfaces)
    base, size = _box(every)
    areas = [area(surface, rtol=rtol) for surface in every]

    def moment(surface: ParametricSurface, axis: int) -> Estimate:
        def integrand(u: Array, v: Array) -> Array:
            offset = surface.derivative(u, v, (0, 0))[..., axis] - base[axis]
            return np.asarray((size + offset) * np.linalg.norm(_crossed(surface, u, v), axis=-1))

        return over_domain(surface, integrand, rtol)

    return _divided(every, moment, _total(areas), base, [size * own for own in areas])


def volume_centroid(surfaces: ParametricSurface | Iterable[ParametricSurface], *, rtol: float = 1e-10) -> Centroid:
    """Centre of gravity of the body inside closed surfaces, by the divergence theorem: ``int x^2 / 2 dA / V``.

    Parameters
    ----------
    surfaces
        One surface, or those that close a body together, with normals that all point outwards, or all inwards.
    rtol
        Wanted error relative to the size, from 1e-14.

    Raises
    ------
    InputError
        When a surface is not in space, there is none, or they enclose no volume.

    Examples
    --------
    A pyramid has it at a quarter of its height. Its sides are cones over the edges of the base:

    >>> from gtcad import BERNSTEIN, Curve
    >>> from gtcad.patches import Ruled, cone
    >>> corners = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    >>> edges = [Curve([a, b], family=BERNSTEIN) for a, b in zip(corners, corners[1:] + corners[:1])]
    >>> base = Ruled(edges[0].transformed([[1, 0, 0], [0, 1, 0], [0, 0, 1]], (0, 4, 0)), edges[0])
    >>> volume_centroid([base, *(cone(edge, (2, 2, 8)) for edge in edges)]).point.round(12).tolist()
    [2.0, 2.0, 2.0]
    """
    every = _in_space(surfaces)
    base, size = _box(every)
    areas = [area(surface, rtol=rtol) for surface in every]

    def moment(surface: ParametricSurface, axis: int) -> Estimate:
        def integrand(u: Array, v: Array) -> Array:
            offset, normal = surface.derivative(u, v, (0, 0))[..., axis] - base[axis], _crossed(surface, u, v)
            return np.asarray(size**2 * np.linalg.norm(normal, axis=-1) + offset**2 * normal[..., axis] / 2)

        return over_domain(surface, integrand, rtol)

    whole = volume(every, origin=base, rtol=rtol)
    return _divided(every, moment, whole, base, [size**2 * own for own in areas])


def vector_area(surface: ParametricSurface, *, rtol: float = 1e-12) -> Array:
    """The integral of the normal ``int S_u x S_v du dv``, shape (3,): of a plane surface, its area along its normal.

    It depends on the boundary alone, so surfaces that overlap count once for a boundary that they have in common.
    """
    (only,) = _in_space(surface)

    def component(axis: int) -> float:
        def integrand(u: Array, v: Array) -> Array:
            normal = _crossed(only, u, v)
            return np.asarray(np.linalg.norm(normal, axis=-1) + normal[..., axis])

        return over_domain(only, integrand, rtol)

    return np.array([component(axis) for axis in range(3)]) - area(only, rtol=rtol)


def _in_space(surfaces: ParametricSurface | Iterable[ParametricSurface]) -> list[ParametricSurface]:
    every = list(surfaces) if isinstance(surfaces, Iterable) else [surfaces]
    if not every:
        raise InputError("a centre of gravity needs at least one surface, got none")
    for surface in every:
        if surface.dimension != 3:
            raise InputError(f"a centre of gravity needs surfaces in space, d = 3, got d = {surface.dimension}")
    return every


def _box(surfaces: list[ParametricSurface]) -> tuple[Array, float]:
    """The middle of a box of samples and the half of its diagonal: moments about it keep digits far from the origin.

    Integrands of moments, and of normals, get the size added: they are small where a surface lies across an axis, and
    no accuracy relative to what is all but 0 is wanted.
    """
    places = np.linspace(0.1, 0.9, 5)
    points = []
    for surface in surfaces:
        u, v = (first + (last - first) * places for first, last in domain_of(surface))
        points.append(surface.derivative(u[:, None], v[None, :], (0, 0)).reshape(-1, 3))
    least, most = np.min([p.min(axis=0) for p in points], axis=0), np.max([p.max(axis=0) for p in points], axis=0)
    return (least + most) / 2, float(np.linalg.norm(most - least)) / 2


def _crossed(surface: ParametricSurface, u: Array, v: Array) -> Array:
    return np.cross(surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1)))


def _total(parts: list[Estimate]) -> Estimate:
    return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))


def _divided(
    surfaces: list[ParametricSurface],
    moment: Callable[[ParametricSurface, int], Estimate],
    whole: Estimate,
    base: Array,
    added: list[float],
) -> Centroid:
    if not abs(whole) > whole.error:
        raise InputError(f"there is nothing to have a centre of gravity: its measure is {whole.value:g}")
    moments = [_total([moment(surface, axis) for surface in surfaces]) for axis in range(3)]
    offset = np.array([math.fsum([part, *(-own for own in added)]) for part in moments]) / whole.value
    error = (math.hypot(*(part.error for part in moments)) + float(np.linalg.norm(offset)) * whole.error) / abs(whole)
    return Centroid(base + offset, float(error))
