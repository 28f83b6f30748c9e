"""The command `foldcar`: one-line errors, `run` and `sweep`."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("sweep", "none.json", "--store", "s.db"), "none.json: cannot be read: No such file or directory"),
        (("run", "l.json", "--experiment", "9"), 'l.json: experiments: has no "9"; known: 1'),
        (
            ("run", "l.json", "--experiment", "1"),
            "l.json: vehicles.1.params.0.common.width: has 2 values (95, 245); choose one with --set width=…",
        ),
        (("run", "l.json", "--experiment", "1", "--set", "width=x"), "--set width=x: is neither NAME=MM"),
        (("run", "l.json", "--experiment", "1", "--set", "w=1"), "--set w: W_B_W has no such parameter"),
        (("run", "l.json", "--experiment", "1", "--set", "width=20"), "--set width: 20 is below the minimum 53.65"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    tmp_path: Path, listing: Path, refused: Any, words: tuple[str, ...], message: str
) -> None:
    listing.rename(tmp_path / "l.json")

    assert refused(*words).startswith(message)
    assert [file.name for file in tmp_path.iterdir()] == ["l.json"]


def test_wrong_usage_is_told_without_traceback(foldcar: Any) -> None:
    answer = foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "0")

    assert answer.returncode == 2
    assert "Usage:" in answer.stderr and "Traceback" not in answer.stderr


def test_without_carsim_the_way_to_one_is_named(tmp_path: Path, listing: Path, refused: Any) -> None:
    message = refused("sweep", listing, "--store", "s.db", env={**os.environ, "FOLDCAR_CARSIM": "/none/carsim"})

    assert message == "FOLDCAR_CARSIM: /none/carsim is not a program"
    assert not (tmp_path / "s.db").exists()


def test_run_tells_the_outcome_and_draws(tmp_path: Path, listing: Path, foldcar: Any) -> None:
    words = ("--experiment", "1", "--set", "width=120", "--sample", "2", "--plot", "run.svg")

    answer = foldcar("run", listing, *words)

    assert answer.returncode == 0, answer.stderr
    printed = dict(line.split(maxsplit=1) for line in answer.stdout.splitlines())
    assert printed["outcome"] in {"passed", "tipped", "stuck", "off_course", "timeout", "fault"}
    assert "width 120 mm" in printed["design"]
    assert 0 < float(printed["elapsed_time_s"]) <= 120
    assert (tmp_path / "run.svg").read_text().startswith("<?xml")


def test_run_shows_how_the_car_differs_from_its_design(write_listing: Any, listing_data: Any, foldcar: Any) -> None:
    listing_data["experiments"]["1"]["params"] |= {"variation": "workshop", "variation_seed": 5}
    words = ("run", write_listing(listing_data), "--experiment", "1", "--set", "width=120", "--sample")

    answers = [foldcar(*words, sample) for sample in ("0", "1", "0")]

    printed = [dict(line.split(maxsplit=1) for line in answer.stdout.splitlines()) for answer in answers]
    assert printed[0] == printed[2]
    assert printed[0]["variation"] != printed[1]["variation"]
    assert all(facts["variation"].endswith("(seed 5)") for facts in printed)


GOAL_RULE = "experiment 1: a run has passed if it reaches its Goal, within the time limit\n"


def test_a_sweep_ends_with_one_line(listing: Path, foldcar: Any) -> None:
    words = ("sweep", listing, "--store", "new/s.db", "--jobs", "2")

    first, second = foldcar(*words), foldcar(*words)

    assert (first.returncode, second.returncode, first.stderr) == (0, 0, GOAL_RULE)
    assert first.stdout.startswith("6 new runs, 0 already stored, ") and first.stdout.count("\n") == 1
    assert first.stdout.endswith("% passed; store: new/s.db\n")
    assert second.stdout.startswith("0 new runs, 6 already stored, ")


def test_a_closed_output_is_not_reported(tmp_path: Path) -> None:
    from test_store import fill

    fill(tmp_path / "s.db")
    code = "from foldcar.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "export", str(tmp_path / "s.db"), "--csv", "-"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()

    assert process.stderr.read() == b""
    assert process.wait() == 1
