"""Developable patches: enveloped by planes, tangent to a spine, or rectifying along a geodesic.

Each is a ruled patch ``S(u, v) = (1 - v) a(u) + v b(u)`` with one tangent plane along each ruling, so that it can be
made of a flat sheet without stretching.
"""

from __future__ import annotations

from gtcad.patches._along_curves import GeodesicDevelopable as GeodesicDevelopable
from gtcad.patches._along_curves import SpineDevelopable as SpineDevelopable
from gtcad.patches._along_curves import geodesic_developable as geodesic_developable
from gtcad.patches._along_curves import spine_developable as spine_developable
from gtcad.patches._developable import Developable as Developable
from gtcad.patches._developable import Ruling as Ruling
from gtcad.patches._enveloping import Enveloping as Enveloping
from gtcad.patches._plane_family import PlaneFamily as PlaneFamily
from gtcad.patches._developability import Developability as Developability
from gtcad.patches._developability import developability as developability
