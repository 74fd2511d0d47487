from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from gtcad import BERNSTEIN, Basis, Curve, Surface
from gtcad.continuity import PARAMETRIC, Start, chain_rule
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.patches import Rotation, Ruled
from gtcad.protocol import SIDES, SeparableSurface
from gtcad.quilt import Quilt, SharedEdge, Use
from gtcad.restricted import Restricted

Array = NDArray[np.float64]

# Quilts to test with


def line(a: Sequence[float], b: Sequence[float]) -> Curve:
    return Curve([a, b], family=BERNSTEIN)


def box(rng: np.random.Generator, degree: int = 4, noise: float = 0.05, size: float = 50.0) -> list[Surface]:
    """The faces of a cube whose lattice of control points is scattered: the rows at its edges are equal."""
    ticks = (Basis(degree).rows(np.linspace(0, 1, degree + 1)).T @ np.arange(degree + 1)) / degree
    lattice = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1)
    lattice = (lattice + noise * rng.normal(size=lattice.shape)) * size
    gammas = rng.uniform(-1, 1, (3, 2)).tolist()
    faces = []
    for axis, end in itertools.product(range(3), (0, -1)):
        first, second = (gammas[k] for k in range(3) if k != axis)
        faces.append(Surface(lattice.take(end, axis=axis), first, second))
    return faces


def circle(radius: float, middle: float = 0.0) -> CurveOfTerms:
    """A whole circle in the plane y = 0 about (middle, 0, 0)."""
    return CurveOfTerms(Waves(0.0, 2 * math.pi), [[middle, 0, 0], [radius, 0, 0], [0, 0, radius]])


AXIS = ([0, 0, 0], [0, 0, 1])


def torus(large: float, small: float) -> list[SeparableSurface]:
    """One patch, closed both ways."""
    return [Rotation(circle(small, large), *AXIS)]


def can(radius: float, height: float) -> list[SeparableSurface]:
    """A tube with a seam, and two discs with a seam and a collapsed side."""
    rim, top = [radius, 0, 0], [radius, 0, height]
    return [
        Rotation(line(rim, top), *AXIS),
        Rotation(line([0, 0, 0], rim), *AXIS),
        Rotation(line([0, 0, height], top), *AXIS),
    ]


def ball(radius: float) -> list[SeparableSurface]:
    """Two halves, each with a seam and a pole."""
    halves = [[[radius, 0, 0], [radius, 0, z], [0, 0, z]] for z in (radius, -radius)]
    return [Rotation(Curve(half), *AXIS) for half in halves]


def sheet(
    rng: np.random.Generator, shape: tuple[int, int], order: int, *, parametric: bool = False, size: float = 100.0
) -> tuple[list[Surface], list[Array], list[Array]]:
    """Patches joined G^order with one (eta, psi, omega) for each strip; the rules of both directions, by strips.

    Patch (i, j) has number i * shape[1] + j; it goes on from (i - 1, j) in u and from (i, j - 1) in v.
    """
    bases, rules, joints = [], [], []
    for count in shape:
        own = [
            Basis(int(rng.integers(order + 2, 2 * order + 4)), rng.uniform(-0.8, 0.8, 2).tolist()) for _ in range(count)
        ]
        scales = [PARAMETRIC if parametric else (rng.uniform(0.6, 1.6), *rng.uniform(-0.3, 0.3, 2)) for _ in own[1:]]
        rules.append([chain_rule(scale, order + 1) for scale in scales])
        joints.append([_joint(*pair, rule) for pair, rule in zip(itertools.pairwise(own), rules[-1], strict=True)])
        bases.append(own)
    nets: dict[tuple[int, int], Array] = {}
    k = order + 1
    for i, j in itertools.product(*map(range, shape)):
        u, v = bases[0][i], bases[1][j]
        net = np.zeros((u.count, v.count, 3))
        net[..., 0] = (i + np.linspace(0, 1, u.count))[:, None]
        net[..., 1] = j + np.linspace(0, 1, v.count)
        net += rng.normal(0, 0.1, net.shape)
        if i:
            net[:k] = np.tensordot(joints[0][i - 1], nets[i - 1, j][-k:], 1)
        if j:
            net[:, :k] = np.einsum("ab,ibd->iad", joints[1][j - 1], nets[i, j - 1][:, -k:])
        nets[i, j] = net
    largest = max(float(np.abs(net).max()) for net in nets.values())
    patches = [Surface(net * size / largest, bases[0][i].gamma, bases[1][j].gamma) for (i, j), net in nets.items()]
    return patches, rules[0], rules[1]


