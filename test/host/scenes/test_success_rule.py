"""When a run has passed: the rule of a program, its runs, and how it is said; undefined where no rule can be read."""

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.scenes.source import open_environment

WriteListing = Callable[[Any], Path]
HEAD = "model model\nego = new Robot at (0, 0), facing -90 deg\n"
TARGET = "target = new Marker at (0.6, 0)\n"
ARRIVAL = "terminate when distance from ego to target <= 0.05\n"
GOAL = "goal = new Goal at (0.8, 0), facing -90 deg\n"
MONITOR = (
    "monitor Late():\n    while simulation().currentRealTime < 0.5:\n        wait\n    terminate simulation\n"
    "require monitor Late()\n"
)
UNDEFINED = "success is undefined: program.scenic has no Goal, no `record final … as passed` and no `terminate when`"


@pytest.fixture
def program(tmp_path: Path) -> Path:
    return tmp_path / "program.scenic"


@pytest.fixture
def listing(write_listing: WriteListing, listing_data: Any, program: Path) -> Path:
    listing_data["environments"]["1"] = {"scenic_filename": program.name, "scenic_params": {"outer_step_s": 0.05}}
    listing_data["experiments"]["1"]["params"] = {"timeout": 20, "environments": 2}
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [95, 115]
    return write_listing(listing_data)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (GOAL, "a run has passed if it reaches its Goal, within the time limit"),
        (
            f"{TARGET}{ARRIVAL}",
            "a run has passed if `terminate when distance from ego to target <= 0.05` (line 4) ends it with the car "
            "upright, within the time limit",
        ),
        (f"{TARGET}terminate simulation when 0.05 > (distance to target)\n", "(line 4) ends it"),
        ("terminate when (distance from ego to (0.6, 0)) <= 0.05 and ego.speed > 0\n", "(line 3) ends it"),
        (f"end = new Marker at (1, 1)\n{TARGET}{ARRIVAL}terminate when (distance to end) < 1\n", "(line 5) ends it"),
        (f"{TARGET}{ARRIVAL}record final ego.speed > 0 as passed\n", "passed if the program ends it and its record"),
        (f"{GOAL}terminate when (distance to goal) <= 0.05\n", "it reaches its Goal, or if `terminate when (distance"),
        (f"{TARGET}terminate when (distance to target) >= 0.05\n", UNDEFINED),
        (f"{TARGET}terminate when (distance to target) <= 0.05 or ego.speed < 0\n", UNDEFINED),
        (
            "a = new Marker at (1, 1)\nb = new Marker at (1, 0)\nterminate when (distance to a) < 1\n"
            "terminate when (distance to b) < 1\n",
            f"{UNDEFINED} on the distance of the car to its target (it measures",
        ),
        (MONITOR, UNDEFINED),
    ],
)
def test_the_rule_is_read_from_the_program(program: Path, text: str, rule: str) -> None:
    program.write_text(HEAD + text)
    success = open_environment(program, {}, 0).success
    assert rule in success.text
    assert success.defined is not success.text.startswith("success is undefined")


def test_the_publications_own_ending_passes(listing: Path, program: Path, foldcar: Any) -> None:
    program.write_text(f"{HEAD}{TARGET}{ARRIVAL}terminate after 10 seconds\n")

    done = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")

    assert done.returncode == 0, done.stderr
    assert ", 100.0 % passed; store" in done.stdout
    rule = "experiment 1: a run has passed if `terminate when distance from ego to target <= 0.05` (line 4) ends it"
    assert done.stderr.startswith(rule)
    again = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    # A program that is not compiled again gets no remarks, which follow the rule.
    assert done.stderr.startswith(again.stderr) and ", 100.0 % passed; store" in again.stdout


def told_of_run(foldcar: Any, listing: Path) -> dict[str, str]:
    """What `foldcar run` tells of the narrow car."""
    done = foldcar("run", listing, "--experiment", "1", "--set", "width=95")
    assert done.returncode == 0, done.stderr
    return dict(line.split(maxsplit=1) for line in done.stdout.splitlines())


@pytest.mark.parametrize("text", [MONITOR, f"{MONITOR}record final ego.speed > 0 as passed\n"])
def test_a_monitor_may_end_a_run_without_a_goal(listing: Path, program: Path, foldcar: Any, text: str) -> None:
    program.write_text(HEAD + text)
    printed = told_of_run(foldcar, listing)
    assert printed["outcome"] == ("passed" if "record" in text else "terminated")
    assert float(printed["elapsed_time_s"]) == pytest.approx(0.5)


def test_no_share_is_given_where_success_is_undefined(listing: Path, program: Path, foldcar: Any, tmp_path: Path) -> None:
    program.write_text(HEAD + MONITOR)

    done = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    report = foldcar("report", "s.db", "-o", "report")
    export = foldcar("export", "s.db", "--csv", "runs.csv")

    assert (done.returncode, report.returncode, export.returncode) == (0, 0, 0), (done, report, export)
    assert "success undefined; store" in done.stdout and "%" not in done.stdout
    assert f"experiment 1: {UNDEFINED}" in done.stderr
    assert UNDEFINED in " ".join(report.stdout.split())
    assert not re.search(r"\b0\.0\b", report.stdout) and report.stdout.count("undefined") == 3
    (experiment,) = study_of(tmp_path / "report")["experiments"]
    assert (
        any(UNDEFINED in text for label, text in experiment["provenance"] if label == "rule") and not experiment["judged"]
    )
    assert all(set(experiment["designs"][name]) == {None} for name in ("low", "high", "belief"))
    assert [file.name for file in (tmp_path / "report").glob("*.svg")] == ["experiment_1_outcomes_by_width_mm.svg"]
    with (tmp_path / "runs.csv").open(newline="") as file:
        assert {(row["outcome"], row["passed"]) for row in csv.DictReader(file)} == {("terminated", "")}
