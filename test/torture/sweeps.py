"""Disturbances of a sweep: signals, deaths, a second sweep. Each ends with a resumed sweep and a comparison."""

import random
import signal
import sqlite3
from pathlib import Path

from processes import died_at_start, ended, kill, marked, moment, require_no_process, start, wait
from study import SWEEP, LossError, require_sound, resume

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
        if running := [pid for pid in marked(folder) if pid != process.pid]:
            kill(chance.choice(running))
            kills += 1
    code, _, errors = ended(process)
    # A simulator that dies twice at the same run is a result; the documentation says how to repeat it.
    repeated = 0
    if code == 1 and "(killed by SIGKILL)" in errors:
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


def two_sweeps(folder: Path, whole: Path, chance: random.Random) -> str:
    """A second sweep into the same store by its name or a symbolic link."""
    other = folder / "s.db"
    if chance.random() < 0.5:
        other = folder / "link.db"
        other.symlink_to(folder / "s.db")
    first = start(folder, SWEEP)
    wait(first, moment(chance))
    second = start(folder, [str(other) if word == "s.db" else word for word in SWEEP])
    if chance.random() < 0.3:
        wait(second, moment(chance, 0.3))
        first.kill()
    codes = []
    for process in (first, second):
        code, _, errors = ended(process)
        if code not in (0, -signal.SIGKILL) and not (code == 2 and "another sweep or trial is writing" in errors):
            raise LossError(f"by {other.name}: exit code {code}: {errors}")
        codes.append(code)
    require_no_process(folder)
    return f"by {other.name}, exit codes {codes}; {resume(folder, whole)}"


def require_sound_if_there(folder: Path) -> None:
    """LossError unless the store is sound; its making may not have come far enough for it to be one."""
    store = folder / "s.db"
    if store.exists() and store.stat().st_size and not store.with_name("s.db-journal").exists():
        require_sound(folder)
