"""Proofs with parameters that slide, on splines that were made to slide, against nearest points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from gtcad.converters.approximation import Bundle
from gtcad.converters.sliding import certify_slid
from gtcad.converters.spline_basis import Knots
from gtcad.patches import Ruled, cone, cylinder
from tests.patches.developables import distances, regular_patches
from tests.patches.kinds import OTHER, QUARTER, WAVE

KNOTS = Knots.smooth(np.linspace(0, 1, 49), 5)
T = np.linspace(0, 1, 101)
DEVELOPABLES = [*regular_patches(3), cylinder(QUARTER, [10, 5, 50])]


def bundle_of(patch):
    rows = patch.factors_v.rows(np.array([0.0, 1.0]))
    return Bundle(patch.factors_u, np.einsum("ijd,jk->ikd", patch.coefficients, rows))


def slid(bundle, ahead):
    """Poles of splines through a(u + ahead_0 u (1 - u)) and b(u + ahead_1 u (1 - u))."""
    t = (1 - np.cos(np.linspace(0, math.pi, 2001))) / 2
    rows = [
        np.einsum("ft,fd->td", bundle.factors.rows(t + one * t * (1 - t)), bundle.vectors[:, side])
        for side, one in enumerate(ahead)
    ]
    poles = np.stack([make_lsq_spline(t, row, KNOTS.flat, 5).c for row in rows], axis=1)
    poles[[0, -1]] = np.stack([row[[0, -1]] for row in rows], axis=1)
    return poles


def measured(bundle, poles):
    """The largest distance of points of the spline from the patch."""
    from scipy.interpolate import BSpline

    def boundaries(t, order):
        return np.moveaxis(np.einsum("ft,fkd->tkd", bundle.factors.rows(t, order), bundle.vectors), 1, 0)

    a, b = np.moveaxis(BSpline(KNOTS.flat, poles, 5)(T), 1, 0)
    return max(distances(a + v * (b - a), T, v, boundaries)[0].max() for v in (0, 0.2, 0.4, 0.5, 0.6, 0.8, 1))


@pytest.mark.parametrize("ahead", [(2e-3, 2e-3), (2e-3, -2e-3), (0, 4e-3), (-3e-3, 1e-3)])
@pytest.mark.parametrize("patch", DEVELOPABLES)
def test_rulings_whose_ends_slide_differently(patch, ahead):
    bundle = bundle_of(patch)
    poles = slid(bundle, ahead)
    found, proved = measured(bundle, poles), certify_slid(bundle, KNOTS, poles, 1.0, 0.0)
    assert found <= proved.upper
    assert proved.lower <= proved.upper
    assert proved.slide == pytest.approx(max(map(abs, ahead)) / 4, rel=0.05)
    assert proved.upper <= 2 * math.pi**2 * 400 * proved.slide**2  # of second order, at a size of 100
    if ahead[0] != ahead[1]:
        assert found > 5e-6
        assert proved.lower > 0.9 * found


def test_a_cone_slides_with_its_apex():
    bundle = bundle_of(cone(QUARTER, [0, 0, 50]))
    poles = slid(bundle, (3e-3, 0))
    proved = certify_slid(bundle, KNOTS, poles, 1.0, 0.0)
    assert measured(bundle, poles) < 1e-8
    bend = np.linalg.norm(QUARTER.derivative(T, 2), axis=-1).max()
    assert proved.upper <= 1.01 * proved.slide**2 * bend  # what is across, and as much for the slide
    assert proved.slide == pytest.approx(7.5e-4, rel=0.02)


def test_a_patch_that_twists_is_left_at_first_order():
    bundle = bundle_of(Ruled(WAVE, OTHER))
    poles = slid(bundle, (2e-3, -2e-3))
    found, proved = measured(bundle, poles), certify_slid(bundle, KNOTS, poles, 1.0, 0.0)
    assert found <= proved.upper
    assert found > 1e-3
    assert proved.lower >= 0.5 * found
