"""What ``make demo`` runs: every sample to a STEP file within 1e-4 mm, and a proof of what each file holds."""

from __future__ import annotations

import argparse
import contextlib
import decimal
import io
import json
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gtcad import cli

SAMPLES = Path(__file__).parent
TOLERANCE = "1e-4"
COLUMNS = "{:<24}{:>6}{:>7}{:>7}{:>21}{:>9}  {}"


@dataclass(frozen=True)
class Outcome:
    """What became of one model: the shapes as exported, the verdicts on what the file holds, and the seconds spent.

    A chain has a verdict for each piece and for each joint, a body one for itself, each patch and each shared edge.
    """

    shapes: list[dict[str, Any]]
    verdicts: list[dict[str, Any]]
    joints: list[dict[str, Any]]
    failed: bool
    seconds: float


def gtcad(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Run a command of gtcad in this process; its exit code and its JSON document."""
    printed = io.StringIO()
    code = 0
    with contextlib.redirect_stdout(printed):
        try:
            cli.app([*arguments, "--json"], prog_name="gtcad")
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, json.loads(printed.getvalue() or "{}")


def run(model: Path, file: Path) -> Outcome:
    start = time.perf_counter()
    code, exported = gtcad("export", str(model), "-o", str(file), "--tolerance", TOLERANCE)
    checked: dict[str, Any] = {}
    if code == 0:
        code, checked = gtcad("check", str(file), "--against", str(model), "--tolerance", TOLERANCE, "--in-process")
    seconds = time.perf_counter() - start
    return Outcome(exported.get("shapes", []), checked.get("shapes", []), checked.get("joints", []), code != 0, seconds)


def line(model: Path, outcome: Outcome) -> str:
    poles = sum(poles_of(shape) for shape in outcome.shapes if "poles" in shape)
    exact = sum(shape.get("exact", False) for shape in outcome.shapes)
    deviations = [row["deviation"][1] for row in outcome.verdicts if row["deviation"]]
    counts = Counter(row["verdict"] for row in outcome.verdicts)
    verdict = ", ".join(f"{count} {verdict}" for verdict, count in counts.items()) or "not written"
    if outcome.joints and not outcome.failed:
        verdict += f", {len(outcome.joints)} joint{'s' if len(outcome.joints) > 1 else ''} kept"
    deviation = rounded_up(max(deviations)) if deviations else "-"
    return COLUMNS.format(model.name, len(outcome.shapes), poles, exact, deviation, f"{outcome.seconds:.1f}", verdict)


def poles_of(shape: dict[str, Any]) -> int:
    """Those of a curve, of a net, or of all edges of a wire or patches of a body."""
    counts: list[int] = shape["poles"]
    return sum(counts) if shape["entity"] in ("wire", "shell", "solid") else math.prod(counts)


def rounded_up(value: float) -> str:
    """Three digits that are still a bound."""
    return f"{decimal.Context(prec=3, rounding=decimal.ROUND_CEILING).create_decimal(value):.2e}"


def main() -> None:
    parser = argparse.ArgumentParser(description=f"Export models to STEP within {TOLERANCE} mm and check the files.")
    parser.add_argument("--output", type=Path, required=True, help="the folder for the STEP files")
    parser.add_argument("models", nargs="*", type=Path, metavar="MODEL", help="every sample when left out")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    models = given.models or sorted(path for path in SAMPLES.iterdir() if path.suffix in (".json", ".toml"))
    print(
        f"{len(models)} models to STEP files within {TOLERANCE} mm, each file read back and checked against its model\n"
    )
    print(COLUMNS.format("model", "shapes", "poles", "exact", "deviation in mm <=", "seconds", "verdict on the file"))
    failed = []
    for model in models:
        outcome = run(model, given.output / f"{model.stem}.step")
        print(line(model, outcome), flush=True)
        failed += [model.name] * outcome.failed
    if failed:
        sys.exit(f"\nfailed: {', '.join(failed)}")
    print(f"\nthe STEP files are in {given.output}; deviations are proved, rounding included, unless called estimated")


if __name__ == "__main__":
    main()
