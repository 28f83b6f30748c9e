"""A store's trials that count as CSV or Parquet: a row per trial, aborted ones too, a column for each design parameter.

Input: an open Store. Output: a file, written whole or not at all. What is not known is an empty cell.
"""

import csv
import io
import json
from pathlib import Path

from foldcar.outputs import atomic_file
from foldcar.report.parquet import write_trials
from foldcar.store.reader import Store
from foldcar.store.trial_records import left_out_text, select_trials

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
    "car",
    "scenic_program",
    "corrections",
)


def export_trials(store: Store, file: Path, simulated_trials: bool) -> tuple[int, str | None]:
    """Write trials of built cars, with ``simulated_trials`` of simulated ones too: Parquet to .parquet, else CSV.

    Returns the number of rows and a sentence that says which trials are left out, None if all are there. The file is
    written atomically. Deviations in CSV are JSON: {name: [x in m, y in m, heading in rad]}. FoldcarError.
    """
    trials, left_out = select_trials(store.trials(), simulated_trials)
    design = list(dict.fromkeys(name for trial in trials for name in trial.design))
    if file.suffix.lower() == ".parquet":
        write_trials(trials, design, (*BEFORE, *AFTER), file)
        return len(trials), left_out_text(left_out)
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
    return len(trials), left_out_text(left_out)
