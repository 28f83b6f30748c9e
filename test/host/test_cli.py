"""The command `foldcar`: help, version, one-line errors, `run` and `sweep`."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar import __version__
from under_coverage import unmeasured


def test_help_names_every_command(foldcar: Any) -> None:
    answer = foldcar("--help")

    assert answer.returncode == 0
    for command in ("sweep", "run", "sample", "report", "export"):
        assert f"\n  {command} " in answer.stdout


def test_version(foldcar: Any) -> None:
    assert foldcar("--version").stdout == f"foldcar {__version__}\n"


def test_help_waits_for_nothing_heavy() -> None:
    heavy = "{'scenic', 'matplotlib', 'numpy', 'scipy', 'pyarrow', 'pydantic', 'sqlite3'}"
    code = f"import sys, foldcar.cli; print({heavy} & set(sys.modules))"

    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=unmeasured())

    assert answer.stdout == "set()\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("sweep", "none.json", "--store", "s.db"), "none.json: cannot be read: No such file or directory"),
        (("run", "none.json", "--experiment", "1"), "none.json: cannot be read: No such file or directory"),
        (("run", "l.json", "--experiment", "9"), 'l.json: experiments: has no "9"; known: 1'),
        (
            ("run", "l.json", "--experiment", "1"),
            "l.json: vehicles.1.params.0.common.width: has 2 values (95, 245); choose one with --set width=…",
        ),
        (("run", "l.json", "--experiment", "1", "--set", "width"), "--set width: not NAME=MM"),
        (("run", "l.json", "--experiment", "1", "--set", "width=x"), "--set width=x: not NAME=MM"),
        (("run", "l.json", "--experiment", "1", "--set", "w=1"), "--set w: W_B_W has no such parameter"),
        (("run", "l.json", "--experiment", "1", "--set", "width=20"), "--set width: 20 is below the minimum 53.65"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any,
    words: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    write_listing(listing_data).rename(tmp_path / "l.json")

    answer = foldcar(*words)

    assert answer.returncode == 2
    assert answer.stderr.startswith(f"foldcar: error: {message}")
    assert answer.stderr.count("\n") == 1 and answer.stdout == ""
    assert [file.name for file in tmp_path.iterdir()] == ["l.json"]


@pytest.mark.parametrize(
    "words", [("fly",), ("sweep",), ("sweep", "l.json", "--store", "s.db", "--jobs", "0"), ("run", "l.json", "--no")]
)
def test_wrong_usage_is_told_without_traceback(foldcar: Any, words: tuple[str, ...]) -> None:
    answer = foldcar(*words)

    assert answer.returncode == 2
    assert "Usage:" in answer.stderr and "Traceback" not in answer.stderr


def test_without_carsim_the_way_to_one_is_named(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any
) -> None:
    listing = write_listing(listing_data)

    answer = foldcar("sweep", listing, "--store", "s.db", env={**os.environ, "FOLDCAR_CARSIM": "/none/carsim"})

    assert answer.returncode == 2
    assert answer.stderr == "foldcar: error: FOLDCAR_CARSIM: /none/carsim is no program\n"
    assert not (tmp_path / "s.db").exists()


def test_run_tells_the_outcome_and_draws(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any, carsim_binary: Path
) -> None:
    listing = write_listing(listing_data)

    answer = foldcar(
        "run", listing, "--experiment", "1", "--set", "width=120", "--sample", "2", "--plot", "run.svg",
        env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)},
    )  # fmt: skip

    assert answer.returncode == 0, answer.stderr
    told = dict(line.split(maxsplit=1) for line in answer.stdout.splitlines())
    assert told["outcome"] in {"passed", "tipped", "stuck", "off_course", "timeout", "fault"}
    assert "width 120 mm" in told["design"]
    assert 0 < float(told["elapsed_time_s"]) <= 120
    assert (tmp_path / "run.svg").read_text().startswith("<?xml")


def test_run_shows_how_the_car_differs_from_its_design(
    write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any, carsim_binary: Path
) -> None:
    listing_data["experiments"]["1"]["params"] |= {"variation": "workshop", "variation_seed": 5}
    listing = write_listing(listing_data)
    words = ("run", listing, "--experiment", "1", "--set", "width=120", "--sample")
    environment = {**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)}

    answers = [foldcar(*words, sample, env=environment) for sample in ("0", "1", "0")]

    told = [dict(line.split(maxsplit=1) for line in answer.stdout.splitlines()) for answer in answers]
    assert told[0] == told[2]
    assert told[0]["variation"] != told[1]["variation"]
    assert all(one["variation"].endswith("(seed 5)") for one in told)


GOAL_RULE = "experiment 1: a run has passed if it reaches its Goal, within the time limit\n"


def test_a_sweep_ends_with_one_line(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any, carsim_binary: Path
) -> None:
    listing = write_listing(listing_data)
    words = ("sweep", listing, "--store", "new/s.db", "--jobs", "2")
    environment = {**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)}

    first = foldcar(*words, env=environment)
    second = foldcar(*words, env=environment)

    assert (first.returncode, second.returncode, first.stderr) == (0, 0, GOAL_RULE)
    assert first.stdout.startswith("6 runs new, 0 there already, ") and first.stdout.count("\n") == 1
    assert first.stdout.endswith("% passed; store: new/s.db\n")
    assert second.stdout.startswith("0 runs new, 6 there already, ")


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
