"""GT shapes as objects of build123d, in builder and in algebra mode, and joined to what build123d made.

All lengths are in mm. Objects are genuine ``Edge``, ``Wire``, ``Face``, ``Sketch`` and ``Part``; each has ``fit`` (its
``deviation`` is proved), ``exact`` (the shape of gtcad where the object is) and ``made``.
"""

from __future__ import annotations

import importlib
from typing import Any, TypeVar

from gtcad.composite import Composite
from gtcad.converters.build123d_faces import (
    GTCoons,
    GTFace,
    GTJoinPatch,
    GTLofted,
    GTProfile,
    GTRotation,
    GTRuled,
    GTSolid,
    GTSurface,
    GTSweep,
    GTSwept,
    GTSwung,
)
from gtcad.converters.build123d_lines import (
    FaceOptions,
    FitOptions,
    GTBezier,
    GTComposite,
    GTConic,
    GTCurve,
    GTHyperbola,
    GTJoin,
    GTObject,
    GTParabola,
    LineOptions,
    host,
    labelled,
)
from gtcad.converters.build123d_sheets import (
    GTDirichlet,
    GTEnveloping,
    GTGeodesicDevelopable,
    GTPlateau,
    GTSpineDevelopable,
)
from gtcad.converters.design import Design
from gtcad.converters.face_designs import FaceDesign, design_from_face
from gtcad.converters.host_designs import DEFAULT_TOLERANCE, design_from_edge
from gtcad.converters.hosts import Core, Made, made_edge, made_face, made_shell, made_solid, made_wire
from gtcad.errors import ExtraMissing
from gtcad.model import Model
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid

__all__ = [
    "FaceOptions",
    "FitOptions",
    "GTBezier",
    "GTComposite",
    "GTConic",
    "GTCoons",
    "GTCurve",
    "GTDirichlet",
    "GTEnveloping",
    "GTFace",
    "GTGeodesicDevelopable",
    "GTHyperbola",
    "GTJoin",
    "GTJoinPatch",
    "GTLofted",
    "GTObject",
    "GTParabola",
    "GTPlateau",
    "GTProfile",
    "GTRotation",
    "GTRuled",
    "GTSolid",
    "GTSpineDevelopable",
    "GTSurface",
    "GTSweep",
    "GTSwept",
    "GTSwung",
    "LineOptions",
    "from_edge",
    "from_face",
    "show",
    "to_compound",
    "to_edge",
    "to_face",
    "to_shape",
    "to_shell",
    "to_solid",
    "to_wire",
]

Kind = TypeVar("Kind", bound="type[Any]")

# --- functions --------------------------------------------------------------------------------------------------------


