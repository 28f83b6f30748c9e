"""Commands leave nothing outside the checkout: not in the user's folder, not in the one for temporary files."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

PROJECT = Path(__file__).resolve().parents[3]
CARS = PROJECT / "patterns" / "published_cars.json"


def test_a_sweep_a_report_and_a_pattern_leave_nothing_outside_the_checkout(
    new_foldcar: Callable[..., Any], listing: Path, tmp_path: Path
) -> None:
    outside = [tmp_path / name for name in ("home", "temporary")]
    for folder in outside:
        folder.mkdir()
    without_own = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "MPLCONFIGDIR"))}
    environment = {**without_own, "HOME": str(outside[0]), "TMPDIR": str(outside[1])}

    for words in (
        ("sweep", listing, "--store", "s.db", "--jobs", "1"),
        ("report", "s.db", "-o", "report"),
        ("pattern", CARS, "--vehicle", "w95", "-o", "car"),
    ):
        done = new_foldcar(*words, env=environment)
        assert done.returncode == 0, done.stderr

    assert [file for folder in outside for file in folder.rglob("*")] == []
