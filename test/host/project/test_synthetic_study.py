"""docs/synthetic_study.py: the whole method on a hidden reality in MuJoCo, in a small setting."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import foldcar

DOCS = Path(__file__).resolve().parents[3] / "docs"
sys.path.insert(0, str(DOCS))

from synthetic_study import REALITY, planned  # noqa: E402


def test_each_design_has_two_cars_and_each_car_trials_in_other_environments() -> None:
    chosen = {"widths": [65, 85, 105], "environments": [3, 1, 4, 9]}

    trials = planned(chosen, 12)

    assert len(trials) == 12 and len({trial.car for trial in trials}) == 6
    assert all(trial.car[:-1] == f"{trial.width_mm:g}" for trial in trials)
    for width in (65, 85, 105):
        of_width = [trial for trial in trials if trial.width_mm == width]
        assert [trial.car[-1] for trial in of_width] == list("abab")
        assert [trial.sample for trial in of_width] == [3, 1, 4, 9]


@pytest.mark.slow
def test_the_whole_method_runs_and_is_judged_by_the_truth(tmp_path: Path) -> None:
    """Two designs and four trials are too few for a right answer: their answer is not asserted."""
    words = [sys.executable, DOCS / "synthetic_study.py", tmp_path, "--quick"]
    done = subprocess.run(words, capture_output=True, text=True)

    lines = done.stdout.splitlines()
    assert (done.returncode, lines[-1].split(":")[0]) in ((0, "right"), (1, "WRONG")), done.stderr
    assert (tmp_path / "rates.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "reality.json").read_text()) == REALITY
    study = foldcar.Study(tmp_path / "study.db")
    # The second round has none if `select` says that another afternoon gains nothing.
    assert len(study.trials) in (2, 4) and "aborted" not in set(study.trials["outcome"])
