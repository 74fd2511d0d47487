"""GT patches nearest to faces: one where that is enough, else a quilt of several.

Planes, cylinders, cones, spheres, tori and surfaces of extrusion or revolution are made of the curve that generates
them: exact where that is. Others are approximated by least squares at Chebyshev points, and the deviation is proved.
All lengths are in mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.composite import Composite
from gtcad.converters.arcs import curve_of_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.certificate import certify_surface
from gtcad.converters.host_designs import DEFAULT_TOLERANCE, design_of, host_shape
from gtcad.converters.part import EllipseArc
from gtcad.converters.spline_parts import part_of_surface, reversed_surface
from gtcad.curve import Curve
from gtcad.errors import InputError, ToleranceNotMet
from gtcad.patches import Rotation, cylinder
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve
from gtcad.surface import Surface

if TYPE_CHECKING:
    from gtcad.converters.occt.generated import Generated

Array = NDArray[np.float64]
Pair = tuple[float, float]

_MOST_DEGREE, _PART_DEGREE, _MOST_PATCHES = 16, 7, 256


@dataclass(frozen=True, eq=False)
class FaceDesign:
    """A GT patch made for a face, or several.

    Attributes
    ----------
    surface
        With the normal of the face. A ``Surface``, a ``Rotation`` or a ``Ruled`` patch; a ``Quilt`` of such where one
        is not enough.
    deviation
        (lower, upper) in mm, at equal parameters: the lower one is attained, the upper one proved.
    """

    surface: SeparableSurface | Quilt
    deviation: tuple[float, float]

    @property
    def patches(self) -> tuple[SeparableSurface, ...]:
        """The patch, or those of the quilt."""
        return self.surface.patches if isinstance(self.surface, Quilt) else (self.surface,)


def design_from_face(
    face: Any, *, tolerance: float = DEFAULT_TOLERANCE, max_degree: int = _MOST_DEGREE, untrimmed: bool = False
) -> FaceDesign:
    """The GT patch of the least degrees found within a tolerance of a face, or a quilt of patches.

    Parameters
    ----------
    face
        A face of build123d or CadQuery, or a TopoDS_Face; whole turns are welcome.
    tolerance
        Largest deviation allowed, in mm.
    max_degree
        Largest degree of each direction, 2 to 40.
    untrimmed
        Whether to take all of the surface under a face that is only a part of it.

    Raises
    ------
    InputError
        When the face is trimmed and that is not allowed, or an argument is out of its range.
    ToleranceNotMet
        When neither one patch nor 256 of them keep the tolerance.
    KernelError
        When the surface has no exact rational form.

    Notes
    -----
    Patches of a quilt of Surfaces join G1 where the face is smooth and ``max_degree`` is at least 3.
    """
    from gtcad.converters.occt.compat import kernel_guard, kernel_module
    from gtcad.converters.occt.generated import generated
    from gtcad.converters.occt.pieces import face_geometry

    if not 2 <= max_degree <= 40:
        raise InputError(f"max_degree must lie in [2, 40], got {max_degree!r}")
    if not tolerance > 0:
        raise InputError(f"tolerance must be above 0, got {tolerance!r}")
    shape = host_shape(face, "FACE")
    with kernel_guard("the surface of a face"):
        spline, kind, trimmed = face_geometry(shape)
        form = generated(shape)
    if trimmed and not untrimmed:
        raise InputError(f"the face is a trimmed part of its {kind}: untrimmed=True fits all of that")
    turned = shape.Orientation() == kernel_module("TopAbs").TopAbs_REVERSED
    if form is not None:
        return _from_form(form, tolerance, turned)
    if turned:
        spline = reversed_surface(spline.transposed()).transposed()
    return _single(spline, tolerance, max_degree) or _several(spline, tolerance, max_degree)


# --- faces that a curve generates -------------------------------------------------------------------------------------


def _from_form(form: Generated, tolerance: float, turned: bool) -> FaceDesign:
    curves, deviation = _generating(form.curve, tolerance)
    patches = [_generated(form, _reversed(curve) if turned else curve) for curve in curves]
    rounding = 64 * UNIT_ROUNDOFF * max(float(np.abs(patch.coefficients).max()) for patch in patches)
    bounds = max(0.0, deviation[0] - rounding), deviation[1] + rounding
    return FaceDesign(patches[0] if len(patches) == 1 else Quilt.recognised(patches), bounds)


def _generating(curve: BSplineCurve | EllipseArc, tolerance: float) -> tuple[tuple[SeparableCurve, ...], Pair]:
    """GT curves for the curve, and their deviation; of a long arc all of it as one, so that the face is one too."""
    if isinstance(curve, EllipseArc) and curve.end - curve.start > math.pi / 2 * (1 + 1e-12):
        return (curve_of_arc(curve),), (0.0, 0.0)
    design = design_of(curve, tolerance=tolerance)
    return (design.curve.pieces if isinstance(design.curve, Composite) else (design.curve,)), design.deviation


def _reversed(curve: SeparableCurve) -> SeparableCurve:
    return curve.reversed() if isinstance(curve, Curve | RestrictedCurve) else RestrictedCurve(curve, (1.0, 0.0))


def _generated(form: Generated, curve: SeparableCurve) -> SeparableSurface:
    if form.point is not None:
        return Rotation(curve, form.point, form.vector, form.angle_deg)
    if not isinstance(curve, Curve):
        return cylinder(curve, form.vector)
    points = curve.control_points
    return Surface(
        np.stack([points, points + form.vector], axis=1), curve.gamma, family_u=curve.family, family_v=BERNSTEIN
    )


# --- one patch --------------------------------------------------------------------------------------------------------


def _single(spline: BSplineSurface, tolerance: float, most: int) -> FaceDesign | None:
    """One patch of the least degrees that keep the tolerance; None when none does."""
    for degrees in _degrees(spline, tolerance, most):
        surface = nearest_patch(spline, degrees)
        proved = certify_surface(surface, spline, limit=tolerance)
        if proved.upper <= tolerance:
            return FaceDesign(surface, (proved.lower, proved.upper))
    return None


def _degrees(spline: BSplineSurface, tolerance: float, most: int) -> list[tuple[int, int]]:
    """Pairs of degrees, both enough by their samples for half the tolerance each, and then higher ones."""
    found = []
    for along in (spline, spline.transposed()):
        gaps = (_gap(along, degree, 0) for degree in range(2, most + 1))
        degree, gap = next(
            ((n, gap) for n, gap in enumerate(gaps, 2) if gap <= tolerance / 2), (most, _gap(along, most, 0))
        )
        if gap > 2 * tolerance:
            return []
        found.append(degree)
    m, n = found
    return [(min(m + k, most), min(n + k, most)) for k in range(most - min(m, n) + 1)]


def _gap(spline: BSplineSurface, degree: int, order: int) -> float:
    """How far lines along u are from their fits, at samples."""
    x = np.linspace(0.0, 1.0, 65)
    points = _data(spline, x, np.linspace(0.0, 1.0, 9), (order, 0))
    fits = np.einsum("ij,jkd->ikd", Basis(degree).evaluate(x) @ fitting(degree, x, order), points)
    return float(np.linalg.norm(fits - points[: len(x)], axis=-1).max())


def fitting(degree: int, x: Array, order: int = 0) -> Array:
    """The matrix from what is known of a function to control points: least squares with the ends kept.

    Parameters
    ----------
    degree
        At least 2 order + 1.
    x
        Where values are known, both ends among them.
    order
        Up to which derivatives are kept at the ends: 1..order at 0, then those at 1, follow the values.
    """
    basis, last, count = Basis(degree), len(x) - 1, order + 1
    values = basis.evaluate(x)
    matrix = np.zeros((degree + 1, len(x) + 2 * order))
    ends = (0.0, 0, slice(0, count)), (1.0, last, slice(degree - order, degree + 1))
    for t, place, known in ends:
        rows = np.array([basis.derivative(np.array(t), k)[known] for k in range(count)])
        derivatives = range(len(x), len(x) + order) if t == 0 else range(len(x) + order, len(x) + 2 * order)
        matrix[known, [place, *derivatives]] = np.linalg.inv(rows)
    for row, place in ((0, 0), (degree, last)):  # the ends themselves, to the last digit
        matrix[row] = np.arange(matrix.shape[1]) == place
    inner, free = slice(1, last), slice(count, degree + 1 - count)
    if degree + 1 > 2 * count:
        rest = -values[inner] @ matrix
        rest[:, inner] += np.eye(last - 1)
        matrix[free] = np.linalg.pinv(values[inner, free]) @ rest
    return matrix


def nearest_patch(spline: BSplineSurface, degrees: tuple[int, int], order: int = 0) -> Surface:
    """Least squares at Chebyshev points; corners and the fits of the sides are kept, whatever the other direction."""
    x, y = ((1 - np.cos(np.linspace(0, np.pi, 4 * degree + 9))) / 2 for degree in degrees)
    points = _data(spline, x, y, (order, order))
    rows, columns = fitting(degrees[0], x, order), fitting(degrees[1], y, order)
    return Surface(np.einsum("ia,jb,abd->ijd", rows, columns, points, optimize=True))


def _data(spline: BSplineSurface, x: Array, y: Array, orders: tuple[int, int]) -> Array:
    """Points, followed by derivatives at both ends, in each direction; parameters on [0, 1]."""
    (u0, u1), (v0, v1) = spline.domain
    u, v = _places(x, orders[0]), _places(y, orders[1])
    result = np.empty((len(u), len(v), 3))
    for a, b in product(range(orders[0] + 1), range(orders[1] + 1)):
        rows, columns = ([k for k, (_, d) in enumerate(one) if d == r] for one, r in ((u, a), (v, b)))
        at_u = u0 + (u1 - u0) * np.array([u[k][0] for k in rows])
        at_v = v0 + (v1 - v0) * np.array([v[k][0] for k in columns])
        derived = spline.derivative(at_u[:, None], at_v[None, :], (a, b))
        result[np.ix_(rows, columns)] = derived * (u1 - u0) ** a * (v1 - v0) ** b
    return result


def _places(x: Array, order: int) -> list[tuple[float, int]]:
    ends = [(end, k) for end in (0.0, 1.0) for k in range(1, order + 1)]
    return [*((float(one), 0) for one in x), *ends]


# --- several patches --------------------------------------------------------------------------------------------------


def _several(spline: BSplineSurface, tolerance: float, most: int) -> FaceDesign:
    """A grid of patches of one degree, cut where the spline has corners and then where a patch misses the tolerance."""
    degree = min(most, _PART_DEGREE)
    order = 1 if degree >= 3 else 0
    lines = [_corners(spline), _corners(spline.transposed())]
    found: dict[tuple[Pair, Pair], tuple[Surface, float, float]] = {}
    while True:
        cells = list(product(pairwise(lines[0]), pairwise(lines[1])))
        if len(cells) > _MOST_PATCHES:
            least = max(upper for _, _, upper in found.values())
            raise ToleranceNotMet(tolerance, least, len(found), f"more than {_MOST_PATCHES} patches would be needed")
        for cell in cells:
            if cell not in found:
                found[cell] = _cell(spline, cell, degree, order, tolerance)
        missed = [cell for cell in cells if found[cell][2] > tolerance]
        if not missed:
            break
        for cell in missed:
            _halve(spline, cell, degree, order, lines)
    patches, lower, upper = zip(*(found[cell] for cell in cells), strict=True)
    return FaceDesign(Quilt.recognised(patches) if len(patches) > 1 else patches[0], (max(lower), max(upper)))


def _corners(spline: BSplineSurface) -> list[float]:
    """Where the spline may be less than C1 along u, with both ends; in its own parameter."""
    least = spline.degree_u
    return [float(x) for x, m in zip(spline.knots_u, spline.multiplicities_u, strict=True) if m >= least]


def _cell(
    spline: BSplineSurface, cell: tuple[Pair, Pair], degree: int, order: int, tolerance: float
) -> tuple[Surface, float, float]:
    part, slack = part_of_surface(spline, cell)
    surface = nearest_patch(part, (degree, degree), order)
    proved = certify_surface(surface, part, limit=tolerance)
    return surface, max(0.0, proved.lower - slack), proved.upper + slack


def _halve(spline: BSplineSurface, cell: tuple[Pair, Pair], degree: int, order: int, lines: list[list[float]]) -> None:
    """Cut the lines of the grid across the direction, or both, in which a cell is worse."""
    part, _ = part_of_surface(spline, cell)
    gaps = _gap(part, degree, order), _gap(part.transposed(), degree, order)
    for direction, knots in enumerate((spline.knots_u, spline.knots_v)):
        if gaps[direction] >= max(gaps) / 4:
            place = _middle(knots, *cell[direction])
            lines[direction] = sorted({*lines[direction], place})


def _middle(knots: Array, a: float, b: float) -> float:
    """The knot nearest to the middle, unless there is none in the inner half."""
    middle = (a + b) / 2
    nearest = float(knots[np.abs(knots - middle).argmin()])
    return nearest if abs(nearest - middle) <= (b - a) / 4 else middle
