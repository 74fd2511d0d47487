"""Patches built from curves: one module for each kind, named like the kind and holding its class.

``gtcad.patches.ruled`` is the module, ``gtcad.patches.Ruled`` its class.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtcad._lazy import lazy_names

if TYPE_CHECKING:
    from gtcad.patches.coons import Coons as Coons
    from gtcad.patches.coons import coons_from_loop as coons_from_loop
    from gtcad.patches.lofted import Lofted as Lofted
    from gtcad.patches.rotation import Rotation as Rotation
    from gtcad.patches.ruled import Ruled as Ruled
    from gtcad.patches.ruled import cone as cone
    from gtcad.patches.ruled import cylinder as cylinder
    from gtcad.patches.sweep import Sweep as Sweep
    from gtcad.patches.sweep import sweep_parts as sweep_parts
    from gtcad.patches.swept import Swept as Swept
    from gtcad.patches.swung import Swung as Swung

__getattr__, __dir__, __all__ = lazy_names(
    __name__,
    {
        "Coons": "coons",
        "Lofted": "lofted",
        "Rotation": "rotation",
        "Ruled": "ruled",
        "Sweep": "sweep",
        "Swept": "swept",
        "Swung": "swung",
        "cone": "ruled",
        "coons_from_loop": "coons",
        "cylinder": "ruled",
        "sweep_parts": "sweep",
    },
)
