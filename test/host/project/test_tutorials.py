"""The tutorials of docs/: a shell runs their commands in order, and the output is what the page shows.

In a block marked `console` a line that begins with `$ ` is a command, `> ` continues it, and the lines below are its
output, in order. On the page, … stands for any text within a line, and for any lines if it is a line of its own.
`foldcar link` runs in the background; its port replaces the page's in all commands and outputs below.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

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


class Shell:
    """A folder and an environment in which a reader types commands."""

    def __init__(self, folder: Path) -> None:
        programs = folder / "bin"
        programs.mkdir()
        program = programs / "foldcar"
        program.write_text(f'#!/bin/sh\nexec {sys.executable} -m foldcar "$@"\n')
        program.chmod(0o755)
        self.folder = folder
        self.environment = {
            **os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "COLUMNS": "160", "PYTHONUNBUFFERED": "1",
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
        done = subprocess.run(
            ["sh", "-c", command], cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=HANGS_S
        )
        assert done.returncode == 0, (command, done.stdout, done.stderr)
        return done.stdout

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


@pytest.mark.parametrize("name", ["first_study", "first_car"])
def test_a_tutorial_s_commands_print_what_its_page_shows(name: str, shell: Shell, carsim_binary: Path) -> None:
    steps = list(steps_of(DOCS / f"{name}.md"))
    assert len(steps) >= 6

    for command, shown in steps:
        output = shell.types(command)
        expected = pattern_of([line.replace(PAGE_PORT, shell.port) for line in shown])
        message = "\n".join([f"{name}.md shows for {command}", *shown, "but it prints", output])
        assert re.fullmatch(expected, output), message