def to_edge(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Edge:
    """The ``Edge`` of a curve, or of a chain that is one edge; no builder takes it in. It has ``made``.

    Parameters
    ----------
    curve
        In mm.
    tolerance
        Largest distance from the curve, in mm.
    label, color
        Of the edge.
    settings
        The other arguments of ``fit_curve`` or ``fit_chain``.

    Raises
    ------
    InputError, ToleranceNotMet, ToleranceBelowPrecision, KernelError
        As ``hosts.made_edge``.
    """
    return _shape(host.Edge, made_edge(curve, tolerance=tolerance, **settings), label, color)


def to_wire(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Wire:
    """The ``Wire`` of a chain or a curve; see ``to_edge``."""
    return _shape(host.Wire, made_wire(curve, tolerance=tolerance, **settings), label, color)


def to_face(
    surface: SeparableSurface,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Face:
    """The ``Face`` of a patch; see ``to_edge``."""
    return _shape(host.Face, made_face(surface, tolerance=tolerance, **settings), label, color)


def to_shell(
    quilt: Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Shell:
    """The ``Shell`` of a quilt, neighbours sharing their edges; see ``to_edge``."""
    return _shape(host.Shell, made_shell(quilt, tolerance=tolerance, **settings), label, color)


def to_solid(
    solid: Solid | Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    label: str = "",
    color: Any = None,
    **settings: Any,
) -> host.Solid:
    """The ``host.Solid`` of a solid, or of what a closed quilt encloses; see ``to_edge``."""
    return _shape(host.Solid, made_solid(solid, tolerance=tolerance, **settings), label, color)


def to_shape(
    shape: Core, *, tolerance: float = DEFAULT_TOLERANCE, label: str = "", color: Any = None, **settings: Any
) -> host.Shape:
    """The edge, wire, face, shell or solid of any shape of gtcad; see ``to_edge``."""
    made: Made[Any]
    if isinstance(shape, Composite):
        made = made_wire(shape, tolerance=tolerance, **settings)
        return _shape(host.Wire, made, label, color)
    if isinstance(shape, SeparableCurve):
        return _shape(host.Edge, made_edge(shape, tolerance=tolerance, **settings), label, color)
    if isinstance(shape, Quilt):
        return _shape(host.Shell, made_shell(shape, tolerance=tolerance, **settings), label, color)
    if isinstance(shape, Solid):
        return _shape(host.Solid, made_solid(shape, tolerance=tolerance, **settings), label, color)
    return _shape(host.Face, made_face(shape, tolerance=tolerance, **settings), label, color)


def to_compound(model: Model, *, tolerance: float = DEFAULT_TOLERANCE, **settings: Any) -> host.Compound:
    """The shapes of a model, with their names as labels and their colours; without what only serves construction."""
    meant = model.in_millimetres()
    children = [
        to_shape(shape, tolerance=tolerance, label=name, color=model.colors.get(name), **settings)
        for name, shape in meant.items()
        if name not in model.construction
    ]
    return host.Compound(children=children)


def _shape(kind: Kind, made: Made[Any], label: str, color: Any) -> Any:
    shape = kind(made.shape)
    labelled(shape, made, label, color)
    return shape


def from_edge(
    edge: Any, *, tolerance: float = DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> Design[Any]:
    """The GT curve nearest to an edge, or a chain where one is not enough: ``curve`` and its proved ``deviation``.

    Lines, circles, ellipses and their arcs come out exactly, unless a degree is given.

    Parameters
    ----------
    edge
        Any edge of build123d, in mm.
    tolerance
        Largest distance of the curve from the edge, in mm.
    degree
        Of the one curve, or of the chain's pieces; the least up to 8 for one curve, 5 for a chain unless given.
    order
        Of the chain's joints, "C0" to "C3" or "G1" to "G3".

    Raises
    ------
    InputError, ToleranceNotMet
        As ``hosts.design_from_edge``.
    """
    return design_from_edge(edge, tolerance=tolerance, degree=degree, order=order)


def from_face(
    face: Any, *, tolerance: float = DEFAULT_TOLERANCE, max_degree: int = 16, untrimmed: bool = False
) -> FaceDesign:
    """The GT patch nearest to a face, or a quilt where one is not enough: ``surface`` and its proved ``deviation``.

    Parameters
    ----------
    face
        Any face of build123d, in mm.
    tolerance
        Largest distance of the patch from the face, in mm.
    max_degree
        Of the patch in either direction.
    untrimmed
        Whether to take the whole surface of a trimmed face, which is refused else.

    Raises
    ------
    InputError, ToleranceNotMet, KernelError
        As ``hosts.design_from_face``.
    """
    return design_from_face(face, tolerance=tolerance, max_degree=max_degree, untrimmed=untrimmed)


def show(*objects: Any, tolerance: float = DEFAULT_TOLERANCE, **options: Any) -> Any:
    """``show`` of ocp_vscode, which also takes shapes of gtcad then.

    Parameters
    ----------
    objects
        Shapes of build123d or of gtcad.
    tolerance
        Of the latter, in mm.
    options
        Those of ``ocp_vscode.show``.

    Raises
    ------
    ExtraMissing
        When ocp_vscode is not installed.
    """
    try:
        viewer = importlib.import_module("ocp_vscode").show
    except ImportError as error:
        raise ExtraMissing("show needs the viewer: pip install ocp-vscode") from error
    core = SeparableCurve | SeparableSurface | Composite | Quilt | Solid
    return viewer(*(to_shape(one, tolerance=tolerance) if isinstance(one, core) else one for one in objects), **options)
