"""Runs that Scenic rejects are in no rate, failed ones count as not passed: both are said wherever results are shown."""

import csv
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.api.oracle import evaluate
from foldcar.api.study import Study
from foldcar.evidence.selecting import select
from foldcar.report.page_data import page_data
from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.rate import anytime_interval
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.reader import Store
from foldcar.study.experiments import read_study
from foldcar.study.search.objectives import OBJECTIVES
from foldcar.study.search.search import Plan, SearchResult, search, searched_study
from written_study import add_trials, write_study

WIDTHS = {"width_mm": [80.0, 100.0, 120.0, 140.0]}
SAMPLES = 20
# Rejects every run whose sample starts ahead of a place, which is filled in, once the car has driven.
PROGRAM = (
    "model model\nx = Range(0, 0.02)\nego = new Robot at (x, 0), facing -90 deg\n"
    "goal = new Goal at (0.4, 0), facing -90 deg\nrequire always x < {} or ego.position.x < 0.2\n"
)


def outcome(design: Mapping[str, float], sample: int) -> str:
    """At 80 mm all is rejected; else 11 of 20 runs; the others pass, but one at 140 mm."""
    if sample < 11 or design["width_mm"] == 80:
        return "rejected"
    return "stuck" if design["width_mm"] == 140 and sample == 19 else "passed"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_study(tmp_path_factory.mktemp("rejected") / "s.db", WIDTHS, SAMPLES, outcome)


def test_a_report_counts_them_apart(store: Path) -> None:
    with Store.open(store) as opened:
        (page,) = page_data(opened)["experiments"]
    designs = page["designs"]

    assert list(zip(designs["passed"], designs["runs"], strict=True)) == [(0, 0), (9, 9), (9, 9), (8, 9)]
    assert designs["outcomes"][OUTCOMES.index("rejected")] == [20, 11, 11, 11]
    assert designs["rate"] == [None, 1.0, 1.0, pytest.approx(8 / 9, abs=1e-6)]
    assert designs["low"][0] is None and designs["belief"][0] is None and designs["verdict"][0] is None
    # A run that got stuck counts with the limit of 120 s; none of 80 mm tells of its time.
    (time,) = (measure["value"] for measure in designs["measures"] if measure["key"] == "time")
    assert time[0] is None and time[3] == pytest.approx((8 * 12.5 + 120) / 9, rel=1e-4)


def test_advice_goes_by_the_others_and_says_so(store: Path, tmp_path: Path) -> None:
    copy = write_study(tmp_path / "trials.db", WIDTHS, SAMPLES, outcome)
    add_trials(copy, [({"width_mm": 100.0}, sample, "passed") for sample in (0, 15)])
    with Store.open(store) as opened:
        (advice,) = select(opened)
    (compared,) = Study(copy).compare().experiments

    assert advice.works == "In simulation 100 to 140 mm reach 75 %, none with 95 % confidence."
    remark = "53 of 80 runs were rejected: they violated a requirement of the program."
    assert any(sentence.startswith(remark) and "1 design has no other run" in sentence for sentence in advice.remarks)
    (design,) = compared.designs
    assert design.simulated is not None and design.simulated.value == 1 and design.evidence.outcomes["rejected"] == 11
    # The trial in a rejected run's environment has nothing to be paired with.
    assert [trial.simulated for trial in design.evidence.trials] == [None, 1]


def test_an_export_keeps_the_outcome_without_a_verdict(store: Path, foldcar: Any) -> None:
    rows = list(csv.DictReader(foldcar("export", store, "--csv", "-").stdout.splitlines()))

    assert {(row["outcome"], row["passed"]) for row in rows} == {("rejected", ""), ("passed", "true"), ("stuck", "false")}


@pytest.fixture
def listing(tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any) -> Path:
    """Two cars in ten environments of p.scenic, which rejects four of the runs of each."""
    program = tmp_path / "p.scenic"
    program.write_text(PROGRAM.format(1))
    starts = sorted(open_environment(program, {}, 0).sample(k)["start"]["x_m"] for k in range(10))
    program.write_text(PROGRAM.format(sum(starts[5:7]) / 2))
    listing_data["environments"]["1"] = {"scenic_filename": "p.scenic"}
    listing_data["experiments"]["1"]["params"] |= {"environments": 10, "threshold": 0.5}
    return write_listing(listing_data)


