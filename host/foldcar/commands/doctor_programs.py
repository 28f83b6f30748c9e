"""What `foldcar doctor` says of programs: PlatformIO with the board's toolchain, and the simulators."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from foldcar.commands.doctor import Finding
from foldcar.errors import FoldcarError
from foldcar.installation import pio_program
from foldcar.link.ports import usb_ports
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import BINARY_VARIABLE, ENGINES, MUJOCO, MULTIBODY

ANSWER_S = 30


@dataclass(frozen=True)
class PlatformioProject:
    """``flags``: carsim's compiler flags; ``core``: the folder of fetched platforms and tools."""

    flags: list[str]
    core: Path


def read_project(checkout: Path) -> PlatformioProject | None:
    """The settings; None if PlatformIO is missing or cannot read them."""
    program = pio_program()
    if program is None:
        return None
    command = [program, "project", "config", "-d", str(checkout), "--json-output"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, check=True, timeout=ANSWER_S)
        sections = {name: dict(options) for name, options in json.loads(answer.stdout)}
        flags = sections["env:carsim"]["build_flags"]
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError):
        return None
    core = sections.get("platformio", {}).get("core_dir") or Path.home() / ".platformio"
    return PlatformioProject(list(flags), Path(core))


BOARD_PLATFORM = "espressif32"
TOOLCHAIN = "toolchain-xtensa-esp32"


def platformio(checkout: Path | None, project: PlatformioProject | None) -> Finding:
    """PlatformIO, which builds carsim and loads firmware."""
    program = pio_program()
    if program is None:
        return Finding("PlatformIO", "absent", "no `pio`: carsim cannot be built, nor a car flashed", "make setup")
    if checkout is None:
        return Finding("PlatformIO", "absent", "the firmware's sources are not here", "use a checkout of the project")
    if project is None:
        return Finding("PlatformIO", "absent", f"{program} cannot read {checkout / 'platformio.ini'}", "make setup")
    return Finding("PlatformIO", "ok", program)


def toolchain(project: PlatformioProject) -> Finding:
    """The board's compiler, which PlatformIO fetches."""
    parts = (Path("platforms") / BOARD_PLATFORM, Path("packages") / TOOLCHAIN)
    missing = [part for part in parts if not (project.core / part).is_dir()]
    if not missing:
        return Finding("toolchain", "ok", f"{TOOLCHAIN} in {project.core}")
    text = f"no {missing[0]} in {project.core}: only `foldcar flash` needs it"
    return Finding("toolchain", "absent", text, "the first `pio run` fetches it from PlatformIO's registry")


def serial_ports() -> Finding:
    """Cars on USB, and whether this user may open them."""
    ports = usb_ports()
    if not ports:
        return Finding("car on USB", "absent", "no USB serial port", "plug a car in, or let `foldcar link` pose as one")
    closed = [port.path for port in ports if not os.access(port.path, os.R_OK | os.W_OK)]
    shown = ", ".join(f"{port.path} ({port.description})" for port in ports)
    if closed:
        return Finding(
            "car on USB", "absent", f"{shown}: no permission for {', '.join(closed)}",
            "sudo usermod -aG dialout $USER, then log in again",
        )  # fmt: skip
    if not any(port.is_feather for port in ports):
        return Finding("car on USB", "absent", f"{shown}: none is a Feather's bridge", "name the car's port with --port")
    return Finding("car on USB", "ok", shown)


# The names by which SCons may call the compiler; the one that it does call is part of the build id.
COMPILERS = ("c++", "g++")

# The checkout's own tools/simulation_digest.py, in a process of its own: it may be of another version than this package.
DIGESTS = """
import sys
from pathlib import Path
from typing import Literal
from simulation_digest import firmware_digest, simulation_digest
root, compiler, fetched, shared, *flags = sys.argv[1:]
print(simulation_digest(Path(root), flags, compiler, [Path(fetched), Path(shared)]), firmware_digest(Path(root)))
"""


def simulator(checkout: Path | None, project: PlatformioProject | None) -> Finding:
    """carsim with its build id, compared with the one that the sources would give now."""
    try:
        carsim = Carsim()
    except FoldcarError as error:
        named = os.environ.get(BINARY_VARIABLE)
        advice = "make setup" if checkout is not None else "pip install --force-reinstall foldcar-….whl"
        advice = f"let {BINARY_VARIABLE} name a carsim, or leave it out" if named else advice
        return Finding("carsim", "missing", str(error), advice)
    return _compared("carsim", "missing", carsim, MULTIBODY, checkout, project)


def simulator_with_mujoco(checkout: Path | None, project: PlatformioProject | None) -> Finding:
    """The simulator with MuJoCo, in the same way; nothing else needs it."""
    try:
        carsim = Carsim(engine=MUJOCO)
    except FoldcarError as error:
        return Finding(
            "MuJoCo", "absent", f"{error}; only --engine mujoco and foldcar crosscheck need it",
            "make mujoco" if checkout is not None else "pip install 'foldcar[mujoco]', which needs Python 3.11 or newer",
        )  # fmt: skip
    return _compared("MuJoCo", "absent", carsim, MUJOCO, checkout, project)


def _compared(
    name: str, fault: Literal["missing", "absent"], carsim: Carsim, engine: str, checkout: Path | None,
    project: PlatformioProject | None,
) -> Finding:  # fmt: skip
    text = f"build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}"
    if checkout is None or project is None:
        return Finding(name, "ok", f"{text}; not compared with sources")
    libraries = [checkout / ".pio" / "libdeps" / ENGINES[engine].environment, project.core / "lib"]
    try:
        expected = [_digests(checkout, project, compiler, libraries) for compiler in COMPILERS]
    except (OSError, subprocess.SubprocessError, ValueError):
        return Finding(name, "ok", f"{text}; not compared with the sources, as compiler or Box2D is missing")
    # MuJoCo's name and version follow the build of the sources.
    if [carsim.build.partition(" ")[0], carsim.firmware] not in expected:
        build, firmware = expected[0]
        told = f"{text}: not of the sources here, which give build {build}, firmware {firmware}"
        return Finding(name, fault, told, f"make {ENGINES[engine].target}, which builds it again")
    return Finding(name, "ok", f"{text}; fits the sources")


def _digests(checkout: Path, project: PlatformioProject, compiler: str, libraries: list[Path]) -> list[str]:
    """The build id of carsim and of the firmware, by the sources; errors of subprocess if they cannot be computed."""
    command = [sys.executable, "-c", DIGESTS, str(checkout), compiler, *map(str, libraries), *project.flags]
    answer = subprocess.run(command, cwd=checkout / "tools", capture_output=True, text=True, check=True, timeout=ANSWER_S)
    return answer.stdout.split()
