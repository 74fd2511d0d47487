from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.centroids import area_centroid, vector_area, volume_centroid
from gtcad.converters.bspline import BSplineSurface
from gtcad.errors import InputError
from gtcad.patches import Ruled, cone
from tests import pieces
from tests.converters import bodies

TURNED = ((1.0, 0.0), (0.0, 1.0))
SHIFT = np.array([1e3, -2e3, 5e2])
RING = bodies.circle(0, 3.0).transformed([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # in the plane z = 0


@pytest.mark.parametrize("shift", [np.zeros(3), SHIFT])
def test_half_a_sphere_has_it_at_half_its_height(shift):
    half = Restricted(bodies.sphere(2.0), ((0.5, 1.0), (0.0, 1.0))).transformed(np.eye(3), shift)
    found = area_centroid(half)
    assert np.abs(found.point - shift - [0, 0, 1]).max() <= max(found.error, 1e-12) <= 1e-8


@pytest.mark.parametrize("shift", [np.zeros(3), SHIFT])
def test_a_cone_has_it_at_a_quarter_of_its_height_and_its_side_at_a_third(shift):
    side = cone(RING, (0, 0, 8)).transformed(np.eye(3), shift)
    base = cone(RING, (0, 0, 0)).transformed(np.eye(3), shift)
    assert np.abs(area_centroid(side).point - shift - [0, 0, 8 / 3]).max() <= 1e-9
    for body in ([side, Restricted(base, TURNED)], [Restricted(side, TURNED), base]):
        found = volume_centroid(body)
        assert np.abs(found.point - shift - [0, 0, 2]).max() <= max(found.error, 1e-9) <= 1e-6


def test_half_a_ball_and_half_a_torus():
    half = Restricted(bodies.sphere(2.0), ((0.5, 1.0), (0.0, 1.0)))
    disk = cone(RING, (0, 0, 0)).transformed(np.eye(3) * 2 / 3)
    outwards = [half, Restricted(disk, TURNED)]
    outwards = outwards if half.derivative(0.5, 0.0)[2] > 0 else outwards[::-1]
    assert volume_centroid(outwards).point[2] == pytest.approx(3 / 8 * 2, rel=1e-9)
    turned = Restricted(bodies.torus(5.0, 2.0), ((0.0, 1.0), (0.0, 0.5)))
    assert math.hypot(*area_centroid(turned).point) == pytest.approx((2 * 25 + 4) / (5 * math.pi), rel=1e-9)


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_patches_against_dense_triangles(seed):
    rng = np.random.default_rng(seed)
    patch = pieces.random_surface(rng, (3, 2), 10.0)
    line = np.linspace(0, 1, 301)
    p = patch.evaluate(line[:, None], line[None, :])
    corners = [
        np.stack(triangle) for triangle in ((p[:-1, :-1], p[1:, :-1], p[1:, 1:]), (p[:-1, :-1], p[1:, 1:], p[:-1, 1:]))
    ]
    both = np.concatenate([t.reshape(3, -1, 3) for t in corners], axis=1)
    normals = np.cross(both[1] - both[0], both[2] - both[0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    wanted = areas @ both.mean(axis=0) / areas.sum()
    assert np.abs(area_centroid(patch).point - wanted).max() < 1e-3
    assert np.abs(vector_area(patch) - normals.sum(axis=0)).max() < 1e-9 * areas.sum() + 1e-2


def test_the_vector_area_depends_on_the_boundary_alone():
    flat = Surface([[[x, y, 0] for y in (0, 1.5, 3)] for x in (0, 1, 2)], (0.3, 0.1), (-0.2, 0.4))
    points = flat.control_points.copy()
    points[1, 1] += (0.2, 0.1, 5)
    bulged = Surface(points, flat.gamma_u, flat.gamma_v)
    assert vector_area(flat) == pytest.approx([0, 0, 6], abs=1e-11)
    assert vector_area(bulged) == pytest.approx([0, 0, 6], abs=1e-11)


def test_splines_have_it_over_their_own_domain():
    net = [[[1, 0, 6], [1, 3, 6]], [[3, 0, 6], [3, 3, 6]]]
    sheet = BSplineSurface(net, [2, 6], [2, 2], 1, [-1, 4], [2, 2], 1)
    assert np.allclose(area_centroid(sheet).point, [2, 1.5, 6], rtol=0, atol=1e-12)
    assert np.allclose(vector_area(sheet), [0, 0, 6], rtol=0, atol=1e-12)


def test_what_has_none_is_refused():
    line = Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN)
    with pytest.raises(InputError, match="at least one surface, got none"):
        area_centroid([])
    with pytest.raises(InputError, match="d = 3, got d = 2"):
        area_centroid(Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN))
    with pytest.raises(InputError, match="its measure is 0"):
        area_centroid(Ruled(line, line))
    square = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    with pytest.raises(InputError, match="its measure is 0"):
        volume_centroid([square, Restricted(square, TURNED)])
