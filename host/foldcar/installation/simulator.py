"""The simulator carsim: whether it is there and starts, and whether it is built of the sources that are here."""

import os
import subprocess
import sys
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.installation.finding import Finding
from foldcar.installation.platformio_project import PlatformioProject
from foldcar.simulation.carsim import BINARY_VARIABLE, Carsim

# The names by which SCons may call the compiler; the one that it does call is part of the build id.
COMPILERS = ("c++", "g++")
ANSWER_S = 30

# The checkout's own tools/simulation_digest.py, in a process of its own: it may be of another version than this package.
DIGESTS = """
import sys
from pathlib import Path
from simulation_digest import firmware_digest, simulation_digest
root, compiler, libraries, *flags = sys.argv[1:]
print(simulation_digest(Path(root), flags, compiler, Path(libraries)), firmware_digest(Path(root)))
"""


def simulator(checkout: Path | None, project: PlatformioProject | None) -> Finding:
    """carsim with its build id, compared with the one that the sources would give now."""
    try:
        carsim = Carsim()
    except FoldcarError as error:
        named = os.environ.get(BINARY_VARIABLE)
        advice = f"let {BINARY_VARIABLE} name a carsim, or leave it out" if named else "make setup"
        return Finding("carsim", "missing", str(error), advice)
    text = f"build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}"
    if checkout is None or project is None:
        return Finding("carsim", "ok", f"{text}; not compared with sources")
    try:
        expected = [_digests(checkout, project, compiler) for compiler in COMPILERS]
    except (OSError, subprocess.SubprocessError, ValueError):
        return Finding("carsim", "ok", f"{text}; not compared with the sources, as compiler or Box2D is missing")
    if [carsim.build, carsim.firmware] not in expected:
        build, firmware = expected[0]
        told = f"{text}: not of the sources here, which give build {build}, firmware {firmware}"
        return Finding("carsim", "missing", told, "make setup, which builds it again")
    return Finding("carsim", "ok", f"{text}; fits the sources")


def _digests(checkout: Path, project: PlatformioProject, compiler: str) -> list[str]:
    """The build id of carsim and of the firmware, by the sources; errors of subprocess if they cannot be computed."""
    libraries = checkout / ".pio" / "libdeps" / "carsim"
    command = [sys.executable, "-c", DIGESTS, str(checkout), compiler, str(libraries), *project.flags]
    answer = subprocess.run(
        command, cwd=checkout / "tools", capture_output=True, text=True, check=True, timeout=ANSWER_S
    )
    return answer.stdout.split()
