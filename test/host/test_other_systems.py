"""Commands where Python lacks what only Linux has, as on Windows: they work, or say in one line what they need."""

import subprocess
import sys
from pathlib import Path

import pytest

from foldcar.commands.new import FILES
from old_stores import VERSIONS, old_store

STARTER = Path(__file__).resolve().parents[2] / "host" / "foldcar" / "study" / "starter"
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
sys.argv[0] = "foldcar"
from foldcar.__main__ import main
main()
"""
CAR = ("--set", "width=115", "--set", "radius=60")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The starting project, and a store of trials and runs."""
    for name in FILES:
        (tmp_path / name).write_bytes((STARTER / name).read_bytes())
    old_store(VERSIONS[-1], tmp_path / "s.db")
    return tmp_path


def poorer(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """The command on such a system."""
    return subprocess.run([sys.executable, "-c", POORER, *words], cwd=folder, capture_output=True, text=True)


def slow(*words: str) -> object:
    return pytest.param(words, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("report", "s.db", "-o", "report"),
        ("sweep", "study.json", "--store", "yard.db"),
        ("pattern", "study.json", "--vehicle", "mine", *CAR, "--mockup", "0.5", "-o", "paper"),
        slow("pattern", "study.json", "--vehicle", "mine", *CAR, "-o", "car"),
        slow("new", "yard"),
        slow("sample", "yard.scenic", "-n", "2", "--seed", "1"),
        slow("gallery", "yard.scenic", "-o", "pictures"),
        slow("run", "study.json", "--experiment", "yard", *CAR),
        slow("model", "study.json", "--vehicle", "mine", *CAR, "--to", "mjcf", "-o", "models"),
        slow("view", "study.json", "--vehicle", "mine", *CAR, "-o", "car.html"),
        slow("export", "s.db", "--folder", "exported"),
        slow("check", "s.db"),
        slow("repair", "s.db", "-o", "whole.db"),
        slow("select", "s.db"),
        slow("trials", "list", "s.db"),
    ],
    ids=lambda words: words[0],
)
def test_what_needs_no_terminal_works(project: Path, words: tuple[str, ...]) -> None:
    done = poorer(project, *words)
    assert done.returncode == 0 and done.stdout + done.stderr and "Traceback" not in done.stderr, done.stderr


def test_what_such_a_system_lacks_is_said_in_one_line(project: Path) -> None:
    done = poorer(project, "params", "get", "--port", "COM3")
    assert done.returncode == 2
    told = "foldcar: error: COM3: cars on USB are driven on Linux and macOS; use WSL "
    assert done.stderr.splitlines()[-1].startswith(told)
