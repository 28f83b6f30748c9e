"""Headings and ticks of the page's charts: none runs into another, and no line runs through them."""

import json
from pathlib import Path
from typing import Any

import pytest

from browser import Tab
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

# 65 and 245 are not round: a tick at 240 would stand beside 245.
STUDIES = {"widths": {"width": [65, 95, 115, 185, 245]}, "wheels": {"width": [75, 115, 245], "radius": [44, 60]}}
SAMPLES = 20

TEXTS = """(async () => {
  const pause = time => new Promise(go => setTimeout(go, time)), charts = [];
  const paper = getComputedStyle(document.documentElement).getPropertyValue("--paper").trim();
  for (const chart of document.querySelectorAll(".chart")) {
    chart.scrollIntoView();
    dispatchEvent(new Event("scroll"));
    await pause(60);
    const marks = [...chart.querySelectorAll("svg path, svg text")], texts = [];
    marks.forEach((mark, place) => {
      const box = mark.getBoundingClientRect();
      if (mark.tagName !== "text" || !mark.textContent.trim() || !box.width) return;
      const size = parseFloat(getComputedStyle(mark).fontSize), edge = marks[place - 1]?.getBoundingClientRect();
      const covers = edge && edge.left <= box.left && edge.right >= box.right && edge.top <= box.top + 2
        && edge.bottom >= box.bottom - 2;
      texts.push({ text: mark.textContent, box: box.toJSON(), place, heading: size === 12,
        ground: Boolean(covers) && marks[place - 1].getAttribute("fill") === paper });
    });
    const lines = marks.map((mark, place) => place).filter(place => marks[place].getAttribute("fill") === "none"
      && (marks[place].getAttribute("d") ?? "").split("L").length > 3);
    charts.push({ name: chart.parentElement.dataset.chart ?? chart.ariaLabel, texts, lastLine: Math.max(-1, ...lines) });
  }
  return charts;
})()"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> dict[str, Path]:
    """The page of each study, by its name."""
    result = {}
    for name, cars in STUDIES.items():
        folder = tmp_path_factory.mktemp(name)
        listing = listing_of(STEP_PYRAMIDS, cars, timeout=40, environments=SAMPLES)
        (folder / "l.json").write_text(json.dumps(listing))
        foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "0")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(write, "_save_figures", lambda *_: None)
            foldcar("report", folder / "s.db", "-o", folder / "report")
        result[name] = folder / "report" / "index.html"
    return result


def close(a: dict[str, float], b: dict[str, float]) -> bool:
    """Whether two texts overlap, or stand in one line with less than 4 px between them."""
    beside = min(a["right"], b["right"]) - max(a["left"], b["left"]) > -4
    return beside and min(a["bottom"], b["bottom"]) - max(a["top"], b["top"]) > 2


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("study", STUDIES)
def test_no_tick_or_heading_runs_into_another_or_under_a_line(pages: dict[str, Path], study: str, width: int) -> None:
    with Tab(pages[study].as_uri(), width) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        charts: list[dict[str, Any]] = tab.ask(TEXTS)
        assert tab.ask("errors") == []

    assert {"parallel", "scatter", "ends", "grid"} < {chart["name"] for chart in charts}
    for chart in charts:
        texts = chart["texts"]
        over = [(a["text"], b["text"]) for k, a in enumerate(texts) for b in texts[:k] if close(a["box"], b["box"])]
        assert len(texts) > 3 and over == [], chart["name"]
    (parallel,) = (chart for chart in charts if chart["name"] == "parallel")
    shown = [text["text"] for text in parallel["texts"]]
    low, high = min(STUDIES[study]["width"]), max(STUDIES[study]["width"])
    assert str(low) in shown and str(high) in shown and str(high - 5) not in shown
    headings = [text for text in parallel["texts"] if text["heading"]]
    assert len(headings) >= 7 and parallel["lastLine"] > 0
    if width < 600:
        # A heading stands between two axes, where lines run: on a ground of its own, above them.
        assert all(heading["ground"] and heading["place"] > parallel["lastLine"] for heading in headings)
