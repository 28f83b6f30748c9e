"""The page's scripts write a rate as Python does: a sentence and a chart of one page have the same number."""

from collections.abc import Mapping
from pathlib import Path

from browser import Tab
from foldcar.statistics.words import percent_number
from swept_listing import foldcar
from written_study import write_study

SAMPLES = 40
WIDTHS, RADII = [float(width) for width in range(70, 120, 5)], [40.0, 45.0, 50.0, 55.0]
# The numbers in the map's cells, by the colours that only they have.
CELLS = """[...document.querySelectorAll("[data-chart=map] svg text")].map(({ textContent }) => textContent)"""


def passing(design: Mapping[str, float]) -> int:
    """How many runs of a design pass: 1 to 40, every number once; every second rate is half a per cent."""
    return 1 + WIDTHS.index(design["width_mm"]) * len(RADII) + RADII.index(design["radius_mm"])


def test_half_per_cents_are_rounded_alike_by_scripts_and_sentences(tmp_path: Path) -> None:
    varied = {"width_mm": WIDTHS, "radius_mm": RADII}
    store = write_study(
        tmp_path / "s.db", varied, SAMPLES, lambda design, sample: "passed" if sample < passing(design) else "stuck"
    )
    foldcar("report", store, "-o", tmp_path / "report")

    with Tab((tmp_path / "report" / "index.html").as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.ask("document.querySelector('[data-chart=map]').scrollIntoView()")
        tab.wait(f"{CELLS}.length > {len(WIDTHS) * len(RADII)}")
        texts = tab.ask(CELLS)

    expected = [percent_number(passed / SAMPLES) for passed in range(1, SAMPLES + 1)]
    assert {"2", "8", "12", "62"} <= set(expected)
    assert set(expected) <= set(texts)
