"""Curvature combs as shapes of the kernel, for a viewer or an exchange file."""

from __future__ import annotations

from typing import Any

import numpy as np

from gtcad._jets import norm
from gtcad.combs import Comb
from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import kernel_guard, kernel_module, point

_BRep = kernel_module("BRep")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_TopoDS = kernel_module("TopoDS")

_SHORTEST = 1e-6  # mm: the kernel takes points nearer than 1e-7 for one


def comb_edges(comb: Comb) -> Any:
    """A curvature comb as a TopoDS_Compound: an edge for each tooth, and the envelope along the tips as wires.

    Parameters
    ----------
    comb
        In mm; combs of plane curves lie in z = 0.

    Returns
    -------
    TopoDS_Compound
        Straight edges from foot to tip, then the wires. Teeth shorter than 1e-6 mm and those without a finite tip are
        left out. The envelope ends where it would run along the curve or miss a tip; of a straight line nothing is
        left, and the compound is empty.

    Raises
    ------
    KernelError
        When the kernel refuses an edge.
    """
    builder = _BRep.BRep_Builder()
    compound = _TopoDS.TopoDS_Compound()
    builder.MakeCompound(compound)
    with kernel_guard("making the edges of a comb"):
        lengths = norm(comb.tips - comb.points)
        for foot, tip, length in zip(comb.points, comb.tips, lengths, strict=True):
            if length > _SHORTEST:
                builder.Add(compound, _BRepBuilderAPI.BRepBuilderAPI_MakeEdge(point(foot), point(tip)).Edge())
        closing = len(comb.envelope) - len(comb.tips)
        for line in _lines(comb.envelope, np.concatenate([lengths, lengths[:closing]])):
            polygon = _BRepBuilderAPI.BRepBuilderAPI_MakePolygon()
            for place in line:
                polygon.Add(point(place))
            builder.Add(compound, polygon.Wire())
    return compound


def _lines(envelope: Array, lengths: Array) -> list[Array]:
    """The parts of the envelope between tips that are missing, and without those whose teeth both have no length."""
    lines: list[list[Array]] = [[]]
    for k, tip in enumerate(envelope):
        off = lengths[max(k - 1, 0) : k + 2] > _SHORTEST  # NaN is not
        if not np.isfinite(tip).all() or not off.any():
            lines.append([])
        elif not lines[-1] or norm(tip - lines[-1][-1]) > _SHORTEST:
            lines[-1].append(tip)
    return [np.array(line) for line in lines if len(line) > 1]
