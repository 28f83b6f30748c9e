"""What a Scenic program consists of: its files are its identity, its modules its own, its samples always the same."""

import contextlib
import importlib
import os
import py_compile
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from conftest import STEP_PYRAMIDS
from foldcar.errors import FoldcarError
from foldcar.scenes import fingerprint
from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, read_study
from foldcar.study.sweep import Sweep
from swept_listing import WriteListing, rows, straight_listing, swept

COURSE = "ego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (0.6, 0), facing -90 deg\n"
HEAD = f"model model\n{COURSE}"
# A value of each sample that a function of Python gives.
SAMPLED = (
    "from scenic.core.distributions import distributionFunction\n"
    "param friction = distributionFunction(value)(Range(0, 1))\n"
)
Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "program" / "program.scenic"
    file.parent.mkdir()
    file.write_text(HEAD)
    return file


@pytest.fixture
def listing(write_listing: WriteListing, listing_data: Any, program: Path) -> Path:
    """A width, three samples of ``program``."""
    return straight_listing(write_listing, listing_data, program)


@pytest.fixture
def experiment(listing: Path) -> Experiment:
    return read_study(listing).experiments[0]


def friction(program: Path, k: int = 0) -> float:
    value: float = open_environment(program, {}, 1).sample(k)["friction"]
    return value


def test_what_is_compiled_is_what_the_fingerprint_is_of(experiment: Experiment) -> None:
    before = ExperimentEnvironment(experiment).fingerprint
    environment = ExperimentEnvironment(experiment)
    experiment.program.write_text(f"{HEAD}param friction = 0.3\n")
    fingerprint = environment.fingerprint
    experiment.program.write_text(f"{HEAD}param friction = 0.4\n")

    assert environment.sample(1)["friction"] == 0.3
    assert environment.fingerprint == fingerprint != before
    experiment.program.write_text(f"{HEAD}param friction = 0.3\n")
    assert ExperimentEnvironment(experiment).fingerprint == fingerprint


def test_a_program_beside_the_simulation_that_is_edited_during_a_sweep_is_refused(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    beside = f"{HEAD}require always ego.position.x < 9\n"
    program.write_text(f"{beside}terminate after 9 seconds\n")

    def edit(line: str) -> None:
        program.write_text(f"{beside}terminate after 1 seconds\n")

    with pytest.raises(FoldcarError, match=r"program\.scenic: has changed while the program was in use"):
        Sweep(read_study(listing), tmp_path / "s.db", Carsim(carsim_binary), "a test").run(1, announce=edit)
    assert not rows(tmp_path / "s.db")


def test_each_program_has_its_own_neighbour_of_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it imports it no sooner than it is sampled; the caller's own module of that name stays."""
    (tmp_path / "helper.py").write_text("value = 'mine'\n")
    monkeypatch.syspath_prepend(tmp_path)
    own_module = importlib.import_module("helper")
    sources = {}
    text = "def value(x):\n    import helper\n    return helper.value(x)\n"
    for folder, number in (("a", 0.3), ("b", 0.4)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "p.scenic").write_text(HEAD + text + SAMPLED)
        (tmp_path / folder / "helper.py").write_text(f"def value(x):\n    return {number}\n")
        sources[folder] = open_environment(tmp_path / folder / "p.scenic", {}, 1)

    assert [source.sample(k)["friction"] for source in sources.values() for k in range(2)] == [0.3, 0.3, 0.4, 0.4]
    assert sys.modules.pop("helper") is own_module


def test_a_neighbour_that_was_edited_is_read_again_whatever_its_size_and_time(program: Path) -> None:
    program.write_text("from helper import number\n" + HEAD + "param friction = number\n")
    helper = program.with_name("helper.py")
    for number in ("0.3", "0.4"):
        helper.write_text(f"number = {number}\n")
        os.utime(helper, (1, 1))
        importlib.invalidate_caches()
        assert friction(program) == float(number)


BY_PATH = """
import importlib.util
from pathlib import Path
spec = importlib.util.spec_from_file_location("far", Path(localPath(".")) / "{name}")
far = importlib.util.module_from_spec(spec)
spec.loader.exec_module(far)
"""


def test_a_module_that_is_loaded_by_its_path_is_loaded_from_its_source(program: Path) -> None:
    far = program.with_name("far.py")
    far.write_text("number = 0.3\n")
    py_compile.compile(str(far), doraise=True)
    status = far.stat()
    far.write_text("number = 0.4\n")
    os.utime(far, ns=(status.st_atime_ns, status.st_mtime_ns))
    program.write_text(BY_PATH.format(name="far.py") + HEAD + "param friction = far.number\n")

    assert friction(program) == 0.4


def test_a_module_of_which_there_is_only_compiled_code_is_refused(program: Path) -> None:
    helper = program.with_name("other.py")
    helper.write_text("number = 0.3\n")
    py_compile.compile(str(helper), cfile=str(helper.with_suffix(".pyc")), doraise=True)
    helper.unlink()
    for head in ("import other as far\n", BY_PATH.format(name="other.pyc")):
        program.write_text(head + HEAD + "param friction = far.number\n")

        with pytest.raises(FoldcarError, match=r"other\.pyc is compiled; put its source there"):
            friction(program)


def test_a_package_that_takes_the_place_of_a_module_is_another_environment(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    program.write_text(f"from helper import number\n{HEAD}param friction = number\n")
    program.with_name("helper.py").write_text("number = 0.5\n")
    before = swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)
    package = program.with_name("helper") / "__init__.py"
    package.parent.mkdir()
    package.write_text("number = 0.9\n")

    after = swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)

    assert (before.new, after.new) == (1, 1)


