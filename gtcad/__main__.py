"""``python -m gtcad`` is the command ``gtcad``."""

from gtcad.cli import main

main()
