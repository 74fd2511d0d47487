"""What samples tell when the search from them ends too far away: subdivision has the last word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.converters import estimates
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.figures import Figure, figure_of

LINE = figure_of(Curve([[0, 0, 0], [10, 0, 0]], family=BERNSTEIN))


def piece(first: float, last: float) -> Figure:
    return Figure(BSplineCurve([[first, 0, 0], [last, 0, 0]], [0, 1], [2, 2], 1))


@pytest.fixture
def _short_sighted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search from the figure that ends 1 mm too far away."""
    nearest = estimates.nearest_of

    def found(*args):
        result = nearest(*args)
        return replace(result, distances=result.distances + 1.0)

    monkeypatch.setattr(estimates, "nearest_of", found)


@pytest.mark.usefixtures("_short_sighted")
@pytest.mark.parametrize(
    ("pieces", "verdict"),
    [
        ((piece(0, 10),), "estimated"),
        ((piece(0, 6), piece(6, 10)), "estimated"),  # each sample is near one of the two only
        ((piece(0, 5), piece(6, 10)), "failed"),
        ((piece(0, 9),), "failed"),
    ],
)
def test_subdivision_corrects_a_search_that_ends_too_far_away(pieces, verdict):
    found = estimates.estimated(LINE, pieces, 0.01)
    assert found.verdict == verdict
    assert (found.distances.max() <= 0.01) == (verdict == "estimated")


@pytest.mark.usefixtures("_short_sighted")
def test_where_subdivision_cannot_tell_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Figure, "is_farther", lambda self, point, length: None)
    assert estimates.estimated(LINE, (piece(0, 10),), 0.01).verdict == "undecided"


def spiked(place: float, axis: int | None = None) -> Figure:
    """Along the line, or on a strip over it, with a spike of 1 mm in spans that equal samples pass by."""
    knots = [0, place - 1e-5, place, place + 1e-5, 1]
    x, height = 10 * np.array(knots), np.array([0, 0, 1, 0, 0])
    rows = np.column_stack([x, 0 * x, height])
    if axis is None:
        return Figure(BSplineCurve(rows, knots, [2, 1, 1, 1, 2], 1))
    points = np.stack([rows, rows + [0, 5, 0]], axis=1)
    spline = BSplineSurface(points, knots, [2, 1, 1, 1, 2], 1, [0, 1], [2, 2], 1)
    return Figure(spline if axis == 0 else spline.transposed())


@pytest.mark.parametrize("place", [0.3111, 0.5, 0.9973])
def test_spikes_in_narrow_spans_are_seen(place):
    strip = figure_of(
        Surface([[[0, 0, 0], [0, 5, 0]], [[10, 0, 0], [10, 5, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    )
    for figure, piece in ((LINE, spiked(place)), (strip, spiked(place, 0)), (strip, spiked(place, 1))):
        for found in (estimates.estimated(figure, (piece,), 0.01), estimates.estimated(piece, (figure,), 0.01)):
            assert found.verdict == "failed"
            assert 0.5 <= found.distances.max() <= 1.0


def test_equal_spans_are_seen_by_the_samples_as_they_are():
    knots = np.linspace(2.0, 5.0, 12)
    curve = BSplineCurve(np.zeros((12, 3)), knots, [2, *[1] * 10, 2], 1)
    assert len(Figure(curve).passed_by(257)) == 0
    assert Figure(curve).passed_by(13).shape == (0, 1)


def test_the_worst_place_is_looked_at_more_closely():
    """A tent whose top lies between the samples, in the middle of the middles between them."""
    top = (256 + 0.5) / 512
    tent = Figure(BSplineCurve([[0, 0, 0], [10 * top, 0, 1], [10, 0, 0]], [0, top, 1], [2, 1, 2], 1))
    assert estimates.estimated(LINE, (tent,), 0.01).distances.max() == pytest.approx(1.0, abs=1e-4)