def _joint(before: Basis, after: Basis, rule: Array) -> Array:
    """From the last control points of one curve to the first ones of the next."""
    ends = np.array([before.derivative(1.0, r)[-len(rule) :] for r in range(len(rule))])
    return np.linalg.solve(Start.of(after, len(rule) - 1).matrix, rule @ ends)


Turn = tuple[bool, bool, bool]  # u reversed, then v reversed, then both exchanged


def turned(patch: Surface, turn: Turn) -> Surface:
    for direction, wanted in zip("uv", turn[:2], strict=True):
        patch = patch.reversed(direction) if wanted else patch
    return patch.transposed() if turn[2] else patch


def random_turns(rng: np.random.Generator, count: int) -> list[Turn]:
    return [tuple(turn) for turn in rng.integers(0, 2, (count, 3)).astype(bool).tolist()]


def backwards(patch: SeparableSurface, direction: str) -> SeparableSurface:
    ranges = ((1, 0), (0, 1)) if direction == "u" else ((0, 1), (1, 0))
    return Restricted(patch, ranges)


def half_twist(rng: np.random.Generator) -> Surface:
    """A strip whose end is its start turned over."""
    net = rng.normal(size=(6, 4, 3))
    net[-1] = net[0][::-1]
    return Surface(net, rng.uniform(-1, 1, 2), [0.3, 0.3])


def side(patch: SeparableSurface, use: Use, t: Array) -> Array:
    fixed = np.full_like(t, float(use.side[1]))
    return patch.evaluate(fixed, t) if use.side[0] == "u" else patch.evaluate(t, fixed)


def assert_edges_hold(quilt: Quilt) -> None:
    """By points at parameters of no rule."""
    t = np.sort(np.random.default_rng(0).uniform(0, 1, 50))
    for edge in quilt.edges:
        first = side(quilt.patches[edge.first.patch], edge.first, t)
        second = side(quilt.patches[edge.second.patch], edge.second, 1 - t if edge.reversed else t)
        np.testing.assert_allclose(second, first, rtol=0, atol=1e-11 * np.abs(first).max())


