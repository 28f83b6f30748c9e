"""Commands where Python lacks what only Linux has, as on Windows: they work, or say in one line what they need."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from foldcar.commands.new import FILES
from foldcar.simulation.engines import find_wasm
from full_store import full_store

STARTER = Path(__file__).resolve().parents[3] / "host" / "foldcar" / "study" / "starter"
# What Python itself, its packages and the simulators need is left, as these have other ways on Windows; modules, signals,
# forks, polls and the list of processors are missing.
POORER = """
import multiprocessing.connection, os, select, shutil, signal, subprocess, sys
import serial.tools.list_ports
import _signal
for name in ("fcntl", "grp", "pwd", "pty", "resource", "syslog", "termios", "tty"):
    sys.modules[name] = None
for module in (signal, _signal):
    for name in ("SIGHUP", "SIGALRM", "SIGPROF", "SIGUSR1", "SIGPIPE", "SIGCHLD", "setitimer", "pthread_sigmask"):
        if hasattr(module, name):
            delattr(module, name)
for name in ("poll", "epoll"):
    delattr(select, name)
for name in (
    "fork", "forkpty", "register_at_fork", "killpg", "getpgid", "setsid", "getuid", "geteuid", "statvfs", "mkfifo",
    "pread", "pwrite", "openpty", "sched_getaffinity", "set_blocking", "WIFSIGNALED",
    "O_NONBLOCK", "O_NOFOLLOW", "O_DIRECTORY",
):
    delattr(os, name)
# Descriptors of folders are Unix's, too: shutil deletes by them, and opens them with O_NONBLOCK from Python 3.13 on.
shutil._use_fd_functions = shutil.rmtree.avoids_symlink_attacks = False
import json
from foldcar.__main__ import main
from foldcar.fabrication.patterns import nesting
# The first order of pieces that fits: a search takes longer than all else.
nesting.MAX_TRIES = 0
for words in json.loads(sys.argv[1]):
    sys.argv[:] = ["foldcar", *words]
    try:
        main()
    except SystemExit as end:
        print("ended with", end.code or 0, file=sys.stderr, flush=True)
"""
CAR = ("--set", "width=115", "--set", "radius=60")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The starting project, and a store of trials and runs."""
    for name in FILES:
        (tmp_path / name).write_bytes((STARTER / name).read_bytes())
    full_store(tmp_path / "s.db")
    return tmp_path


def poorer(folder: Path, *commands: tuple[str, ...]) -> "subprocess.CompletedProcess[str]":
    """The commands on such a system, one after the other in one process; carsim runs in WebAssembly."""
    module = find_wasm()
    assert module is not None
    python = [sys.executable, "-c", POORER, json.dumps(commands)]
    environment = {**os.environ, "FOLDCAR_CARSIM": str(module)}
    # With this hash seed the command does not start Python again, which would bring back what is missing.
    environment |= {"PYTHONHASHSEED": "0"}
    return subprocess.run(python, cwd=folder, capture_output=True, text=True, env=environment)


COMMON = (
    ("--help",),
    ("sweep", "study.json", "--store", "study.db", "--samples", "2"),
    ("export", "s.db", "--csv", "runs.csv", "--trials", "trials.csv"),
    ("check", "s.db"),
    ("trials", "list", "s.db"),
)
# Drives, cuts, folds and draws: half a minute.
REST = (
    ("sweep", "study.json", "--store", "two.db", "--samples", "2"),
    ("report", "two.db", "-o", "report"),
    ("pattern", "study.json", "--vehicle", "mine", *CAR, "-o", "car"),
    ("new", "yard"),
    ("sample", "yard.scenic", "-n", "2", "--seed", "1"),
    ("sample", "yard.scenic", "-n", "3", "--plot", "yard.png"),
    ("run", "study.json", "--experiment", "yard", *CAR),
    ("model", "study.json", "--vehicle", "mine", *CAR, "--to", "mjcf", "-o", "models"),
    ("view", "study.json", "--vehicle", "mine", *CAR, "-o", "car.html"),
    ("select", "s.db"),
)


@pytest.mark.parametrize("commands", [COMMON, pytest.param(REST, marks=pytest.mark.slow)], ids=["common", "rest"])
def test_what_needs_no_terminal_works(project: Path, commands: tuple[tuple[str, ...], ...]) -> None:
    done = poorer(project, *commands)
    assert "Traceback" not in done.stderr and done.returncode == 0, done.stderr
    ends = [line for line in done.stderr.splitlines() if line.startswith("ended with")]
    assert ends == ["ended with 0"] * len(commands), done.stderr
    made = {"report", "car", "yard.png", "car.html"} if commands is REST else {"study.db", "runs.csv", "trials.csv"}
    assert made <= {file.name for file in project.iterdir()}


def test_what_such_a_system_lacks_is_said_in_one_line(project: Path) -> None:
    done = poorer(project, ("params", "get", "--port", "COM3"))
    error, ended = done.stderr.splitlines()[-2:]
    assert error == "foldcar: error: COM3: no such port"
    assert ended == "ended with 2"
