"""Sweeps that do not end as planned: broken simulators, studies that cannot run, kills, full disks."""

import os
import re
import resource
import shlex
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.errors import FoldcarError
from forked_foldcar import ForkedProcess, original
from swept_listing import WriteListing, rows, stored_runs, swept
from test_listing import change


def simulator(tmp_path: Path, carsim: Path, batch: str) -> Path:
    """A program like carsim with another command `batch`."""
    script = tmp_path / "broken-carsim"
    script.write_text(f'#!/bin/sh\n[ "$1" = batch ] || exec {shlex.quote(str(carsim))} "$@"\n{batch}\n')
    script.chmod(0o755)
    return script


@pytest.mark.parametrize(
    ("batch", "message"),
    [
        ("cat > /dev/null; echo oops >&2; exit 3", "exit code 3 (oops) after 0 of "),
        ("cat > /dev/null; echo '[]'", "its answer is not a result: []"),
        ('cat > /dev/null; echo \'{"outcome": "flew"}\'', "its answer is an impossible result: "),
    ],
)
def test_a_simulator_that_breaks_down_is_named(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, batch: str, message: str
) -> None:
    broken = simulator(tmp_path, carsim_binary, batch)

    with pytest.raises(FoldcarError) as caught:
        swept(write_listing(listing_data), tmp_path / "s.db", broken)

    assert str(caught.value).startswith(f"{broken}: {message}")


# Runs carsim's batch, but dies of a signal when it comes to a run of the first sample's scene.
DYING = """#!/usr/bin/env python3
import json, os, signal, subprocess, sys

if sys.argv[1] != "batch":
    os.execv({carsim!r}, ["carsim", *sys.argv[1:]])
process = subprocess.Popen([{carsim!r}, "batch"], stdin=subprocess.PIPE, text=True)
for line in sys.stdin:
    dies = '"run"' in line and json.loads(line)["run"]["scene"] == "s1"
    if dies:
        break
    process.stdin.write(line)
process.communicate()
if dies:
    print("box2d: assertion failed", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGABRT)
sys.exit(process.returncode)
"""


def test_a_run_that_crashes_is_a_result_and_the_rest_goes_on(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, foldcar: Any
) -> None:
    dying = tmp_path / "dying-carsim"
    dying.write_text(DYING.format(carsim=str(carsim_binary)))
    dying.chmod(0o755)
    listing = write_listing(listing_data)
    words = ("sweep", listing, "--store", "s.db", "--jobs", "1")
    swept(listing, tmp_path / "whole.db", carsim_binary)

    crashing = foldcar(*words, env={**os.environ, "FOLDCAR_CARSIM": str(dying)})
    again = foldcar(*words, env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)})
    report = foldcar("report", "s.db", "-o", "report")

    assert crashing.returncode == 1
    assert "2 of 6 runs failed and count as not passed:\n  2 x the simulation crashed" in crashing.stderr
    results, whole = rows(tmp_path / "s.db"), rows(tmp_path / "whole.db")
    assert [result.sample for result in results if result.outcome == "failed"] == [0, 0]
    assert {result.message for result in results if result.sample == 0} == {
        "the simulation crashed (killed by SIGABRT (box2d: assertion failed))"
    }
    assert [result for result in results if result.sample] == [result for result in whole if result.sample]
    assert " % passed, 2 failed; store: s.db\n" in crashing.stdout
    # Failed runs are not repeated until the simulator changes.
    assert again.stdout.startswith("0 new runs, 6 already stored, ")
    assert " % passed, 2 failed; store: s.db\n" in again.stdout
    assert "2 of 6 runs failed" in report.stdout
    assert "2 of 6 runs failed" in (tmp_path / "report" / "index.html").read_text()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("vehicles.1.params.0.common.width", [20], "width: 20 is below the minimum"),
        ("environments.1.scenic_params", {"no_such_param": 1}, "param no_such_param: unknown"),
        ("experiments.1.params.timeout", 1e9, r"experiments\.1\.params\.timeout: 1e\+09 is above"),
    ],
)
def test_a_study_that_cannot_run_is_refused_and_leaves_no_store(
    tmp_path: Path, write_listing: Any, listing_data: Any, carsim_binary: Path, path: str, value: Any, message: str
) -> None:
    listing = write_listing(change(listing_data, path, value))

    with pytest.raises(FoldcarError, match=message):
        swept(listing, tmp_path / "folder" / "s.db", carsim_binary)

    assert not (tmp_path / "folder").exists()


def start(listing: Path, store: Path, carsim: Path, environments: int) -> ForkedProcess:
    words = ["sweep", str(listing), "--store", str(store), "--samples", str(environments), "--jobs", "2"]
    return original().start(words, listing.parent, {**os.environ, "FOLDCAR_CARSIM": str(carsim)})


def test_ctrl_c_stops_keeps_and_says_how_to_go_on(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    process = start(write_listing(listing_data), tmp_path / "s.db", carsim_binary, 5000)
    while process.poll() is None and stored_runs(tmp_path / "s.db") == 0:
        time.sleep(0.05)

    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=100)

    assert process.returncode == 130
    stored = stored_runs(tmp_path / "s.db")
    assert 0 < stored < 10000
    rule = "experiment 1: a run has passed if it reaches its Goal, within the time limit\n"
    assert errors == f"{rule}stopped: {stored} of 10,000 runs are stored in {tmp_path / 's.db'}; " \
        "the same command resumes\n"  # fmt: skip
    assert output == ""
    assert sorted(file.name for file in tmp_path.iterdir()) == ["listing.json", "s.db"]


def test_a_report_says_how_many_of_the_planned_runs_are_here(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, foldcar: Any
) -> None:
    """Beside a running sweep, and after the sweep was killed."""
    store = tmp_path / "s.db"
    process = start(write_listing(listing_data), store, carsim_binary, 5000)
    while process.poll() is None and stored_runs(store) == 0:
        time.sleep(0.05)

    def reported() -> int:
        answer = foldcar("report", store, "-o", tmp_path / "report")
        assert answer.returncode == 0, answer.stderr
        # Two designs in 5,000 environments.
        (number,) = re.findall(r"Unfinished: ([\d,]+) of 10,000 planned runs are here\.", " ".join(answer.stdout.split()))
        (experiment,) = study_of(tmp_path / "report")["experiments"]
        assert [remark for remark in experiment["remarks"] if f"{number} of 10,000 planned runs are here." in remark]
        runs = int(number.replace(",", ""))
        assert runs == sum(experiment["designs"]["runs"])
        return runs

    beside = reported()
    assert process.poll() is None
    process.kill()
    process.wait()
    assert 0 < beside <= reported() == stored_runs(store) < 10_000


def test_a_full_disk_is_one_line_and_loses_nothing(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, new_foldcar: Any
) -> None:
    listing = write_listing(listing_data)
    swept(listing, tmp_path / "s.db", carsim_binary)
    limit = (tmp_path / "s.db").stat().st_size + 60_000

    answer = new_foldcar(
        "sweep", listing, "--store", "s.db", "--samples", "2000",
        env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip

    assert answer.returncode == 2
    rule, error = answer.stderr.splitlines()
    assert rule.startswith("experiment 1: a run has passed if") and error.startswith("foldcar: error: s.db: ")
    assert len(rows(tmp_path / "s.db")) >= 6