# What is found


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (3, 2), (3, 4)])
@pytest.mark.parametrize("seed", range(3))
def test_a_sheet_has_the_edges_of_a_grid_however_its_patches_lie(shape: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, n = shape
    patches = [
        turned(patch, turn) for patch, turn in zip(sheet(rng, shape, 1)[0], random_turns(rng, m * n), strict=True)
    ]
    quilt = Quilt.recognised(patches, order="G1")
    beside = {(k, k + n) for k in range((m - 1) * n)} | {(k, k + 1) for k in range(m * n) if (k + 1) % n}
    assert {(edge.first.patch, edge.second.patch) for edge in quilt.edges} == beside
    assert len(quilt.edges) == len(beside)
    assert {edge.order for edge in quilt.edges} <= {"G1"}
    assert len(quilt.free) == 2 * (m + n)
    assert not quilt.closed
    assert quilt.collapsed == ()
    assert_edges_hold(quilt)


def test_the_patches_of_a_sheet_are_flipped_as_they_were_turned() -> None:
    rng = np.random.default_rng(5)
    turns = random_turns(rng, 12)
    patches = [turned(patch, turn) for patch, turn in zip(sheet(rng, (3, 4), 1)[0], turns, strict=True)]
    over = [sum(turn) % 2 == 1 for turn in turns]
    assert any(over)
    assert not all(over)
    assert Quilt.recognised(patches).flipped == tuple(one ^ over[0] for one in over)


@pytest.mark.parametrize("seed", range(3))
def test_a_box_closes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    faces = [turned(face, turn) for face, turn in zip(box(rng), random_turns(rng, 6), strict=True)]
    quilt = Quilt.recognised(faces)
    assert quilt.closed
    assert len(quilt.edges) == 12
    assert any(edge.reversed for edge in quilt.edges)
    assert not all(edge.reversed for edge in quilt.edges)
    assert_edges_hold(quilt)
    middle = np.mean([face.evaluate(0.5, 0.5) for face in faces], axis=0)
    for face, over in zip(faces, quilt.flipped, strict=True):
        outwards = np.cross(face.derivative(0.5, 0.5, (1, 0)), face.derivative(0.5, 0.5, (0, 1)))
        assert ((face.evaluate(0.5, 0.5) - middle) @ outwards < 0) == over


BODIES: dict[str, tuple[Callable[[], list[SeparableSurface]], int, int, float, float]] = {
    # patches, shared edges, collapsed sides, volume, area
    "torus": (lambda: torus(4, 1), 2, 0, 2 * math.pi**2 * 4, 4 * math.pi**2 * 4),
    "can": (lambda: can(2, 3), 5, 2, 12 * math.pi, 20 * math.pi),
    "ball": (lambda: ball(2), 3, 2, 32 / 3 * math.pi, 16 * math.pi),
    "box": (lambda: list(box(np.random.default_rng(0), noise=0, size=2)), 12, 0, 8, 24),
}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("seed", range(2))
def test_closed_bodies_have_their_volume_whichever_way_their_patches_turn(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    build, edges, collapsed, volume, area = BODIES[name]
    patches = [backwards(patch, str(rng.choice(["u", "v"]))) if rng.random() < 0.5 else patch for patch in build()]
    quilt = Quilt.recognised(patches)
    assert (quilt.closed, len(quilt.edges), len(quilt.collapsed)) == (True, edges, collapsed)
    assert quilt.volume() == pytest.approx(volume, rel=1e-11)
    assert quilt.area() == pytest.approx(area, rel=1e-11)
    assert abs(quilt.volume() - volume) <= quilt.volume().error + 1e-13 * volume
    assert_edges_hold(quilt)


def test_a_mirror_image_has_the_same_volume_and_turns_over() -> None:
    quilt = Quilt.recognised(box(np.random.default_rng(3)))
    image = quilt.transformed(np.diag([1, 1, -2]), [5, 6, 1e3])
    assert image.edges == quilt.edges
    assert image.flipped == tuple(not one for one in quilt.flipped)
    assert image.volume() == pytest.approx(2 * quilt.volume(), rel=1e-9)


def test_separate_bodies_each_face_outwards() -> None:
    other = [backwards(patch, "v").transformed(np.eye(3), [100, 0, 0]) for patch in can(2, 3)]
    quilt = Quilt.recognised(ball(2) + other)
    assert quilt.volume() == pytest.approx((32 / 3 + 12) * math.pi, rel=1e-11)


def test_kinds_do_not_matter() -> None:
    arc = Curve([[2, 0, 0], [2, 2, 0], [0, 2, 0]])
    whole = Rotation(line([2, 0, 0], [2, 0, 3]), *AXIS, 360)
    flange = np.array(arc.control_points) * np.array([1, 1.5, 2])[:, None, None] + [0, 0, 3]
    patches = [
        Ruled(arc.transformed(np.eye(3), [0, 0, -1]), arc),
        Restricted(whole, ((0, 1), (0.25, 0))),
        Surface(flange, (0.5, -0.3)),
    ]
    edges = Quilt.recognised(patches).edges
    assert [(edge.first, edge.second, edge.reversed) for edge in edges] == [
        (Use(0, "v1"), Use(1, "u0"), True),
        (Use(1, "u1"), Use(2, "u0"), True),
    ]


@pytest.mark.parametrize(("shift", "edges"), [(1e-14, 1), (1e-13, 1), (1e-11, 0), (1e-3, 0)])
def test_curves_are_one_up_to_rounding_only(shift: float, edges: int) -> None:
    low, middle, high = ([[0, 0, z], [3, 1, z], [10, 0, z]] for z in (0, 1, 2))
    moved = np.array(middle) + [0, 0, 10 * shift]
    quilt = Quilt.recognised([Ruled(Curve(low), Curve(middle)), Ruled(Curve(moved), Curve(high))])
    assert len(quilt.edges) == edges


def test_equal_ends_and_middles_are_not_enough() -> None:
    net = np.array([[[x, 0.0, z] for x in range(5)] for z in range(3)])
    bent = net.copy()
    bent[0, 1, 1], bent[0, 3, 1] = 1.0, -1.0  # odd about the middle of symmetric functions
    quilt = Quilt.recognised([Surface(net), Surface(bent * [1, 1, -1])])
    np.testing.assert_allclose(quilt.patches[1].evaluate(0, [0, 0.5, 1]), quilt.patches[0].evaluate(0, [0, 0.5, 1]))
    assert quilt.edges == ()
    assert len(quilt.free) == 8


def test_many_patches_are_sorted_out() -> None:
    rng = np.random.default_rng(8)
    x, y = np.meshgrid(np.arange(25.0), np.arange(25.0), indexing="ij")
    lattice = np.stack([x, y, rng.normal(size=x.shape)], axis=-1)
    patches = [
        Surface(lattice[i : i + 3, j : j + 3], (0.1, 0.4), (-0.6, 0)) for i in range(0, 24, 2) for j in range(0, 24, 2)
    ]
    quilt = Quilt.recognised(patches)
    assert (len(quilt.edges), len(quilt.free)) == (2 * 12 * 11, 4 * 12)
    assert not any(quilt.flipped)


# What is stated


def apart(gap: float) -> list[SeparableSurface]:
    low, middle, high = ([[0, 0, z], [3, 1, z], [10, 0, z]] for z in (0, 1, 2))
    return [Ruled(Curve(low), Curve(middle)), Ruled(Curve(np.array(middle) + [0, gap, 0]), Curve(high))]


def test_a_stated_edge_may_have_the_gap_that_is_allowed() -> None:
    stated = SharedEdge(Use(0, "v1"), Use(1, "v0"), False)
    quilt = Quilt.recognised(apart(1e-3), stated=[stated], gap=2e-3)
    assert quilt.edges == (stated,)
    assert quilt.gaps == pytest.approx((1e-3,), rel=1e-9)
    with pytest.raises(InputError, match=r"patch 1.v1 and patch 2.v0 .* 0.001 apart; gap allows 0.0005"):
        Quilt.recognised(apart(1e-3), stated=[stated], gap=5e-4)
    with pytest.raises(InputError, match="apart"):
        Quilt.recognised(apart(0), stated=[SharedEdge(Use(0, "v1"), Use(1, "v0"), True)], gap=1)
    with pytest.raises(InputError, match="only order C0 is kept, got G2"):
        Quilt.recognised(apart(1e-3), stated=[SharedEdge(Use(0, "v1"), Use(1, "v0"), False, "G2")], gap=1e-2)


def test_stated_edges_come_first_and_keep_their_order() -> None:
    stated = SharedEdge(Use(1, "v0"), Use(0, "v1"), False, "C2")
    assert Quilt.recognised(apart(0), stated=[stated], order="G1").edges == (stated,)


def test_orders_by_side() -> None:
    patches = sheet(np.random.default_rng(1), (1, 3), 1)[0]
    edges = Quilt.recognised(patches, order={Use(2, "v0"): "G1"}).edges
    assert [edge.order for edge in edges] == ["C0", "G1"]
    with pytest.raises(InputError, match=r"in no edge found: patch 1.u0"):
        Quilt.recognised(patches, order={Use(0, "u0"): "G1"})
    with pytest.raises(InputError, match=r"order differs for patch 1.v1 and patch 2.v0"):
        Quilt.recognised(patches, order={Use(0, "v1"): "G1", Use(1, "v0"): "G2"})
    with pytest.raises(InputError, match="order must be"):
        Quilt.recognised(patches, order="G4")


# What is refused


def test_a_moebius_strip_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"not orientable: their sides disagree at patch 1.u0 and patch 1.u1"):
        Quilt.recognised([half_twist(rng)])
    whole = half_twist(rng)
    parts = [Restricted(whole, ((k / 3, (k + 1) / 3), (0, 1))) for k in range(3)]
    assert len(Quilt.recognised(parts[:2]).edges) == 1
    with pytest.raises(InputError, match="not orientable"):
        Quilt.recognised([parts[0], backwards(parts[1], "u"), parts[2]])


def test_three_sides_at_one_edge_are_refused() -> None:
    spine = [[0, 0, 0], [3, 1, 0], [10, 0, 0]]
    fans = [Ruled(Curve(spine), Curve(np.array(spine) + off)) for off in ([0, 0, 1], [0, 1, 0], [0, -1, 0])]
    with pytest.raises(InputError, match=r"two sides at most, but these are one curve: a.v0, c.v1, d.v0"):
        Quilt.recognised(
            [fans[0], Ruled(Curve([[0, 5, 9], [1, 5, 9], [2, 2, 9]]), line([0, 9, 9], [3, 3, 3])),
             backwards(fans[1], "v"), fans[2]],
            names="abcd",
        )  # fmt: skip


def test_bad_arguments_are_refused() -> None:
    one, other = apart(0)
    edge = SharedEdge(Use(0, "v1"), Use(1, "v0"), False)
    with pytest.raises(InputError, match="one patch at least"):
        Quilt.recognised([])
    with pytest.raises(InputError, match=r"patches\[1\] must be a surface, got Curve"):
        Quilt.recognised([one, line([0, 0], [1, 1])])  # type: ignore[list-item]
    with pytest.raises(InputError, match=r"one dimension, got \[2, 3\]"):
        Quilt.recognised([one, Surface(np.zeros((3, 3, 2)))])
    for names in (["a"], ["a", "a"]):
        with pytest.raises(InputError, match="names must be 2 different ones"):
            Quilt.recognised([one, other], names=names)
    for use in (Use(2, "u0"), Use(-1, "u0"), Use(0, "w0")):
        with pytest.raises(InputError, match="does not exist"):
            Quilt((one, other), ("a", "b"), (SharedEdge(use, Use(1, "v0"), False),))
    with pytest.raises(InputError, match=r"side b.v0 is stated in two edges"):
        Quilt((one, other), ("a", "b"), (edge, SharedEdge(Use(1, "v0"), Use(0, "u0"), False)))
    with pytest.raises(InputError, match=r"a.v1 and a.v1|a.v1 is stated in two"):
        Quilt((one, other), ("a", "b"), (SharedEdge(Use(0, "v1"), Use(0, "v1"), False),))
    with pytest.raises(InputError, match="a side that is one point can be none"):
        Quilt.recognised(ball(1), stated=[SharedEdge(Use(0, "u1"), Use(1, "u1"), False)], gap=9)
    with pytest.raises(InputError, match=r"these sides are free: patch 1.u0, patch 1.u1, patch 1.v0, patch 2.u0"):
        Quilt.recognised([one, other]).volume()


def test_a_plane_quilt_has_an_area() -> None:
    square = Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    quilt = Quilt.recognised([square, square.transformed(np.eye(2), [1, 0]).reversed("u")])
    assert quilt.area() == pytest.approx(2)
    assert quilt.flipped == (False, True)
    assert len(quilt.free) == len(SIDES) * 2 - 2


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(200))
def test_sheets_however_their_patches_lie(seed: int) -> None:
    shape = tuple(np.random.default_rng(seed).integers(1, 6, 2).tolist())
    test_a_sheet_has_the_edges_of_a_grid_however_its_patches_lie(shape, seed)
