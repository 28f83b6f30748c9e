"""A store with a row in every table, and what is in a store, table by table."""

import contextlib
import hashlib
import json
import sqlite3
from pathlib import Path
from typing import Any

from foldcar.store.measured import write_measured
from foldcar.store.reality_runs import reality_keys
from foldcar.store.tables import Table
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, write_trials
from foldcar.store.writer import PlannedDesign, PlannedExperiment, StoreWriter, write_store
from written_study import EXPERIMENT_FACTS, FACTS, METRICS, add_experiment

CAR = CarFacts("fw", "hash", "/dev/pts/7", "built", "Ada")


def full_store(path: Path) -> Path:
    """Make the store: runs, records, paths; two driven trials with logs, one of them corrected; imported trials."""
    with write_store(path) as writer:
        writer.begin_study(FACTS, "b1")
        passes = lambda design, sample: "passed" if sample else "tipped"  # noqa: E731
        add_experiment(writer, "1", {"width_mm": (65.0, 95.0)}, 3, passes, {})
        _add_recording_experiment(writer)
        _add_reality_runs(writer)
    with write_trials(path) as trials:
        for number in (1, 2):
            log = path.parent / f"{path.stem}-logs" / f"trial-000{number}-20261122T113100Z.tlog"
            log.parent.mkdir(exist_ok=True)
            log.write_bytes(f"log of trial {number}".encode())
            drive = Drive({"id": "b"}, {"time_limit_s": 9}, {"friction": 0.6}, "environment of 1", "bumps.scenic", number)
            name = str(log.relative_to(path.parent))
            design = TrialDesign("W_B_W", {"width_mm": 95.0})
            trial = trials.begin("1", design, drive, {"A": (0.01, 0, 0)}, CAR, name, "Ada")
            digest = hashlib.sha256(log.read_bytes()).hexdigest()
            trials.complete(trial, Ending("passed", "goal", 2.5, "", digest))
        trials.correct(1, {"note": "over the edge", "outcome": "tipped"}, "seen on the film", "Bo")
        trials.withdraw([2], True, "practice", "Bo")
        trials.put_media(1, "photo", Path(__file__).parents[2] / "docs" / "car.png")
        for at, outcome in enumerate(("stuck", "passed")):
            row = {"uuid": f"row {at}", "experiment": "1", "vehicle_type": "W_B_W", "source": "table", "car": "built"}
            trials.import_trials([{**row, "design": {"width_mm": 95.0}, "sample": at, "outcome": outcome}])
    with write_measured(path) as measured:
        measured.measure("1", {"track_m": 0.002})
    return path


def _add_recording_experiment(writer: StoreWriter) -> None:
    """Experiment 2: one design in two samples; the first run records, the second failed."""
    environment, spread = writer.environment("environment of 2"), writer.spread("workshop")
    plan = PlannedExperiment("2", "car", "hills", environment, spread, 2, {**EXPERIMENT_FACTS, "varied": {}})
    writer.put_experiment(plan, [PlannedDesign({"width_mm": 80.0}, {"id": "c", "hinges": []}, {"time_limit_s": 9})])
    recorded = {"way": {"kind": "series", "value": [[0.0, 0.0], [0.25, 0.1]]}, "side": {"kind": "final", "value": 1.5}}
    passed = {**METRICS, "outcome": "passed", "recorded": recorded}
    for sample, result in enumerate((passed, {"error": "no"})):
        objects = [("hill", {"x_m": 0.5, "height_m": 0.02 + 0.01 * sample})]
        writer.put_sample(environment, sample, {"of": "2", "sample": sample}, objects=objects)
        writer.put_draw(spread, sample, {"sample": sample})
        writer.add_results((run, result) for run in writer.planned_runs(plan, sample))


def _add_reality_runs(writer: StoreWriter) -> None:
    """Two runs of experiment 1 in other realities, of which the second failed."""
    spread = writer.spread("realities of 1")
    writer.update_facts("1", realities=2, reality_spread="realities of 1")
    keys = reality_keys(writer, "1")
    assert keys is not None
    (body, settings), scene = keys.designs[1], keys.scenes[2]
    key = {"build_id": keys.build_id, "spread_id": spread, "body_id": body, "settings_id": settings, "scene_id": scene}
    writer.add_reality_runs(
        {**key, "number": number, "scores": json.dumps([0.5, -1.25]), "passed": passed}
        for number, passed in enumerate((1, None))
    )


def contents(path: Path) -> dict[str, list[dict[str, Any]]]:
    """All rows of all tables, as SQLite itself reads them."""
    with contextlib.closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        connection.row_factory = sqlite3.Row
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        rows_of = {table: [dict(row) for row in connection.execute(f"SELECT * FROM {table}")] for table in tables}
        return {
            table: sorted(rows, key=lambda row: [str(value) for value in row.values()]) for table, rows in rows_of.items()
        }


def change(store: Path, table: Table, where: str, **values: Any) -> None:
    """Give rows other values behind foldcar's back."""
    with contextlib.closing(sqlite3.connect(store)) as connection:
        changes = ", ".join(f"{name} = ?" for name in values)
        connection.execute(f"UPDATE {table.name} SET {changes} WHERE {where}", tuple(values.values()))
        connection.commit()


def alter(path: Path, *statements: str) -> None:
    """Change a store behind foldcar's back."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()