def test_a_file_that_appears_where_a_program_looks_for_it_is_another_environment(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    read = "float(open(localPath('f.txt')).read())"
    program.write_text(f"{HEAD}try:\n    param friction = {read}\nexcept OSError:\n    param friction = 0.5\n")
    before = swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)
    again = swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)
    program.with_name("f.txt").write_text("0.9")

    after = swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)

    assert (before.new, again.new, after.new) == (1, 0, 1)


LISTINGS = {
    "listdir": "import os\nnames = sorted(os.listdir(localPath('stones')))\n",
    "glob": "from pathlib import Path\nnames = sorted(f.name for f in Path(localPath('stones')).glob('*'))\n",
    "walk": "import os\nnames = sorted(f for _, _, files in os.walk(localPath('stones')) for f in files)\n",
}


@pytest.mark.parametrize("head", LISTINGS.values(), ids=LISTINGS)
def test_the_names_in_a_folder_that_a_program_lists_are_part_of_the_environment(
    head: str, listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    stones = program.parent / "stones"
    stones.mkdir()
    (stones / "0.3").touch()
    program.write_text(f"{head}{HEAD}param friction = float(max(name for name in names if name[0] == '0'))\n")

    def new_runs() -> int:
        return swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1).new

    assert [new_runs(), new_runs()] == [1, 0]
    for name in ("__pycache__", ".DS_Store"):
        (stones / name).touch()
    (program.parent / "beside.txt").touch()
    assert new_runs() == 0
    (stones / "0.4").touch()
    assert [new_runs(), new_runs()] == [1, 0]


def test_a_symbolic_link_that_leads_elsewhere_is_another_environment(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    """Such as `data -> data_v2`: the files to which it led are unchanged."""
    program.write_text(f"{HEAD}param friction = float(open(localPath('../program/data/f.txt')).read())\n")
    for version, number in (("v1", 0.3), ("v2", 0.4)):
        (program.parent / version).mkdir()
        (program.parent / version / "f.txt").write_text(str(number))
    new_runs = []
    for version in ("v1", "v1", "v2", "v2"):
        (program.parent / "data").unlink(missing_ok=True)
        (program.parent / "data").symlink_to(version)
        new_runs.append(swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1).new)

    assert new_runs == [1, 0, 1, 0]


