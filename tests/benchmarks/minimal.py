"""Dirichlet extremals for thousands of design variables beside a plain loop, and areas beside true minimal surfaces."""

from __future__ import annotations

import numpy as np

from gtcad import BERNSTEIN, GT, Basis
from gtcad.patches import fixed_contour, least_area
from gtcad.patches.minimal import ExtremalEnergies, dirichlet_energies, dirichlet_extremal, energy
from tests.benchmarks.timing import median, paired, table
from tests.patches.surfaces import SURFACES

PARTICLES, ITERATIONS = 30, 100
LOOP = 60  # extremals of the loops that are timed
_EQUAL = 1e-12  # relative: what the true areas are known to
DEGREES = (2, 3, 4, 5, 6, 8)


def run() -> str:
    """The tables of this part."""
    return "\n\n".join(
        ["## Minimal surfaces: 3000 Dirichlet extremals", _solves(), "### Relative excess of area", excess()]
    )


def _solves() -> str:
    count = PARTICLES * ITERATIONS
    rng = np.random.default_rng(1)
    gammas = rng.uniform(-1, 1, (count, 4))
    rows = []
    for n, m in ((3, 3), (5, 4), (8, 8)):
        net = rng.normal(size=(n + 1, m + 1, 3))
        swarm = ExtremalEnergies(net)

        def by_iterations(swarm: ExtremalEnergies = swarm) -> None:
            for k in range(ITERATIONS):
                swarm(gammas[k * PARTICLES : (k + 1) * PARTICLES])

        def plain(net: np.ndarray = net) -> None:
            for gamma in gammas[:LOOP]:
                plain_energy(net, gamma)

        def one_by_one(net: np.ndarray = net) -> None:
            for gamma in gammas[:LOOP]:
                energy(dirichlet_extremal(net, gamma[:2], gamma[2:]))

        at_once, loop, ratio = paired(lambda net=net: dirichlet_energies(net, gammas), plain)
        scale = count / LOOP
        rows.append(
            [
                f"({n}, {m})",
                f"{at_once:.3f}",
                f"{median(by_iterations, 5):.3f}",
                f"{loop * scale:.2f}",
                f"{ratio * scale:.0f}",
                f"{median(one_by_one, 3) * scale:.2f}",
            ]
        )
    header = ["degrees", "all at once, s", "30 at a time, s", "plain loop, s", "times as fast", "one by one, gtcad, s"]
    return table(header, rows)


def plain_energy(net: np.ndarray, gamma: np.ndarray) -> float:
    """The least Dirichlet energy as one writes it down: Gram matrices, a Kronecker sum, one system."""
    bases = [Basis(size - 1, tuple(pair)) for size, pair in zip(net.shape[:2], (gamma[:2], gamma[2:]), strict=True)]
    (mass_u, stiff_u), (mass_v, stiff_v) = ((basis.gram(), basis.gram(1, 1)) for basis in bases)
    form = np.kron(stiff_u, mass_v) + np.kron(mass_u, stiff_v)
    inner = np.zeros(net.shape[:2], dtype=bool)
    inner[1:-1, 1:-1] = True
    inside, points = inner.ravel(), net.reshape(-1, 3).copy()
    right = -form[np.ix_(inside, ~inside)] @ points[~inside]
    points[inside] = np.linalg.solve(form[np.ix_(inside, inside)], right)
    return float(np.einsum("id,ij,jd", points, form, points)) / 2


def excess() -> str:
    """Areas of least-area patches over fixed contours beside the true ones: degree against relative excess."""
    rows = []
    for name, make in SURFACES.items():
        surface = make()
        for family in (GT, BERNSTEIN):
            found = [least_area(fixed_contour(surface.contour, n, family=family)) for n in DEGREES]
            dirichlet = found[-1].start / surface.area - 1
            texts = [_shown(one.area / surface.area - 1) for one in found]
            rows.append([name, family.name, *texts, _shown(dirichlet)])
    return table(["contour", "family", *map(str, DEGREES), "8, Dirichlet"], rows)


def _shown(value: float) -> str:
    return f"{value:.0e}" if abs(value) > _EQUAL else f"< {_EQUAL:.0e}"
