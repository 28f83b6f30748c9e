"""Sweeps that are killed, interrupted or out of disk keep what is done, and resume."""

import os
import random
import resource
import signal
import time
from pathlib import Path
from typing import Any

from forked_foldcar import ForkedProcess, original
from swept_listing import WriteListing, rows, stored_runs, swept


def start(listing: Path, store: Path, carsim: Path, environments: int) -> ForkedProcess:
    words = ["sweep", str(listing), "--store", str(store), "--environments", str(environments), "--jobs", "2"]
    return original().start(words, listing.parent, {**os.environ, "FOLDCAR_CARSIM": str(carsim)})


def test_killed_at_random_and_resumed_the_rows_are_the_same(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = {"from": 65, "to": 245, "step": 90}
    listing, environments, pause = write_listing(listing_data), 60, random.Random(1)
    swept(listing, tmp_path / "alone.db", carsim_binary, environments=environments)

    seen = 0
    for _ in range(3):
        process = start(listing, tmp_path / "killed.db", carsim_binary, environments)
        while process.poll() is None and stored_runs(tmp_path / "killed.db") <= seen:
            time.sleep(0.02)
        time.sleep(0.2 * pause.random())
        process.kill()
        process.communicate()
        assert stored_runs(tmp_path / "killed.db") >= seen
        seen = stored_runs(tmp_path / "killed.db")
    counts = swept(listing, tmp_path / "killed.db", carsim_binary, environments=environments)

    assert counts.there == seen > 0
    assert rows(tmp_path / "killed.db") == rows(tmp_path / "alone.db")


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
    assert errors == f"{rule}stopped: {stored} of 10000 runs are stored in {tmp_path / 's.db'}; " \
        "the same command resumes\n"  # fmt: skip
    assert output == ""
    assert sorted(file.name for file in tmp_path.iterdir()) == ["listing.json", "s.db"]


def test_a_full_disk_is_one_line_and_loses_nothing(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, new_foldcar: Any
) -> None:
    listing = write_listing(listing_data)
    swept(listing, tmp_path / "s.db", carsim_binary)
    limit = (tmp_path / "s.db").stat().st_size + 60_000

    answer = new_foldcar(
        "sweep", listing, "--store", "s.db", "--environments", "2000",
        env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip

    assert answer.returncode == 2
    rule, error = answer.stderr.splitlines()
    assert rule.startswith("experiment 1: a run has passed if") and error.startswith("foldcar: error: s.db: ")
    assert len(rows(tmp_path / "s.db")) >= 6
