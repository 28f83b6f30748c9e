"""`make torture` in short, and that it would see a loss."""

import contextlib
import os
import re
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from foldcar.store.migrations import VERSION
from old_stores import old_store

TORTURE = Path(__file__).resolve().parents[1] / "torture"
sys.path.append(str(TORTURE))
import study  # noqa: E402
import torture  # noqa: E402


# What each disturbance may lose has a quick test of its own among those of sweeps, trials, `check` and `repair`.
@pytest.mark.slow
def test_nothing_is_lost_for_a_while(carsim_binary: Path) -> None:
    answer = subprocess.run(
        [sys.executable, TORTURE / "torture.py"], capture_output=True, text=True,
        env={**os.environ, "TORTURE_S": "5", "TORTURE_SEED": "24", "FOLDCAR_CARSIM": str(carsim_binary)},
    )  # fmt: skip

    assert answer.returncode == 0, answer.stdout + answer.stderr
    counts = dict(re.findall(r"^(\S.*?) {2,}(\d+)", answer.stdout, re.MULTILINE))
    assert set(torture.DISTURBANCES) <= set(counts) and int(counts["together"]) >= 1


@pytest.mark.parametrize(
    "loss",
    [
        "DELETE FROM run WHERE body_id = 1 AND scene_id = 1",
        "UPDATE run SET max_roll_rad = max_roll_rad + 1e-15",
        "UPDATE recorded SET value = '0'",
        "DELETE FROM sample WHERE sample = 1",
    ],
)
def test_a_lost_row_is_seen(tmp_path: Path, loss: str) -> None:
    whole, other = old_store(VERSION, tmp_path / "whole.db"), old_store(VERSION, tmp_path / "s.db")
    study.require_same(other, whole, "nothing was changed")

    with contextlib.closing(sqlite3.connect(other)) as connection:
        assert connection.execute(loss).rowcount > 0
        connection.commit()

    with pytest.raises(study.LossError, match="changed: "):
        study.require_same(other, whole, "changed")
