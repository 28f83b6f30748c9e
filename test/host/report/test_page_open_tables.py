"""A table that is open below a chart has the chart's numbers, also after a slider, a filter or an axis has changed."""

import sqlite3
from pathlib import Path

import pytest

from browser import READY, Tab, move_slider
from swept_listing import foldcar, reported

WIDTHS, SAMPLES = (80, 95, 245), 6
# With these values designs pass in other numbers of environments than nominally.
SLIDERS = {"obstacle height": 1.2, "friction": 0.7}
AS_SIMULATED = """
  [...document.querySelectorAll("#whatif button")].find(({ textContent }) => textContent === "as simulated").click()
"""
# The sum of the counts in the table of where runs end.
TOTAL = """
  [...document.querySelectorAll("#ends tbody td")].reduce((sum, cell) => sum + (Number(cell.textContent) || 0), 0)
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The folder of a swept store, s.db, and of its report."""
    return reported(tmp_path_factory.mktemp("page"), WIDTHS, SAMPLES)


def counts(store: Path) -> list[str]:
    """How many runs of each design passed, as the page writes it."""
    query = "SELECT sum(outcome = 'passed'), count(*) FROM result GROUP BY design_position ORDER BY design_position"
    return [f"{passed} of {runs}" for passed, runs in sqlite3.connect(store).execute(query)]


def cells(tab: Tab, place: str, column: int) -> list[str]:
    """The texts of a column of the first table in a place of the page."""
    rows = f"document.querySelectorAll('{place} details.behind tbody tr')"
    texts: list[str] = tab.ask(f"[...{rows}].map(row => row.children[{column}].textContent)")
    return texts


def test_an_open_table_follows_the_sliders_as_a_sweep_in_that_reality(study: Path) -> None:
    nominal = counts(study / "s.db")

    with Tab((study / "report" / "index.html").as_uri()) as tab:
        tab.wait(READY)
        tab.ask("document.querySelector('#whatif details.behind').open = true")
        tab.wait("!!document.querySelector('#whatif details.behind table')")
        assert cells(tab, "#whatif", 2) == nominal
        for name, value in SLIDERS.items():
            move_slider(tab, name, value)
        tab.wait("document.getElementById('whatif').dataset.done")
        (study / "reality.json").write_text(tab.ask("JSON.stringify(study.state.reality)"))
        other = study / "other.db"
        options = ("--reality", study / "reality.json", "--realities", "0")
        foldcar("sweep", study / "l.json", "--store", other, *options)
        changed = counts(other)
        assert changed != nominal
        assert [cells(tab, "#whatif", column) for column in (1, 2)] == [nominal, changed]

        tab.ask(AS_SIMULATED)
        tab.wait(f"document.querySelector('#whatif tbody tr td:nth-child(3)').textContent === '{nominal[0]}'")
        assert cells(tab, "#whatif", 2) == nominal
        assert tab.ask("errors") == []


def test_an_open_table_of_where_runs_end_follows_the_filter_of_outcomes(study: Path) -> None:
    query = "SELECT outcome, count(*) FROM result WHERE outcome NOT IN ('passed', 'rejected', 'failed') GROUP BY 1"
    ended = dict(sqlite3.connect(study / "s.db").execute(query).fetchall())
    kept, *others = sorted(ended, key=lambda name: ended[name])
    assert others

    with Tab((study / "report" / "index.html").as_uri()) as tab:
        tab.wait(READY)
        tab.ask("document.querySelector('#ends details.behind').open = true")
        tab.wait("!!document.querySelector('#ends details.behind table')")
        assert tab.ask(TOTAL) == sum(ended.values())
        tab.ask(f"study.set({{ outcomes: ['{kept}'] }})")
        tab.wait(f"{TOTAL.strip()} === {ended[kept]}")
        # An equal table is not replaced: what a reader has marked in it stays marked.
        tab.ask("window.shown = document.querySelector('#ends table')")
        tab.ask("study.set({})")
        assert tab.ask("window.shown === document.querySelector('#ends table')")
        assert tab.ask("errors") == []
