"""A store's trials that count as CSV or Parquet: a row per trial, aborted ones too, a column for each design parameter.

Input: an open Store. Output: a file, written whole or not at all. What is not known is an empty cell.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.outputs import atomic_file
from foldcar.report.parquet import field
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, left_out_text, select_trials

BEFORE = ("id", "experiment", "vehicle_type")
AFTER = (
    "sample", "outcome", "ending", "elapsed_time_s", "note", "operator", "started_utc", "ended_utc", "firmware_build",
    "design_hash", "log", "log_sha256", "source", "car", "car_name", "scenic_program", "corrections",
)  # fmt: skip


def export_trials(store: Store, file: Path, simulated_trials: bool) -> tuple[int, str | None]:
    """Write trials of built cars, with ``simulated_trials`` of simulated ones too: Parquet to .parquet, else CSV.

    Returns the number of rows and a sentence that says which trials are left out, None if all are there. The file is
    written atomically. Deviations in CSV are JSON: {name: [x in m, y in m, heading in rad]}; in Parquet a list of name,
    x_m, y_m, heading_rad. FoldcarError.
    """
    trials, left_out = select_trials(store.trials(), simulated_trials)
    design = list(dict.fromkeys(name for trial in trials for name in trial.design))
    rows = [
        [
            *(getattr(trial, name) for name in BEFORE),
            *(trial.design.get(name) for name in design),
            *(getattr(trial, name) for name in AFTER),
        ]
        for trial in trials
    ]
    if file.suffix.lower() == ".parquet":
        _write_parquet(trials, design, rows, file)
        return len(trials), left_out_text(left_out)
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["trial", *BEFORE[1:], *design, *AFTER, "deviations"])
        writer.writerows([*row, json.dumps(trial.deviations)] for row, trial in zip(rows, trials, strict=True))
        text.detach()
    return len(trials), left_out_text(left_out)


def _write_parquet(trials: Sequence[Trial], design: Sequence[str], rows: Sequence[Sequence[Any]], file: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    of_name = {"trial": pa.int64(), "sample": pa.int64(), "corrections": pa.int64(), "elapsed_time_s": pa.float64()}
    of_name |= dict.fromkeys(design, pa.float64())
    fields = [field(name, of_name.get(name, pa.string())) for name in ("trial", *BEFORE[1:], *design, *AFTER)]
    place = [field(name, pa.float64()) for name in ("x_m", "y_m", "heading_rad")]
    schema = pa.schema([*fields, ("deviations", pa.list_(pa.struct([("name", pa.string()), *place])))])
    columns = [list(column) for column in zip(*rows, strict=True)] or [[] for _ in fields]
    columns.append([_deviations(trial.deviations) for trial in trials])
    with atomic_file(file) as binary:
        pq.write_table(pa.table(columns, schema=schema), binary)


def _deviations(places: Mapping[str, tuple[float, float, float]]) -> list[dict[str, Any]]:
    return [{"name": name, "x_m": x, "y_m": y, "heading_rad": turn} for name, (x, y, turn) in places.items()]
