"""`make torture` in short, and that it would see a loss."""

import contextlib
import os
import random
import re
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

import foldcar
from foldcar.store.migrations import VERSION
from old_stores import old_store

TORTURE = Path(__file__).resolve().parents[1] / "torture"
sys.path.append(str(TORTURE))
import processes  # noqa: E402
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


def test_a_loss_ends_it_with_the_way_to_repeat_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lose(folder: Path, whole: Path, chance: random.Random) -> str:
        raise study.LossError("a row is gone")

    monkeypatch.setenv("TORTURE_SEED", "9")
    monkeypatch.delenv("TORTURE_ROUND", raising=False)
    monkeypatch.setattr(torture, "DISTURBANCES", {"row lost": lose})
    monkeypatch.setattr(torture, "prepare", lambda folder: old_store(VERSION, tmp_path / "whole.db"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    assert torture.main() == 1

    said = capsys.readouterr().out
    assert "LOSS in round 1, row lost: a row is gone" in said
    assert "again: make torture TORTURE_SEED=9 TORTURE_ROUND=1\n" in said


def test_only_a_traceback_from_before_the_first_line_of_foldcar_is_pythons_own() -> None:
    start = 'Fatal Python error: init_sys_streams\nTraceback (most recent call last):\n  File "<frozen abc>", line 92\n'
    within = f'Traceback (most recent call last):\n  File "{study.__file__}"\n  File "{Path(foldcar.__file__)}", line 2\n'

    assert processes.died_at_start(f"{start}KeyboardInterrupt\n\n")
    assert not processes.died_at_start(f"{start}MemoryError\n")
    assert not processes.died_at_start(f"{within}KeyboardInterrupt\n")
