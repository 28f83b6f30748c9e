"""Ctrl-C and its like, at any moment of any command: exit code 130, one line, no process and no file left."""

import json
import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from conftest import two_widths
from forked_foldcar import original
from shell_signals import like_a_shell

FOLDCAR = [sys.executable, "-m", "foldcar"]
BESIDE = """model model
ego = new Robot at (0, 0), facing -90 deg
new Goal at (1.3, 0), facing -90 deg
record ego.position.x as way
"""
Start = Callable[..., "subprocess.Popen[str]"]
MARK = "FOLDCAR_TEST_MARK"
RUN = ["--experiment", "1", "--set", "width=95"]
# Everything that a command passes on its way is interrupted by some of these: imports, Scenic, sampling, simulating.
MOMENTS_S = (0.0, 0.4, 1.2)
COMMANDS = {
    "run": ["run", "flat.json", *RUN],
    "sweep": ["sweep", "beside.json", "--store", "s.db", "--jobs", "2"],
    "report": ["report", "full.db", "-o", "page"],
    "link": ["link", "flat.json", *RUN],
    "log": ["log", "flat.json", "--experiment", "1", "--port", "nowhere"],
}


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of the listing's runs in one environment."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "flat.json").write_text(json.dumps(two_widths()))
    words = ["sweep", "flat.json", "--store", "full.db", "--samples", "1"]
    assert original().run(words, folder).returncode == 0
    return folder / "full.db"


@pytest.fixture
def study(tmp_path: Path, swept: Path, listing_data: dict[str, Any]) -> Path:
    """A folder with a listing, one that needs Scenic beside the simulation, and a store."""
    listing_data["experiments"]["1"]["params"]["environments"] = 300
    (tmp_path / "flat.json").write_text(json.dumps(listing_data))
    (tmp_path / "beside.scenic").write_text(BESIDE)
    listing_data["environments"]["1"]["scenic_filename"] = "beside.scenic"
    (tmp_path / "beside.json").write_text(json.dumps(listing_data))
    shutil.copy(swept, tmp_path)
    return tmp_path


@pytest.fixture
def started(study: Path) -> Iterator[Start]:
    """A function that starts a command in that folder; its processes are marked, and ended after the test."""

    def start(*words: str, ready: bool = True, **options: Any) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [*FOLDCAR, *words], cwd=study, stdin=options.pop("stdin", subprocess.PIPE), stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, preexec_fn=like_a_shell, env={**os.environ, MARK: str(study)}, **options,
        )  # fmt: skip
        while ready and process.poll() is None and not catches(process.pid, signal.SIGTERM):
            time.sleep(0.001)
        return process

    yield start
    for pid in marked(str(study)):
        os.kill(pid, signal.SIGKILL)


def catches(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler of that signal: foldcar's code has begun to run."""
    status = Path(f"/proc/{pid}/status").read_text()
    mask = next((line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")), "0")
    return bool(int(mask, 16) >> (number - 1) & 1)


def marked(mark: str) -> list[int]:
    """The running processes that were started with that mark, and their children."""
    result = []
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and f"{MARK}={mark}\0".encode() in (folder / "environ").read_bytes() + b"\0":
                result.append(int(folder.name))
        except OSError:
            continue
    return result


def no_process_of(mark: str, within_s: float = 10) -> bool:
    """Whether none is left soon. One look may miss a process that starts meanwhile: two in a row must find none."""
    end_s = time.monotonic() + within_s
    empty_looks = 0
    while empty_looks < 2 and time.monotonic() < end_s:
        empty_looks = 0 if marked(mark) else empty_looks + 1
        time.sleep(0.02)
    return empty_looks == 2


@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_ends_a_command_at_any_moment_with_one_line(study: Path, started: Start, command: str) -> None:
    interrupted = 0
    for index, moment_s in enumerate(MOMENTS_S):
        process = started(*COMMANDS[command])
        time.sleep(moment_s)
        ended = process.poll() is not None
        process.send_signal((signal.SIGTERM, signal.SIGHUP, signal.SIGINT)[index])
        errors = process.communicate(timeout=100)[1]
        # What a command says before it stops: how `link` is ended, when a sweep's run has passed.
        expected_ends = ("Ctrl-C ends", "within the time limit", "are too narrow")
        lines = [line for line in errors.splitlines() if not line.endswith(expected_ends)]

        if not ended and process.returncode != 0 and not errors.startswith("foldcar: error: nowhere"):
            interrupted += 1
            assert (process.returncode, len(lines)) == (130, 1), f"after {moment_s} s: {errors}"
            assert "stopped" in lines[0] or lines == ["ended"]
        assert no_process_of(str(study))
        assert [file.name for file in study.iterdir() if file.name.startswith(".") or "-" in file.name] == []
    assert interrupted >= 1


def test_a_killed_sweep_leaves_no_process(study: Path, started: Start) -> None:
    process = started(*COMMANDS["sweep"])
    end_s = time.monotonic() + 300
    # What was seen once counts: some processes live for a moment only.
    while len(running := marked(str(study))) < 2 and process.poll() is None and time.monotonic() < end_s:
        time.sleep(0.01)
    assert len(running) >= 2, process.poll()

    process.kill()
    process.wait()

    assert no_process_of(str(study))


def test_a_killed_link_leaves_its_terminal_as_it_was(study: Path, started: Start, tmp_path: Path) -> None:
    import fcntl
    import termios

    master, terminal = pty.openpty()
    before = termios.tcgetattr(terminal), fcntl.fcntl(terminal, fcntl.F_GETFL)
    process = started(*COMMANDS["link"], stdin=terminal)
    assert process.stdout is not None
    port = Path(process.stdout.readline().strip())
    assert port.exists()
    os.write(master, b'{"unknown": 1}\n')
    assert "error" in process.stdout.readline()

    process.kill()
    process.wait()

    assert no_process_of(str(study))
    assert (termios.tcgetattr(terminal), fcntl.fcntl(terminal, fcntl.F_GETFL)) == before
    os.close(master)
    os.close(terminal)


INTERRUPTED_DESTRUCTOR = """
import os, signal, time
from foldcar.interrupts import handle_signals, stop_line

class Interrupted:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

class Faulty:
    def __del__(self):
        raise ValueError("a fault")

handle_signals()
try:
    Faulty()
    Interrupted()
    time.sleep(5)
except KeyboardInterrupt:
    print(stop_line())
"""


def test_an_interrupted_destructor_prints_nothing_and_is_interrupted_again() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED_DESTRUCTOR], capture_output=True, text=True, timeout=60)

    assert done.stdout == "foldcar: stopped\n"
    assert "a fault" in done.stderr
    assert "KeyboardInterrupt" not in done.stderr
