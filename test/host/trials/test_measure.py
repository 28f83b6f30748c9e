"""`foldcar trials measure`: values that were measured on built cars and obstacles."""

from pathlib import Path
from typing import Any

import pytest

from foldcar.store.measured import measured_values
from foldcar.store.reader import Store
from written_study import write_study


@pytest.fixture
def swept(tmp_path: Path) -> Path:
    """A store with experiment 1."""
    return write_study(tmp_path / "s.db", {"width_mm": [95.0]}, 3, lambda design, sample: "passed")


def test_measured_values_are_kept_changed_and_deleted(swept: Path, foldcar: Any) -> None:
    before = foldcar("trials", "measure", "s.db")
    foldcar("trials", "measure", "s.db", "track_m=0.5e-2", "obstacle_height=1.1", "friction=0.9")
    kept = foldcar("trials", "measure", "s.db", "track_m=0.002", "friction=")

    assert before.stdout == "experiment 1: no measured values\n"
    assert kept.stdout == "experiment 1: obstacle_height 1.1 ×\nexperiment 1: track_m 0.002 m\n"
    with Store.open(swept) as opened:
        assert measured_values(opened, "1") == {"obstacle_height": 1.1, "track_m": 0.002}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("track_m=0.5",), "trials measure: track_m: 0.5 is outside -0.01 to 0.01 (m)"),
        (("track=0",), 'trials measure: track: unknown parameter "track"'),
        (("track=",), "trials measure: track=: unknown parameter; known: friction, "),
        (("track_m=wide",), "trials measure: track_m=wide: is not NAME=VALUE with a number"),
        (("track_m=0", "track_m=0.001"), "trials measure: track_m: is given twice"),
        (("track_m=0", "--experiment", "3"), 's.db: has no experiment "3"; it has 1'),
    ],
)
def test_wrong_measurements_are_refused(swept: Path, refused: Any, words: tuple[str, ...], message: str) -> None:
    before = swept.read_bytes()

    assert message in refused("trials", "measure", "s.db", *words)
    assert swept.read_bytes() == before
