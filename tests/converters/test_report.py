from __future__ import annotations

import base64
import io
import itertools
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gtcad import Surface
from gtcad.converters import fit_surface
from gtcad.converters.check import Report
from gtcad.converters.outcome import Job, run_job
from gtcad.converters.part import Part
from gtcad.converters.readiness import Criterion, Finding, Readiness
from gtcad.converters.report import html_page, write_report
from gtcad.converters.report_view import EDGES, MAPS
from gtcad.converters.report_words import headline, lines_of
from gtcad.converters.scene import scene_of_parts
from gtcad.converters.step import write_step
from gtcad.converters.verdicts import Histogram, Row, Worst
from gtcad.errors import ExtraMissing, FileError, InputError
from tests.converters.scenes import face, outcome, patch, strip, strip_outcome

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip
LAPTOP = {"width": 1366, "height": 768}
WITHOUT_WEBGL = """
const original = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : original.call(this, kind, ...rest);
};
"""
HOSTILE = '</script><img src=x onerror="window.hacked = true"><b>\'&amp;`${1}\u2028'


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None and not os.environ.get("CI"):
        pytest.skip("no Chromium is installed")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        assert CHROMIUM is not None, "Chromium must be installed where CI is set"
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


class Opened:
    """A report in the browser, and what it said and asked for."""

    def __init__(self, browser, path: Path, *, webgl: bool = True, **settings) -> None:
        self.page = browser.new_page(viewport=LAPTOP, **settings)
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: message.type == "error" and self.errors.append(message.text))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.blocked: list[tuple[str, str]] = []
        self.page.on("requestfailed", lambda request: self.blocked.append((request.url, request.failure)))
        self.page.on("dialog", lambda dialog: self.errors.append(dialog.message))
        if not webgl:
            self.page.add_init_script(WITHOUT_WEBGL)
        self.page.goto(path.as_uri())

    def settled(self) -> None:
        """Wait for two frames: what was asked is drawn."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self, number: int = 0) -> np.ndarray:
        """The pixels of a view, shape (height, width, 3)."""
        section = self.page.locator("section.outcome:has(canvas)").nth(number)
        for _ in range(100):
            self.settled()
            if section.get_attribute("data-renderer"):
                break
        data = self.page.evaluate(
            "(number) => document.querySelectorAll('canvas')[number].toDataURL('image/png')", number
        )
        with Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))) as picture:
            return np.asarray(picture.convert("RGB")).astype(int)

    def click(self, selector: str) -> None:
        self.page.click(selector)
        self.settled()

    def rows(self, selector: str = "table.shapes tbody tr") -> list[str]:
        return self.page.eval_on_selector_all(selector, "rows => rows.map(row => row.cells[0].innerText.trim())")

    def point(self, x: float, y: float) -> tuple[float, float]:
        """A place in the view, as shares of its size, in the window."""
        box = self.page.locator("canvas").first.bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, [strip_outcome()])
    return path


@pytest.fixture
def opened(browser, report):
    made = Opened(browser, report)
    yield made
    made.page.close()


@pytest.fixture(params=[True, False], ids=["WebGL", "software"])
def either(request, browser, report):
    made = Opened(browser, report, webgl=request.param)
    if request.param and made.page.evaluate("document.createElement('canvas').getContext('webgl')") is None:
        pytest.skip("this Chromium has no WebGL")
    yield made
    made.page.close()


def ready(outcome_) -> Readiness:
    held = outcome_.scene.faces
    elements = f"edge 3 of face 2 {held[1].name!r}", f"face 3 {held[2].name!r}"
    findings = (
        Finding("G-CU-TI", "tiny-edge", "error", elements[0], 0.0123, 0.02, "mm", (12.0, 0.0, 0.0), "short"),
        Finding("G-SU-HD", "degree", "warning", elements[1], 12.0, 11.0, "", None, ""),
    )
    criteria = (
        Criterion("G-CU-TI", "length of an edge", 0.02, "mm", "VDA 4955", 12, 1),
        Criterion("G-SU-HD", "degree", 11.0, "", "gtcad's own", 3, 1, active=False),
    )
    edge = {
        "element": "edge 4 of face 1 'patch 1', face 2 'patch 2'", "faces": ["face 1", "face 2"], "continuity": "G1",
        "length": 10.0, "gap": 1e-9, "angle_deg": 0.05, "curvature_jump_percent": 100.0, "point": [10.0, 5.0, 0.0],
    }  # fmt: skip
    return Readiness("cam", criteria, findings, {"faces": 3, "degrees": {"2x2": 3}, "continuity": [edge]})


# --- the page ---------------------------------------------------------------------------------------------------------


def test_the_page_asks_for_nothing_and_has_no_errors(either: Opened, report: Path) -> None:
    assert either.page.locator("html[data-ready=yes]").count() == 1
    for selector in (
        "button[data-mode=zebra]",
        "button[data-lines=net]",
        "th button",
        "tbody button.name",
        "button[data-view=top]",
    ):
        either.click(f"{selector} >> nth=0")
    assert either.errors == []
    assert either.requests == [report.as_uri()]


def test_the_policy_of_the_page_forbids_scripts_and_requests(browser, report: Path) -> None:
    opened = Opened(browser, report)
    opened.page.evaluate("""() => {
      const made = document.createElement("script");
      made.textContent = "window.hacked = true";
      document.body.append(made);
      const image = document.createElement("img");
      image.src = "http://127.0.0.1:9/x.png";
      document.body.append(image);
    }""")
    assert opened.page.evaluate("fetch('http://127.0.0.1:9/').then(() => 'sent', () => 'refused')") == "refused"
    assert opened.page.evaluate("window.hacked") is None
    opened.settled()
    assert set(opened.requests[1:]) <= {url for url, why in opened.blocked if why == "csp"}
    assert len(opened.errors) >= 3
    assert all("Content Security Policy" in error for error in opened.errors)


def test_the_verdict_stands_first_in_words(opened: Opened) -> None:
    text = opened.page.inner_text("main")
    assert text.index("failed") < text.index("Deviation")
    assert "1 outside the tolerance" in opened.page.inner_text(".headline")
    assert "patch 2, 5.00e-3 mm" in opened.page.inner_text(".headline")
    for known in ("folder/strip.step (STEP)", "models/strip.toml", "0.001 mm", "OCCT 7.9.3", "9f86d081884c7d65"):
        assert known in opened.page.inner_text(".environment")


def test_it_is_readable_without_scripts(browser, report: Path) -> None:
    opened = Opened(browser, report, java_script_enabled=False)
    assert opened.page.inner_text("table.shapes").count("proved") == 2
    opened.page.close()


def test_it_fits_a_laptop_and_a_narrow_window(opened: Opened) -> None:
    for width in (1366, 700, 380):
        opened.page.set_viewport_size({"width": width, "height": 768})
        opened.settled()
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    opened.page.set_viewport_size(LAPTOP)
    box = opened.page.locator("canvas").bounding_box()
    assert box["y"] + box["height"] < LAPTOP["height"]  # the whole view is in sight


CONTRAST = """() => {
  const numbers = (text) => text.match(/[\\d.]+/g).slice(0, 4).map(Number);
  const linear = (c) => (c / 255 <= 0.03928 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const ground = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const rgba = numbers(getComputedStyle(at).backgroundColor);
      if (rgba.length < 4 || rgba[3] > 0.5) return rgba;
    }
    return [255, 255, 255];
  };
  const hasText = (one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  const found = [];
  for (const one of document.querySelectorAll("body *:not(script, style, canvas, title)")) {
    if (!hasText(one) || !one.getClientRects().length) continue;
    const style = getComputedStyle(one);
    const levels = [luminance(numbers(one.closest("svg") ? style.fill : style.color)), luminance(ground(one))];
    found.push([(Math.max(...levels) + 0.05) / (Math.min(...levels) + 0.05), one.outerHTML.slice(0, 80)]);
  }
  return found;
}"""


def test_texts_contrast_with_their_ground(browser, tmp_path: Path) -> None:
    made = strip_outcome()
    rows = [Row(verdict, verdict) for verdict in ("estimated", "missing", "invalid", "undecided")]
    report = Report((*made.report.rows, *rows), ("extra",))
    made = strip_outcome(readiness=None)
    made = outcome(report=report, scene=made.scene, readiness=ready(made), code=1)
    write_report(tmp_path / "all.html", [made, strip_outcome()])
    opened = Opened(browser, tmp_path / "all.html")
    opened.click("tbody button.name >> nth=4")
    found = opened.page.evaluate(CONTRAST)
    assert len(found) > 80
    assert [text for ratio, text in found if ratio < 4.5] == []
    opened.page.close()


def test_every_control_has_a_name_and_tables_have_headings(opened: Opened) -> None:
    assert opened.page.evaluate("[...document.querySelectorAll('button')].every((one) => one.innerText.trim())")
    assert opened.page.evaluate("[...document.querySelectorAll('th')].every((one) => one.scope === 'col')")
    assert opened.page.get_attribute("canvas", "aria-label")
    assert opened.page.get_attribute("html", "lang") == "en"
    assert opened.page.locator("h1").count() == 1


# --- the view ---------------------------------------------------------------------------------------------------------


def test_the_view_draws(either: Opened) -> None:
    picture = either.picture()
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    assert (picture != 255).any(axis=2).mean() > 0.05


def test_both_renderers_draw_the_same(browser, report: Path) -> None:
    pictures = []
    for webgl in (True, False):
        opened = Opened(browser, report, webgl=webgl)
        pictures.append(opened.picture())
        name = opened.page.get_attribute("section.outcome", "data-renderer")
        opened.page.close()
        if webgl and name != "WebGL":
            pytest.skip("this Chromium has no WebGL")
        assert name == ("WebGL" if webgl else "software")
    first, second = pictures
    assert first.shape == second.shape
    drawn = [(picture != 255).any(axis=2) for picture in pictures]
    assert (drawn[0] & drawn[1]).sum() > 0.95 * (drawn[0] | drawn[1]).sum()
    assert np.median(np.abs(first - second)[drawn[0] & drawn[1]]) <= 3


def test_colours_tell_the_sign_of_deviations(browser, tmp_path: Path) -> None:
    """Outside is orange, inside blue."""
    found = {}
    for bump in (0.02, -0.02):
        write_report(tmp_path / "report.html", [strip_outcome(bump=bump)])
        opened = Opened(browser, tmp_path / "report.html")
        for selector in ("button[data-view=top]", "button[data-lines=edges]"):
            opened.click(selector)
        assert opened.page.locator(".legend").text_content().startswith("deviation, mm")
        red, _, blue = np.moveaxis(opened.picture(), 2, 0)
        found[bump] = int((red > blue + 60).sum()), int((blue > red + 60).sum())
        assert float(opened.page.locator(".legend text").last.text_content()) == pytest.approx(0.005, rel=1e-3)
        opened.page.close()
    (orange, line), (none, both) = found[0.02], found[-0.02]  # a curve is blue in both
    assert orange > 1000
    assert none < 50
    assert both > line + 1000


def test_every_colour_mode_and_toggle_changes_the_picture(either: Opened) -> None:
    pictures = {"deviation": either.picture()}
    for mode in ("distance", "mean", "zebra", "plain"):
        either.click(f"button[data-mode={mode}]")
        assert either.page.get_attribute(f"button[data-mode={mode}]", "aria-pressed") == "true"
        assert either.page.locator("button[data-mode][aria-pressed=true]").count() == 1
        pictures[mode] = either.picture()
    for lines in ("net", "edges", "comb"):
        before = either.page.get_attribute(f"button[data-lines={lines}]", "aria-pressed")
        either.click(f"button[data-lines={lines}]")
        assert either.page.get_attribute(f"button[data-lines={lines}]", "aria-pressed") != before
        pictures[lines] = either.picture()
    for (a, first), (b, second) in itertools.combinations(pictures.items(), 2):
        assert (first != second).any(), (a, b)


def test_the_range_of_colours_can_be_the_tolerance(opened: Opened) -> None:
    assert opened.page.locator(".legend text").last.text_content() == "0.005"
    before = opened.picture()
    opened.click("button[data-tolerance]")
    assert opened.page.locator(".legend text").last.text_content() == "0.001"
    assert "beyond" in opened.page.locator(".legend").text_content()
    assert (opened.picture() != before).any()


def test_dragging_turns_and_moves(either: Opened) -> None:
    before = either.picture()
    mouse, (x, y) = either.page.mouse, either.point(0.5, 0.5)
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 90, y + 40, steps=3)
    mouse.up()
    turned = either.picture()
    assert (turned != before).any()
    either.page.keyboard.down("Shift")
    mouse.down()
    mouse.move(x + 140, y + 40, steps=3)
    mouse.up()
    either.page.keyboard.up("Shift")
    moved = either.picture()
    columns = [np.flatnonzero((picture != 255).any(axis=(0, 2))).mean() for picture in (turned, moved)]
    assert columns[1] - columns[0] == pytest.approx(50, abs=8)
    either.click("button[data-view=fit]")
    np.testing.assert_array_equal(either.picture(), before)


def test_keys_turn_move_and_zoom(opened: Opened) -> None:
    opened.page.focus("canvas")
    pictures = [opened.picture()]
    for key in ("ArrowLeft", "ArrowUp", "Shift+ArrowRight", "+", "-"):
        opened.page.keyboard.press(key)
        pictures.append(opened.picture())
    for first, second in itertools.pairwise(pictures):
        assert (first != second).any()
    opened.page.keyboard.press("Home")
    np.testing.assert_array_equal(opened.picture(), pictures[0])


def test_the_wheel_zooms_a_view_that_was_clicked_and_else_scrolls_the_page(opened: Opened) -> None:
    x, y = opened.point(0.02, 0.5)  # beside the shape
    opened.page.mouse.move(x, y)
    before = opened.picture()
    opened.page.mouse.wheel(0, 50)
    opened.page.wait_for_timeout(200)
    assert opened.page.evaluate("window.scrollY") > 0
    np.testing.assert_array_equal(opened.picture(), before)
    opened.page.evaluate("window.scrollTo(0, 0)")
    opened.page.mouse.click(x, y)
    opened.page.mouse.wheel(0, -200)
    opened.page.wait_for_timeout(100)
    zoomed = opened.picture()
    assert (zoomed != 255).any(axis=2).sum() > 1.2 * (before != 255).any(axis=2).sum()


def test_two_fingers_zoom(opened: Opened) -> None:
    before = opened.picture()
    opened.page.evaluate("""() => {
      const canvas = document.querySelector("canvas"), box = canvas.getBoundingClientRect();
      canvas.setPointerCapture = () => {};
      const send = (kind, pointerId, x) => {
        const place = { clientX: box.x + x, clientY: box.y + 100 };
        canvas.dispatchEvent(new PointerEvent(kind, { pointerId, pointerType: "touch", ...place, bubbles: true }));
      };
      send("pointerdown", 11, 400); send("pointerdown", 12, 500);
      send("pointermove", 12, 600); send("pointermove", 11, 300);
      send("pointerup", 11, 300); send("pointerup", 12, 600);
    }""")
    after = opened.picture()
    assert (after != 255).any(axis=2).sum() > 2 * (before != 255).any(axis=2).sum()
    assert opened.page.locator("tr.chosen").count() == 0


# --- tables -----------------------------------------------------------------------------------------------------------


def test_headings_sort_by_number_and_by_name(opened: Opened) -> None:
    assert opened.rows() == ["patch 1", "patch 2", "patch 3", "wave"]
    head = "table.shapes th:nth-child(3)"
    assert opened.page.get_attribute(head, "data-label") == "deviation, mm"
    opened.click(f"{head} button")
    assert opened.page.get_attribute(head, "aria-sort") == "ascending"
    assert [name for name in opened.rows() if name != "wave"] == ["patch 3", "patch 1", "patch 2"]
    opened.click(f"{head} button")
    assert opened.page.get_attribute(head, "aria-sort") == "descending"
    assert [name for name in opened.rows() if name != "wave"] == ["patch 2", "patch 1", "patch 3"]
    opened.page.focus("table.shapes th:nth-child(1) button")
    opened.page.keyboard.press("Enter")
    assert opened.rows() == ["patch 1", "patch 2", "patch 3", "wave"]
    assert opened.page.get_attribute(head, "aria-sort") == "none"
    opened.click("table.shapes th:nth-child(2) button")
    opened.click("table.shapes th:nth-child(2) button")
    assert opened.rows()[0] == "patch 2"  # the worst verdict


def test_names_sort_with_their_numbers(browser, tmp_path: Path) -> None:
    rows = [Row(f"face {k}", "proved", (0.0, 1e-5 * k)) for k in (10, 9, 100)]
    write_report(tmp_path / "names.html", [outcome(report=Report(tuple(rows), ()))])
    opened = Opened(browser, tmp_path / "names.html")
    opened.click("table.shapes th:nth-child(1) button")
    assert opened.rows() == ["face 9", "face 10", "face 100"]
    opened.page.close()


def test_a_click_on_a_face_selects_its_row_and_a_row_its_face(either: Opened) -> None:
    before = either.picture()
    either.click("button[data-view=top]")
    either.page.mouse.click(*either.point(0.5, 0.55))
    either.settled()
    assert either.rows("tr.chosen") == ["patch 2"]
    assert either.page.get_attribute("tr.chosen button.name", "aria-pressed") == "true"
    told = either.page.inner_text(".selected")
    assert "(0.5, 0.5)" in told
    assert "(15, 5, 0)" in told
    assert either.page.locator(".selected svg.histogram rect").count() == 2
    either.page.focus("table.shapes tbody tr:nth-child(3) button.name")
    either.page.keyboard.press("Enter")
    assert either.rows("tr.chosen") == ["patch 3"]
    either.click("button[data-view=fit]")
    assert (either.picture() != before).any()
    either.page.focus("canvas")
    either.page.keyboard.press("Escape")
    assert either.rows("tr.chosen") == []
    np.testing.assert_array_equal(either.picture(), before)


def test_a_selected_face_is_the_one_that_keeps_its_colour(browser, tmp_path: Path) -> None:
    """Three patches from left to right, seen from above: only the third of the one chosen stays dark."""
    write_report(tmp_path / "strip.html", [strip_outcome()])
    opened = Opened(browser, tmp_path / "strip.html")
    for selector in (
        "button[data-mode=plain]",
        "button[data-lines=edges]",
        "button[data-view=top]",
    ):
        opened.click(selector)
    opened.click("tbody tr:nth-child(3) button.name")
    picture = opened.picture().sum(axis=2)
    columns = np.flatnonzero((picture < 760).any(axis=0))
    thirds = np.array_split(columns, 3)
    dark = [(picture[:, third] < 600).mean() for third in thirds]
    assert dark[2] > 4 * max(dark[0], dark[1])
    opened.page.close()


def test_a_row_whose_face_looks_away_turns_the_view(opened: Opened) -> None:
    """From below the strip is seen from its back; its rows turn it, and a second one leaves it as it is."""
    opened.page.focus("canvas")
    for _ in range(20):
        opened.page.keyboard.press("ArrowUp")
    below = opened.picture()
    opened.click("tbody tr:nth-child(1) button.name")
    turned = opened.picture()
    assert (turned != below).any(axis=2).mean() > 0.05
    opened.click("tbody tr:nth-child(3) button.name")
    opened.click("tbody tr:nth-child(1) button.name")
    np.testing.assert_array_equal(opened.picture(), turned)


def test_findings_point_at_their_places(browser, tmp_path: Path) -> None:
    made = strip_outcome()
    write_report(tmp_path / "ready.html", [outcome(scene=made.scene, readiness=ready(made), code=1)])
    opened = Opened(browser, tmp_path / "ready.html")
    assert opened.rows() == ["patch 1", "patch 2", "patch 3", "wave"]
    assert "1 error and 1 warning" in opened.page.inner_text(".headline")
    assert "warning" in opened.page.inner_text("table.shapes tbody tr:nth-child(3)")
    before = opened.picture()
    opened.click("table.findings tbody tr:nth-child(1) button.name")
    assert "0.0123 mm" in opened.page.inner_text(".selected")
    assert (opened.picture() != before).any()
    assert "off" in opened.page.inner_text("table.criteria tbody tr:nth-child(2)")
    assert "G1: tangent planes agree" in opened.page.inner_text(".key")  # as measured by the check, not by the scene
    assert opened.rows("table.edges tbody tr") == ["edge 4 of face 1 'patch 1', face 2 'patch 2'"]
    assert opened.errors == []
    opened.page.close()


def test_each_curve_has_its_comb(opened: Opened) -> None:
    assert opened.page.locator(".combs figure").count() == 1
    assert opened.page.inner_text(".combs figcaption") == "wave"
    assert opened.page.locator(".combs figure svg").count() == 2
    assert opened.page.locator(".combs svg >> nth=0 >> polyline").count() > 100


def test_hostile_names_are_texts(browser, tmp_path: Path) -> None:
    shapes, parts = strip()
    name = HOSTILE
    part = face(name, shapes["patch 1"])
    rows = (Row(name, "failed", (1.0, 1.0), name, name, face=(0,)),)
    scene = scene_of_parts([part, *parts[1:]], rows, {name: shapes["patch 1"]})
    finding = Finding(name, name, "error", name, 1.0, 2.0, name, (0.0, 0.0, 0.0), name)
    criterion = Criterion(name, name, 1.0, name, name, 1, 1)
    edge = {"element": name, "continuity": "G1", "length": 1.0, "gap": 0.0, "angle_deg": 0.0, "point": None}
    readiness = Readiness(name, (criterion,), (finding,), {name: name, "continuity": [edge]})
    made = outcome(
        file=f"/tmp/{name.replace('/', '')}",
        against=name,
        report=Report(rows, (name,)),
        readiness=readiness,
        scene=scene,
        code=1,
        environment={name: name},
    )
    refused = outcome(file=name, message=name, code=4, environment={})
    write_report(tmp_path / "hostile.html", [made, refused])
    opened = Opened(browser, tmp_path / "hostile.html")
    for number in range(opened.page.locator("tbody button.name").count()):
        opened.click(f"tbody button.name >> nth={number}")
    assert opened.page.evaluate("window.hacked") is None
    assert opened.page.locator("img, b").count() == 0
    assert opened.page.eval_on_selector("table.shapes button.name", "one => one.textContent") == name
    assert name in opened.page.text_content("#outcome-2 .headline")
    assert opened.errors == []
    assert len(opened.requests) == 1
    opened.page.close()


def test_numbers_that_are_none_do_not_stop_a_report(browser, tmp_path: Path) -> None:
    nothing = (float("nan"), float("inf"), 0.0)
    scene = scene_of_parts([face("far", patch([0, 0, 0], [1e160, 0, 0], [0, 1e160, 0], 1e159))])
    row = Row("far", "undecided", (0.0, float("inf")), worst=Worst((0.5, 0.5), nothing, nothing), face=(0,))
    finding = Finding("G", "c", "error", "face 1 'far'", float("nan"), float("inf"), "mm", nothing, "")
    readiness = Readiness("cam", (), (finding,), {"size_mm": float("inf")})
    made = outcome(report=Report((row,), ()), scene=scene, readiness=readiness, code=5)
    for suffix in ("html", "png", "pdf"):
        write_report(tmp_path / f"far.{suffix}", [made])
    opened = Opened(browser, tmp_path / "far.html")
    for number in range(2):
        opened.click(f"tbody button.name >> nth={number}")
    assert opened.rows("tr.chosen") == ["G"]
    assert opened.errors == []
    opened.page.close()


def test_half_letters_in_names_do_not_stop_a_report(tmp_path: Path) -> None:
    made = outcome(file="part\ud800.step", message="\udcff", code=3)
    for suffix in ("html", "png"):
        write_report(tmp_path / f"half.{suffix}", [made])
        assert (tmp_path / f"half.{suffix}").stat().st_size > 1000


# --- several files, and none ------------------------------------------------------------------------------------------


def test_several_files_have_a_table_and_a_section_each(browser, tmp_path: Path) -> None:
    outcomes = [
        strip_outcome(),
        outcome(file="bad.step", message="bad.step: is not a readable STEP file", code=3, environment={}),
        strip_outcome(bump=0.001, file="fine.step"),
    ]
    outcomes[2] = outcome(file="fine.step", report=outcomes[2].report, scene=outcomes[2].scene)
    write_report(tmp_path / "batch.html", outcomes)
    opened = Opened(browser, tmp_path / "batch.html")
    assert opened.rows("table.index tbody tr") == ["strip.step", "bad.step", "fine.step"]
    assert opened.page.locator("section.outcome").count() == 3
    assert "not a readable STEP file" in opened.page.inner_text("#outcome-2")
    opened.click("table.index tbody tr:nth-child(3) a")
    opened.page.wait_for_selector("#outcome-3[data-renderer]")
    for number in (0, 1):
        opened.page.locator("canvas").nth(number).scroll_into_view_if_needed()
        opened.settled()
        assert (opened.picture(number) != 255).any(axis=2).mean() > 0.05
    opened.click("#outcome-3 button[data-mode=plain]")
    assert opened.page.get_attribute("#outcome-1 button[data-mode=deviation]", "aria-pressed") == "true"
    opened.click("table.index th:nth-child(2) button")
    assert opened.rows("table.index tbody tr") == ["fine.step", "strip.step", "bad.step"]
    assert opened.errors == []
    opened.page.close()


def test_too_many_views_for_a_page_are_left_out_and_said_so(monkeypatch) -> None:
    monkeypatch.setattr("gtcad.converters.report._MOST_CORNERS", 3000)
    text = html_page([strip_outcome(), strip_outcome()])
    assert text.count('class="scene"') == 1
    assert text.count("was left out to keep the page small") == 1


def test_a_model_of_twelve_patches_stays_below_5_MB(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    points = np.stack([x, y, np.random.default_rng(2).normal(0, 2, (4, 4))], axis=-1)
    first = Surface(points, (0.2, -0.4), (0.6, 0.1))
    fit = fit_surface(first, tolerance=1e-6)
    shapes, rows, parts = {}, [], []
    for k in range(12):
        name, away = f"patch {k}", np.array([4.0 * k, 0, 0])
        shapes[name] = first.transformed(np.eye(3), away)
        parts.append(Part(name, fit.spline.with_control_points(fit.spline.control_points + away)))
        rows.append(Row(name, "proved", fit.deviation, face=(k,)))
    scene = scene_of_parts(parts, rows, shapes)
    for row, held in zip(rows, scene.faces, strict=True):  # samples at nearest points: at most the proved bound
        assert 0 < np.abs(held.values["deviation"]).max() <= row.deviation[1] + 1e-13
    write_report(tmp_path / "twelve.html", [outcome(report=Report(tuple(rows), ()), scene=scene)])
    assert 5e5 < (tmp_path / "twelve.html").stat().st_size < 5e6


# --- paper ------------------------------------------------------------------------------------------------------------


def test_the_page_prints_with_its_picture(browser, report: Path) -> None:
    opened = Opened(browser, report)
    opened.settled()
    data = opened.page.pdf(format="A4", prefer_css_page_size=True, print_background=False)
    assert data.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", data)) == 2 or len(re.findall(rb"/Type\s*/Page\b", data)) == 1
    assert re.search(rb"/Subtype\s*/Image", data)
    opened.page.set_viewport_size({"width": 703, "height": 1000})
    opened.page.emulate_media(media="print")
    opened.page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert not opened.page.is_visible(".tools")
    assert opened.page.is_visible("canvas")
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 703
    assert (opened.picture() != 255).any(axis=2).mean() > 0.05
    opened.page.close()


def test_wide_tables_fit_paper(browser, tmp_path: Path) -> None:
    """A4 without its margins is 703 pixels wide."""
    worst = Worst((0.123456, 0.654321), (-1234.5678, -2345.6789, -3456.789), (-1.234e-5, -2.345e-5, -3.456e-5))
    told = "all faces; closed solid, 19498.2227 mm^3 by the kernel"
    rows = [
        Row(
            f"turbine blade.pressure side {k}",
            "undecided",
            (5.48e-4, 5.52e-4),
            told,
            told,
            worst,
            Histogram((0, 1), (3,)),
        )
        for k in range(3)
    ]
    made = strip_outcome()
    write_report(
        tmp_path / "wide.html", [outcome(report=Report(tuple(rows), ()), scene=made.scene, readiness=ready(made))]
    )
    opened = Opened(browser, tmp_path / "wide.html")
    opened.page.set_viewport_size({"width": 703, "height": 1000})
    opened.page.emulate_media(media="print")
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 703
    opened.page.close()


def test_views_that_were_never_seen_print_too(browser, tmp_path: Path) -> None:
    write_report(tmp_path / "many.html", [strip_outcome()] * 4)
    opened = Opened(browser, tmp_path / "many.html")
    assert opened.page.get_attribute("#outcome-4", "data-renderer") is None
    opened.page.pdf(format="A4")
    assert (opened.picture(3) != 255).any(axis=2).mean() > 0.05
    opened.page.close()


def test_png(tmp_path: Path) -> None:
    write_report(tmp_path / "report.png", [strip_outcome()])
    picture = np.asarray(Image.open(tmp_path / "report.png").convert("RGB")).astype(int)
    assert picture.shape[1] == round(8.27 * 150)
    assert picture.shape[0] > 900
    red, blue = picture[..., 0], picture[..., 2]
    assert (red > blue + 60).sum() > 2000  # the raised patch is orange
    made = strip_outcome(bump=-0.02)
    write_report(tmp_path / "low.png", [made])
    low = np.asarray(Image.open(tmp_path / "low.png").convert("RGB")).astype(int)
    assert (low[..., 2] > low[..., 0] + 60).sum() > (blue > red + 60).sum() + 2000


def test_pdf_pages(tmp_path: Path) -> None:
    def pages(outcomes) -> int:
        write_report(tmp_path / "report.pdf", outcomes)
        data = (tmp_path / "report.pdf").read_bytes()
        assert data.startswith(b"%PDF-")
        return len(re.findall(rb"/Type\s*/Page\b", data))

    assert pages([strip_outcome()]) == 1
    assert pages([outcome(), outcome(message="no", code=4)]) == 3  # the table, and one each
    rows = tuple(Row(f"face {k}", "proved", (0.0, 1e-6), "equal parameters") for k in range(150))
    assert pages([outcome(report=Report(rows, ()))]) >= 2


def test_long_batches_fit_a_png(tmp_path: Path, monkeypatch) -> None:
    """Pictures have at most 65536 lines: what is beyond a height is left out."""
    monkeypatch.setattr("gtcad.converters.report_print._HIGHEST", 6.0)
    rows = tuple(Row(f"face {k}", "missing") for k in range(100))
    write_report(tmp_path / "long.png", [outcome(report=Report(rows, ()), code=1)] * 2)
    with Image.open(tmp_path / "long.png") as picture:
        assert 6 * 150 < picture.size[1] < 8 * 150


def test_print_needs_the_extra(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for suffix in ("pdf", "png"):
        with pytest.raises(ExtraMissing, match=r"gtcad\[plot\]"):
            write_report(tmp_path / f"report.{suffix}", [strip_outcome()])
    write_report(tmp_path / "report.html", [strip_outcome()])
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


# --- files and words --------------------------------------------------------------------------------------------------


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.html, \.pdf, \.png, got '.*report\.txt'"):
        write_report(tmp_path / "report.txt", [outcome()])
    with pytest.raises(InputError, match="at least one outcome"):
        write_report(tmp_path / "report.html", [])
    with pytest.raises(FileError, match="cannot be written"):
        write_report(tmp_path / "nowhere" / "report.html", [outcome()])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", ["html", "png", "pdf"])
def test_equal_outcomes_give_equal_bytes(tmp_path: Path, suffix: str) -> None:
    for name in ("a", "b"):
        write_report(tmp_path / f"{name}.{suffix}", [strip_outcome()])
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_what_the_verdict_says() -> None:
    rows = tuple(Row(f"s{k}", "proved", (0.0, 8.41e-4)) for k in range(3))
    text = headline(outcome(report=Report(rows, ())))
    assert (
        text == "3 shapes, each proved to lie within 0.001 mm of strip.toml, the largest deviation at most 8.41e-4 mm."
    )
    rows = (*rows, Row("e", "estimated", (9.991e-4, 9.991e-4)))
    assert "3 proved and 1 estimated" in headline(outcome(report=Report(rows, ())))
    assert "10.00e-4" not in headline(outcome(report=Report(rows, ())))
    assert "1.00e-3 mm" in headline(outcome(report=Report(rows, ())))  # rounded up
    rows = (*rows, Row("m", "missing"), Row("f", "failed", (0.12345, 0.2)), Row("u", "undecided"))
    text = headline(outcome(report=Report(rows, ()), code=1))
    assert "1 outside the tolerance, 1 missing, 1 undecided" in text
    assert "Worst: f, 1.23e-1 mm" in text  # rounded down
    assert headline(outcome(message="bad.step: is empty", code=3)) == "Not checked: bad.step: is empty"


def test_lines_tell_what_holds_each_shape() -> None:
    first, *_, last = lines_of(strip_outcome())
    assert (first.kind, first.degree, first.poles, first.faces) == ("B-spline, 3x3 poles", "2x2", 9, (0,))
    assert (last.name, last.verdict) == ("wave", "extra")


def test_the_report_of_a_real_check(browser, tmp_path: Path) -> None:
    """A file that was written, read, and checked for CAM and against another one."""
    shapes, parts = strip(bump=0.02)
    files = [str(tmp_path / f"{name}.step") for name in ("strip", "flat")]
    write_step(files[0], parts)
    write_step(files[1], strip(bump=0.0)[1])
    job = Job(files[0], "STEP", files[1], "STEP", 1e-3, profile="cam", scene=True)
    checked = run_job(job)
    assert [held.name for held in checked.scene.faces] == list(shapes)
    middle = checked.scene.faces[1].values["deviation"]
    assert np.abs(middle).max() == pytest.approx(0.005, rel=1e-6)
    assert lines_of(checked)[1].verdict == "failed"
    write_report(tmp_path / "report.html", [checked])
    opened = Opened(browser, tmp_path / "report.html")
    assert opened.rows() == list(shapes)
    assert opened.page.locator("table.criteria tbody tr").count() == len(checked.readiness.criteria)
    assert (opened.picture() != 255).any(axis=2).mean() > 0.05
    assert opened.errors == []
    opened.page.close()


# --- colours ----------------------------------------------------------------------------------------------------------

# G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009), severity 1.0
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
)
PROTANOPIA = np.array(
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
)


def linear(colour: str) -> np.ndarray:
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(rgb, 0, 1)
    x, y, z = np.where((t := xyz / [0.9505, 1.0, 1.089]) > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", [np.eye(3), DEUTERANOPIA, PROTANOPIA])
def test_colours_are_told_apart_with_any_colour_vision(vision: np.ndarray) -> None:
    seen = {name: np.array([lab(vision @ linear(colour)) for colour in colours]) for name, colours in MAPS.items()}
    assert (np.diff(seen["magnitude"][:, 0]) > 3).all()  # always lighter
    signed = seen["signed"]
    assert (np.diff(signed[:5, 0]) > 3).all()
    assert (np.diff(signed[4:, 0]) < -3).all()
    for k in range(4):  # both signs of one magnitude
        assert np.linalg.norm(signed[k] - signed[-1 - k]) > 20
    edges = [lab(vision @ linear(colour)) for colour, *_ in EDGES.values()]
    for (i, a), (j, b) in itertools.combinations(enumerate(edges), 2):
        assert np.linalg.norm(a - b) > 15, (i, j)
    assert len({dash for _, _, dash, _ in EDGES.values()}) == len(EDGES)
