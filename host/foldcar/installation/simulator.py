"""The simulators: whether they are there and start, and whether they are built of the sources that are here."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Literal

from foldcar.errors import FoldcarError
from foldcar.installation.finding import Finding
from foldcar.installation.platformio_project import PlatformioProject
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import BINARY_VARIABLE, ENGINES, MUJOCO, MULTIBODY

# The names by which SCons may call the compiler; the one that it does call is part of the build id.
COMPILERS = ("c++", "g++")
ANSWER_S = 30

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
        advice = f"let {BINARY_VARIABLE} name a carsim, or leave it out" if named else _again(checkout, "make setup")
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
    name: str,
    fault: Literal["missing", "absent"],
    carsim: Carsim,
    engine: str,
    checkout: Path | None,
    project: PlatformioProject | None,
) -> Finding:
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


def _again(checkout: Path | None, target: str) -> str:
    return target if checkout is not None else "pip install --force-reinstall foldcar-….whl"


def _digests(checkout: Path, project: PlatformioProject, compiler: str, libraries: list[Path]) -> list[str]:
    """The build id of carsim and of the firmware, by the sources; errors of subprocess if they cannot be computed."""
    command = [sys.executable, "-c", DIGESTS, str(checkout), compiler, *map(str, libraries), *project.flags]
    answer = subprocess.run(
        command, cwd=checkout / "tools", capture_output=True, text=True, check=True, timeout=ANSWER_S
    )
    return answer.stdout.split()
