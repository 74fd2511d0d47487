"""Patches built from curves: one module for each kind, named like the kind and holding its class.

``gtcad.patches.ruled`` is the module, ``gtcad.patches.Ruled`` its class.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtcad._lazy import lazy_names

if TYPE_CHECKING:
    from gtcad.patches.coons import Coons as Coons
    from gtcad.patches.coons import coons_from_loop as coons_from_loop
    from gtcad.patches.developable import Developable as Developable
    from gtcad.patches.developable import Enveloping as Enveloping
    from gtcad.patches.developable import GeodesicDevelopable as GeodesicDevelopable
    from gtcad.patches.developable import PlaneFamily as PlaneFamily
    from gtcad.patches.developable import QuasiDevelopable as QuasiDevelopable
    from gtcad.patches.developable import SpineDevelopable as SpineDevelopable
    from gtcad.patches.developable import developability as developability
    from gtcad.patches.developable import geodesic_developable as geodesic_developable
    from gtcad.patches.developable import quasi_developable as quasi_developable
    from gtcad.patches.developable import spine_developable as spine_developable
    from gtcad.patches.lofted import Lofted as Lofted
    from gtcad.patches.minimal import Plateau as Plateau
    from gtcad.patches.minimal import dirichlet_extremal as dirichlet_extremal
    from gtcad.patches.minimal import fixed_contour as fixed_contour
    from gtcad.patches.minimal_area import area_bounds as area_bounds
    from gtcad.patches.minimal_area import least_area as least_area
    from gtcad.patches.minimal_study import minimal_patch as minimal_patch
    from gtcad.patches.minimal_study import minimal_table as minimal_table
    from gtcad.patches.rotation import Rotation as Rotation
    from gtcad.patches.ruled import Ruled as Ruled
    from gtcad.patches.ruled import cone as cone
    from gtcad.patches.ruled import cylinder as cylinder
    from gtcad.patches.sweep import Sweep as Sweep
    from gtcad.patches.sweep import sweep_parts as sweep_parts
    from gtcad.patches.swept import Swept as Swept
    from gtcad.patches.swung import Swung as Swung
    from gtcad.patches.tb_coons import TBCoons as TBCoons
    from gtcad.patches.tb_coons import tb_coons_extremal as tb_coons_extremal

__getattr__, __dir__, __all__ = lazy_names(
    __name__,
    {
        "Coons": "coons",
        "Developable": "developable",
        "Enveloping": "developable",
        "GeodesicDevelopable": "developable",
        "Lofted": "lofted",
        "PlaneFamily": "developable",
        "Plateau": "minimal",
        "QuasiDevelopable": "developable",
        "Rotation": "rotation",
        "Ruled": "ruled",
        "SpineDevelopable": "developable",
        "Sweep": "sweep",
        "Swept": "swept",
        "Swung": "swung",
        "TBCoons": "tb_coons",
        "area_bounds": "minimal_area",
        "cone": "ruled",
        "coons_from_loop": "coons",
        "cylinder": "ruled",
        "developability": "developable",
        "dirichlet_extremal": "minimal",
        "fixed_contour": "minimal",
        "geodesic_developable": "developable",
        "least_area": "minimal_area",
        "minimal_patch": "minimal_study",
        "minimal_table": "minimal_study",
        "quasi_developable": "developable",
        "spine_developable": "developable",
        "sweep_parts": "sweep",
        "tb_coons_extremal": "tb_coons",
    },
)
