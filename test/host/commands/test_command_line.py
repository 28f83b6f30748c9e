"""What every command shares: help, completion, `--json`, output folders, and how it behaves in pipes."""

import json
import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from foldcar import __version__
from foldcar.cli import app
from forked_foldcar import original
from under_coverage import unmeasured

PROJECT = Path(__file__).resolve().parents[3]
COMMAND = [sys.executable, "-m", "foldcar"]
# Root writes anywhere, unless it gives up that capability.
WEAK = ["setpriv", "--bounding-set=-dac_override", "--inh-caps=-dac_override"] if os.geteuid() == 0 else []
# Of processor time, slow machines included; without the heavy imports it takes 0.2 s.
QUICK_S = 1.5


def commands(group: Any = None, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command that does something, by its words."""
    group = group if group is not None else typer.main.get_command(app)
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


EVERY = dict(commands())


@pytest.fixture
def study(foldcar: Any, write_listing: Any, listing_data: Any, carsim_binary: Path, tmp_path: Path) -> Path:
    """The listing of a swept store s.db in the test's folder."""
    listing_data["vehicles"]["2"] = {"type": "W_B_W", "params": [{"common": {"width": 120}}]}
    listing: Path = write_listing(listing_data)
    done = foldcar("sweep", listing, "--store", "s.db")
    assert done.returncode == 0, done.stderr
    return listing


def test_python_m_foldcar_is_the_command() -> None:
    answer = subprocess.run([*COMMAND, "--version"], capture_output=True, text=True, check=True)

    assert answer.stdout == f"foldcar {__version__}\n"


@pytest.mark.parametrize("words", EVERY, ids=" ".join)
def test_help_has_an_example_that_exists(words: tuple[str, ...]) -> None:
    answer = original().run([*words, "-h"], PROJECT, {**os.environ, "COLUMNS": "80"})

    assert answer.returncode == 0, answer.stderr
    example = answer.stdout.partition("Example: ")[2].splitlines()[0].split()
    assert tuple(example[1 : 1 + len(words)]) == words
    for word in example:
        if word.startswith(("scenarios/", "patterns/")):
            assert (PROJECT / word).is_file(), word
    options = {option for param in EVERY[words].params for option in param.opts}
    assert {word for word in example if word.startswith("-")} <= options


def test_results_that_a_script_would_use_are_offered_as_json() -> None:
    offered = {words for words, command in EVERY.items() if any("--json" in param.opts for param in command.params)}

    documented = (PROJECT / "docs" / "commands.md").read_text(encoding="utf-8").partition("## JSON")[2]
    assert offered == {tuple(words.split()) for words in re.findall(r"^\|`([a-z ]+)`\|", documented, re.MULTILINE)}


def test_bash_completes_commands_and_options(tmp_path: Path) -> None:
    program = tmp_path / "foldcar"
    program.write_text(f"#!{sys.executable}\nimport sys\nsys.argv[0] = 'foldcar'\nfrom foldcar.cli import main\nmain()\n")
    program.chmod(0o755)
    script = """
        eval "$(foldcar --completion bash)"
        COMP_WORDS=(foldcar pat) COMP_CWORD=1; _foldcar_completion foldcar; echo "${COMPREPLY[*]}"
        COMP_WORDS=(foldcar pattern --veh) COMP_CWORD=2; _foldcar_completion foldcar; echo "${COMPREPLY[*]}"
    """
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}

    answer = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, env=environment)

    assert answer.stdout.split() == ["pattern", "--vehicle"]


def test_completion_imports_nothing_heavy_and_runs_no_options(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("raise SystemExit('executed')")
    words = f"foldcar run l.json --components {tmp_path / 'own.py'} --plot {tmp_path}/no/such/folder/x.png --exp"
    code = """
import sys
sys.argv = ["foldcar"]
from foldcar.cli import main
# Help waits for this.
early = {"pydantic"} & set(sys.modules)
try:
    main()
except SystemExit:
    pass
heavy = {"scenic", "matplotlib", "numpy", "scipy", "pyarrow", "sqlite3", "json5"}
print(heavy & set(sys.modules) | early)
"""
    environment = {
        **unmeasured(),
        "_FOLDCAR_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split()) - 1),
    }
    before_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime

    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)

    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before_s < QUICK_S
    assert answer.stdout == "--experiment\nset()\n"


