"""What all kinds of patches have in common."""

from __future__ import annotations

import abc
import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, WithIsoparametrics
from gtcad.protocol import Factors, SeparableCurve, affine

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Rows = tuple[tuple[float, ...], ...]

_SIMILAR = 1e-14  # how far a matrix may be from a similarity by rounding
LINEAR = Basis(1, family=BERNSTEIN)  # 1 - v and v


class Patch(WithIsoparametrics):
    """A patch that is kept as what it was built from, and evaluated as a surface of terms."""

    @abc.abstractmethod
    def _built(self) -> SurfaceOfTerms:
        """The terms of the patch."""

    @cached_property
    def terms(self) -> SurfaceOfTerms:
        """The patch as a general surface."""
        return self._built()

    @property
    def factors_u(self) -> Factors:
        """The functions of u."""
        return self.terms.factors_u

    @property
    def factors_v(self) -> Factors:
        """The functions of v."""
        return self.terms.factors_v

    @property
    def coefficients(self) -> Array:
        """Their coefficients, shape (count_u, count_v, d)."""
        return self.terms.coefficients


def checked_curves(**curves: SeparableCurve) -> None:
    """Check arguments by name.

    Raises
    ------
    InputError
        When one is no curve of the protocol, or their dimensions differ.
    """
    for name, curve in curves.items():
        if not isinstance(curve, SeparableCurve):
            raise InputError(f"{name} must be a curve, got {type(curve).__name__}")
    dimensions = [curve.dimension for curve in curves.values()]
    if len(set(dimensions)) > 1:
        raise InputError(f"{' and '.join(curves)} must have one dimension, got {dimensions}")


def in_space(curve: SeparableCurve) -> SeparableCurve:
    """The curve itself, or a plane one at z = 0."""
    return curve if curve.dimension == 3 else curve.transformed(np.eye(3, 2))


def checked_vector(name: str, value: ArrayLike) -> Vector:
    """Three finite numbers.

    Raises
    ------
    InputError
        When it is anything else.
    """
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} must be three finite numbers, got {value!r}")
    x, y, z = (vector + 0.0).tolist()
    return x, y, z


def checked_direction(name: str, value: ArrayLike) -> Vector:
    """Three finite numbers, not all 0.

    Raises
    ------
    InputError
        When it is anything else.
    """
    vector = checked_vector(name, value)
    if not any(vector):
        raise InputError(f"{name} must not be zero, got {vector}")
    return vector


def checked_number(name: str, value: float) -> float:
    """A finite number as a float.

    Raises
    ------
    InputError
        When it is anything else.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{name} must be a finite number, got {value!r}")
    return number + 0.0


def checked_placement(placement: ArrayLike | None) -> Rows | None:
    """The rows of an affine map ``[matrix | translation]``, shape (2 or 3, 4); None as it is.

    Raises
    ------
    InputError
        When it is anything else.
    """
    if placement is None:
        return None
    try:
        rows = np.asarray(placement, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.shape not in ((2, 4), (3, 4)) or not np.isfinite(rows).all():
        raise InputError(f"placement must be rows [matrix | translation], shape (2 or 3, 4), got {placement!r}")
    return tuple(tuple(row) for row in (rows + 0.0).tolist())


def followed(placement: Rows | None, matrix: ArrayLike, translation: ArrayLike | None) -> Rows:
    """The placement, then the affine map."""
    columns = (np.eye(3, 4) if placement is None else np.array(placement)).T
    linear, offset = affine(columns[:3], matrix, None), affine(columns[3], matrix, translation)
    return tuple(tuple(row) for row in np.column_stack([linear.T, offset]).tolist())


def placed(terms: SurfaceOfTerms, placement: Rows | None) -> SurfaceOfTerms:
    """The surface where its placement puts it."""
    if placement is None:
        return terms
    rows = np.array(placement)
    return terms.transformed(rows[:, :3], rows[:, 3])


def placed_error(placement: Rows | None, error: float, size: float) -> float:
    """What becomes of a bound of a distance between points up to a size by a placement, its rounding included."""
    if placement is None:
        return error
    matrix, offset = np.array(placement)[:, :3], np.array(placement)[:, 3]
    moved = float(np.linalg.norm(matrix)) * size + float(np.linalg.norm(offset))
    return float(np.linalg.norm(matrix, 2)) * error + 8 * UNIT_ROUNDOFF * moved


def handedness(matrix: ArrayLike, tolerance: float = _SIMILAR) -> int:
    """1 or -1, the sign of the determinant, for the matrix of a similarity of space; 0 for any other.

    The tolerance is relative: images of exact shapes need all digits, what is measured afterwards fewer.
    """
    linear = np.asarray(matrix, dtype=np.float64)
    if linear.shape != (3, 3) or not np.isfinite(linear).all():
        return 0
    squares = linear.T @ linear
    size = float(np.trace(squares)) / 3
    if size == 0 or np.abs(squares - size * np.eye(3)).max() > tolerance * size:
        return 0
    return 1 if np.linalg.det(linear) > 0 else -1
