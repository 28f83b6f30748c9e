"""A store's trials as CSV or Parquet: a row per trial, aborted ones too, a column for each parameter of their designs.

Input: an open Store. Output: a file, written whole or not at all. What is not known is an empty cell.
"""

import csv
import io
import json
from pathlib import Path

from foldcar.atomic_file import atomic_file
from foldcar.report.parquet import write_trials
from foldcar.store.reader import Store

BEFORE = ("id", "experiment", "vehicle_type")
AFTER = (
    "sample",
    "outcome",
    "ending",
    "elapsed_time_s",
    "note",
    "operator",
    "started_utc",
    "ended_utc",
    "firmware_build",
    "design_hash",
    "log",
    "log_sha256",
    "source",
    "corrections",
)


def export_trials(store: Store, file: Path) -> int:
    """Write the trials atomically, as Parquet to .parquet, else as CSV; returns the number of rows. FoldcarError.

    Deviations in CSV are JSON: {name: [x in m, y in m, heading in rad]}.
    """
    trials = list(store.trials())
    design = list(dict.fromkeys(name for trial in trials for name in trial.design))
    if file.suffix.lower() == ".parquet":
        write_trials(trials, design, (*BEFORE, *AFTER), file)
        return len(trials)
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["trial", *BEFORE[1:], *design, *AFTER, "deviations"])
        for trial in trials:
            writer.writerow(
                [
                    *(getattr(trial, column) for column in BEFORE),
                    *(trial.design.get(name) for name in design),
                    *(getattr(trial, column) for column in AFTER),
                    json.dumps(trial.deviations),
                ]
            )
        text.detach()
    return len(trials)
