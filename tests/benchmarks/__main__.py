"""``python -m tests.benchmarks``: measures and prints; figures are of this machine, ratios travel better."""

from __future__ import annotations

import argparse
import datetime
import os
import platform
from pathlib import Path

import numpy
import scipy

from tests.benchmarks import comparison, evaluation, fitting, growth, minimal, patches

PARTS = {
    "evaluation": evaluation.run,
    "fitting": fitting.run,
    "curves": comparison.run,
    "limit": comparison.run_limit,
    "patches": patches.run,
    "minimal": minimal.run,
    "growth": growth.run,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, help="also write the tables to this file")
    parser.add_argument("--only", choices=PARTS, help="one part alone")
    arguments = parser.parse_args()
    versions = f"Python {platform.python_version()}, numpy {numpy.__version__}, scipy {scipy.__version__}"
    text = f"# Measured {datetime.date.today()}, {os.cpu_count()} cores, {versions}\n"
    print(text)
    for name, run in PARTS.items():
        if arguments.only in (None, name):
            part = run()
            print(part, "\n", flush=True)
            text += "\n" + part + "\n"
    if arguments.output:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(text)


if __name__ == "__main__":
    main()
