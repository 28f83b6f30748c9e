"""Takes the trials of another store into a store, which may be of an earlier version of foldcar.

Runs can be simulated again; trials cannot. So every version reads the trials of the versions since OLDEST_TRIALS, with
their scenes, bodies and settings, corrections, photos and films, logs, and measured values.
"""

import contextlib
import shutil
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foldcar.store.check import missing_references
from foldcar.store.connection import connect_reading, transaction, writing
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.merge import Merge
from foldcar.store.tables import (
    BY_NAME,
    CORRECTION,
    ENVIRONMENT,
    MEASURED,
    MEDIA,
    OLDEST_TRIALS,
    SAMPLE,
    TRIAL,
    create_tables,
)

# For each table to take, in the order of their references, the rows that belong to trials.
_OF_TRIALS = {
    "body": "id IN (SELECT body_id FROM trial)",
    "settings": "id IN (SELECT settings_id FROM trial)",
    "scene": "id IN (SELECT scene_id FROM trial UNION SELECT s.scene_id FROM sample s JOIN trial t "
    "ON t.environment_id = s.environment_id AND t.sample = s.sample)",
    ENVIRONMENT.name: "id IN (SELECT environment_id FROM trial)",
    # By these, foldcar recognises an environment whose program was changed without changing its scenes.
    SAMPLE.name: "(environment_id, sample) IN (SELECT environment_id, sample FROM trial)",
    TRIAL.name: "1",
    CORRECTION.name: "1",
    MEDIA.name: "1",
    MEASURED.name: "1",
}


@dataclass(frozen=True)
class TakenTrials:
    """The numbers of the ``new`` trials in the store, and how many trials it had already."""

    new: list[int]
    known: int


def take_trials(store: Path, other: Path) -> TakenTrials:
    """Take the trials of the store ``other`` into ``store``, which is created if it does not exist.

    A trial that both have is identified by its UUID; the copy that was corrected later is kept. Logs are copied. Raises
    StoreError if ``other`` is not a store, is too old or too new, or contradicts ``store``; then nothing is taken.
    """
    if store.exists() and store.samefile(other):
        raise StoreError(f"{store}: is the store itself; name another store")
    copied: list[Path] = []
    existed = store.exists()
    with contextlib.closing(connect_reading(other, OLDEST_TRIALS)) as source, _in_this_version(other, source) as trials:
        for missing in missing_references(trials):
            raise StoreError(f"{other}: {missing}")
        (number,) = trials.execute("SELECT count(*) FROM trial").fetchone()
        try:
            with writing(store, synchronous="FULL") as connection, store_errors(store), transaction(connection):
                before = {uuid for (uuid,) in connection.execute("SELECT uuid FROM trial")}
                merge = Merge(connection, store)
                merge.add(other, trials, [BY_NAME[name] for name in _OF_TRIALS])
                for log, target in merge.logs.items():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    copied.append(target)
                    shutil.copyfile(log, target)
                rows = connection.execute("SELECT id, uuid FROM trial ORDER BY id").fetchall()
        except BaseException:
            for target in (*copied, *(() if existed else (store,))):
                target.unlink(missing_ok=True)
            raise
    new = [trial for trial, uuid in rows if uuid not in before]
    return TakenTrials(new, number - len(new))


@contextlib.contextmanager
def _in_this_version(path: Path, source: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """Yield a database in memory with the trials of a store, in the tables of this version."""
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as trials, store_errors(path):
        create_tables(trials)
        for name, where in _OF_TRIALS.items():
            present = {column[1] for column in source.execute(f"PRAGMA table_info({name})")}
            columns = ", ".join(column for column in BY_NAME[name].names if column in present)
            if not columns:
                raise StoreError(f"{path}: is damaged: {name} is missing")
            marks = ", ".join("?" for _ in columns.split(", "))
            rows = source.execute(f"SELECT {columns} FROM {name} WHERE {where}")
            trials.executemany(f"INSERT INTO {name} ({columns}) VALUES ({marks})", rows)
        yield trials
