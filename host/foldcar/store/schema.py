"""The store's tables, its version, and how its file is opened, locked and refused.

A store is one SQLite file. While a sweep writes it, the file is in write-ahead mode with two files beside it,
and a lock file keeps a second sweep out; a sweep that ends turns it back into a single file.
"""

import contextlib
import fcntl
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError

# "Fcar" in ASCII: tells a store from other SQLite files.
APPLICATION_ID = 0x46636172
VERSION = 3

SCHEMA = (
    "CREATE TABLE study (key TEXT PRIMARY KEY, value TEXT NOT NULL)",
    "CREATE TABLE build (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE)",
    "CREATE TABLE body (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL)",
    "CREATE TABLE scene (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL)",
    "CREATE TABLE settings (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL)",
    "CREATE TABLE variation (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL)",
    # dynamic: 1 if the program has to run beside the simulation, 0 if not, NULL as long as nobody knows.
    "CREATE TABLE environment (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE, dynamic INTEGER)",
    """CREATE TABLE sample (
        environment_id INTEGER NOT NULL REFERENCES environment, sample INTEGER NOT NULL,
        scene_id INTEGER NOT NULL REFERENCES scene, PRIMARY KEY (environment_id, sample)) WITHOUT ROWID""",
    "CREATE TABLE spread (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE)",
    """CREATE TABLE draw (
        spread_id INTEGER NOT NULL REFERENCES spread, sample INTEGER NOT NULL,
        variation_id INTEGER NOT NULL REFERENCES variation, PRIMARY KEY (spread_id, sample)) WITHOUT ROWID""",
    """CREATE TABLE experiment (
        id TEXT PRIMARY KEY, position INTEGER NOT NULL, build_id INTEGER NOT NULL REFERENCES build,
        environment_id INTEGER NOT NULL REFERENCES environment, spread_id INTEGER NOT NULL REFERENCES spread,
        environments INTEGER NOT NULL, vehicle TEXT NOT NULL, environment TEXT NOT NULL,
        facts TEXT NOT NULL)""",
    """CREATE TABLE design (
        experiment TEXT NOT NULL REFERENCES experiment, position INTEGER NOT NULL, parameters TEXT NOT NULL,
        body_id INTEGER NOT NULL REFERENCES body, settings_id INTEGER NOT NULL REFERENCES settings,
        PRIMARY KEY (experiment, position)) WITHOUT ROWID""",
    """CREATE TABLE run (
        build_id INTEGER NOT NULL REFERENCES build, body_id INTEGER NOT NULL REFERENCES body,
        scene_id INTEGER NOT NULL REFERENCES scene, settings_id INTEGER NOT NULL REFERENCES settings,
        variation_id INTEGER NOT NULL REFERENCES variation,
        outcome TEXT NOT NULL, elapsed_time_s REAL, distance_to_target_m REAL, consumed_energy_j REAL,
        max_roll_rad REAL, max_pitch_rad REAL, message TEXT,
        PRIMARY KEY (build_id, body_id, scene_id, settings_id, variation_id)) WITHOUT ROWID""",
    """CREATE TABLE recorded (
        build_id INTEGER NOT NULL, body_id INTEGER NOT NULL, scene_id INTEGER NOT NULL,
        settings_id INTEGER NOT NULL, variation_id INTEGER NOT NULL,
        name TEXT NOT NULL, kind TEXT NOT NULL, value TEXT NOT NULL,
        PRIMARY KEY (build_id, body_id, scene_id, settings_id, variation_id, name)) WITHOUT ROWID""",
    # What a trial was driven with is NULL where nobody knows it: in trials that come from elsewhere.
    """CREATE TABLE trial (
        id INTEGER PRIMARY KEY, experiment TEXT NOT NULL, vehicle_type TEXT NOT NULL, design TEXT NOT NULL,
        body_id INTEGER REFERENCES body, settings_id INTEGER REFERENCES settings,
        environment_id INTEGER REFERENCES environment, sample INTEGER, scene_id INTEGER REFERENCES scene,
        deviations TEXT NOT NULL, outcome TEXT NOT NULL, ending TEXT NOT NULL, elapsed_time_s REAL,
        note TEXT NOT NULL, operator TEXT NOT NULL, started_utc TEXT, ended_utc TEXT,
        firmware_build TEXT, design_hash TEXT, port TEXT, log TEXT, log_sha256 TEXT, source TEXT)""",
    """CREATE TABLE correction (
        id INTEGER PRIMARY KEY, trial_id INTEGER NOT NULL REFERENCES trial, corrected_utc TEXT NOT NULL,
        field TEXT NOT NULL, before, after, reason TEXT NOT NULL, operator TEXT NOT NULL)""",
    """CREATE VIEW result AS
        SELECT e.position AS experiment_position, e.id AS experiment, e.vehicle, e.environment,
            d.position AS design_position, d.parameters, s.sample, r.outcome, r.elapsed_time_s,
            r.distance_to_target_m, r.consumed_energy_j, r.max_roll_rad, r.max_pitch_rad, r.message,
            (SELECT json_group_object(v.name, json_object('kind', v.kind, 'value', json(v.value)))
                FROM recorded v
                WHERE v.build_id = r.build_id AND v.body_id = r.body_id AND v.scene_id = r.scene_id
                    AND v.settings_id = r.settings_id AND v.variation_id = r.variation_id) AS recorded,
            r.build_id, r.body_id, r.scene_id, r.settings_id, r.variation_id
        FROM experiment e CROSS JOIN design d CROSS JOIN sample s CROSS JOIN draw w CROSS JOIN run r
        WHERE d.experiment = e.id AND s.environment_id = e.environment_id AND s.sample < e.environments
            AND w.spread_id = e.spread_id AND w.sample = s.sample
            AND r.build_id = e.build_id AND r.body_id = d.body_id AND r.scene_id = s.scene_id
            AND r.settings_id = d.settings_id AND r.variation_id = w.variation_id""",
)


