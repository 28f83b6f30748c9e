"""Without the extras' packages the core works; what needs one names it in a line, before anything is written."""

import ast
import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import foldcar
from foldcar import installation
from foldcar.installation import MODULES

# Scenic brings these, so they are there without the extra.
OF_SCENIC = ("cv2", "fcl", "trimesh")
BARE = f"""
import json
import sys
sys.modules.update(dict.fromkeys({[name for names in MODULES.values() for name in names if name not in OF_SCENIC]}))
from foldcar.cli import main
from foldcar.fabrication.patterns import nesting
# `select` nests a car's sheets: the first order that fits, as a search takes longer than all else.
nesting.MAX_TRIES = 0
sys.argv[0] = "foldcar"
for words in json.loads(sys.argv.pop()):
    sys.argv[1:] = words
    try:
        main()
    except SystemExit as end:
        print("ended with", end.code or 0, file=sys.stderr, flush=True)
"""
SPACE = Path(__file__).resolve().parents[3] / "examples" / "design_space.json"
CAR = ("--set", "width=115", "--set", "radius=60")


def test_the_core_sweeps_and_reports_and_other_commands_name_their_extra(tmp_path: Path, free_course: Path) -> None:
    core = (
        ("new", "yard"),
        ("sweep", free_course.name, "--store", "s.db"),
        ("report", "s.db", "-o", "report"),
        ("select", "s.db"),
    )
    others = (
        ("pattern", "yard/study.json", *CAR, "-o", "car"),
        ("view", "yard/study.json", *CAR, "-o", "view.html"),
        ("params", "get", "--port", "tcp:127.0.0.1:9"),
        ("optimize", str(SPACE), "--store", "other.db"),
        ("export", "s.db", "--parquet", "runs.parquet"),
        ("sweep", "yard/study.json", "--store", "other.db", "--scheduler", "local:1"),
    )
    commands = json.dumps([*core, *others])

    # In one process, as it takes longer to import what these need than to do it.
    done = subprocess.run([sys.executable, "-c", BARE, commands], cwd=tmp_path, capture_output=True, text=True)

    # What the first commands print beside their results ends where the first of them does.
    *ends, last = done.stderr.split("ended with ")
    assert (done.returncode, last) == (0, "2\n"), done.stderr
    codes = [end[0] for end in ends[1:]] + [last[0]]
    assert codes == ["0"] * len(core) + ["2"] * len(others), done.stderr
    for words, end in zip(others, ends[len(core) :], strict=True):
        (error,) = end.splitlines()[1:]
        assert error.startswith("foldcar: error: this needs the package "), (words, error)
        assert error.endswith("; install it: make extras"), (words, error)
    assert {file.name for file in tmp_path.iterdir()} == {"l.json", "free.scenic", "yard", "s.db", "report"}


def test_an_installed_foldcar_names_the_extra_for_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "source_tree", lambda: None)

    line = installation.missing_extra(ModuleNotFoundError(name="pyarrow"))

    assert line == "this needs the package pyarrow; install it: pip install 'foldcar[parquet]'"


def test_what_foldcar_imports_it_declares_and_an_extra_brings_the_modules_that_it_is_told_for() -> None:
    declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    packages = importlib.metadata.packages_distributions()
    for extra, modules in MODULES.items():
        brought = {
            requirement.name.lower()
            for requirement in declared
            if requirement.marker and requirement.marker.evaluate({"extra": extra})
        }
        for module in modules:
            # A package of the extra, or one that these bring (Dask by its scheduler).
            assert brought & {name.lower() for name in packages[module]} or module == "dask", module

    imported = set()
    for file in Path(foldcar.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            imported_names = [name.name for name in node.names] if isinstance(node, ast.Import) else []
            imported |= {name.partition(".")[0] for name in [*imported_names, getattr(node, "module", None) or ""]}
    names = {requirement.name.lower() for requirement in declared}
    # These come with Jinja, Matplotlib, Scenic and its scheduler; the last is Webots' own.
    others = {*sys.stdlib_module_names, "foldcar", "", "markupsafe", "PIL", "rv_ltl", "dask", "controller"}

    assert len(imported - others) > 20
    assert [
        name for name in imported - others if not names & {distribution.lower() for distribution in packages[name]}
    ] == []
