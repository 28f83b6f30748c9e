"""An experiment's trials as the page lists them, each beside its design and environment if these were simulated."""

from collections.abc import Sequence
from typing import Any

from foldcar.report.page_designs import Designs
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial


def trial_rows(store: Store, info: ExperimentInfo, designs: Designs, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """A row for each trial, in their order; ``environment`` only where the runs have the same samples."""
    here = store.trials_here(info)
    found = []
    for trial in trials:
        index = designs.index_of(trial)
        found.append(
            {
                "number": trial.id,
                "design": index,
                "car": designs.name_of(trial) if index is None else designs.names[index],
                "standing": trial.standing,
                "environment": trial.sample if trial.id in here else None,
                "passed": trial.outcome == "passed" if trial.completed else None,
                "outcome": trial.outcome.replace("_", " "),
                "time_s": trial.elapsed_time_s,
                "when": trial.started_utc,
                "note": trial.note or trial.source or "",
                "replay": None,
            }
        )
    return found