class StoreError(FoldcarError):
    """No store, another version, in use, or a disk that does not take it; the message names the file."""


@contextlib.contextmanager
def store_errors(path: Path) -> Iterator[None]:
    """Turns SQLite's errors into StoreErrors that name the file."""
    try:
        yield
    except sqlite3.Error as error:
        raise StoreError(f"{path}: {error}") from error


def open_reading(path: Path) -> sqlite3.Connection:
    """A connection that sees one moment of an existing store and never writes; StoreError if it is none."""
    if not path.exists():
        raise StoreError(f"{path}: no such store")
    if not path.is_file():
        raise StoreError(f"{path}: is no file")
    with store_errors(path):
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, isolation_level=None)
    try:
        _check_version(path, connection)
        connection.execute("BEGIN")
    except BaseException:
        connection.close()
        raise
    return connection


def open_writing(path: Path) -> sqlite3.Connection:
    """A connection to the store at ``path``, created with its folder if there is none. Lock it first."""
    with store_errors(path):
        connection = sqlite3.connect(path, isolation_level=None)
    try:
        if _is_blank(path, connection):
            _create(path, connection)
        _check_version(path, connection)
        with store_errors(path):
            connection.execute("PRAGMA journal_mode = WAL")
            # A commit survives the death of the program; only a power cut may lose the last ones.
            connection.execute("PRAGMA synchronous = NORMAL")
    except BaseException:
        connection.close()
        raise
    return connection


def close_writing(path: Path, connection: sqlite3.Connection) -> None:
    """Close, leaving a single file if nobody reads it at the moment."""
    # An interrupt may have left a query half read, which would keep the mode: closing ends every query.
    connection.close()
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as last:
        last.execute("PRAGMA journal_mode = DELETE")


@contextlib.contextmanager
def writer_lock(path: Path) -> Iterator[None]:
    """The right to write the store, for one process at a time; released however the process ends."""
    lock_path = path.with_name(path.name + "-lock")
    lock_file = os.open(lock_path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # The last owner removes the file: what was locked must still be the file of that name.
            current = lock_path.exists() and os.path.samestat(os.fstat(lock_file), lock_path.stat())
        except BlockingIOError:
            current = False
        if not current:
            raise StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")
        try:
            yield
        finally:
            lock_path.unlink(missing_ok=True)
    finally:
        os.close(lock_file)


def _is_blank(path: Path, connection: sqlite3.Connection) -> bool:
    """Whether the file is new, or as a creation that was cut short leaves it."""
    try:
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        (application_id,) = connection.execute("PRAGMA application_id").fetchone()
    except sqlite3.DatabaseError as error:
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    return bool(tables == 0 and application_id == 0)


def _create(path: Path, connection: sqlite3.Connection) -> None:
    with store_errors(path):
        connection.execute("BEGIN IMMEDIATE")
        for statement in SCHEMA:
            connection.execute(statement)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")
        connection.execute("COMMIT")


def _check_version(path: Path, connection: sqlite3.Connection) -> None:
    try:
        (application_id,) = connection.execute("PRAGMA application_id").fetchone()
        (version,) = connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.DatabaseError as error:
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    if application_id != APPLICATION_ID:
        raise StoreError(f"{path}: is no foldcar store")
    if version != VERSION:
        raise StoreError(f"{path}: is a store of version {version}, this foldcar reads version {VERSION}")