def test_a_folder_that_is_listed_too_late_is_refused(program: Path) -> None:
    (program.parent / "stones").mkdir()
    text = "import os\ndef value(x):\n    return 0.3 if x > 1 or os.listdir(localPath('stones')) else 0.4\n"
    program.write_text(text + HEAD + SAMPLED)
    source = open_environment(program, {}, 1)
    source.sample(0)
    source.fixed_files()
    (program.parent / "stones" / "1").touch()

    with pytest.raises(FoldcarError, match=r"stones: has changed while the program was in use"):
        source.sample(1)


@pytest.mark.parametrize(
    "read",
    [
        "from concurrent.futures import ThreadPoolExecutor\nwith ThreadPoolExecutor(1) as pool:\n"
        "    number = float(pool.submit(lambda: open(localPath('f.txt')).read()).result())\n",
        "import sqlite3\nnumber = sqlite3.connect(localPath('f.txt')).execute('select h from t').fetchone()[0]\n",
    ],
    ids=["a thread", "a database"],
)
def test_files_of_threads_and_databases_are_part_of_the_environment(read: str, program: Path) -> None:
    data = program.with_name("f.txt")

    def write(number: float) -> None:
        data.unlink(missing_ok=True)
        if "sqlite3" not in read:
            data.write_text(str(number))
            return
        with contextlib.closing(sqlite3.connect(data)) as database, database:
            database.execute("create table t (h)")
            database.execute("insert into t values (?)", (number,))

    program.write_text(f"{read}{HEAD}param friction = number\n")
    names = []
    for number in (0.3, 0.4):
        write(number)
        source = open_environment(program, {}, 1)
        assert source.sample(0)["friction"] == number
        names.append(dict(source.fixed_files())["f.txt"])
    assert len(set(names)) == 2


def test_what_a_program_reads_is_part_of_its_fingerprint(experiment: Experiment, tmp_path: Path) -> None:
    """Modules in folders, files in its folder and outside, read at its head or in samples; not what it does not read."""
    experiment.program.write_text(
        f"from lib.heights import number\n{HEAD}h = [open(localPath(one)).read() for one in ('h.txt', '../o.txt')]\n"
        f"def value(x):\n    return float(open({str(tmp_path / 'sampled.txt')!r}).read())\n{SAMPLED}"
    )
    folder = experiment.program.parent
    (folder / "lib").mkdir()
    read = ["lib/heights.py", "h.txt", "../o.txt", "../sampled.txt", "beside.scenic"]
    for name in (*read, "lib/other.py", "other.txt"):
        (folder / name).write_text("number = 1" if name.endswith(".py") else "0.1")

    def edited(name: str) -> str:
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace("1", "2"))
        result = ExperimentEnvironment(experiment).fingerprint
        (folder / name).write_text(text)
        return result

    first = ExperimentEnvironment(experiment).fingerprint
    assert len({first, *map(edited, read)}) == 1 + len(read)
    assert edited("lib/other.py") == edited("other.txt") == ExperimentEnvironment(experiment).fingerprint == first


def test_the_command_itself_is_no_part_of_the_fingerprint(
    listing: Path, program: Path, tmp_path: Path, experiment: Experiment
) -> None:
    """Lines of every file on the stack are read to be shown, those of the command `foldcar` too."""
    program.write_text(STEP_PYRAMIDS.read_text())
    command = [str(Path(sys.executable).with_name("foldcar")), "sweep", str(listing), "--store", "s.db", "--jobs", "1"]
    subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    with contextlib.closing(sqlite3.connect(tmp_path / "s.db")) as store:
        assert store.execute("SELECT fingerprint FROM environment").fetchall() == [
            (ExperimentEnvironment(experiment).fingerprint,)
        ]


