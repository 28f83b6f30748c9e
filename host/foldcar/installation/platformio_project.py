"""The project's settings as PlatformIO reads them, and how to start PlatformIO."""

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ANSWER_S = 30


@dataclass(frozen=True)
class PlatformioProject:
    """``flags``: carsim's compiler flags; ``core``: the folder of fetched platforms and tools."""

    flags: list[str]
    core: Path


def pio_program() -> str | None:
    """The command `pio` beside this Python, or else on the PATH."""
    beside = Path(sys.executable).with_name("pio")
    return str(beside) if beside.is_file() else shutil.which("pio")


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
