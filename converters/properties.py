"""Validation properties: what a file says of its shapes besides the shapes, for the system that reads it to compare.

They come from the exact shapes of a model, not from the splines that approximate them: area, volume, centre of gravity
and points that lie on the faces. `stated` makes them; ``gtcad.converters.stated_check`` holds them against a file.

References
----------
ISO 10303-41, property_definition; CAx Implementor Forum, Recommended Practices for Geometric and Assembly Validation
Properties, release 4.4, 2016.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gtcad._entries import ModelShape
from gtcad.centroids import Centroid, area_centroid, vector_area, volume_centroid
from gtcad.converters.part import Properties
from gtcad.measure import Estimate, area
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedSurface
from gtcad.solid import Solid

Array = NDArray[np.float64]

_RTOL = 1e-10
_TURNED = ((1.0, 0.0), (0.0, 1.0))
_WORST = 1e-6  # relative error of an integral that is not stated
_PLACES = (1 + np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])) / 2  # of the points on a face, in each direction


def stated(shape: ModelShape) -> Properties | None:
    """The properties of a surface, a quilt or a body without a wall, in mm; None of anything else.

    Areas are those of all faces, the caps of bodies included. The centre of gravity is that of the volume of a body,
    else that of the area. There are nine points for each patch. What converges too slowly to six digits is left out.
    """
    if isinstance(shape, Solid):
        return None if shape.thickness is not None else _of_body(shape)
    if isinstance(shape, Quilt):
        return _of_sheet(shape.patches) if shape.dimension == 3 else None
    if isinstance(shape, SeparableSurface):
        return _of_sheet((shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2)),))
    return None


def _of_sheet(patches: Sequence[SeparableSurface]) -> Properties:
    return Properties(_kept(_area(patches)), None, _point(area_centroid(patches, rtol=_RTOL)), _points(patches))


def _of_body(body: Solid) -> Properties:
    closed, patches = body.closed, body.quilt.patches
    outwards = [
        RestrictedSurface(patch, _TURNED) if turn else patch
        for patch, turn in zip(closed.patches, closed.flipped, strict=True)
    ]
    total = _area(patches)
    fans = iter(outwards[len(patches) :])  # of the caps, as many for each loop as it has sides
    for loop in body.loops if closed is not body.quilt else ():
        # the integral of the normal of a plane cap is its area, whatever the form of its boundary
        cap = float(np.linalg.norm(np.sum([vector_area(next(fans), rtol=_RTOL) for _ in loop], axis=0)))
        total = Estimate(total + cap, total.error + _RTOL * cap)
    volume = body.volume()
    if volume is None:
        return Properties(_kept(total), None, None, _points(patches))
    return Properties(_kept(total), _kept(volume), _point(volume_centroid(outwards, rtol=_RTOL)), _points(patches))


def _area(patches: Sequence[SeparableSurface]) -> Estimate:
    parts = [area(patch, rtol=_RTOL) for patch in patches]
    return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))


def _kept(value: Estimate) -> float | None:
    return float(value) if value.error <= _WORST * abs(value) else None


def _point(centre: Centroid) -> tuple[float, float, float] | None:
    if not centre.error <= _WORST * max(1.0, float(np.abs(centre.point).max())):
        return None
    x, y, z = (float(value) for value in centre.point)
    return x, y, z


def _points(patches: Sequence[SeparableSurface]) -> Array:
    found = [patch.evaluate(_PLACES[:, None], _PLACES[None, :]).reshape(-1, 3) for patch in patches]
    return np.concatenate(found)
