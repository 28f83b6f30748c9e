"""Failed runs are said where results are shown: how many, why, how to list them."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.scenes.source import open_environment
from page_check import study_of

FAILS_FROM = (
    "model model\nego = new Robot at (Range(0, 0.02), 0), facing -90 deg\n"
    "goal = new Goal at (0.4, 0), facing -90 deg\nrecord initial 1 / (ego.position.x < {}) as y\n"
)


@pytest.fixture
def listing(tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any) -> Path:
    """One car in ten environments of p.scenic."""
    (tmp_path / "p.scenic").write_text(FAILS_FROM.format(1))
    listing_data["environments"]["1"] = {"scenic_filename": "p.scenic"}
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = 95
    listing_data["experiments"]["1"]["params"]["environments"] = 10
    return write_listing(listing_data)


def test_three_failed_runs_of_ten_are_said_everywhere(listing: Path, tmp_path: Path, foldcar: Any) -> None:
    program = tmp_path / "p.scenic"
    starts = [open_environment(program, {}, 0).sample(k)["start"]["x_m"] for k in range(10)]
    program.write_text(FAILS_FROM.format(sum(sorted(starts)[6:8]) / 2))
    bad = [k for k in range(10) if starts[k] in sorted(starts)[7:]]

    swept = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    again = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")

    why = f"3 x {program}: sample …: line 4: ZeroDivisionError: division by zero"
    command = "foldcar export s.db --failed --csv -"
    for said in (swept, again):
        assert said.returncode == 1
        assert ", 70.0 % passed, 3 failed; store: s.db" in said.stdout
        lines = ["3 of 10 runs failed and count as not passed:", f"  {why}", f"list them: {command}"]
        assert said.stderr.splitlines()[1:] == lines
    rows = list(csv.DictReader(foldcar(*command.split()[1:]).stdout.splitlines()))
    assert [int(row["sample"]) for row in rows] == bad
    assert all(row["outcome"] == "failed" and "division by zero" in row["message"] for row in rows)

    report = foldcar("report", "s.db", "-o", "report")
    remark = f"3 of 10 runs failed, and count as not passed: {why}. List them: {command}"
    assert report.returncode == 0
    assert remark.replace(" ", "") in "".join(report.stdout.split())
    (one,) = study_of(tmp_path / "report")["experiments"]
    assert remark in one["remarks"]

    run = foldcar("run", listing, "--experiment", "1", "--sample", str(bad[0]))
    assert run.returncode == 1 and "division by zero" in run.stdout
    good = min(set(range(10)) - set(bad))
    assert foldcar("run", listing, "--experiment", "1", "--sample", str(good)).returncode == 0


def test_only_failed_runs_need_a_file(foldcar: Any) -> None:
    answer = foldcar("export", "s.db", "--failed", "--trials", "t.csv")
    assert (answer.returncode, answer.stderr.count("\n")) == (2, 1)
    assert "--failed: says nothing without --csv FILE or --parquet FILE" in answer.stderr
