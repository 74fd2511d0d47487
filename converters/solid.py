"""Solids from fitted quilts, with planar caps where these are wanted, and walls of a thickness."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gtcad.basis import BERNSTEIN
from gtcad.converters.folds import check_fold, crease
from gtcad.converters.wall import SMOOTH, wall, wall_volume
from gtcad.curve import Curve
from gtcad.errors import InputError, KernelError
from gtcad.factors import CurveOfTerms
from gtcad.measure import Estimate, volume
from gtcad.patches.ruled import Ruled
from gtcad.protocol import SeparableSurface, checked_kind, checked_tolerance
from gtcad.quilt import Quilt

if TYPE_CHECKING:
    from gtcad.converters.occt.caps import Cap
    from gtcad.converters.occt.shells import Shell
    from gtcad.converters.quilt_fit import QuiltFit

Caps = Literal["none", "planar"]
_RTOL = 1e-10  # of the kernel's volumes, which come with an estimate of their error
_AREA_RTOL = 1e-6  # of the kernel's areas


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
        Of the exact patches with the same caps, or of the exact wall, in mm^3; None where it is not known.
    area
        Of the exact patches with the same caps, or of the faces of a wall, in mm^2.
    deviation
        Bound of the distance of the solid's boundary from the exact one, in mm. Proved as far as it comes from a fit,
        estimated by samples where the surfaces are offsets.
    proved
        Whether the deviation is proved.
    """

    shape: Any
    faces: Mapping[str, Any]
    volume: float
    exact_volume: Estimate | None
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
    _check_fit(fit)
    _check_quilt(fit.quilt, caps)
    return _solid(fit, _oriented(fit))


def thicken(fit: QuiltFit, thickness: float, *, tolerance: float, caps: Caps = "none") -> Body:
    """The wall between a quilt and its offset: of an open quilt a sheet, of a closed one a hollow body.

    Parameters
    ----------
    fit
        In mm.
    thickness
        In mm, not 0: positive along the normals, negative against them. Those of a body that is closed, by caps too,
        point outwards, those of an open quilt as ``quilt.flipped`` says.
    tolerance
        Largest distance of the offset's faces from the exact offset, in mm.
    caps
        As of ``solid_of``: with "planar" an open quilt becomes a hollow body, not a sheet.

    Returns
    -------
    Body
        Without creases between patches the offset is fitted from the exact normals; its faces are called after their
        patches, "... offset", and those at free sides "... rim". With creases (all planar caps have them) the body must
        be closed, and the offset is the kernel's, rounded where faces part; its faces are called "offset 1", ...

    Raises
    ------
    InputError
        When an argument is out of its range, or the wall folds: with the place and the limit. When the quilt is open
        and has a crease, with the place. And as ``solid_of``.
    ToleranceNotMet
        When an offset cannot be fitted within the tolerance.
    KernelError
        When the kernel refuses a shape, its volume is not that of the exact wall within deviation times area, or its
        offset of a body with creases is not at the distance.

    Notes
    -----
    Folds are looked for with the exact curvatures of the patches, by dense samples and a search around the best: the
    limit is estimated, and a margin of 1 % is kept. Not tested is whether parts of the wall that are far from each
    other on the surface meet in space. Of offsets over creases only samples are tested, and no volume.
    """
    _check_fit(fit)
    checked_tolerance(tolerance)
    if not 0 < abs(_number(thickness)) < math.inf:
        raise InputError(f"thickness must be a finite number of mm other than 0, got {thickness!r}")
    quilt = fit.quilt
    _check_quilt(quilt, caps, open_too=True)
    if quilt.free and caps == "planar":
        closed = _oriented(fit)
        check_fold(quilt, thickness, closed.flipped)
        return _hollow(_solid(fit, closed), thickness, tolerance)
    check_fold(quilt, thickness, quilt.flipped)
    place = crease(quilt, SMOOTH * tolerance / abs(thickness))
    if place is None:
        return _smooth_wall(fit, thickness, tolerance)
    if quilt.free:
        raise InputError(f"an open quilt with a crease cannot be thickened: it has one {place}")
    return _hollow(_solid(fit, _oriented(fit)), thickness, tolerance)


def _check_fit(fit: object) -> None:
    from gtcad.converters.quilt_fit import QuiltFit

    checked_kind("fit", fit, QuiltFit, "a QuiltFit, as fit_quilt makes of a quilt")


