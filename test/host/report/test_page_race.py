"""The recommended car drives at the top of the page and designs that are pressed race it, as the store's runs did."""

import json
import re
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from browser import READY, Tab, study_of
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

WIDTHS, SAMPLES = (80, 95, 110, 180, 245), 20
RACE = "document.getElementById('race')?"
DROVE = f"{RACE}.dataset.readyMs"
LEGEND = "[...document.querySelectorAll('#race .scene-legend > span')].map(one => one.textContent)"
ENVIRONMENT = "document.querySelector('#drive select[aria-label], #drive label select').value"
WORDS = {
    "passed": "passed",
    "tipped": "tipped over",
    "stuck": "stuck",
    "off_course": "off course",
    "timeout": "time limit",
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The folder of a store with runs in other realities and two trials, s.db, and of its report."""
    folder = tmp_path_factory.mktemp("race")
    listing = listing_of(STEP_PYRAMIDS, {"width": list(WIDTHS)}, timeout=60, environments=SAMPLES)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "400")
    rows = ("vehicle_type,outcome,source,width_mm", "W_B_W,passed,notes,95", "W_B_W,tipped,notes,95", "")
    (folder / "t.csv").write_text("\n".join(rows))
    foldcar("trials", "import", folder / "s.db", folder / "t.csv", "--experiment", "1")
    foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder


@pytest.fixture(scope="module")
def page(study: Path) -> str:
    return (study / "report" / "index.html").as_uri()


def ending(study: Path, design: int, environment: int) -> str:
    """What the legend says of a stored run."""
    outcome, elapsed_s = (
        sqlite3.connect(study / "s.db")
        .execute(
            "SELECT outcome, elapsed_time_s FROM result WHERE design_position = ? AND sample = ?", (design, environment)
        )
        .fetchone()
    )
    return f"{WIDTHS[design]} mm: {WORDS[outcome]} after {elapsed_s:.2f} s"


def passes(study: Path) -> dict[int, set[int]]:
    """The designs that pass in each environment."""
    rows = sqlite3.connect(study / "s.db").execute("SELECT sample, design_position, outcome FROM result").fetchall()
    return {
        k: {design for sample, design, outcome in rows if sample == k and outcome == "passed"} for k in range(SAMPLES)
    }


def recommended(study: Path) -> int:
    """The design that the page's first line says to take."""
    (experiment,) = study_of(study / "report")["experiments"]
    name = re.search(r"(?:the car of |works\? )(\d+) mm", experiment["headline"])
    assert name is not None
    return WIDTHS.index(int(name[1]))


def test_the_recommended_car_drives_twice_where_designs_differ_and_stops(study: Path, page: str) -> None:
    with Tab(page) as tab:
        tab.wait(DROVE)
        best, environment = recommended(study), int(tab.ask(ENVIRONMENT))
        assert tab.ask(LEGEND) == [ending(study, best, environment)]
        option = tab.ask("document.querySelector('#drive label select').selectedOptions[0].textContent")
        passed = passes(study)
        assert option == f"{environment}: {len(passed[environment])} of {len(WIDTHS)} designs pass"
        # No environment that it passes divides the designs better.
        divided = {k: abs(len(names) / len(WIDTHS) - 0.5) for k, names in passed.items() if best in names}
        assert environment in divided and divided[environment] == min(divided.values())
        assert tab.ask("!document.querySelector('.still').checkVisibility() && !!document.querySelector('#drive canvas')")

        tab.wait(f"{RACE}.dataset.left === '1' && {RACE}.dataset.playing === 'true'")
        tab.wait(f"{RACE}.dataset.left === '0' && {RACE}.dataset.playing === 'false'")
        end_s = tab.ask("Number(document.querySelector('#race output').textContent.split(' / ')[1].slice(0, -2))")
        assert tab.ask(f"Number({RACE}.dataset.t)") == pytest.approx(end_s, abs=0.01)
        assert tab.ask("errors") == []


def test_a_pause_stops_it_for_good(page: str) -> None:
    with Tab(page) as tab:
        tab.wait(f"Number({RACE}.dataset.t) > 0.2")
        tab.ask("document.querySelector('#race .scene-controls button').click()")
        stopped = tab.ask(f"{RACE}.dataset.t")
        tab.ask("new Promise(go => setTimeout(go, 2500))")
        assert tab.ask(f"{RACE}.dataset.t") == stopped


def test_designs_that_are_pressed_race_at_most_three_beside_the_recommended_one(study: Path, page: str) -> None:
    best = recommended(study)
    others = [design for design in range(len(WIDTHS)) if design != best]
    with Tab(page) as tab:
        tab.wait(DROVE)
        environment = int(tab.ask(ENVIRONMENT))
        proposed = tab.ask("document.querySelector('#race .add')?.textContent ?? null")
        failed = [design for design in others if design not in passes(study)[environment]]
        assert (proposed is not None) == bool(failed)
        for design in [*others, best]:
            tab.ask(f"study.open({design})")
        rivals = others[-3:]
        wanted = [ending(study, design, environment) for design in [best, *rivals]]
        # Before the last of these has driven, the race shows an earlier four.
        tab.wait(f"{LEGEND}.join() === {','.join(wanted)!r}")
        names = [f"{WIDTHS[design]} mm" for design in rivals]
        tab.wait(f"new URLSearchParams(location.hash.slice(1)).get('race') === {';'.join(names)!r}")

        tab.ask(f"document.querySelector('#race button[aria-label=\"take {names[1]} out of the race\"]').click()")
        assert tab.wait(f"{LEGEND}.length === 3 && {LEGEND}") == [wanted[0], wanted[1], wanted[3]]
        assert tab.ask("errors") == []


def test_a_link_opens_a_race_in_its_environment_and_says_what_cannot_race(study: Path, page: str) -> None:
    best = recommended(study)
    rival = next(design for design in range(len(WIDTHS)) if design != best)
    with Tab(f"{page}#race=7 mm;{WIDTHS[rival]} mm&course=5") as tab:
        tab.wait(DROVE)
        assert tab.ask(LEGEND) == [ending(study, design, 5) for design in (best, rival)]
        assert tab.ask("document.getElementById('link-remarks').textContent") == (
            "The link's design 7 mm cannot race, because it is not in experiment 1."
        )
    with Tab(f"{page}#course=77") as tab:
        tab.wait(READY)
        assert "environment 77, which this page cannot simulate" in tab.ask(
            "document.getElementById('link-remarks').textContent"
        )


def seen(tab: Tab) -> Any:
    """Which of the still picture and the drive are visible, and what stands below."""
    return tab.ask("""[document.querySelector(".still").checkVisibility(),
      document.getElementById("drive").checkVisibility(), document.querySelector("#race .note").textContent]""")


def test_a_still_picture_of_the_car_stands_there_without_a_simulator_and_in_print(study: Path, page: str) -> None:
    with Tab(page, before="delete window.WebAssembly;") as tab:
        tab.wait("document.querySelector('#race .note')?.textContent")
        still, drive, note = seen(tab)
        assert still and not drive and note.startswith("The page cannot simulate: ")
        caption = tab.ask("document.querySelector('.still figcaption').textContent")
        assert caption == f"{WIDTHS[recommended(study)]} mm, folded"
        assert tab.ask("document.querySelectorAll('.still svg path').length") > 20
    with Tab(page) as tab:
        tab.wait(DROVE)
        tab.send("Emulation.setEmulatedMedia", media="print")
        assert seen(tab)[:2] == [True, False]


def test_without_motion_the_car_stands_at_its_start(page: str) -> None:
    with Tab(page) as tab:
        tab.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
        tab.send("Page.reload")
        tab.wait(f"{READY} && {DROVE}")
        tab.ask("new Promise(go => setTimeout(go, 1000))")
        assert tab.ask(f"[{RACE}.dataset.t, {RACE}.dataset.playing]") == ["0.000", "false"]
