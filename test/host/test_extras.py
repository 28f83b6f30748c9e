"""Without the extras' packages the core works; what needs one names it in a line, before anything is written."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from foldcar.extras import MODULES

# Scenic brings these, so they are there without the extra.
OF_SCENIC = ("fcl", "trimesh")
BARE = f"""
import sys
sys.modules.update(dict.fromkeys({[name for names in MODULES.values() for name in names if name not in OF_SCENIC]}))
sys.argv[0] = "foldcar"
from foldcar.cli import main
main()
"""
SPACE = Path(__file__).resolve().parents[2] / "examples" / "design_space.json"
CAR = ("--set", "width=115", "--set", "radius=60")


def bare(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """The command where no extra is installed."""
    return subprocess.run([sys.executable, "-c", BARE, *words], cwd=folder, capture_output=True, text=True, timeout=120)


def test_the_core_sweeps_and_reports_and_other_commands_name_their_extra(tmp_path: Path) -> None:
    for words in (
        ("new", "yard"),
        ("sweep", "yard/study.json", "--store", "s.db", "--environments", "2"),
        ("report", "s.db", "-o", "report", "--no-replay"),
        ("select", "s.db"),
        ("export", "s.db", "--csv", "runs.csv"),
    ):
        done = bare(tmp_path, *words)
        assert done.returncode == 0, (words, done.stderr)
    before = sorted(tmp_path.rglob("*"))
    for extra, words in (
        ("fabricate", ("pattern", "yard/study.json", *CAR, "-o", "car")),
        ("fabricate", ("view", "yard/study.json", *CAR, "-o", "view.html")),
        ("link", ("params", "get", "--port", "tcp:127.0.0.1:9")),
        ("optimize", ("optimize", str(SPACE), "--store", "other.db")),
        ("parquet", ("export", "s.db", "--parquet", "runs.parquet")),
        ("cluster", ("sweep", "yard/study.json", "--store", "other.db", "--scheduler", "local:1")),
    ):
        done = bare(tmp_path, *words)
        assert done.returncode == 2, (words, done.stderr)
        assert done.stderr.startswith("foldcar: error: this needs the package "), (words, done.stderr)
        assert done.stderr.endswith(f"of an extra: pip install 'foldcar[{extra}]'\n"), (words, done.stderr)
        assert len(done.stderr.splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("extra", MODULES)
def test_an_extra_brings_the_modules_that_it_is_told_for(extra: str) -> None:
    declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    brought = {one.name.lower() for one in declared if one.marker is not None and one.marker.evaluate({"extra": extra})}
    packages = importlib.metadata.packages_distributions()

    for module in MODULES[extra]:
        # A package of the extra, or one that these bring (Dask by its scheduler).
        assert brought & {name.lower() for name in packages[module]} or module == "dask", module
