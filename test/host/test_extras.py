"""Without the extras' packages the core works; what needs one names it in a line, before anything is written."""

import ast
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import foldcar
from foldcar.installation import MODULES

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


def test_what_foldcar_imports_it_declares() -> None:
    imported = set()
    for file in Path(foldcar.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            imported |= {name.partition(".")[0] for name in [*names, getattr(node, "module", None) or ""]}
    declared = {Requirement(text).name.lower() for text in importlib.metadata.requires("foldcar") or []}
    packages = importlib.metadata.packages_distributions()
    # These come with Jinja, Matplotlib, Scenic and its scheduler; the last is Webots' own.
    others = {*sys.stdlib_module_names, "foldcar", "", "markupsafe", "PIL", "rv_ltl", "dask", "controller"}

    assert len(imported - others) > 20
    assert [name for name in imported - others if not declared & {one.lower() for one in packages[name]}] == []
