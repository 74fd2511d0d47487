"""The command ``gtcad optimize``."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gtcad import _options as options
from gtcad import _tables as tables
from gtcad import errors
from gtcad._command import Code, JsonOption, ModelArgument, guarded, option, print_json
from gtcad._export_command import check_output

if TYPE_CHECKING:
    from gtcad.model import Model
    from gtcad.optimize import Optimum

OutputOption = Annotated[
    str, typer.Option("--output", "-o", metavar="MODEL2", help="The model file to write, .json or .toml.")
]
ShapeOption = Annotated[
    list[str],
    typer.Option("--shape", metavar="NAME", help="A shape to optimise, one for each option; all when left out."),
]
ObjectiveOption = Annotated[
    str, typer.Option("--objective", metavar="NAME", help="What to make least; dirichlet when left out.")
]
MethodOption = Annotated[
    str, typer.Option("--method", metavar="NAME", help="pso (a particle swarm) when left out, polish or de.")
]
SeedOption = Annotated[str, typer.Option("--seed", metavar="N", help="Of the random numbers; 0 when left out.")]
ParticlesOption = Annotated[str, typer.Option("--particles", metavar="N", help="Designs at once; 30 when left out.")]
IterationsOption = Annotated[
    str, typer.Option("--iterations", metavar="N", help="How often they move; 100 when left out.")
]
_SIDE = 9  # points on each side of a patch, to see where patches meet
_MEET = 1e-6  # of the size of the model
_MOST_PARTICLES, _MOST_ITERATIONS, _MOST_SEED = 10_000, 1_000_000, 999_999_999


@guarded
def optimize(
    model: ModelArgument,
    *,
    output: OutputOption,
    shape: ShapeOption = [],  # noqa: B006 - typer copies it
    objective: ObjectiveOption = "dirichlet",
    method: MethodOption = "pso",
    seed: SeedOption = "0",
    particles: ParticlesOption = "30",
    iterations: IterationsOption = "100",
    as_json: JsonOption = False,
) -> None:
    """Find the design variables of shapes of a MODEL that make an objective least, and write the model to MODEL2."""
    option("MODEL", options.model_path, model)
    option("--output", options.model_path, output)
    settings: dict[str, Any] = {
        "seed": option("--seed", lambda text: options.whole_number(text, 0, _MOST_SEED), seed),
        "particles": option("--particles", lambda text: options.whole_number(text, 3, _MOST_PARTICLES), particles),
        "iterations": option("--iterations", lambda text: options.whole_number(text, 1, _MOST_ITERATIONS), iterations),
    }

    from gtcad.objectives import KNOWN, PREFIXES
    from gtcad.optimize import METHODS

    settings["method"] = option("--method", lambda text: _one_of(METHODS, text), method)
    option("--objective", lambda text: _one_of(KNOWN, text, PREFIXES), objective)
    check_output(model, output)

    from gtcad.model import dump_model, load_model

    content = load_model(model)
    names = _wanted(model, content, shape, objective)
    found: dict[str, Optimum] = {}
    interrupted = False
    try:
        for name in names:
            found[name] = _optimised(model, content, name, objective, settings)
            if interrupted := found[name].interrupted:
                break
    except KeyboardInterrupt:
        interrupted = True
    result = _with_shapes(content, found)
    dump_model(result, output)
    if as_json:
        rows = [{"name": name, **one.as_data()} for name, one in found.items()]
        print_json(model=model, output=output, unit=content.unit, interrupted=interrupted, shapes=rows)
    elif found:
        tables.print_table(
            ("name", f"{objective} before", "after", "design variables", "remark"),
            [_row(name, one, content[name]) for name, one in found.items()],
        )
    for first, second in _parted(content, result, found):
        tables.message(f"Warning: {first!r} and {second!r} met before, and do so no longer")
    if interrupted:
        tables.message(f"Interrupted: {output} holds the best so far")
        raise typer.Exit(int(Code.INTERRUPTED))


def _one_of(names: Sequence[str], text: str, prefixes: Sequence[str] = ()) -> str:
    if text not in names:
        plain = [name for name in names if name.partition("-")[0] not in prefixes]
        more = f", those of curves also after {', '.join(f'{prefix}-' for prefix in prefixes)}" if prefixes else ""
        raise options.Refused(f"must be one of {', '.join(plain)}{more}, got {text!r}")
    return text


def _wanted(path: str, model: Model, names: Sequence[str], objective: str) -> list[str]:
    """The shapes to optimise: those named, or all that there are."""
    from gtcad._design_space import variables_of
    from gtcad.objectives import checked_objective, objectives_of

    problems = []
    for name in names:
        if name not in model:
            problems.append(f"there is no shape of the name {name!r}; there are {', '.join(map(repr, model))}")
            continue
        try:
            if not variables_of(model[name]):
                raise errors.InputError("it has no design variables")
            checked_objective(model[name], objective)
        except errors.InputError as error:
            problems.append(f"shape {name!r}: {error}")
    if problems:
        raise errors.ModelError(path, problems)
    if names:
        return list(dict.fromkeys(names))
    movable = [name for name, one in model.items() if name not in model.construction and _has_variables(one)]
    if not movable:
        raise errors.ModelError(path, ["none of its shapes has design variables"])
    fitting = [name for name in movable if objective in objectives_of(model[name])]
    if not fitting:
        known = dict.fromkeys(one for name in movable for one in objectives_of(model[name]))
        message = f"objective {objective} fits none of its shapes that have design variables; {', '.join(known)} do"
        raise errors.ModelError(path, [message])
    return fitting


def _has_variables(shape: Any) -> bool:
    from gtcad._design_space import variables_of

    with contextlib.suppress(errors.InputError):
        return bool(variables_of(shape))
    return False


def _optimised(path: str, model: Model, name: str, objective: str, settings: Mapping[str, Any]) -> Optimum:
    from gtcad.optimize import optimize as search

    with tables.progress(f"optimising {tables.printable(name)}", settings["iterations"]) as advance:
        try:
            return search(model[name], objective, on_step=lambda _: advance(), keep_interrupted=True, **settings)
        except (errors.InputError, errors.NoFeasibleDesign) as error:
            raise errors.ModelError(path, [f"shape {name!r}: {error}"]) from error


def _with_shapes(model: Model, found: Mapping[str, Optimum]) -> Model:
    shapes = {name: found[name].shape if name in found else shape for name, shape in model.items()}
    return dataclasses.replace(model, shapes=shapes)


def _row(name: str, optimum: Optimum, given: Any) -> list[str]:
    from gtcad._design_space import variables_of

    before = variables_of(given)
    moved = {key: pair for key, pair in optimum.gamma.items() if pair != before[key]}
    gammas = ", ".join(f"{key} ({a:.6g}, {b:.6g})" for key, (a, b) in moved.items()) or "as given"
    remark = "interrupted" if optimum.interrupted else "" if optimum.converged else "no minimum yet"
    if "solved" in optimum.setting:
        remark = ", ".join(filter(None, (remark, optimum.setting.partition(",")[0])))
    values = (f"{float(value):.9g}" for value in (optimum.start_value, optimum.value))
    return [name, *values, gammas, remark]


def _parted(before: Model, after: Model, changed: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Pairs of patches of which a side met the other's before, and no longer does."""
    import numpy as np

    sides = {name: (_sides(shape), _sides(after[name])) for name, shape in before.items()}
    names = [name for name, (points, _) in sides.items() if points is not None]
    if not names:
        return
    limit = _MEET * float(np.ptp(np.concatenate([sides[name][0].reshape(-1, 3) for name in names]), axis=0).max())
    for k, first in enumerate(names):
        for second in names[:k]:
            if first in changed or second in changed:
                met, meet = (
                    np.linalg.norm(sides[first][time][:, None] - sides[second][time], axis=-1).max(axis=-1) <= limit
                    for time in (0, 1)
                )
                if (met & ~meet).any():
                    yield second, first


def _sides(shape: Any) -> Any:
    """Points of the sides of a patch, in both directions: shape (8, points, 3); None for other shapes."""
    import numpy as np

    from gtcad.protocol import SeparableSurface

    if not isinstance(shape, SeparableSurface) or shape.dimension != 3:
        return None
    t = np.linspace(0, 1, _SIDE)
    along = [shape.evaluate(*place) for end in (0.0, 1.0) for place in ((t, end), (end, t))]
    return np.stack([line for side in along for line in (side, side[::-1])])
