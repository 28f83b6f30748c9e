"""The tutorials of docs/: a shell runs their commands in order, and the output is what the page shows.

In a block marked `console` a line that begins with `$ ` is a command, `> ` continues it, and the lines below are its
output, in order. On the page, … stands for any text within a line, and for any lines if it is a line of its own.
`foldcar link` runs in the background; its port replaces the page's in all commands and outputs below. Commands print on
a terminal of 80 columns, as a reader's. They leave nothing outside their folder and the checkout: not in the reader's
home, not in the folder for temporary files.
"""

import contextlib
import os
import pty
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from typist import COLOURS, WIDTH

DOCS = Path(__file__).resolve().parents[3] / "docs"
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGE_PORT = "/dev/pts/4"
HANGS_S = 300


def steps_of(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield each command of a page with the lines of output that the page shows."""
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        for step in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, *rest = step.splitlines()
            continued = [line[2:] for line in rest if line.startswith("> ")]
            yield "\n".join([command, *continued]), rest[len(continued) :]


def pattern_of(shown: list[str]) -> str:
    """Make a regular expression of the lines that a page shows."""
    lines = []
    for line in shown:
        if line == "…":
            lines.append(r"(?:[^\n]*\n)*?")
        else:
            parts = [r"[ \t]+".join(map(re.escape, re.split(r"[ \t]+", part))) for part in line.split("…")]
            lines.append(r"[^\n]*".join(parts) + r"[ \t]*\n")
    return "".join(lines)


def shown_on(terminal: int) -> str:
    """Read what is printed on a terminal until it is closed; returns what it shows then, without colours."""
    printed = b""
    end_s = time.monotonic() + HANGS_S
    # Reading fails when the last program that prints has ended.
    with contextlib.suppress(OSError):
        while time.monotonic() < end_s and (data := os.read(terminal, 65536)):
            printed += data
    os.close(terminal)
    lines, row = [""], 0
    # Progress that is shown in place moves the cursor up and erases lines.
    for part in re.split(r"(\n|\x1b\[\d*A|\x1b\[2K)", printed.decode().replace("\r", "")):
        if part == "\n":
            row += 1
            lines += [""] * (row == len(lines))
        elif part.endswith("A") and part.startswith("\x1b"):
            row = max(0, row - int(part[2:-1] or 1))
        elif part == "\x1b[2K":
            lines[row] = ""
        else:
            lines[row] += COLOURS.sub("", part)
    text = "\n".join(lines).rstrip("\n")
    return f"{text}\n" if text else ""


class Shell:
    """A folder and an environment in which a reader types commands."""

    def __init__(self, folder: Path) -> None:
        programs = folder / "bin"
        programs.mkdir()
        program = programs / "foldcar"
        program.write_text(f'#!/bin/sh\nexec {sys.executable} -m foldcar "$@"\n')
        program.chmod(0o755)
        self.folder = folder
        self.outside = [folder.with_name(f"{folder.name}-{name}") for name in ("home", "temporary")]
        for place in self.outside:
            place.mkdir()
        home, temporary = map(str, self.outside)
        # The reader has not chosen where caches are.
        own = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "MPLCONFIGDIR"))}
        self.environment = {
            **own, "HOME": home, "TMPDIR": temporary, "PATH": f"{programs}:{os.environ['PATH']}", "COLUMNS": str(WIDTH),
            "TERM": "xterm", "PYTHONUNBUFFERED": "1",
        }  # fmt: skip
        self.port = PAGE_PORT
        self.car: subprocess.Popen[str] | None = None

    def types(self, command: str) -> str:
        """Run a command; returns its output. `foldcar link` stays in the background, and replaces an earlier one."""
        command = command.replace(PAGE_PORT, self.port)
        if command.startswith("cd "):
            self.folder /= command.removeprefix("cd ")
            return ""
        if command.startswith("foldcar link "):
            self.unplugs()
            self.car = subprocess.Popen(
                ["sh", "-c", f"exec {command}"], cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, text=True
            )
            assert self.car.stdout is not None
            line = self.car.stdout.readline()
            self.port = line.strip()
            return line
        terminal, inner = pty.openpty()
        with tempfile.TemporaryFile() as errors:
            process = subprocess.Popen(
                ["sh", "-c", command], cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL, stdout=inner,
                stderr=errors,
            )  # fmt: skip
            os.close(inner)
            output = shown_on(terminal)
            errors.seek(0)
            assert process.wait(HANGS_S) == 0, (command, output, errors.read())
        return output

    def unplugs(self) -> None:
        """End the simulated car, if there is one."""
        if self.car is not None:
            self.car.terminate()
            self.car.communicate(timeout=HANGS_S)
            self.car = None


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    """A shell in an empty folder."""
    shell = Shell(tmp_path)
    yield shell
    shell.unplugs()


def test_the_tutorials_commands_print_what_their_pages_show(shell: Shell, carsim_binary: Path) -> None:
    # The second page goes on in the folder of the first.
    for name in ("first_study", "first_car"):
        steps = list(steps_of(DOCS / f"{name}.md"))
        assert len(steps) >= 6

        for command, shown in steps:
            output = shell.types(command)
            expected = pattern_of([line.replace(PAGE_PORT, shell.port) for line in shown])
            message = "\n".join([f"{name}.md shows for {command}", *shown, "but it prints", output])
            assert re.fullmatch(expected, output), message
    shell.unplugs()
    assert [file for place in shell.outside for file in place.rglob("*")] == []
