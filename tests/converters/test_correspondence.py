"""What is proved of a figure and a piece at corresponding parameters, and what each may be off besides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve
from gtcad.conics import arc
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.analytic import quadric_of
from gtcad.converters.correspondence import Way, common_ranges, covers, part_way, whole_way
from gtcad.converters.exact import IDENTITY
from gtcad.converters.figures import Figure, figure_of, figure_of_part
from gtcad.converters.part import Part
from gtcad.converters.quadrics import Quadric
from gtcad.converters.spline_parts import part_of_curve
from gtcad.factors import SurfaceOfTerms
from gtcad.patches import Rotation, cylinder
from tests import pieces

SWING = Curve([[0, 0, 0], [30, 10, 5], [40, 40, 0]], (0.3, -0.2))
BARREL = Rotation(Curve([[20, 0, 0], [24, 0, 15], [20, 0, 30]], (0.1, 0.2)), (0, 0, 0), (0, 0, 1), 80)
PATCH = pieces.random_surface(np.random.default_rng(8), (3, 3), 40.0)


@pytest.mark.parametrize(
    ("figure", "spline"),
    [
        (figure_of(SWING), fit_curve(SWING, tolerance=1e-4).spline),
        (figure_of(PATCH), fit_surface(PATCH, tolerance=1e-4).spline),
        (figure_of(BARREL), fit_surface(BARREL, tolerance=1e-4).spline),
    ],
)
def test_what_either_may_be_off_widens_the_bounds(figure, spline):
    piece = Figure(replace(spline, control_points=spline.control_points + [0, 0, 1e-3]))
    plain = whole_way(figure, piece).certificate(1.0)
    assert 0 < plain.lower <= plain.upper < 5e-3
    off = plain.lower / 4
    for wide in (
        whole_way(replace(figure, rounding=off), piece).certificate(1.0),
        whole_way(figure, replace(piece, rounding=off)).certificate(1.0),
    ):
        assert wide.upper == pytest.approx(plain.upper + off, rel=1e-6)
        assert wide.lower == pytest.approx(plain.lower - off, rel=1e-6)


def test_what_an_analytic_piece_may_be_off_widens_the_upper_bound():
    tube = cylinder(arc([1, 2, 3], 5, 20, 80).pieces[0], (0, 0, 7))
    piece = figure_of_part(Part("", quadric_of(tube)))
    assert whole_way(figure_of(tube), piece).certificate(1.0).upper < 1e-11
    assert 0.25 <= whole_way(figure_of(tube), replace(piece, rounding=0.25)).certificate(1.0).upper < 0.26


QUADRICS = [
    Quadric("cylinder", [1, 2, 3], [1, 1, 1], [1, -1, 0], 17.3, 0.0, (0.1, 2.9), (-3.0, 11.0)),
    Quadric("cone", [0, 0, 1], [0, 1, 1], [1, 0, 0], 9.1, 0.3, (0.0, 6.0), (-2.0, 30.0)),
    Quadric("sphere", [-4, 0, 1], [2, 1, 1], [1, -2, 0], 33.3, 0.0, (0.3, 1.3), (-1.0, 0.5)),
    Quadric("torus", [5, 5, 5], [0, 0, 1], [1, 0, 0], 30.7, 7.1, (0.0, 6.2), (1.0, 4.0)),
]


@pytest.mark.parametrize("quadric", QUADRICS, ids=lambda quadric: quadric.kind)
def test_a_surface_computed_from_a_quadric_is_as_near_as_its_rounding_says(quadric):
    figure = figure_of_part(Part("", quadric))
    x = np.linspace(0.0, 1.0, 33)
    u, v = (first + (last - first) * x for first, last in (quadric.u_range, quadric.v_range))
    apart = figure.geometry.evaluate(x[:, None], x[None, :]) - quadric.evaluate(u[:, None], v[None, :])
    assert 0 < np.linalg.norm(apart, axis=-1).max() <= figure.rounding < 1e-11


class Approximate(SurfaceOfTerms):
    """Terms that are only near the surface that is meant."""

    @property
    def definition_error(self) -> float:
        return 0.25


def test_what_the_terms_of_a_surface_leave_out_is_in_the_bound():
    tube = cylinder(arc([1, 2, 3], 5, 20, 80).pieces[0], (0, 0, 7))
    meant = figure_of(Approximate(tube.factors_u, tube.factors_v, tube.coefficients))
    fitted = fit_surface(tube, tolerance=1e-6).spline
    analytic = figure_of_part(Part("", quadric_of(tube)))
    raised = figure_of(tube.transformed(np.eye(3), [0, 0, 1e-3]))
    for piece in (Figure(fitted), analytic, replace(analytic, source=None), raised):
        found = whole_way(meant, piece).certificate(1.0)
        assert found.lower == 0
        assert 0.25 <= found.upper < 0.26


def test_ranges_that_a_piece_seems_to_keep_are_dropped_where_they_do_not_fit():
    """A part over [0.2003, 0.7] that calls its ends 0.2 and 0.7: what would be 0.02 mm off."""
    curve = Curve([[0, 0, 0], [30, 10, 5], [40, 40, 0]], family=BERNSTEIN)
    spline, _ = part_of_curve(fit_curve(curve, tolerance=1e-9).spline, (0.2003, 0.7))
    way = part_way(figure_of(curve), Figure(replace(spline, knots=np.array([0.2, 0.7]))), 1e-4)
    np.testing.assert_allclose(way.ranges, [(0.2003, 0.7)], atol=1e-7)
    assert way.certificate(1e-4).upper < 1e-5
    kept, _ = part_of_curve(fit_curve(curve, tolerance=1e-9).spline, (0.2, 0.7))
    assert part_way(figure_of(curve), Figure(kept), 1e-4).ranges == ((0.2, 0.7),)


def test_ends_that_nearly_meet_are_made_one_and_those_at_the_border_reach_it():
    figure = figure_of(SWING)
    piece = Figure(fit_curve(SWING, tolerance=1e-3).spline)
    found = ((1e-6, 0.3), (0.6, 0.300002), (0.6, 1 - 1e-6))
    ways = [Way(figure, piece, (ends,), False, (IDENTITY,)) for ends in found]
    assert not covers(ways)
    joined = common_ranges(ways, lambda axis: 1e-5)
    first, second, third = (way.ranges[0] for way in joined)
    assert (first[0], third[1]) == (0.0, 1.0)
    assert first[1] == second[1] == pytest.approx(0.300001, abs=1e-12)
    assert second[0] == third[0] == 0.6
    assert covers(joined)
    assert not covers(joined[:2])
    assert not covers(joined[1:])
