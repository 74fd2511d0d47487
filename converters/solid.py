"""Solids from fitted quilts, with planar caps where these are wanted, and walls of a thickness."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gtcad.basis import BERNSTEIN
from gtcad.curve import Curve
from gtcad.errors import InputError, KernelError
from gtcad.factors import CurveOfTerms
from gtcad.measure import Estimate, volume
from gtcad.patches.ruled import Ruled
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt

if TYPE_CHECKING:
    from gtcad.converters.occt.shells import Cap, Shell
    from gtcad.converters.quilt_fit import QuiltFit

Caps = Literal["none", "planar"]
_RTOL = 1e-10  # of the kernel's volumes, which come with an estimate of their error


@dataclass(frozen=True, eq=False)
class Body:
    """A solid of the kernel and what is known of it.

    Attributes
    ----------
    shape
        TopoDS_Solid, valid by the kernel's own check, each edge in two faces or a seam; in mm.
    faces
        The kernel's faces by name, in order: those of the patches, then of what was added to close them.
    volume
        Of the kernel's solid, in mm^3.
    exact_volume
        Of the exact patches with the same caps, in mm^3.
    area
        Of the exact patches with the same caps, in mm^2.
    deviation
        Bound of the distance of the solid's boundary from the exact one, in mm. Proved as far as it comes from a fit,
        estimated by samples where the surfaces are offsets: see ``proved``.
    proved
        Whether the deviation is proved.
    """

    shape: Any
    faces: Mapping[str, Any]
    volume: float
    exact_volume: Estimate
    area: Estimate
    deviation: float
    proved: bool


def solid_of(fit: QuiltFit, *, caps: Caps = "none") -> Body:
    """The solid inside a closed quilt, or inside an open one and planar caps.

    Parameters
    ----------
    fit
        In mm.
    caps
        "planar": each loop of free edges is closed by a plane face, which shares these edges; they are called
        "cap 1", "cap 2", ... The loops must be plane within the fit's deviation.

    Returns
    -------
    Body
        With normals outwards, whichever way the patches have them.

    Raises
    ------
    InputError
        When the patches are not in space, free edges remain, a loop is not plane, the patches are more than one body,
        or they enclose nothing.
    KernelError
        When the kernel refuses a shape, or its volume is not the exact one within deviation times area.

    Notes
    -----
    That the surface does not cross itself is not tested.
    """
    if caps not in ("none", "planar"):
        raise InputError(f'caps must be "none" or "planar", got {caps!r}')
    quilt = fit.quilt
    _check_quilt(quilt)
    if caps == "none" and quilt.free:
        free = ", ".join(map(quilt.label, quilt.free))
        raise InputError(f"a solid needs a closed quilt, but these sides are free: {free}; caps can close plane loops")
    from gtcad.converters.occt.faces import volume as kernel_volume
    from gtcad.converters.occt.shells import edge_uses, make_solid

    shell, made = _closed_shell(fit, quilt.flipped)
    exact, area = _measured(quilt, quilt.flipped, made)
    if exact < 0:
        flipped = tuple(not flip for flip in quilt.flipped)
        shell, made = _closed_shell(fit, flipped)
        exact, area = _measured(quilt, flipped, made)
    deviation = max([fit.deviation[1], *(cap.flatness for cap in made)])
    if exact - exact.error <= deviation * area:
        raise InputError(f"the surface encloses no volume: {exact:.3g} mm^3 within {deviation * area:.3g} mm^3")
    solid = make_solid(shell)
    uses = edge_uses(solid)
    if not uses.closed:
        raise KernelError(f"the solid must have each edge in two faces, got {uses}")
    held = kernel_volume(solid, rtol=_RTOL)
    check_volume(held, exact, deviation * area)
    names = (*quilt.names, *_cap_names(quilt, len(made)))
    faces = MappingProxyType(dict(zip(names, shell.faces, strict=True)))
    return Body(solid, faces, float(held), exact, area, deviation, True)


def check_volume(held: Estimate, exact: Estimate, allowed: float) -> None:
    """Compare volumes in mm^3.

    Raises
    ------
    KernelError
        When the kernel's volume differs from the exact one by more than is allowed.
    """
    gap = abs(held - exact)
    if not gap <= allowed + held.error + exact.error:
        raise KernelError(
            f"the kernel's solid has the volume {float(held):.9g} mm^3, the exact surface {float(exact):.9g} mm^3: "
            f"{gap:.3g} mm^3 apart, allowed are {allowed:.3g} mm^3"
        )


def _check_quilt(quilt: Quilt) -> None:
    if quilt.patches[0].dimension != 3:
        raise InputError("a solid needs patches in space, d = 3, got d = 2")


def _cap_names(quilt: Quilt, count: int) -> list[str]:
    names = (f"cap {k}" for k in range(1, count + len(quilt.names) + 1))
    return [name for name in names if name not in quilt.names][:count]


def _closed_shell(fit: QuiltFit, flipped: tuple[bool, ...]) -> tuple[Shell, tuple[Cap, ...]]:
    from gtcad.converters.occt.shells import capped, make_shell, planar_caps

    shell = make_shell(fit.splines, fit.quilt.edges, flipped)
    caps: tuple[Cap, ...] = ()
    if shell.free:
        caps = planar_caps(shell, flatness=fit.deviation[1])
        shell = capped(shell, caps)
    return shell, caps


def _measured(quilt: Quilt, flipped: tuple[bool, ...], caps: tuple[Cap, ...]) -> tuple[Estimate, Estimate]:
    """Volume and area of the exact surface, of caps by the divergence theorem on the cone over their boundary."""
    origin = quilt.patches[0].evaluate(0.5, 0.5)
    volumes, areas = [], [quilt.area()]
    for patch, flip in zip(quilt.patches, flipped, strict=True):
        one = volume(patch, origin=origin)
        volumes.append(Estimate(-one if flip else one, one.error))
    for cap in caps:
        covered = _cap_area(quilt, cap)
        height = float((cap.centre - origin) @ cap.normal)
        volumes.append(Estimate(height * covered / 3, abs(height) * covered.error / 3))
        areas.append(covered)
    return _total(volumes), _total(areas)


def _cap_area(quilt: Quilt, cap: Cap) -> Estimate:
    """Three times the volume of the cone over the cap, of height 1."""
    parts = []
    for edge in cap.loop:
        boundary = _boundary(quilt.patches[edge.patch], edge.side)
        cone = Ruled(boundary, Curve(np.stack([cap.centre, cap.centre]), family=BERNSTEIN))
        one = volume(cone, origin=cap.centre - cap.normal)
        parts.append(Estimate(-3 * one if edge.ahead else 3 * one, 3 * one.error))
    return _total(parts)


def _boundary(patch: SeparableSurface, side: str) -> CurveOfTerms:
    across, along = (patch.factors_u, patch.factors_v) if side[0] == "u" else (patch.factors_v, patch.factors_u)
    row = across.rows(np.array([float(side[1])]))[:, 0]
    return CurveOfTerms(along, np.tensordot(row, patch.coefficients, (0, 0 if side[0] == "u" else 1)))


def _total(parts: list[Estimate]) -> Estimate:
    return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))
