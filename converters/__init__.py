"""From GT-Bezier shapes to B-splines, kernels, files and hosts; imported as ``gtcad.converters``."""

from __future__ import annotations

if __name__ != "gtcad.converters":
    raise ImportError(f"imported as {__name__!r}; import it as 'gtcad.converters'")

from gtcad._lazy import lazy_names

__getattr__, __dir__, __all__ = lazy_names(
    __name__,
    {
        "BSplineCurve": "bspline",
        "BSplineSurface": "bspline",
        "ChainFit": "chain",
        "Design": "design",
        "Fit": "fit",
        "arranged": "flat_outline",
        "draw_pattern": "flat_outline",
        "fit_chain": "chain",
        "fit_curve": "fit",
        "fit_developable": "developable_fit",
        "fit_offset": "offset",
        "fit_quilt": "quilt_fit",
        "fit_surface": "fit",
        "Body": "solid",
        "Mesh": "mesh",
        "QuiltFit": "quilt_fit",
        "mesh_surface": "mesh",
        "mesh_surfaces": "mesh",
        "nearest_chain": "design",
        "nearest_gt": "design",
        "read_brep": "brep",
        "read_iges": "iges",
        "read_step": "step",
        "solid_of": "solid",
        "thicken": "solid",
        "write_brep": "brep",
        "write_dxf": "flat",
        "write_iges": "iges",
        "write_mesh": "mesh",
        "write_step": "step",
        "write_svg": "flat",
    },
)
