"""The study page simulates its runs in a browser: a press, the check of all runs, sliders, what it cannot simulate."""

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from browser import Tab, move_slider, study_of
from foldcar.statistics.rate import wilson_interval
from foldcar.store.reader import Store
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, reported

WIDTHS, SAMPLES = (95, 120, 245), 4
VERIFIED = "document.querySelector('#verify [role=status]').textContent"
RATES = "[...document.querySelectorAll('#whatif-chart td:nth-child(3)')].map(cell => cell.textContent)"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The folder of a swept store, s.db, with two trials, of its listing l.json and its report."""
    return reported(tmp_path_factory.mktemp("page"), WIDTHS, SAMPLES)


def opened(report: Path, fragment: str = "") -> Tab:
    return Tab(f"{(report / 'index.html').as_uri()}#{fragment}")


def ready(tab: Tab) -> Tab:
    tab.wait("document.body?.dataset.state === 'ready'")
    return tab


def set_slider(tab: Tab, label: str, value: float) -> None:
    """Move a slider as a person does, and wait until all designs are simulated."""
    tab.ask("delete document.getElementById('whatif').dataset.done")
    move_slider(tab, label, value)
    tab.wait("document.getElementById('whatif').dataset.done")


def test_a_pressed_run_drives_as_it_was_stored_and_all_runs_are_reproduced(study: Path) -> None:
    with opened(study / "report") as tab:
        ready(tab).ask("study.open(1, 2)")
        tab.wait("document.getElementById('replay').dataset.readyMs")
        end_s = float(tab.ask("document.getElementById('replay').dataset.end"))
        verdict = tab.ask("document.querySelector('.verified').textContent")
        tab.ask("document.querySelector('#verify button').click()")
        tab.wait(f"/^[✓✗]/.test({VERIFIED})", 120)
        verified, errors = tab.ask(VERIFIED), tab.ask("errors")

    query = "SELECT elapsed_time_s FROM result WHERE design_position = 1 AND sample = 2"
    (stored_s,) = sqlite3.connect(study / "s.db").execute(query).fetchone()
    runs = len(WIDTHS) * SAMPLES
    assert end_s == pytest.approx(stored_s) and errors == []
    assert verdict == "✓ This page computed the stored outcome and numbers, bit by bit."
    assert verified.startswith(f"✓ {runs} of {runs} runs reproduced by this page, bit by bit (carsim ")


@pytest.mark.parametrize("is_same_build", [True, False])
def test_a_result_that_differs_is_named_with_its_reason(study: Path, tmp_path: Path, is_same_build: bool) -> None:
    (tmp_path / "s.db").write_bytes((study / "s.db").read_bytes())
    with sqlite3.connect(tmp_path / "s.db") as connection:
        (roll_rad,) = connection.execute("SELECT max(max_roll_rad) FROM run").fetchone()
        connection.execute("UPDATE run SET max_roll_rad = ?1 * (1 + 1e-15) WHERE max_roll_rad = ?1", [roll_rad])
        query = "SELECT design_position, sample FROM result ORDER BY max_roll_rad DESC"
        design, sample = connection.execute(query).fetchone()
        (build,) = connection.execute("SELECT name FROM build").fetchone()
        if not is_same_build:
            connection.execute("UPDATE build SET name = '0123456789abcdef'")
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    with opened(tmp_path / "report", f"design={WIDTHS[design]}+mm&env={sample}&at=runs") as tab:
        ready(tab).wait("document.querySelector('.verified').textContent")
        verdict = tab.ask("document.querySelector('.verified').textContent")
        tab.ask("document.querySelector('#verify button').click()")
        tab.wait(f"/^[✓✗]/.test({VERIFIED})", 120)
        verified, agent = tab.ask(VERIFIED), tab.ask("navigator.userAgent")

    fault = (
        f"Both are of carsim {build}, which should compute the same bits everywhere: this is a fault of foldcar, not of "
        "your study. Please send its authors this page (index.html), this text, and the name of your system. Your "
        f"browser: {agent}."
    )
    other_build = (
        f"The stored result is of carsim 0123456789abcdef, this page has {build}: "
        "sweep and report again with one foldcar."
    )
    reason = fault if is_same_build else other_build
    assert verdict.startswith("✗ The stored run ") and verdict.endswith(reason)
    assert verified.startswith(f"✗ {len(WIDTHS) * SAMPLES - 1} of {len(WIDTHS) * SAMPLES} runs reproduced")
    assert verified.endswith(f" These differ: {WIDTHS[design]} mm in environment {sample}. {reason}")


@pytest.mark.parametrize("variation", [None, "workshop"])
def test_a_slider_gives_the_rates_of_a_sweep_with_that_reality(variation: str | None, tmp_path: Path) -> None:
    listing = listing_of(STEP_PYRAMIDS, {"width": list(WIDTHS)}, timeout=120, environments=SAMPLES)
    if variation:
        listing["experiments"]["1"]["params"]["variation"] = variation
    (tmp_path / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db")
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    with opened(tmp_path / "report", "r.servo_torque=0.8") as tab:
        ready(tab).wait("document.getElementById('whatif').dataset.done")
        set_slider(tab, "obstacle height", 1.25)
        set_slider(tab, "start scatter, heading", 0.08)
        tab.ask("document.querySelector('#whatif-chart summary').click()")
        tab.wait(f"{RATES}.length")
        # The page writes its address at most twice a second.
        tab.wait("location.hash.includes('r.start_heading_sd_rad')")
        rates, address, errors = tab.ask(RATES), tab.ask("location.hash"), tab.ask("errors")
        spans = tab.ask(RATES.replace("(3)", "(4)"))
    values = {part.split("=")[0][2:]: float(part.split("=")[1]) for part in address[1:].split("&") if part[:2] == "r."}
    (tmp_path / "reality.json").write_text(json.dumps(values))
    foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--reality", tmp_path / "reality.json")

    assert set(values) == {"servo_torque", "obstacle_height", "start_heading_sd_rad"} and errors == []
    with Store.open(tmp_path / "s.db") as store:
        _, name = store.info().experiments
        counts = store.design_counts(name)
    assert rates == [f"{passed} of {SAMPLES}" for passed in counts.passed]
    intervals = [wilson_interval(passed, SAMPLES) for passed in counts.passed]
    assert spans == [f"{100 * low:.0f} % to {100 * high:.0f} %" for low, high in intervals]


def test_before_a_slider_moves_every_design_stands_where_it_was_simulated(study: Path) -> None:
    with opened(study / "report") as tab:
        ready(tab).ask("document.querySelector('#whatif-chart summary').click()")
        tab.wait(f"{RATES}.length")
        assert tab.ask(RATES) == tab.ask(RATES.replace("(3)", "(2)"))
        assert tab.ask(RATES)[0].endswith(f" of {SAMPLES}")
        tab.ask("document.getElementById('whatif').scrollIntoView(); dispatchEvent(new Event('scroll'))")
        line = tab.wait("document.querySelectorAll('#whatif-chart svg path[stroke=\"#d55e00\"]').length")
        assert line > len(WIDTHS)


def test_the_unknown_that_matters_most_comes_first(study: Path) -> None:
    with opened(study / "report", "design=95+mm") as tab:
        ready(tab).ask("document.getElementById('marginals').click()")
        tab.wait("document.getElementById('whatif-single').dataset.done", 300)
        captions = tab.ask("[...document.querySelectorAll('#whatif-single figcaption')].map(one => one.textContent)")
        errors = tab.ask("errors")

    points = [int(caption.split("changes success by ")[1].split(" ")[0]) for caption in captions]
    assert len(captions) == 9 and points == sorted(points, reverse=True) and points[0] > 0
    assert errors == []


def test_the_pictures_of_each_unknown_say_at_which_values_the_others_were(study: Path) -> None:
    """A slider that moves on changes neither the pictures nor their heading."""
    heading = "document.querySelector('#whatif-single h3').textContent"
    first = f"Success of 95 mm over each unknown, in {SAMPLES} environments, the others as simulated"
    with opened(study / "report", "design=95+mm") as tab:
        ready(tab).ask("document.getElementById('marginals').click()")
        assert tab.ask(heading) == first
        set_slider(tab, "friction", 0.7)
        assert tab.ask(heading) == first
        friction = tab.ask("document.querySelector('input[aria-label^=\"friction\"]').getAttribute('aria-valuetext')")
        tab.ask("document.getElementById('marginals').click()")
        assert tab.ask(heading) == f"{first}, except friction {friction}"


def test_what_a_page_cannot_simulate_is_said(study: Path, tmp_path: Path) -> None:
    listing: Any = json.loads((study / "l.json").read_text())
    listing["experiments"]["1"]["params"]["environments"] = 1
    (tmp_path / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--engine", "mujoco")
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    (experiment,) = study_of(tmp_path / "report")["experiments"]
    assert experiment["drives"] is None
    assert any("The page cannot simulate: MuJoCo does not run in a page" in remark for remark in experiment["remarks"])
    with opened(tmp_path / "report") as tab:
        ready(tab)
        hidden = tab.ask("['verify', 'whatif', 'replay'].map(id => document.getElementById(id).hidden)")
    assert hidden == [True, True, True]
