"""What a reader must know of an experiment's numbers beside the numbers: what is missing, left out or of another kind."""

import shlex
from typing import TYPE_CHECKING

from foldcar.inference.design_evidence import in_family
from foldcar.inference.remarks import trials_in_other_environments
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.stopping import MIN_CHANCE
from foldcar.statistics.words import count
from foldcar.store.calibrations import calibrations
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED

if TYPE_CHECKING:
    from foldcar.report.page_data import Experiment

# Different messages of failed runs, and skipped cars, that are shown.
SHOWN = 3


def remarks(store: Store, one: "Experiment") -> list[str]:
    """Return the remarks on an experiment. Raises StoreError."""
    info, evidence = one.info, one.evidence
    ends = dict(zip(OUTCOMES, evidence.outcome_counts.sum(axis=0).tolist(), strict=True))
    found = stopped_remarks(info)
    if ends["terminated"] and info.success_defined:
        found.append(
            f"The program itself ended {ends['terminated']:,} of {info.stored_runs:,} runs; they count as not passed."
        )
    if info.skipped:
        more = f"; and {len(info.skipped) - SHOWN} more" if len(info.skipped) > SHOWN else ""
        shown = "; ".join(info.skipped[:SHOWN]) + more
        found.append(f"{count(len(info.skipped), 'car')} of the family cannot be built: {shown}.")
    strange = sum(not in_family(info, trial.vehicle_type, trial.design) for trial in one.trials)
    if strange:
        found.append(f"{count(strange, 'trial')} of cars that do not belong to this family count in no rate here.")
    passed, number = one.columns.simulated_trial_counts.sum(axis=0).tolist()
    if number:
        found.append(f"SIMULATED trials, which count in no rate: {passed} of {number} of simulated cars passed.")
    simulated = [trial.id for trial in one.trials if trial.standing == SIMULATED]
    found += trials_in_other_environments([one.elsewhere[at] for at in simulated if at in one.elsewhere], info)
    for calibration in calibrations(store):
        if calibration.experiment == info.id:
            findings = " ".join(calibration.summary["findings"])
            found.append(f"Calibration {calibration.name} ({calibration.created_utc}, UTC): {findings}")
    return [*one.selection.remarks, *found, *_failures(store, info, ends["failed"])]


def _failures(store: Store, info: ExperimentInfo, failed: int) -> list[str]:
    if not failed:
        return []
    messages = store.failures([info.id])
    shown = "; ".join(f"{number} x {message}" for message, number in messages[:SHOWN])
    more = f"; and {len(messages) - SHOWN} other messages" if len(messages) > SHOWN else ""
    command = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    counted = ", and count as not passed" if info.success_defined else ""
    return [f"{failed:,} of {info.stored_runs:,} runs failed{counted}: {shown}{more}. List them: {command}"]


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """How many designs are decided, and how to read their rates; nothing after a sweep of all runs."""
    if info.searched:
        early = (
            " It left designs early that did worse than the best: of those that would have ended as good, at most 10 %."
        )
        return [
            "A search chose these designs, so rates of its best are too good as a rule: believe those in fresh "
            "environments." + (early if len(info.objectives) == 1 else "")
        ]
    if info.until is None:
        return []
    undecided = info.designs - info.decided
    rest = ""
    if undecided:
        left = f", or left before when those would decide with a chance below {100 * MIN_CHANCE:g} %"
        why = left if info.until.thresholds else ""
        rest = f"; {undecided} are undecided, simulated in all {info.environments} environments{why}"
    if info.stored_runs < info.planned_runs:
        rest = f"; {undecided} are not yet" if undecided else ""
    away = "the thresholds" if info.until.thresholds else "50 %"
    most = info.designs * info.environments
    return [
        f"The sweep stopped simulating a design when {info.until.text}: {info.decided} of {info.designs} designs are "
        f"decided{rest}. {info.stored_runs} of at most {most} runs were made.",
        "Intervals are anytime-valid (Beta-binomial mixture): each holds for its design at whatever number of runs it "
        "stopped, by itself and not for all designs together. Rates of designs that stopped early lie on average "
        f"somewhat too far from {away}. Rates over several designs count each design alike.",
    ]