def test_a_sweep_counts_them_apart(listing: Path, tmp_path: Path, foldcar: Any) -> None:
    swept = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    numbers = json.loads(foldcar("sweep", listing, "--store", "s.db", "--jobs", "1", "--json").stdout)
    report = foldcar("report", "s.db", "-o", "report")

    assert ", 100.0 % of 12 passed, 8 rejected; store: s.db" in swept.stdout, swept.stderr
    assert (numbers["judged"], numbers["passed"], numbers["rejected"]) == (12, 12, 8)
    assert "8 of 20 runs were rejected: they violated a requirement of the program." in report.stdout
    assert "In simulation each of 2 designs reaches 50 %" in " ".join(report.stdout.split())
    evaluation = evaluate({"type": "W_B_W", "params": [{"common": {"width": 95}}]}, tmp_path / "p.scenic", 10, jobs=1)
    assert evaluation.rate.value == 1 and evaluation.runs["passed"].isna().sum() == 4


def test_a_sweep_until_decided_and_a_search_go_by_the_others(listing: Path, foldcar: Any) -> None:
    until = json.loads(foldcar("sweep", listing, "--store", "u.db", "--jobs", "1", "--until", "decided", "--json").stdout)
    plan, result = Plan((OBJECTIVES["success"],), designs=2, fresh=3), SearchResult(planned=2)
    search(searched_study(read_study(listing), plan), plan, listing.parent / "o.db", Carsim(), 1, "", result)

    rule = StoppingRule(None, (0.5,))
    for design in until["designs"]:
        assert design["rejected"] and design["passed"] == design["runs"] - design["rejected"]
        assert design["decided"] == bool(rule.decided(design["passed"], design["passed"]))
        assert design["low"] == pytest.approx(float(anytime_interval(design["passed"], design["passed"])[0]))
    assert [design.chosen_by for design in result.best] == [(1,), (1,)]


FAILS_FROM = (
    "model model\nego = new Robot at (Range(0, 0.02), 0), facing -90 deg\n"
    "goal = new Goal at (0.4, 0), facing -90 deg\nrecord initial 1 / (ego.position.x < {}) as y\n"
)


@pytest.fixture
def failing(tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any) -> Path:
    """One car in ten environments of p.scenic."""
    (tmp_path / "p.scenic").write_text(FAILS_FROM.format(1))
    listing_data["environments"]["1"] = {"scenic_filename": "p.scenic"}
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = 95
    listing_data["experiments"]["1"]["params"]["environments"] = 10
    return write_listing(listing_data)


def test_three_failed_runs_of_ten_are_said_everywhere(failing: Path, tmp_path: Path, foldcar: Any) -> None:
    program = tmp_path / "p.scenic"
    starts = [open_environment(program, {}, 0).sample(k)["start"]["x_m"] for k in range(10)]
    program.write_text(FAILS_FROM.format(sum(sorted(starts)[6:8]) / 2))
    bad = [k for k in range(10) if starts[k] in sorted(starts)[7:]]

    swept = foldcar("sweep", failing, "--store", "s.db", "--jobs", "1")
    again = foldcar("sweep", failing, "--store", "s.db", "--jobs", "1")

    why = f"3 x {program}: sample …: line 4: ZeroDivisionError: division by zero"
    command = "foldcar export s.db --failed --csv -"
    for done in (swept, again):
        assert done.returncode == 1
        assert ", 70.0 % passed, 3 failed; store: s.db" in done.stdout
        lines = ["3 of 10 runs failed and count as not passed:", f"  {why}", f"list them: {command}"]
        assert done.stderr.splitlines()[1:] == lines
    rows = list(csv.DictReader(foldcar(*command.split()[1:]).stdout.splitlines()))
    assert [int(row["sample"]) for row in rows] == bad
    assert all(row["outcome"] == "failed" and "division by zero" in row["message"] for row in rows)

    report = foldcar("report", "s.db", "-o", "report")
    remark = f"3 of 10 runs failed, and count as not passed: {why}. List them: {command}"
    assert report.returncode == 0
    assert remark.replace(" ", "") in "".join(report.stdout.split())
    (experiment,) = study_of(tmp_path / "report")["experiments"]
    assert remark in experiment["remarks"]

    run = foldcar("run", failing, "--experiment", "1", "--sample", str(bad[0]))
    assert run.returncode == 1 and "division by zero" in run.stdout
    good = min(set(range(10)) - set(bad))
    assert foldcar("run", failing, "--experiment", "1", "--sample", str(good)).returncode == 0
