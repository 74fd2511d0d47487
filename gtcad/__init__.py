"""Generalized trigonometric Bezier curves and surfaces, and their way into CAD with a proved tolerance.

``import gtcad`` stays cheap: the names below are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtcad._lazy import lazy_names

if TYPE_CHECKING:
    from gtcad.basis import BERNSTEIN as BERNSTEIN
    from gtcad.basis import GT as GT
    from gtcad.basis import Basis as Basis
    from gtcad.basis import Family as Family
    from gtcad.composite import Composite as Composite
    from gtcad.curve import Curve as Curve
    from gtcad.errors import GtcadError as GtcadError
    from gtcad.model import Model as Model
    from gtcad.model import dump_model as dump_model
    from gtcad.model import load_model as load_model
    from gtcad.quilt import Quilt as Quilt
    from gtcad.restricted import Restricted as Restricted
    from gtcad.solid import Solid as Solid
    from gtcad.surface import Surface as Surface

    from . import combs as combs
    from . import conics as conics
    from . import continuity as continuity
    from . import converters as converters
    from . import design_variables as design_variables
    from . import differential as differential
    from . import extremes as extremes
    from . import flat_pattern as flat_pattern
    from . import flat_strip as flat_strip
    from . import fronts as fronts
    from . import interpolation as interpolation
    from . import measure as measure
    from . import objectives as objectives
    from . import offset as offset
    from . import optimize as optimize
    from . import patch_joins as patch_joins
    from . import patch_studies as patch_studies
    from . import patches as patches
    from . import pictures as pictures
    from . import queries as queries
    from . import surface_pictures as surface_pictures

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_names(
    __name__,
    {
        "BERNSTEIN": "basis",
        "GT": "basis",
        "Basis": "basis",
        "Composite": "composite",
        "Curve": "curve",
        "Family": "basis",
        "GtcadError": "errors",
        "Model": "model",
        "Quilt": "quilt",
        "Restricted": "restricted",
        "Solid": "solid",
        "Surface": "surface",
        "combs": "combs",
        "conics": "conics",
        "continuity": "continuity",
        "converters": "converters",
        "design_variables": "design_variables",
        "differential": "differential",
        "dump_model": "model",
        "extremes": "extremes",
        "flat_pattern": "flat_pattern",
        "flat_strip": "flat_strip",
        "fronts": "fronts",
        "interpolation": "interpolation",
        "load_model": "model",
        "measure": "measure",
        "objectives": "objectives",
        "offset": "offset",
        "optimize": "optimize",
        "patch_joins": "patch_joins",
        "patch_studies": "patch_studies",
        "patches": "patches",
        "pictures": "pictures",
        "queries": "queries",
        "surface_pictures": "surface_pictures",
    },
)
