"""Developable patches: enveloped by planes, tangent to a spine, rectifying along a geodesic, or nearly so.

Each is a ruled patch ``S(u, v) = (1 - v) a(u) + v b(u)`` with one tangent plane along each ruling, so that it can be
made of a flat sheet without stretching. ``developability`` tells how near any ruled patch is to that.
"""

from __future__ import annotations

from gtcad.patches._along_curves import (
    GeodesicDevelopable,
    SpineDevelopable,
    geodesic_developable,
    spine_developable,
)
from gtcad.patches._developability import Developability, developability
from gtcad.patches._developable import Developable, Ruling
from gtcad.patches._enveloping import Enveloping
from gtcad.patches._plane_family import PlaneFamily
from gtcad.patches._quasi import QuasiDevelopable, quasi_developable

__all__ = [
    "Developability",
    "Developable",
    "Enveloping",
    "GeodesicDevelopable",
    "PlaneFamily",
    "QuasiDevelopable",
    "Ruling",
    "SpineDevelopable",
    "developability",
    "geodesic_developable",
    "quasi_developable",
    "spine_developable",
]