def test_each_summary_is_one_json_object(foldcar: Any, study: Path, tmp_path: Path) -> None:
    def json_output(*words: str | Path) -> dict[str, Any]:
        done = foldcar(*words, "--json")
        assert done.returncode == 0, done.stderr
        # A sweep says its rule of success there, an import which of its cars were not swept.
        known = ("experiment 1: a run has passed if", 'note: experiment "1" was swept without a car of ')
        assert all(line.startswith(known) for line in done.stderr.splitlines()), done.stderr

        def refuse(constant: str) -> None:
            raise AssertionError(f"{words}: {constant}")

        answer = json.loads(done.stdout, parse_constant=refuse)
        assert isinstance(answer, dict)
        return answer

    environment = PROJECT / "scenarios" / "two_bumps.scenic"
    published = PROJECT / "scenarios" / "published_trials.csv"
    again = json_output("sweep", study, "--store", "s.db")
    assert (again["runs"], again["new"], again["there"], again["failed"]) == (6, 0, 6, 0)
    run = json_output("run", study, "--experiment", "1", "--set", "width=95", "--sample", "1")
    assert run["design"]["width_mm"] == 95
    assert run["metrics"]["elapsed_time_s"] > 0
    assert [scene["id"] for scene in json_output("sample", environment, "-n", "2")["scenes"]] == ["0/0", "0/1"]
    assert json_output("sample", environment, "-o", "scenes.jsonl")["file"] == "scenes.jsonl"
    foldcar("trials", "import", "s.db", published, "--experiment", "1")
    assert len(json_output("trials", "list", "s.db")["trials"]) == 44
    experiments = {command: json_output(command, "s.db")["experiments"] for command in ("select", "compare")}
    assert all(len(experiment) == 1 for experiment in experiments.values())
    assert {finding["state"] for finding in json_output("doctor")["findings"]} <= {"ok", "absent", "missing"}


def outputs() -> list[tuple[tuple[str, ...], str]]:
    """Words of every command with each of its outputs left to the end."""
    environment = str(PROJECT / "scenarios" / "two_bumps.scenic")
    cars = str(PROJECT / "patterns" / "published_cars.json")
    study = str(PROJECT / "scenarios" / "two_bumps.json")
    experiment = ("--experiment", "1")
    return [
        (("sweep", study, "--store"), "s.db"),
        (("run", study, *experiment, "--plot"), "r.png"),
        (("sample", environment, "-o"), "s.jsonl"),
        (("report", "s.db", "-o"), ""),
        (("export", "s.db", "--csv"), "s.csv"),
        (("model", cars, "--vehicle", "w95", "--to", "mjcf", "-o"), ""),
        (("pattern", cars, "--vehicle", "w95", "-o"), ""),
        (("view", cars, "--vehicle", "w95", "-o"), "c.html"),
        (("trials", "dialect", "-o"), ""),
    ]


@pytest.mark.parametrize(("words", "name"), outputs(), ids=lambda value: " ".join(value[:2]) if value else "")
def test_an_output_two_missing_folders_deep_is_refused_first(
    refused: Any, tmp_path: Path, words: tuple[str, ...], name: str
) -> None:
    output = Path("no") / "such" / name

    assert refused(*words, output) == f"{output}: cannot be written: the folder no does not exist"
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_permission_is_refused_before_the_work(foldcar: Any, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    words = ["sweep", str(PROJECT / "scenarios" / "two_bumps.json"), "--store", str(closed / "s.db")]

    done = subprocess.run([*WEAK, *COMMAND, *words], cwd=tmp_path, capture_output=True, text=True)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"foldcar: error: {closed / 's.db'}: cannot be written: no permission to write in the folder {closed}\n"
    )
