"""Reports for print, as PDF pages or one PNG, drawn by matplotlib: they need the extra ``plot``.

As with ``gtcad.pictures`` equal input gives equal bytes, and drawing is for one thread.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gtcad.converters import report_words as words
from gtcad.converters.report_markup import SIGNS
from gtcad.converters.report_pictures import draw_scene
from gtcad.errors import ExtraMissing

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome

_WIDTH, _HEIGHT, _MARGIN = 8.27, 11.69, 0.5  # inches: A4
_DPI = 150
_LINE = 1.35  # of the size of the letters
_MONO, _SANS = 0.602, 0.56  # of the size: width of a letter, exact and about
_SMALL = 6.6  # points
_HIGHEST = 400.0  # inches: pictures have at most 65536 lines
_MOST_ROWS = 300  # of a table
_COLOURS = {"passed": "#00664a", "failed": "#a33b00", "error": "#a33b00", "undecided": "#8a6100"}
_PICTURE = 3.6  # inches


@dataclass(frozen=True)
class _Block:
    """Something of a height in inches, drawn on a figure with its top at a distance from the figure's."""

    height: float
    draw: Callable[[Any, float], None]
    breaks: bool = False


def write_pdf(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Pages of A4: for several outcomes a table of them, then each from a new page.

    Raises
    ------
    ExtraMissing
        When matplotlib is not installed.
    """
    with _matplotlib() as new_figure:
        from matplotlib.backends.backend_pdf import PdfPages

        with PdfPages(path, metadata={"Title": "gtcad check", "CreationDate": None}) as pages:
            for blocks in _pages(list(_blocks(outcomes))):
                figure = new_figure(_HEIGHT)
                _draw(figure, blocks)
                pages.savefig(figure)


def write_png(path: Path, outcomes: Sequence[Outcome]) -> None:
    """One picture as high as it needs to be, but for what is beyond 10 m.

    Raises
    ------
    ExtraMissing
        When matplotlib is not installed.
    """
    with _matplotlib() as new_figure:
        blocks = list(_cut(_blocks(outcomes)))
        figure = new_figure(sum(block.height for block in blocks) + 2 * _MARGIN)
        _draw(figure, blocks)
        figure.savefig(path, format="png", dpi=_DPI, metadata={"Title": "gtcad check"})


@contextmanager
def _matplotlib() -> Iterator[Callable[[float], Any]]:
    """A maker of figures of the page's width, under matplotlib's own settings whatever the user's are."""
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ExtraMissing(f"drawing needs more packages ({error}): pip install 'gtcad[plot]'") from error

    def new_figure(height: float) -> Any:
        figure = Figure(figsize=(_WIDTH, height), dpi=_DPI)
        FigureCanvasAgg(figure)
        return figure

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams["text.parse_math"] = False  # a name may hold a dollar
        yield new_figure


def _cut(blocks: Iterable[_Block]) -> Iterator[_Block]:
    """As many as fit a picture, and a line that says so when they do not all."""
    room = _HIGHEST
    for block in blocks:
        room -= block.height
        if room < 0:
            yield _text("The rest does not fit a picture: a report in PDF or HTML has it.", 9)
            return
        yield block


def _pages(blocks: Sequence[_Block]) -> Iterator[list[_Block]]:
    page: list[_Block] = []
    room = _HEIGHT - 2 * _MARGIN
    for block in blocks:
        if page and (block.breaks or block.height > room):
            yield page
            page, room = [], _HEIGHT - 2 * _MARGIN
        page.append(block)
        room -= block.height
    yield page


def _draw(figure: Any, blocks: Sequence[_Block]) -> None:
    top = _MARGIN
    for block in blocks:
        block.draw(figure, top)
        top += block.height


# --- what stands on the pages -----------------------------------------------------------------------------------------


def _blocks(outcomes: Sequence[Outcome]) -> Iterator[_Block]:
    if len(outcomes) > 1:
        yield _text(f"Check of {len(outcomes)} files", 14, weight="bold")
        rows = [[words.title_of(o), _marked(words.state_of(o)), words.headline(o)] for o in outcomes]
        yield from _table("", ("file", "verdict", "in words"), rows, (30, 14, 80))
    for number, outcome in enumerate(outcomes):
        yield from _section(outcome, new_page=number > 0 or len(outcomes) > 1)


def _section(outcome: Outcome, *, new_page: bool) -> Iterator[_Block]:
    state = words.state_of(outcome)
    yield _text(f"Check of {words.title_of(outcome)}", 14, weight="bold", breaks=new_page)
    yield _text(f"{_marked(state)}. {words.headline(outcome)}", 10, color=_COLOURS[state])
    for mark, text in words.vouched(outcome):
        yield _text(f"{_marked(mark)}: {text}", 8)
    yield _text("   ".join(f"{key}: {value}" for key, value in words.environment_of(outcome)), 7, color="#444444")
    if outcome.scene is not None and (outcome.scene.faces or outcome.scene.curves):
        yield _Block(_PICTURE, partial(_draw_picture, outcome))
    lines = words.lines_of(outcome)
    columns = ("name", "verdict", "deviation, mm", "worst place: point, vector", "held as", "remarks")
    rows = [
        [line.name, _marked(line.verdict), words.interval(line.deviation), _worst(line), line.kind, line.remark]
        for line in lines
    ]
    yield from _table("Shapes", columns, rows, (22, 13, 20, 30, 18, 18))
    if outcome.report is not None:
        joints = [
            [
                j.name,
                j.wanted,
                j.report.order,
                f"{j.report.gap:.2g} mm",
                f"{j.report.tangent_angle_deg:.2g} deg",
                _marked("kept" if j.kept else "lost"),
            ]
            for j in outcome.report.joints
        ]
        yield from _table(
            "Joints", ("joint", "wanted", "found", "gap", "angle", "verdict"), joints, (50, 8, 8, 14, 14, 10)
        )
    if outcome.statements:
        stated = [
            [s.name, s.quantity, *words.statement(s), _marked("kept" if s.kept else "broken")]
            for s in outcome.statements
        ]
        columns = ("shape", "quantity", "stated", "found", "may differ by", "verdict")
        yield from _table("What the file states of its shapes, and holds", columns, stated, (30, 18, 20, 20, 16, 10))
    if outcome.readiness is not None:
        findings = [
            [
                f.code,
                _marked(f.level),
                f.criterion,
                f.element,
                words.figure(f.value, f.unit),
                words.figure(f.limit, f.unit),
                "" if f.point is None else words.numbers(f.point, 5),
                f.remark,
            ]
            for f in outcome.readiness.findings
        ]
        yield from _table(
            "Findings",
            ("code", "level", "criterion", "element", "value", "limit", "place", "remark"),
            findings,
            (9, 10, 20, 20, 12, 12, 18, 20),
        )
        criteria = [
            [c.code, c.title, words.figure(c.limit, c.unit), str(c.checked), str(c.found), c.source]
            for c in outcome.readiness.criteria
        ]
        yield from _table(
            f"Criteria of the profile {outcome.readiness.profile}",
            ("code", "criterion", "limit", "checked", "found", "source"),
            criteria,
            (17, 36, 12, 9, 8, 44),
        )


def _marked(verdict: str) -> str:
    return f"{SIGNS.get(verdict, '')} {verdict}".strip()


def _worst(line: words.Line) -> str:
    return "" if line.worst is None else f"{words.numbers(line.worst.point, 5)} {words.numbers(line.worst.vector, 2)}"


def _draw_picture(outcome: Outcome, figure: Any, top: float) -> None:
    height = figure.get_figheight()
    box = (_MARGIN / _WIDTH, 1 - (top + _PICTURE) / height, 1 - 2 * _MARGIN / _WIDTH, (_PICTURE - 0.25) / height)
    draw_scene(figure, box, words.measured_scene(outcome)[0])


def _text(text: str, size: float, *, color: str = "#1a1a1a", weight: str = "normal", breaks: bool = False) -> _Block:
    letters = int((_WIDTH - 2 * _MARGIN) * 72 / (size * _SANS))
    lines = textwrap.wrap(_printable(text), letters) or [""]

    def draw(figure: Any, top: float) -> None:
        for k, line in enumerate(lines):
            y = 1 - (top + (k + 1) * size * _LINE / 72) / figure.get_figheight()
            figure.text(_MARGIN / _WIDTH, y, line, fontsize=size, color=color, fontweight=weight, va="baseline")

    return _Block((len(lines) * _LINE + 0.5) * size / 72, draw, breaks)


def _table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int]
) -> Iterator[_Block]:
    """Rows of letters of one width, wrapped within their columns; columns without a text leave their room to others."""
    if not rows:
        return
    used = [k for k in range(len(columns)) if any(row[k] for row in rows)]
    letters = int((_WIDTH - 2 * _MARGIN) * 72 / (_SMALL * _MONO))
    scale = letters / sum(widths[k] for k in used)
    room = [int(widths[k] * scale) for k in used]
    if title:
        yield _text(title, 9, weight="bold")
    yield _row([columns[k] for k in used], room, "bold")
    for row in rows[:_MOST_ROWS]:
        yield _row([row[k] for k in used], room, "normal")
    if len(rows) > _MOST_ROWS:
        yield _text(f"and {len(rows) - _MOST_ROWS} more, which a report in HTML has", 7)
    yield _Block(0.12, lambda figure, top: None)


def _row(texts: Sequence[str], room: Sequence[int], weight: str) -> _Block:
    cells = [textwrap.wrap(_printable(text), width - 1) or [""] for text, width in zip(texts, room, strict=True)]
    count = max(map(len, cells))
    step = _SMALL * _LINE / 72

    def draw(figure: Any, top: float) -> None:
        from matplotlib.lines import Line2D

        height = figure.get_figheight()
        starts = [sum(room[:k]) for k in range(len(room))]
        for start, lines in zip(starts, cells, strict=True):
            x = (_MARGIN + start * _SMALL * _MONO / 72) / _WIDTH
            for k, line in enumerate(lines):
                y = 1 - (top + (k + 0.95) * step) / height
                figure.text(x, y, line, fontsize=_SMALL, family="monospace", fontweight=weight, va="baseline")
        y = 1 - (top + count * step + 0.045) / height
        ends = [_MARGIN / _WIDTH, 1 - _MARGIN / _WIDTH]
        figure.add_artist(Line2D(ends, [y, y], color="#bbbbbb", linewidth=0.5))

    return _Block(count * step + 0.06, draw)


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
