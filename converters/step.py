"""Writing and reading STEP files (ISO 10303-21)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime
from typing import Literal

from gtcad._files import written_whole
from gtcad.converters.occt import exchange
from gtcad.converters.part import Part