def _number(value: Any) -> float:
    """NaN for what is no number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _smooth_wall(fit: QuiltFit, thickness: float, tolerance: float) -> Body:
    from gtcad.converters.occt.faces import area
    from gtcad.converters.occt.shells import make_shell, make_solid

    made = wall(fit, thickness, tolerance)
    shells = [make_shell(skin.splines, skin.edges, skin.flipped) for skin in made.skins]
    solid = make_solid(*shells)
    names = [name for skin in made.skins for name in skin.names]
    faces = dict(zip(names, (face for shell in shells for face in shell.faces), strict=True))
    surface = Estimate(value := math.fsum(map(area, faces.values())), _AREA_RTOL * value)
    exact = wall_volume(fit.quilt, thickness)
    held = _checked_volume(solid, exact, made.deviation * surface)
    return Body(solid, MappingProxyType(faces), held, exact, surface, made.deviation, False)


def _hollow(body: Body, thickness: float, tolerance: float) -> Body:
    from gtcad.converters.occt.faces import area
    from gtcad.converters.occt.faces import volume as kernel_volume
    from gtcad.converters.occt.pieces import ShapeKey, subshapes
    from gtcad.converters.occt.thickening import hollow_solid

    solid, off = hollow_solid(body.shape, thickness)
    if off > tolerance:
        raise KernelError(
            f"the kernel's offset by {thickness:g} mm is wrong by up to {off:.3g} mm at samples, more "
            f"than the tolerance of {tolerance:.3g} mm: the wall meets itself, or the kernel is less exact at edges"
        )
    known = {ShapeKey(face): name for name, face in body.faces.items()}
    numbers = itertools.count(1)
    faces = {
        known.get(ShapeKey(face)) or f"offset {next(numbers)}": face
        for face in sorted(subshapes(solid, "FACE"), key=lambda face: ShapeKey(face) not in known)
    }
    surface = Estimate(value := math.fsum(map(area, faces.values())), _AREA_RTOL * value)
    held = float(kernel_volume(solid, rtol=_RTOL))
    return Body(solid, MappingProxyType(faces), held, None, surface, body.deviation + off, False)


def _checked_volume(solid: Any, exact: Estimate, allowed: float) -> float:
    """The kernel's volume of a solid whose edges are right too.

    Raises
    ------
    KernelError
        When an edge is not in two faces, or the volume differs from the exact one by more than is allowed, in mm^3.
    """
    from gtcad.converters.occt.faces import volume as kernel_volume
    from gtcad.converters.occt.shells import edge_uses

    uses = edge_uses(solid)
    if not uses.closed:
        raise KernelError(f"a solid must have each edge in two faces, got {uses}")
    held = kernel_volume(solid, rtol=_RTOL)
    gap = abs(held - exact)
    if not gap <= allowed + held.error + exact.error:
        raise KernelError(
            f"the kernel's solid has the volume {float(held):.9g} mm^3, the exact surface {float(exact):.9g} mm^3: "
            f"{gap:.3g} mm^3 apart, allowed are {allowed:.3g} mm^3"
        )
    return float(held)


# --- closed shells ----------------------------------------------------------------------------------------------------


def _check_quilt(quilt: Quilt, caps: str, *, open_too: bool = False) -> None:
    if caps not in ("none", "planar"):
        raise InputError(f'caps must be "none" or "planar", got {caps!r}')
    if quilt.patches[0].dimension != 3:
        raise InputError("a solid needs patches in space, d = 3, got d = 2")
    if quilt.free and caps == "none" and not open_too:
        free = ", ".join(map(quilt.label, quilt.free))
        raise InputError(f"a solid needs a closed quilt, but these sides are free: {free}; caps can close plane loops")


@dataclass(frozen=True, eq=False)
class _Closed:
    """A closed shell with its normals outwards, and the exact measures of what it bounds."""

    shell: Shell
    caps: tuple[Cap, ...]
    flipped: tuple[bool, ...]
    volume: Estimate
    area: Estimate


def _oriented(fit: QuiltFit) -> _Closed:
    closed = _closed(fit, fit.quilt.flipped)
    return closed if closed.volume > 0 else _closed(fit, tuple(not flip for flip in fit.quilt.flipped))


def _closed(fit: QuiltFit, flipped: tuple[bool, ...]) -> _Closed:
    from gtcad.converters.occt.caps import capped, planar_caps
    from gtcad.converters.occt.shells import make_shell

    shell = make_shell(fit.splines, fit.quilt.edges, flipped)
    caps: tuple[Cap, ...] = ()
    if shell.free:
        caps = planar_caps(shell, flatness=fit.deviation[1])
        shell = capped(shell, caps)
    return _Closed(shell, caps, flipped, *_measured(fit.quilt, flipped, caps))


def _solid(fit: QuiltFit, closed: _Closed) -> Body:
    from gtcad.converters.occt.shells import make_solid

    deviation = max([fit.deviation[1], *(cap.flatness for cap in closed.caps)])
    allowed = deviation * closed.area
    if closed.volume - closed.volume.error <= allowed:
        raise InputError(f"the surface encloses no volume: {closed.volume:.3g} mm^3 within {allowed:.3g} mm^3")
    solid = make_solid(closed.shell)
    held = _checked_volume(solid, closed.volume, allowed)
    names = (*fit.quilt.names, *_cap_names(fit.quilt, len(closed.caps)))
    faces = MappingProxyType(dict(zip(names, closed.shell.faces, strict=True)))
    return Body(solid, faces, held, closed.volume, closed.area, deviation, True)


def _cap_names(quilt: Quilt, count: int) -> list[str]:
    names = (f"cap {k}" for k in range(1, count + len(quilt.names) + 1))
    return [name for name in names if name not in quilt.names][:count]


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
