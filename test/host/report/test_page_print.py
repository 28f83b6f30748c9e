"""The study page on paper with a browser's own settings: coloured keys, whole headings, complete charts."""

import json
import re
import sqlite3
import unicodedata
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import pytest
from pypdf import PdfReader

from browser import Tab, study_of
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

CARS, ENVIRONMENTS = {"width": [80, 95, 245], "radius": [45, 60]}, 170


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The page of a study with so many runs that the screen shows their grid as a canvas."""
    folder = tmp_path_factory.mktemp("paper")
    listing = listing_of(STEP_PYRAMIDS.with_name("kerb.scenic"), CARS, timeout=20, environments=ENVIRONMENTS)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "0")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_save_figures", lambda *_: None)
        foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder / "report" / "index.html"


# What the page shows between the events of a print; before it, every chart has been in sight.
PRINT = """(async () => {
  const pause = time => new Promise(go => setTimeout(go, time)), drawings = css => document.querySelectorAll(css).length;
  const see = async () => {
    for (const chart of document.querySelectorAll(".chart")) {
      chart.scrollIntoView();
      dispatchEvent(new Event("scroll"));
      await pause(30);
    }
  };
  await see();
  const screen = [drawings(".chart > div > svg"), drawings(".chart > div > canvas")];
  dispatchEvent(new Event("beforeprint"));
  const paper = [drawings(".chart > div > svg"), drawings(".chart > div > canvas")];
  const cells = document.querySelectorAll("[data-chart=grid] svg path").length;
  const parallel = [...document.querySelectorAll("[data-chart=parallel] svg text")];
  const texts = parallel.map(text => ({ text: text.textContent, size: parseFloat(getComputedStyle(text).fontSize),
    box: text.getBoundingClientRect().toJSON() })).filter(({ size, text }) => size === 12 && text);
  const keys = ".key, .scale i, .bar i, .bar b, .slider .marks i";
  const faded = [...document.querySelectorAll(keys)].filter(key => getComputedStyle(key).printColorAdjust !== "exact");
  dispatchEvent(new Event("afterprint"));
  await see();
  return { screen, paper, cells, texts, faded: faded.length, keys: drawings(keys), errors,
    again: [drawings(".chart > div > svg"), drawings(".chart > div > canvas")] };
})()"""


def test_paper_has_colours_whole_headings_and_complete_charts(page: Path) -> None:
    with Tab(page.as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        shown = tab.ask(PRINT)
        axes = tab.ask("study.e.axes.filter(axis => axis.values.some(value => value !== null)).map(axis => axis.label)")

    # A canvas is printed as it was frames ago; the grid's cells, a path each, are all there.
    assert shown["screen"][1] > 0 and shown["paper"] == [shown["screen"][0] + 1, 0] and shown["again"] == shown["screen"]
    assert shown["cells"] >= 6 * ENVIRONMENTS
    assert shown["keys"] > 15 and shown["faded"] == 0 and shown["errors"] == []
    # Headings: every word of every axis once, none cut short, none over another.
    texts, words = shown["texts"], " ".join(text["text"] for text in shown["texts"])
    assert not any(text["text"].endswith(("...", "…")) for text in texts)
    assert all(words.count(word) >= 1 for label in axes for word in label.split())
    boxes = [text["box"] for text in texts]
    over = [
        (a["left"], b["left"])
        for k, a in enumerate(boxes)
        for b in boxes[:k]
        if min(a["right"], b["right"]) - max(a["left"], b["left"]) > 0.5
        and min(a["bottom"], b["bottom"]) - max(a["top"], b["top"]) > 2
    ]
    assert len(boxes) > len(axes) and over == []


def test_the_first_two_pages_are_a_handout(page: Path) -> None:
    with Tab(page.as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        # A4, in inches.
        pdf = tab.send("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"]
        screen = tab.ask("getComputedStyle(document.querySelector('#best-designs')).display")
    (shown,) = study_of(page.parent)["experiments"]
    query = "SELECT design_position, SUM(outcome = 'passed'), COUNT(*) FROM result GROUP BY 1 ORDER BY 1"
    counts = sqlite3.connect(page.parents[1] / "s.db").execute(query).fetchall()

    # NFKC takes ligatures apart.
    sheets = [unicodedata.normalize("NFKC", sheet.extract_text()) for sheet in PdfReader(BytesIO(b64decode(pdf))).pages]
    pages = [" ".join(sheet.split()) for sheet in sheets]
    handout = " ".join(pages[:2])
    # What works, the chart with its axes, what to do next, the best designs.
    title = "How likely is each car to work?"
    assert "radius (mm)" in pages[0] and "width (mm)" in pages[0]
    place = 0
    for text in (shown["headline"], title, shown["next"]["text"], "The best 6 designs"):
        place = handout.find(" ".join(text.split()), place) + 1
        assert place, text
    best = sorted(counts, key=lambda row: -row[1] / row[2])
    rows = re.findall(r"width (\d+) mm, radius (\d+) mm (\d+) of (\d+)", handout.split("The best 6 designs")[1])
    assert [[int(passed), int(runs)] for _, _, passed, runs in rows] == [[passed, runs] for _, passed, runs in best]
    by_name = dict(zip(shown["designs"]["name"], (passed for _, passed, _ in counts), strict=True))
    assert all(by_name[f"width {width} mm, radius {radius} mm"] == int(passed) for width, radius, passed, _ in rows)
    # The rest begins on a page of its own.
    rest = ("What if the world differed?", "What makes the difference?", "The runs", "Where the numbers come from")
    assert "environments 170" in handout and pages[2].startswith(rest[0])
    assert all(text not in handout and text in " ".join(pages[2:]) for text in rest)
    assert "save as" not in " ".join(pages) and "as a table" not in " ".join(pages)
    assert screen == "none"
