"""An experiment's trials as the page lists them, each beside its design and environment if these were simulated."""

from collections.abc import Sequence
from typing import Any

from foldcar.report.page_designs import Designs
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial

# What is not known of an experiment that was not swept.
NOTHING = ("speed_m_s", "seed", "condition", "variation_seed")
NONE = ("environments", "timeout_s", "yaw_rate_rad_s", "planned_runs", "stored_runs")
NO_NAME = ("vehicle", "environment", "carsim_build")


def unswept_experiments(store: Store) -> dict[str, tuple[ExperimentInfo, list[Trial]]]:
    """The experiments that have trials only, one for each type of car, as if swept without a run, by their names."""
    infos = store.info().experiments.values() if store.holds_study() else ()
    known = {name for info in infos for name in (info.id, info.listed_id)}
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in store.trials():
        if trial.experiment not in known:
            groups.setdefault((trial.experiment, trial.vehicle_type), []).append(trial)
    return {f"{name}: {kind}, trials only": (_unswept(some), some) for (name, kind), some in groups.items()}


def _unswept(trials: Sequence[Trial]) -> ExperimentInfo:
    first, designs = trials[0], [trial.design for trial in trials]
    values = {name: sorted({one[name] for one in designs if name in one}) for one in designs for name in one}
    varied = {name: tuple(some) for name, some in values.items() if len(some) > 1}
    facts: dict[str, Any] = {**dict.fromkeys(NOTHING), **dict.fromkeys(NONE, 0), **dict.fromkeys(NO_NAME, "")}
    return ExperimentInfo(
        **facts,
        id=first.experiment,
        vehicle_type=first.vehicle_type,
        varied=varied,
        fixed={name: some[0] for name, some in values.items() if name not in varied},
        scenic_program=first.scenic_program or "an unknown program",
        scenic_params={},
        variation={},
        success_rule="a trial has passed as its operator judged",
        success_defined=True,
    )


def trial_rows(store: Store, info: ExperimentInfo, designs: Designs, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """A row for each trial, in their order; ``environment`` only where the runs have the same samples."""
    here = store.trials_here(info) if designs.swept else set()
    found = []
    for trial in trials:
        index = designs.index_of(trial)
        found.append(
            {
                "number": trial.id,
                "design": index,
                "car": designs.name_of(trial) if index is None else designs.names[index],
                "car_name": trial.car_name,
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
