"""Putting files into PlatformIO's core folder so that an interrupted call leaves nothing half-written."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class SeedError(Exception):
    """Something that seeding needs is out of reach; the message is one line and says what."""


def write_if_changed(file: Path, text: str) -> None:
    """Writes the file whole or not at all, and leaves it alone if it says the same already."""
    if file.is_file() and file.read_text(encoding="utf-8") == text:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(file)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Gives an empty folder to fill, which takes the place of ``folder`` if the block raises nothing."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".seed-", dir=folder.parent) as scratch:
        part = Path(scratch) / folder.name
        part.mkdir()
        yield part
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)


def run(purpose: str, *command: str, cwd: Path | None = None) -> str:
    """The command's output. Raises SeedError with the command's own last error line."""
    environment = {**os.environ, "LC_ALL": "C"}
    try:
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise SeedError(f"{purpose}: there is no command {command[0]} here") from None
    if done.returncode != 0:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        errors = [line for line in lines if line.lstrip().upper().startswith(("E:", "ERROR"))]
        raise SeedError(f"{purpose}: {(errors or lines or ['it failed without a message'])[-1].strip()}")
    return done.stdout