def test_a_program_is_not_compiled_if_its_files_and_all_results_are_there(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    """That a parameter names another file is noticed."""
    program.write_text(
        f"{HEAD}param file = 'a.txt'\nparam friction = float(open(localPath(globalParameters.file)).read())\n"
    )
    for name, number in (("a.txt", 0.3), ("b.txt", 0.4)):
        program.with_name(name).write_text(str(number))
    listings = [listing, listing.with_name("other.json")]
    listings[1].write_text(listing.read_text().replace('"seed"', '"scenic_params": {"file": "b.txt"}, "seed"'))
    opened: list[ExperimentEnvironment] = []

    def environment_of(experiment: Experiment) -> ExperimentEnvironment:
        opened.append(ExperimentEnvironment(experiment))
        return opened[-1]

    compilations = [
        Sweep(read_study(listing), tmp_path / "s.db", Carsim(carsim_binary), "a test", environment_of).run(1).new
        for listing in (*listings, *reversed(listings))
    ]
    compiled = [environment._source is not None for environment in opened]
    assert (compilations, compiled) == ([1, 1, 0, 0], [True, True, False, True])
    assert {environment.files["a.txt" if at in (0, 3) else "b.txt"] for at, environment in enumerate(opened)} == {
        sha256(text).hexdigest() for text in (b"0.3", b"0.4")
    }


def test_samples_that_depend_on_the_ones_before_are_refused(
    listing: Path, program: Path, foldcar: Run, tmp_path: Path
) -> None:
    program.write_text(f"{HEAD}import random\nown = random.Random(1)\ndef value(x):\n    return own.random()\n{SAMPLED}")
    for jobs in ("1", "2"):
        done = foldcar("sweep", listing, "--store", "s.db", "--jobs", jobs)
        assert done.returncode == 2
        assert "program.scenic: sample 0 is another scene now than when it was first drawn" in done.stderr
        assert not (tmp_path / "s.db").exists()


def test_a_sweep_that_resumes_with_other_samples_is_refused(
    listing: Path, program: Path, foldcar: Run, tmp_path: Path
) -> None:
    program.write_text(f"{HEAD}import os\ndef value(x):\n    return os.getpid() % 97 / 100 + 0.1\n{SAMPLED}")
    words = ["sweep", listing, "--store", "s.db", "--samples"]
    assert foldcar(*words, "2").returncode == 0
    again, more = foldcar(*words, "2"), foldcar(*words, "4")
    assert "0 new runs, 2 already stored" in again.stdout
    assert more.returncode == 2
    assert "program.scenic: sample 1 is another scene now" in more.stderr
    assert len(rows(tmp_path / "s.db")) == 2


@pytest.mark.parametrize("mode", ["r", "r+", "a+"])
def test_a_file_that_is_opened_to_be_read_and_written_is_an_input(
    mode: str, listing: Path, program: Path, foldcar: Run
) -> None:
    number = program.with_name("number.txt")
    number.write_text("0.5")
    program.write_text(
        f"{HEAD}with open(localPath('number.txt'), '{mode}') as file:\n    file.seek(0)\n    x = float(file.read())\n"
        "new Kerb at (x, 0), facing -90 deg\n"
    )
    assert "1 new run, 2 already stored" in foldcar("sweep", listing, "--store", "s.db").stdout
    number.write_text("0.4")
    assert "1 new run, 2 already stored" in foldcar("sweep", listing, "--store", "s.db").stdout


def test_a_run_may_import_neighbours_but_read_nothing_that_the_fingerprint_does_not_know(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path
) -> None:
    program.with_name("late.py").write_text("number = 7\n")
    program.write_text(f"{HEAD}def given():\n    import late\n    return late.number\nrecord final given() as n\n")
    assert swept(listing, tmp_path / "s.db", carsim_binary, 1).failed == 0
    assert [row.recorded["n"].value for row in rows(tmp_path / "s.db")] == [7, 7, 7]

    program.with_name("late.txt").write_text("7")
    late = str(program.with_name("late.txt"))
    program.write_text(f"{HEAD}record final open({late!r}).read() as n\n")
    with pytest.raises(FoldcarError, match=r"program\.scenic: reads .*late\.txt for the first time after sample 0"):
        swept(listing, tmp_path / "t.db", carsim_binary, 1)


def test_nothing_is_imported_from_the_working_directory(listing: Path, program: Path, tmp_path: Path) -> None:
    program.write_text(f"{HEAD}record final ego.position.x as x\n")
    folder = tmp_path / "work"
    folder.mkdir()
    for name in ("json", "numpy", "random", "scenic", "socket"):
        (folder / f"{name}.py").write_text("raise SystemExit(f'{__name__} of the working directory')\n")
    command = [Path(sys.executable).with_name("foldcar"), "sweep", listing, "--store", "s.db", "--samples", "1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "1 new run" in done.stdout


def test_files_of_one_name_in_two_folders_are_told_apart(experiment: Experiment, tmp_path: Path) -> None:
    experiment.program.write_text(f"{HEAD}h = [open(localPath(f'../{{one}}/h.txt')).read() for one in 'ab']\n")
    folders = experiment.program.parent.parent / "a", experiment.program.parent.parent / "b"

    def fingerprint_with(*contents: str) -> str:
        for folder, content in zip(folders, contents, strict=True):
            folder.mkdir(exist_ok=True)
            (folder / "h.txt").write_text(content)
        return ExperimentEnvironment(experiment).fingerprint

    assert fingerprint_with("0.1", "0.2") != fingerprint_with("0.2", "0.1")


@pytest.mark.parametrize("changed", [lambda text: b"\xef\xbb\xbf" + text, lambda text: text.replace(b"\n", b"\r\n")])
def test_a_byte_order_mark_and_other_line_breaks_make_no_other_environment(
    experiment: Experiment, changed: Callable[[bytes], bytes]
) -> None:
    program, helper = experiment.program, experiment.program.with_name("helper.py")
    text = f"from helper import number\n{HEAD}param note = '''a\nb'''\nparam friction = number\nterminate when False\n"
    program.write_text(text)
    helper.write_text("number = 0.4\n")
    before = ExperimentEnvironment(experiment).fingerprint
    for file in (program, helper):
        file.write_bytes(changed(file.read_bytes()))

    assert ExperimentEnvironment(experiment).fingerprint == before
    opened = open_environment(program, {}, 1)
    assert opened.sample(0)["friction"] == 0.4 and opened.success and opened.scenario.params["note"] == "a\nb"


def test_an_edit_of_any_file_of_code_that_is_hashed_changes_the_digest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = fingerprint.PACKAGE
    skip = shutil.ignore_patterns("__pycache__")
    for name in ("scenes", "simulation", "car"):
        shutil.copytree(package / name, tmp_path / name, ignore=skip)
    monkeypatch.setattr(fingerprint, "PACKAGE", tmp_path)
    for places in (fingerprint.SCENE_CODE, fingerprint.VARIATION_CODE):
        copied = [tmp_path / place.relative_to(package) for place in places]
        files = [file for place in copied for file in (place.rglob("*") if place.is_dir() else [place]) if file.is_file()]
        digests = {fingerprint.code_digest(copied)}
        for file in files:
            file.write_bytes(file.read_bytes() + b"#")
            digests.add(fingerprint.code_digest(copied))
        assert len(digests) == 1 + len(files) > 2
    with pytest.raises(FileNotFoundError, match="no code to hash"):
        fingerprint.code_digest([tmp_path / "variation"])


def test_environment_variables_are_no_part_of_an_environment(
    listing: Path, program: Path, tmp_path: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither while it is sampled nor while it drives, beside which Scenic records."""
    program.write_text(
        f"import os\n{HEAD}param friction = float(os.environ.get('FOLDCAR_FRICTION', '0.5'))\n"
        "record final float(os.environ.get('FOLDCAR_FRICTION', '0.5')) as seen\n"
    )
    monkeypatch.setenv("FOLDCAR_FRICTION", "0.7")

    swept(listing, tmp_path / "s.db", carsim_binary, 1, environments=1)

    assert open_environment(program, {}, 0).sample(0)["friction"] == 0.5
    assert [result.recorded["seen"].value for result in rows(tmp_path / "s.db")] == [0.5]
    assert os.environ["FOLDCAR_FRICTION"] == "0.7"


def test_parameters_seed_and_condition_are_part_of_the_fingerprint(experiment: Experiment) -> None:
    changed = replace(experiment, program=STEP_PYRAMIDS)
    changes: list[dict[str, Any]] = [{}, {"seed": 1}, {"scenic_params": {"friction": 0.5}}, {"condition": {"sample": 0}}]
    assert len({ExperimentEnvironment(replace(changed, **change)).fingerprint for change in changes}) == len(changes)
