"""Patches of one boundary side by side: area, energies and mean curvature for every functional and family.

Areas are compared over one contour only. In the setting "free boundary" curved boundaries move with the design
variables and the family: such patches have contours of their own, and their areas say nothing about each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad.basis import BERNSTEIN, GT, Family
from gtcad.differential import mean_curvature
from gtcad.errors import InputError
from gtcad.measure import Estimate, area
from gtcad.patches._plateau import Contour, Plateau, Setting, is_contour, setting_of
from gtcad.patches.minimal import energy, extremal, fixed_contour, harmonic_residual
from gtcad.patches.minimal_area import least_area
from gtcad.protocol import SeparableSurface
from gtcad.queries import nearest
from gtcad.surface import Surface

Array = NDArray[np.float64]
Functional = Literal["dirichlet", "quasi-harmonic", "bending", "area"]

FUNCTIONALS: tuple[Functional, ...] = ("dirichlet", "quasi-harmonic", "bending", "area")
"""What can be made least."""

COLUMNS = ("setting", "family", "functional", "degrees", "contour", "area", "Dirichlet energy", "residual", "max |H|")

_SIDES = ("u0", "u1", "v0", "v1")
_SAME = 1e-9  # of the size: what the contours of patches may differ by
_PLACES = np.linspace(0, 1, 9)
_SAMPLES = 65  # in each direction, then windows of 9 x 9 around the best, each a quarter as wide
_WINDOWS = 8
_SINGULAR = 1e-4  # of the largest |S_u x S_v|


def minimal_patch(
    boundary: ArrayLike | Contour,
    functional: Functional = "dirichlet",
    *,
    degree: int | Sequence[int] | None = None,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Surface | Plateau:
    """The patch for which a functional is least, in either setting.

    Parameters
    ----------
    boundary
        Boundary control points, for the setting "free boundary"; or four curves c0, c1, d0, d1 or a ``Coons`` patch,
        for "fixed contour".
    functional
        "dirichlet", "quasi-harmonic", "bending" or "area"; the last one starts from the first.
    degree
        Of the interior functions of a fixed contour; a net has its own.
    gamma_u, gamma_v, family
        As for ``gtcad.patches.minimal.extremal``.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> net = [[[i, j, i * j] for j in range(3)] for i in range(3)]
    >>> setting_of(minimal_patch(net)), minimal_patch(net, "area") == minimal_patch(net)
    ('free boundary', False)
    """
    if functional not in FUNCTIONALS:
        raise InputError(f"functional must be one of {', '.join(FUNCTIONALS)}, got {functional!r}")
    first = "dirichlet" if functional == "area" else functional
    found: Surface | Plateau
    if is_contour(boundary):
        if degree is None:
            raise InputError("degree is needed for a fixed contour: that of the interior functions, from 2")
        found = fixed_contour(boundary, degree, first, gamma_u=gamma_u, gamma_v=gamma_v, family=family)  # type: ignore[arg-type]
    else:
        if degree is not None:
            raise InputError(f"degree is that of the net, got {degree!r} besides")
        found = extremal(boundary, first, gamma_u=gamma_u, gamma_v=gamma_v, family=family)  # type: ignore[arg-type]
    return least_area(found).patch if functional == "area" else found


@dataclass(frozen=True)
class MinimalFigures:
    """The figures of one patch.

    Attributes
    ----------
    patch
        The patch.
    functional
        What was made least.
    contour
        Number of its contour: patches with equal numbers have one contour.
    area, dirichlet_energy
        In the square of the model's unit; the area is never above the energy. Errors are estimated.
    residual
        The root of the mean of ``|S_uu + S_vv|^2``, in the unit.
    mean_curvature
        The largest |H|, in the inverse of the unit: estimated from samples.
    """

    patch: Surface | Plateau
    functional: Functional
    contour: int
    area: Estimate
    dirichlet_energy: Estimate
    residual: Estimate
    mean_curvature: float

    @property
    def setting(self) -> Setting:
        """Which of both."""
        return setting_of(self.patch)

    @property
    def family(self) -> Family:
        """Of the interior functions."""
        return self.patch.family if isinstance(self.patch, Plateau) else self.patch.family_u


@dataclass(frozen=True)
class MinimalTable:
    """Figures of patches of one boundary; ``print`` shows them.

    Attributes
    ----------
    entries
        One for each family and functional.
    """

    entries: tuple[MinimalFigures, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """What ``rows`` hold."""
        return COLUMNS

    def rows(self) -> list[tuple[str | int | float, ...]]:
        """The table as data: for each patch what ``columns`` say."""
        return [
            (
                entry.setting,
                entry.family.name,
                entry.functional,
                "x".join(map(str, entry.patch.degrees)),
                entry.contour,
                entry.area.value,
                entry.dirichlet_energy.value,
                entry.residual.value,
                entry.mean_curvature,
            )
            for entry in self.entries
        ]

    def area_excess(self, reference: float | None = None) -> tuple[float, ...]:
        """Areas over a reference less 1, one for each entry: over the least of them, or over a known area.

        Raises
        ------
        InputError
            When the patches have more than one contour, there are none, or the reference is not above 0.
        """
        if len({entry.contour for entry in self.entries}) > 1:
            raise InputError(
                "areas are compared over one contour only, and these patches have several: with a free boundary the "
                "curves move with design variables and family; take the boundary curves as a fixed contour"
            )
        if not self.entries:
            raise InputError("there are no patches to compare")
        least = min(entry.area.value for entry in self.entries) if reference is None else reference
        if not least > 0:
            raise InputError(f"reference must be above 0, got {least}")
        return tuple(entry.area.value / least - 1 for entry in self.entries)

    def __str__(self) -> str:
        texts = [COLUMNS, *([_shown(value) for value in row] for row in self.rows())]
        widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
        lines = ["  ".join(map(str.ljust, line, widths)).rstrip() for line in texts]
        return "\n".join([lines[0], "-" * (sum(widths) + 2 * len(widths) - 2), *lines[1:]])


def _shown(value: str | float) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def minimal_table(
    boundary: ArrayLike | Contour,
    *,
    degree: int | Sequence[int] | None = None,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    families: Sequence[Family] = (GT, BERNSTEIN),
    functionals: Sequence[Functional] = FUNCTIONALS,
) -> MinimalTable:
    """The patches for which each functional is least, with each family, and their figures.

    Parameters
    ----------
    boundary, degree, gamma_u, gamma_v
        As for ``minimal_patch``; a family that takes no design variables is used without.
    families, functionals
        Which.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> from gtcad import Curve
    >>> corners = [0, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, 0]
    >>> sides = [Curve([corners[a], corners[b]], family=BERNSTEIN) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]
    >>> table = minimal_table(sides, degree=3, families=[GT], functionals=["dirichlet", "area"])
    >>> [round(100 * excess, 3) for excess in table.area_excess()]
    [0.119, 0.0]
    """
    entries: list[MinimalFigures] = []
    contours: list[SeparableSurface] = []
    for family in families:
        gammas: tuple[ArrayLike, ArrayLike] = (gamma_u, gamma_v) if family.takes_gamma else ((0.0, 0.0), (0.0, 0.0))
        for functional in functionals:
            patch = minimal_patch(
                boundary, functional, degree=degree, gamma_u=gammas[0], gamma_v=gammas[1], family=family
            )
            number = next((k for k, one in enumerate(contours) if same_contour(one, patch)), len(contours))
            if number == len(contours):
                contours.append(patch)
            entries.append(_figures(patch, functional, number + 1))
    return MinimalTable(tuple(entries))


def _figures(patch: Surface | Plateau, functional: Functional, contour: int) -> MinimalFigures:
    return MinimalFigures(
        patch,
        functional,
        contour,
        area(patch),
        energy(patch),
        harmonic_residual(patch),
        largest_mean_curvature(patch),
    )


def same_contour(first: SeparableSurface, second: SeparableSurface) -> bool:
    """Whether the sides of two patches are the same sets of points, each that of the same name.

    Judged by nine points of each side: those of one must lie on the other to 1e-9 of the size, the ends at its ends.

    Examples
    --------
    Straight edges stay when design variables change, though they are run through at another speed; curved ones move:

    >>> net = np.array([[[i, j, 0] for j in range(3)] for i in range(3)], dtype=float)
    >>> same_contour(Surface(net), Surface(net, (1, 1), (0.5, -1)))
    True
    >>> net[0, 1] = [-1, 1, 0]
    >>> same_contour(Surface(net), Surface(net, (1, 1), (0.5, -1)))
    False
    """
    if first.dimension != second.dimension:
        return False
    grid = np.linspace(0, 1, 5)
    size = float(np.linalg.norm(np.ptp(first.evaluate(grid[:, None], grid).reshape(-1, first.dimension), axis=0)))
    return all(_same_side(first, second, side, _SAME * size) for side in _SIDES)


def _same_side(first: SeparableSurface, second: SeparableSurface, side: str, gap: float) -> bool:
    end = float(side[1])
    place = (end, _PLACES) if side[0] == "u" else (_PLACES, end)
    points = first.evaluate(*place), second.evaluate(*place)
    apart = np.linalg.norm(points[0] - points[1], axis=-1)
    if (apart <= gap).all():
        return True
    if (apart[[0, -1]] > gap).any():
        return False
    curve = second.boundary(side)  # type: ignore[attr-defined]
    return all(nearest(curve, point).distance <= gap for point in points[0][1:-1])


def largest_mean_curvature(surface: SeparableSurface) -> float:
    """The largest |H| of a surface, in the inverse of the unit: estimated from 65 x 65 samples and finer ones.

    Where |S_u x S_v| is below 1e-4 of its largest value the surface is taken as singular and not looked at.

    Examples
    --------
    A cylinder of radius 2: 1/4.

    >>> rows = [[x, y, z] for x, y in ((2, 0), (2, 2), (0, 2)) for z in (0, 1)]
    >>> round(largest_mean_curvature(Surface(np.reshape(rows, (3, 2, 3)), family_v=BERNSTEIN)), 12)
    0.25
    """
    if surface.dimension == 2:
        return 0.0
    u = v = np.linspace(0, 1, _SAMPLES)
    largest = singular = 0.0
    for k in range(_WINDOWS + 1):
        grid = u[:, None], v[None, :]
        sizes = norm(np.cross(surface.derivative(*grid, (1, 0)), surface.derivative(*grid, (0, 1))))
        singular = singular or _SINGULAR * float(sizes.max())
        values = np.abs(mean_curvature(surface, *grid))
        values = np.where(np.isfinite(values) & (sizes > singular), values, -1.0)
        best = np.unravel_index(int(values.argmax()), values.shape)
        largest = max(largest, float(values[best]))
        window = np.linspace(-1, 1, 9) / (_SAMPLES - 1) / 4**k
        u, v = (np.clip(side[place] + window, 0, 1) for side, place in zip((u, v), best, strict=True))
    return largest
