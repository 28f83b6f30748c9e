"""Damage to stores: bits that flip, files cut short, blocks of zeros. `check` names it, `repair` saves what is whole."""

import contextlib
import random
import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from study import LossError, resume

from foldcar.store.check import check_store
from foldcar.store.errors import StoreError
from foldcar.store.repair import repair_store

# Prepared once: whole.db of the undisturbed sweep, killed.db with its -wal of a killed one, trials.db with trials.
VICTIMS = {"whole": ("",), "killed": ("", "-wal", "-wal"), "trials": ("",)}
# Less may be the schema and no row.
LEAST_BYTES = 32768
# The share of damaged stores that a sweep goes on with.
RESUMED = 0.05
Damage = Callable[[bytearray, random.Random], str]


def flipped_bits(content: bytearray, chance: random.Random) -> str:
    """One bit, in the first page every fourth time, where header and schema are; every other time up to 50."""
    places = [chance.randrange(min(len(content), 4096) if chance.random() < 0.25 else len(content))]
    if chance.random() < 0.5:
        places += [chance.randrange(len(content)) for _ in range(chance.randint(1, 49))]
    for place in places:
        content[place] ^= 1 << chance.randrange(8)
    return f"{len(places)} bits from byte {places[0]} on"


def zeroed_block(content: bytearray, chance: random.Random) -> str:
    """A block of 4096 bytes, as a disk loses them."""
    place = 4096 * chance.randrange(1 + len(content) // 4096)
    content[place : place + 4096] = bytes(len(content[place : place + 4096]))
    return f"the block at byte {place} zeroed"


def cut_short(content: bytearray, chance: random.Random) -> str:
    """Truncated anywhere."""
    length = chance.randrange(len(content))
    del content[length:]
    return f"cut to {length} bytes"


def contents(store: Path) -> dict[str, Counter[str]]:
    """All rows of all tables, as SQLite reads a copy of the store."""
    with contextlib.closing(sqlite3.connect(f"{store.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        names = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {name: Counter(map(repr, connection.execute(f"SELECT * FROM {name} NOT INDEXED"))) for name in names}


def damaged(kind: Damage) -> Callable[[Path, Path, random.Random], str]:
    """The disturbance that does ``kind`` to one of the prepared stores."""

    def disturb(folder: Path, whole: Path, chance: random.Random) -> str:
        victim = chance.choice(list(VICTIMS))
        suffix = chance.choice(VICTIMS[victim])
        for file in whole.parent.glob(f"{victim}.db*"):
            shutil.copyfile(file, folder / file.name.replace(victim, "s", 1))
        if victim == "trials":
            shutil.copytree(whole.parent / "s-logs", folder / "s-logs")
        sound = contents(whole.parent / f"{victim}.db")
        file = folder / f"s.db{suffix}"
        content = bytearray(file.read_bytes())
        # A sweep takes a hundred times as long as the rest.
        resumes = victim != "trials" and chance.random() < RESUMED
        what = f"{victim}.db{suffix}: {kind(content, chance)}"
        file.write_bytes(content)
        try:
            return f"{what}; {_judge(folder, whole, sound, suffix == '-wal', resumes)}"
        except LossError as error:
            raise LossError(f"{what}: {error}") from None

    return disturb


def _judge(folder: Path, whole: Path, sound: dict[str, Counter[str]], is_log: bool, resumes: bool) -> str:
    store, target = folder / "s.db", folder / "w.db"
    before = {file.name: file.read_bytes() for file in folder.glob("s.db*")}
    try:
        findings = check_store(store).findings
    except StoreError as error:
        findings = [str(error)]
    try:
        repaired = repair_store(store, target)
    except StoreError as error:
        if len(before["s.db"]) > LEAST_BYTES and not is_log:
            raise LossError(f"nothing was saved: {error}") from None
        return f"no store is left: {error}"
    if any((folder / name).read_bytes() != content for name, content in before.items() if not name.endswith("-shm")):
        raise LossError("the damaged file was changed")
    # The end of a log looks as if it was being written when the program was killed.
    if not findings and not is_log and contents(store) != sound:
        raise LossError("check finds nothing, but rows are others")
    saved = contents(target)
    if is_log:
        # An earlier transaction wrote it otherwise.
        del saved["environment"]
    _require_saved_rows_were_there(sound, saved, repaired.trials)
    if check_store(target).findings:
        raise LossError(f"the repaired store: {check_store(target).findings}")
    lost = sum((rows - saved.get(name, Counter())).total() for name, rows in sound.items())
    if lost and not findings and not is_log:
        raise LossError(f"check finds nothing, but {lost} rows cannot be saved")
    if lost and repaired.is_whole and not is_log:
        raise LossError(f"repair says that nothing is lost, but {lost} rows are")
    total = sum(rows.total() for rows in sound.values())
    text = f"{len(findings)} findings, {total - lost} of {total} rows saved"
    return f"{text}; {resume(folder, whole, target.name)}" if resumes else text


def _require_saved_rows_were_there(
    sound: dict[str, Counter[str]], saved: dict[str, Counter[str]], trials: list[str]
) -> None:
    for name, rows in saved.items():
        strange = rows - sound.get(name, Counter())
        # A trial that lost a reference says so, and so do its corrections.
        if strange.total() > (len(trials) if name == "trial" else 4 * len(trials) if name == "correction" else 0):
            raise LossError(f"table {name}: repair made up {strange.total()} rows, such as {next(iter(strange))[:300]}")
