"""GT shapes for CadQuery: free functions in the manner of ``cadquery.func``, and methods of ``Workplane``.

The functions return shapes of CadQuery, in mm, each with its exact shape and its proof. Importing the module adds the
methods to ``cadquery.Workplane``; importing it again changes nothing.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Concatenate, Literal, ParamSpec, TypeAlias, TypeVar, Unpack

from numpy.typing import ArrayLike

from gtcad.composite import Composite
from gtcad.converters.cadquery_functions import (
    from_edge,
    from_face,
    gtAssembly,
    gtChain,
    gtCoons,
    gtCurve,
    gtCurveOn,
    gtLofted,
    gtRotation,
    gtRuled,
    gtShape,
    gtShell,
    gtSolid,
    gtSurface,
    gtSurfaceOn,
    gtSweep,
    gtSwept,
    gtSwung,
    show,
)
from gtcad.converters.cadquery_shapes import (
    CurveLike,
    GtEdge,
    GtFace,
    GtShell,
    GtSolid,
    GtWire,
    Settings,
    SurfaceLike,
    cq,
    curve_of,
)
from gtcad.converters.cadquery_sheets import (
    gtDirichlet,
    gtEnveloping,
    gtGeodesicDevelopable,
    gtPlateau,
    gtSpineDevelopable,
)
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.quilt import Quilt
from gtcad.solid import Solid

P = ParamSpec("P")
W = TypeVar("W", bound=cq.Workplane)
CombineMode: TypeAlias = bool | Literal["cut", "a", "s"]

__all__ = [
    "GtEdge",
    "GtFace",
    "GtShell",
    "GtSolid",
    "GtWire",
    "Workplane",
    "from_edge",
    "from_face",
    "gtAssembly",
    "gtChain",
    "gtCoons",
    "gtCurve",
    "gtCurveOn",
    "gtDirichlet",
    "gtEnveloping",
    "gtGeodesicDevelopable",
    "gtLofted",
    "gtPlateau",
    "gtRotation",
    "gtRuled",
    "gtShape",
    "gtShell",
    "gtSolid",
    "gtSpineDevelopable",
    "gtSurface",
    "gtSurfaceOn",
    "gtSweep",
    "gtSwept",
    "gtSwung",
    "show",
]


# --- methods of Workplane ---------------------------------------------------------------------------------------------


def _at_points(make: Callable[P, Any]) -> Callable[Concatenate[W, P], W]:
    """The method that makes a shape in the plane's coordinates, and puts one at each point of the stack."""

    def method(self: W, /, *args: P.args, **kwargs: P.kwargs) -> W:
        return _placed(self, make(*args, **kwargs))

    signature = inspect.signature(make)
    own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    described: Any = method
    described.__signature__ = signature.replace(parameters=[own, *signature.parameters.values()])
    described.__name__, described.__doc__ = make.__name__, make.__doc__
    return method


def _placed(workplane: W, shape: Any, combine: CombineMode = False, clean: bool = False) -> W:
    """The shape at each point of the stack; cleaning would make another shape of it."""
    result: W = workplane.eachpoint(shape.moved, True, combine, clean)
    return result


def _drawn(workplane: W, shapes: list[Any], forConstruction: bool) -> W:
    """Shapes in the plane's coordinates as what was drawn last."""
    placed = [shape.moved(workplane.plane.location) for shape in shapes]
    if not forConstruction:
        for shape in placed:
            add = workplane._addPendingWire if isinstance(shape, cq.Wire) else workplane._addPendingEdge
            add(shape)
    result: W = workplane.newObject(placed)
    return result


class Workplane(cq.Workplane):  # type: ignore[misc]
    """``cadquery.Workplane`` with the methods of this module, which all of them have; this one tells editors so.

    Points and curves are in the plane's coordinates.
    """

    def gtCurve(
        self: W,
        points: CurveLike | Composite,
        gamma: ArrayLike = (0.0, 0.0),
        forConstruction: bool = False,
        includeCurrent: bool = False,
        makeWire: bool = False,
        **settings: Unpack[Settings],
    ) -> W:
        """Draw a GT curve, as ``bezier`` draws a Bezier curve.

        Parameters
        ----------
        points, gamma, settings
            As of the function ``gtCurve``.
        forConstruction, includeCurrent, makeWire
            As of ``Workplane.bezier``; the current point becomes the first control point.
        """
        if includeCurrent:
            if isinstance(points, SeparableCurve | Composite | cq.Shape):
                raise InputError("includeCurrent=True needs control points, got a whole curve")
            points = [self._findFromPoint(True), *points]
        curve = points if isinstance(points, Composite) else curve_of("points", points, gamma)
        if makeWire:
            chain = curve if isinstance(curve, Composite) else Composite((curve,), ())
            return _drawn(self, [gtChain(chain, **settings)], forConstruction)
        return _drawn(self, [gtCurve(curve, **settings)], forConstruction)

    def gtChain(
        self: W,
        pieces: Composite | Sequence[CurveLike],
        orders: str | Sequence[str] = "C0",
        closed: bool = False,
        forConstruction: bool = False,
        **settings: Unpack[Settings],
    ) -> W:
        """Draw a chain: a closed one as a wire at each point of the stack, as ``circle``; an open one as edges.

        Parameters
        ----------
        pieces, orders, closed, settings
            As of the function ``gtChain``.
        forConstruction
            Whether it is left out of what is extruded.
        """
        wire = gtChain(pieces, orders, closed, **settings)
        wire.forConstruction = forConstruction
        return _placed(self, wire) if wire.IsClosed() else _drawn(self, wire.Edges(), forConstruction)

    def gtSolid(
        self: W,
        patches: Quilt | Solid | cq.Shell | Iterable[SurfaceLike],
        caps: Literal["none", "planar"] = "none",
        thickness: float | None = None,
        combine: CombineMode = True,
        clean: bool = True,
        **settings: Unpack[Settings],
    ) -> W:
        """Put a solid at each point of the stack, and combine it with the solid that is there, as ``box``.

        Parameters
        ----------
        patches, caps, thickness, settings
            As of the function ``gtSolid``.
        combine, clean
            As of ``Workplane.box``. One solid that there is nothing to combine with stays as it is, with its fit.
        """
        if len(self.objects) < 2 and self._findType((cq.Solid,), True, True) is None:
            combine = False
        return _placed(self, gtSolid(patches, caps, thickness, **settings), combine, clean and bool(combine))

    gtSurface = _at_points(gtSurface)
    gtRuled = _at_points(gtRuled)
    gtSwept = _at_points(gtSwept)
    gtSwung = _at_points(gtSwung)
    gtRotation = _at_points(gtRotation)
    gtLofted = _at_points(gtLofted)
    gtCoons = _at_points(gtCoons)
    gtSweep = _at_points(gtSweep)
    gtShell = _at_points(gtShell)
    gtDirichlet = _at_points(gtDirichlet)
    gtEnveloping = _at_points(gtEnveloping)
    gtGeodesicDevelopable = _at_points(gtGeodesicDevelopable)
    gtPlateau = _at_points(gtPlateau)
    gtSpineDevelopable = _at_points(gtSpineDevelopable)


def register() -> None:
    """Add the methods to ``cadquery.Workplane``; done on import."""
    for name, method in vars(Workplane).items():
        if name.startswith("gt"):
            setattr(cq.Workplane, name, method)


register()
