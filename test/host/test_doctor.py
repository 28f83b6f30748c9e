"""The command `foldcar doctor`: what it finds, what it advises, and its exit code."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from foldcar.commands.doctor_programs import PlatformioProject, simulator
from foldcar.simulation.carsim import Carsim
from test_command_line import COMMAND, WEAK

Command = Callable[..., "subprocess.CompletedProcess[str]"]
PROJECT = Path(__file__).resolve().parents[2]
SOURCES = ("firmware/lib", "firmware/src", "sim2d", "tools", "host/foldcar/link")


def test_the_machine_of_the_tests_is_sound(new_foldcar: Command, carsim_binary: Path, tmp_path: Path) -> None:
    done = new_foldcar("doctor")

    assert (done.returncode, done.stderr) == (0, "")
    found = {line[9:20].strip(): line for line in done.stdout.splitlines()}
    for name in ("foldcar", "packages", "Scenic", "carsim", "results", "temporary", "PlatformIO", "MuJoCo", "MAVProxy"):
        assert found[name].startswith("ok "), found[name]
    assert f"build {Carsim(carsim_binary).build}, " in found["carsim"]
    assert found["carsim"].endswith("; fits the sources")
    assert f" {tmp_path}: " in found["results"]
    assert all(" -> " in line for line in found.values() if not line.startswith("ok "))


def test_without_a_simulator_it_says_what_to_do_and_fails(foldcar: Command) -> None:
    done = foldcar("doctor", "--json", env={**os.environ, "FOLDCAR_CARSIM": "/none/carsim"})

    assert (done.returncode, done.stderr) == (1, "")
    found = {one["name"]: one for one in json.loads(done.stdout)["findings"]}
    assert found["carsim"] == {
        "name": "carsim",
        "state": "missing",
        "text": "FOLDCAR_CARSIM: /none/carsim is no program",
        "advice": "let FOLDCAR_CARSIM name a carsim, or leave it out",
    }
    assert [one["name"] for one in found.values() if one["state"] == "missing"] == ["carsim"]


def test_a_simulator_of_other_sources_is_told(carsim_binary: Path, tmp_path: Path) -> None:
    for folder in SOURCES:
        shutil.copytree(PROJECT / folder, tmp_path / folder)
    changed = tmp_path / "sim2d" / "lib" / "model" / "scene_spec.h"
    changed.write_text(changed.read_text() + "// changed\n")

    (tmp_path / ".pio").symlink_to(PROJECT / ".pio")
    found = simulator(tmp_path, PlatformioProject(["-O2"], PROJECT / ".pio-core"))

    assert found.state == "missing"
    assert f"build {Carsim(carsim_binary).build}, " in found.text and "not of the sources here" in found.text
    assert found.advice == "make setup, which builds it again"


def test_a_folder_that_cannot_be_written_is_missing(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    done = subprocess.run([*WEAK, *COMMAND, "doctor"], cwd=closed, capture_output=True, text=True)

    assert done.returncode == 1
    assert f"missing  results     {closed}: cannot be written: Permission denied -> " in done.stdout
