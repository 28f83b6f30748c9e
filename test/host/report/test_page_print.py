"""The study page on paper with a browser's own settings: coloured keys, whole headings, complete charts."""

import json
from pathlib import Path

import pytest

from browser import Tab
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
