"""Commands where Python lacks what only Linux has, as on Windows: they work, or say in one line what they need."""

import subprocess
import sys
from pathlib import Path

import pytest

from foldcar.commands.new import FILES

STARTER = Path(__file__).resolve().parents[2] / "host" / "foldcar" / "study" / "starter"
# What Python itself and the simulators need is left; modules, signals and the list of processors are missing.
POORER = """
import os, signal, sys
import _signal
for name in ("fcntl", "grp", "pwd", "pty", "resource", "termios", "tty"):
    sys.modules[name] = None
for module in (signal, _signal):
    for name in ("SIGHUP", "SIGALRM", "SIGPROF", "setitimer", "pthread_sigmask"):
        if hasattr(module, name):
            delattr(module, name)
del os.sched_getaffinity
sys.argv[0] = "foldcar"
from foldcar.__main__ import main
main()
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The starting project."""
    for name in FILES:
        (tmp_path / name).write_bytes((STARTER / name).read_bytes())
    return tmp_path


def poorer(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """The command on such a system."""
    return subprocess.run([sys.executable, "-c", POORER, *words], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("new", "yard"),
        ("sample", "yard.scenic", "-n", "2", "--seed", "1"),
        ("run", "study.json", "--experiment", "yard", "--set", "width=115", "--set", "radius=60"),
        ("pattern", "study.json", "--vehicle", "mine", "--set", "width=115", "--set", "radius=60", "-o", "car"),
    ],
    ids=lambda words: words[0],
)
@pytest.mark.slow
def test_what_needs_no_terminal_and_no_store_works(project: Path, words: tuple[str, ...]) -> None:
    done = poorer(project, *words)
    assert done.returncode == 0 and done.stdout and "Traceback" not in done.stderr, done.stderr


def test_a_store_that_cannot_be_locked_is_refused_in_one_line(project: Path) -> None:
    done = poorer(project, "sweep", "study.json", "--store", "yard.db")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("foldcar: error: yard.db: stores are written on Linux only; ")
    assert not (project / "yard.db").exists()
