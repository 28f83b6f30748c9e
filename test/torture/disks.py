"""Disks that are full or cannot be written, while a sweep or another command writes."""

import os
import random
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from processes import ended, moment, require_no_process, start, wait
from study import SWEEP, LossError, foldcar, require_sound, resume, write_listing

# Commands that make a file or a folder of a whole store: all of it or nothing.
OUTPUTS = {
    "export": (["export", "s.db", "--csv", "out"], ["export", "s.db", "--csv", "again"]),
    "folder": (["export", "s.db", "--folder", "out"], ["check", "s.db"]),
    "repair": (["repair", "s.db", "-o", "out"], ["check", "out"]),
    "report": (["report", "s.db", "-o", "out"], ["check", "s.db"]),
}


def limited_file(folder: Path, whole: Path, chance: random.Random) -> str:
    """No file may grow beyond a limit."""
    limit = int(chance.uniform(0, 1.1) * whole.stat().st_size)
    process = start(folder, SWEEP, limit_bytes=limit)
    code, _, errors = ended(process)
    _require_one_line(code, errors)
    require_no_process(folder)
    return f"{limit} bytes, exit code {code}; {resume(folder, whole)}"


def full_disk(folder: Path, whole: Path, chance: random.Random) -> str:
    """A small disk is full in the middle of a sweep, and then has room again."""
    size_kb = int(chance.uniform(20, 600))
    with _mounted(folder / "disk", size_kb) as disk:
        if disk is None:
            return "skipped: no right to mount"
        process = start(disk, SWEEP)
        if chance.random() < 0.3:
            wait(process, moment(chance))
            process.kill()
            process.communicate()
            code = -9
        else:
            code, _, errors = ended(process)
            _require_one_line(code, errors)
        require_no_process(disk)
        _remount(disk, "size=64m")
        return f"{size_kb} kB, exit code {code}; {resume(disk, whole)}"


def read_only_disk(folder: Path, whole: Path, chance: random.Random) -> str:
    """A disk that can be read only, after a sweep was killed on it: every command says so, none harms."""
    with _mounted(folder / "disk", 65536) as disk:
        if disk is None:
            return "skipped: no right to mount"
        process = start(disk, SWEEP)
        at = moment(chance)
        wait(process, at)
        process.kill()
        process.communicate()
        require_no_process(disk)
        _remount(disk, "ro")
        before = {file.name: file.read_bytes() for file in disk.iterdir()}
        code, _, errors = ended(start(disk, SWEEP))
        if code != 2:
            raise LossError(f"read-only: exit code {code}: {errors}")
        _require_one_line(code, errors)
        checked = foldcar(disk, "check", "s.db")
        if checked.returncode and before.get("s.db"):
            raise LossError(f"read-only: check: {checked.stdout}{checked.stderr}")
        if {file.name: file.read_bytes() for file in disk.iterdir()} != before:
            raise LossError("read-only: files have changed")
        _remount(disk, "rw")
        return f"after {at:.3f} s; {resume(disk, whole)}"


def outputs(folder: Path, whole: Path, chance: random.Random) -> str:
    """Commands that write a file or a folder, killed or out of room: it is whole or not there."""
    name = chance.choice(list(OUTPUTS))
    words, proof = OUTPUTS[name]
    shutil.copyfile(whole, folder / "s.db")
    limit = int(10 ** chance.uniform(2, 5.6)) if chance.random() < 0.5 else None
    process = start(folder, words, limit_bytes=limit)
    if limit is None:
        wait(process, moment(chance, 0.5))
        process.kill()
    code, _, errors = ended(process)
    if limit is not None:
        _require_one_line(code, errors)
    text = f"{name}, {'killed' if limit is None else f'{limit} bytes'}, exit code {code}"
    if not (folder / "out").exists():
        text += ", nothing made"
    else:
        answer = foldcar(folder, *proof)
        same = name != "export" or (folder / "out").read_bytes() == (folder / "again").read_bytes()
        if answer.returncode != 0 or not same:
            raise LossError(f"{text}: in part: {answer.stdout}{answer.stderr}")
        if name == "folder":
            again = foldcar(folder, "import", "out", "--store", "again.db")
            if again.returncode:
                raise LossError(f"{text}: in part: {again.stderr}")
        if name == "report" and "</html>" not in (folder / "out" / "index.html").read_text()[-100:]:
            raise LossError(f"{text}: in part")
    left = [file.name for file in folder.iterdir() if file.name.endswith(".part")]
    if left and limit is not None:
        raise LossError(f"{text}: left {left}")
    require_sound(folder)
    return text


def _require_one_line(code: int, errors: str) -> None:
    lines = [line for line in errors.splitlines() if line.startswith("foldcar: error: ")]
    if code not in (0, 2) or (code == 2 and len(lines) != 1):
        raise LossError(f"exit code {code}: {errors}")


@contextmanager
def _mounted(place: Path, size_kb: int) -> Iterator[Path | None]:
    """A disk in memory with the study's files, None without the right to mount one."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "foldcar-torture", str(place)]
    if os.getuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        yield None
        return
    try:
        write_listing(place)
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def _remount(disk: Path, options: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{options}", str(disk)], check=True)
