"""Disturbances of a sweep: signals, deaths, clocks, a second sweep. Each ends with a resumed sweep and a comparison."""

import os
import random
import signal
import sqlite3
import subprocess
from pathlib import Path

from processes import children, died_at_start, ended, kill, moment, require_no_process, start, wait
from study import SWEEP, LossError, require_sound, resume

CLOCK = "FOLDCAR_TORTURE_CLOCK"
INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
BESIDE = ".part", "-wal", "-shm", "-journal"


def killed_client(folder: Path, whole: Path, chance: random.Random) -> str:
    """SIGKILL of the sweep, up to three times."""
    moments = []
    for _ in range(chance.randint(1, 3)):
        process = start(folder, SWEEP)
        moments.append(moment(chance))
        wait(process, moments[-1])
        process.kill()
        process.communicate()
        require_no_process(folder)
        require_sound_if_there(folder)
    return f"after {', '.join(f'{at:.3f}' for at in moments)} s; {resume(folder, whole)}"


def killed_simulators(folder: Path, whole: Path, chance: random.Random) -> str:
    """SIGKILL of simulators and workers while the sweep goes on."""
    process = start(folder, SWEEP)
    kills = 0
    while wait(process, 0.3 + chance.random()):
        if running := children(folder, process):
            kill(chance.choice(running))
            kills += 1
    code, _, errors = ended(process)
    # A simulator that dies twice at the same run is a result; the documentation says how to repeat it.
    repeated = 0
    if code == 1 and "crashed (killed by SIGKILL)" in errors:
        with sqlite3.connect(folder / "s.db") as connection:
            repeated = connection.execute("DELETE FROM run WHERE outcome = 'failed'").rowcount
    elif code not in (0, 2) or (code == 2 and "killed by SIGKILL" not in errors):
        raise LossError(f"exit code {code}: {errors}")
    require_no_process(folder)
    return f"{kills} killed, exit code {code}, {repeated} failed runs repeated; {resume(folder, whole)}"


def interrupted(folder: Path, whole: Path, chance: random.Random) -> str:
    """Ctrl-C, SIGTERM or SIGHUP at any stage from the first millisecond on, sometimes more than one."""
    process = start(folder, SWEEP)
    at, number = moment(chance), chance.choice(INTERRUPTS)
    wait(process, at)
    for _ in range(chance.choice((1, 1, 3))):
        process.send_signal(number)
    code, _, errors = ended(process)
    # Before foldcar's first line runs, Python itself dies of the signal.
    if code not in (0, 130, -number) and not died_at_start(errors):
        raise LossError(f"{number.name} after {at:.3f} s: exit code {code}: {errors}")
    if code == 130 and "stopped" not in errors.splitlines()[-1]:
        raise LossError(f"{number.name} after {at:.3f} s does not say that it stopped: {errors}")
    require_no_process(folder)
    left = [file.name for file in folder.iterdir() if file.name.endswith(BESIDE)]
    if left:
        raise LossError(f"{number.name} after {at:.3f} s left {left}")
    require_sound_if_there(folder)
    return f"{number.name} after {at:.3f} s, exit code {code}; {resume(folder, whole)}"


def stepping_clock(folder: Path, whole: Path, chance: random.Random) -> str:
    """The wall clock steps by up to years, back and forth, twice a second."""
    if CLOCK not in os.environ:
        return "skipped: no compiler for the clock"
    step_s = chance.choice((-1, 1)) * int(10 ** chance.uniform(0, 8.5))
    process = start(folder, SWEEP, {"LD_PRELOAD": os.environ[CLOCK], "FOLDCAR_CLOCK_STEP_S": str(step_s)})
    if chance.random() < 0.5:
        wait(process, moment(chance))
        process.kill()
        process.communicate()
    else:
        code, _, errors = ended(process)
        if code != 0:
            raise LossError(f"steps of {step_s} s: exit code {code}: {errors}")
    require_no_process(folder)
    return f"steps of {step_s} s; {resume(folder, whole)}"


def two_sweeps(folder: Path, whole: Path, chance: random.Random) -> str:
    """A second sweep into the same store by its name, a symbolic link or a hard link."""
    kind = chance.choice(("name", "symbolic link", "hard link"))
    (folder / "other").mkdir()
    other = folder / "s.db" if kind == "name" else folder / "other" / "t.db"
    if kind == "symbolic link":
        other.symlink_to(folder / "s.db")
    elif kind == "hard link":
        (folder / "s.db").touch()
        os.link(folder / "s.db", other)
    first = start(folder, SWEEP)
    wait(first, moment(chance))
    second = start(folder, [str(other) if word == "s.db" else word for word in SWEEP])
    if chance.random() < 0.3:
        wait(second, moment(chance, 0.3))
        first.kill()
    codes = []
    for process in (first, second):
        code, _, errors = ended(process)
        refused = "another sweep or trial is writing" in errors or "another name (hard link)" in errors
        if code not in (0, -signal.SIGKILL) and not (code == 2 and refused):
            raise LossError(f"by {kind}: exit code {code}: {errors}")
        codes.append(code)
    require_no_process(folder)
    if kind == "hard link":
        other.unlink()
    text = resume(folder, whole)
    if kind == "hard link":
        os.link(folder / "s.db", other)
    require_sound(folder, str(other))
    return f"by {kind}, exit codes {codes}; {text}"


def require_sound_if_there(folder: Path) -> None:
    """LossError unless the store is sound; its making may not have come far enough for it to be one."""
    store = folder / "s.db"
    if store.exists() and store.stat().st_size and not store.with_name("s.db-journal").exists():
        require_sound(folder)


def build_clock(folder: Path) -> None:
    """Compile the clock that steps, if there is a compiler."""
    source, library = Path(__file__).with_name("stepping_clock.c"), folder / "stepping_clock.so"
    try:
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return
    os.environ[CLOCK] = str(library)
