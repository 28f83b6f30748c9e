"""The wheel as pip installs it, outside a checkout: it brings carsim and every file that it needs, and works."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from zipfile import ZipFile

import pytest

from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO
from foldcar.store.reader import Store

PROJECT = Path(__file__).resolve().parents[3]
SOURCES = ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "host")
# The shell's own tools; no compiler, no `make`, no `pio`.
WORDS = ("cat", "dirname", "head", "kill", "mktemp", "rm", "sh", "sleep", "test")


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what wheels are made from, so that nothing lands in the source tree."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source = PROJECT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
        else:
            shutil.copy(source, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(carsim_binary: Path, sources: Path) -> Path:
    """A wheel with the programs that `make test` has built."""
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", sources / "dist"]
    environment = {**os.environ, "FOLDCAR_BUILD_DIR": str(carsim_binary.parents[1])}
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, sources], check=True, cwd=sources, env=environment)
    (result,) = (sources / "dist").iterdir()
    return result


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment with the wheel, and what it depends on by way of this Python's packages."""
    folder = tmp_path_factory.mktemp("installed") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    pip = [sys.executable, "-m", "pip", "--quiet", "--python", folder / "bin" / "python"]
    subprocess.run([*pip, "install", "--no-deps", wheel], check=True)
    own_site, site = Path(sysconfig.get_path("purelib")), site_of(folder)
    (site / "dependencies.pth").write_text(f"{own_site}\n", encoding="utf-8")
    # foldcar[mujoco] puts it there.
    (site / "mujoco").symlink_to(own_site / "mujoco")
    return folder


def site_of(environment: Path) -> Path:
    (site,) = environment.glob("lib/python3*/site-packages")
    return site


def test_the_wheel_is_for_every_python_and_has_every_file(wheel: Path) -> None:
    assert wheel.name.split("-")[2:4] == ["py3", "none"] and "linux" in wheel.name
    package = PROJECT / "host" / "foldcar"
    source = {file.relative_to(PROJECT / "host").as_posix() for file in package.rglob("*") if file.is_file()}
    with ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("foldcar/")}
    assert names == {name for name in source if "__pycache__" not in name} | {
        "foldcar/carsim",
        "foldcar/carsim_mujoco",
        "foldcar/carsim.wasm",
    }


@pytest.mark.slow
def test_the_wheel_for_every_system_simulates_with_node(sources: Path, carsim_binary: Path, tmp_path: Path) -> None:
    """The same results as the native simulator's, from a folder without any other simulator."""
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path]
    variables = {**os.environ, "FOLDCAR_BUILD_DIR": str(carsim_binary.parents[1]), "FOLDCAR_WHEEL": "any"}
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, sources], check=True, cwd=sources, env=variables)
    (wheel,) = tmp_path.glob("*.whl")
    installed = tmp_path / "site"
    with ZipFile(wheel) as archive:
        archive.extractall(installed)
    (tmp_path / "yard").mkdir()
    python = [sys.executable, "-c", "import sys; sys.path.insert(0, sys.argv.pop(1)); from foldcar.cli import app; app()"]

    def foldcar(folder: Path, *words: str) -> str:
        command = [*python, str(folder), *words]
        return subprocess.run(command, cwd=tmp_path / "yard", check=True, capture_output=True, text=True).stdout

    foldcar(installed, "new", ".")
    for name, folder in (("node", installed), ("native", PROJECT / "host")):
        foldcar(folder, "sweep", "study.json", "--store", f"{name}.db", "--samples", "2")

    assert wheel.name.endswith("-py3-none-any.whl")
    assert not (installed / "foldcar" / "carsim").exists() and (installed / "foldcar" / "carsim.wasm").is_file()
    with Store.open(tmp_path / "yard" / "node.db") as node, Store.open(tmp_path / "yard" / "native.db") as native:
        assert list(node.results("yard")) == list(native.results("yard"))
    assert foldcar(installed, "sweep", "study.json", "--store", "native.db", "--samples", "2").startswith("0 new runs")
    assert "WebAssembly with Node, " in foldcar(installed, "doctor")


def test_without_a_compiler_the_sources_say_what_they_need(sources: Path, tmp_path: Path) -> None:
    alone = {name: value for name, value in os.environ.items() if name != "FOLDCAR_BUILD_DIR"} | {"PATH": str(tmp_path)}
    options = ["--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", *options, sources], env=alone, capture_output=True, text=True
    )
    assert done.returncode != 0 and not list(tmp_path.iterdir())
    (error,) = [line.strip() for line in (done.stdout + done.stderr).splitlines() if "error: carsim" in line]
    assert error == (
        "error: carsim is built from its sources here, which needs g++ "
        "(Debian, Ubuntu: apt-get install g++); foldcar's wheel needs none"
    )


def test_the_installed_programs_are_the_checkouts_builds(environment: Path, tmp_path: Path) -> None:
    script = """
import json, foldcar
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO
programs = [[str(one.binary), one.build, one.firmware] for one in (Carsim(), Carsim(engine=MUJOCO))]
print(json.dumps([foldcar.__file__, *programs]))
"""
    done = subprocess.run([environment / "bin" / "python", "-c", script], cwd=tmp_path, capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
    package = site_of(environment) / "foldcar"
    file, *programs = json.loads(done.stdout)
    assert Path(file).parent == package
    built = (("carsim", Carsim()), ("carsim_mujoco", Carsim(engine=MUJOCO)))
    assert programs == [[str(package / name), carsim.build, carsim.firmware] for name, carsim in built]


@pytest.mark.slow
def test_a_first_user_gets_from_a_new_project_to_a_report_sheets_and_a_car(environment: Path, tmp_path: Path) -> None:
    words = tmp_path / "bin"
    words.mkdir()
    for word in WORDS:
        (words / word).symlink_to(shutil.which(word) or "")
    command = [PROJECT / "tools" / "smoke.sh", environment / "bin" / "foldcar"]
    alone = {"PATH": str(words), "HOME": str(tmp_path), "LC_ALL": "C.UTF-8"}

    done = subprocess.run(command, cwd=tmp_path, env=alone, capture_output=True, text=True)

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1].startswith("smoke: ")
    assert "180 new runs, 0 already stored" in done.stdout
