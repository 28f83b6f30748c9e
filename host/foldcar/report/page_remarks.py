"""Remarks on an experiment's numbers, for the page: what is missing, left out, failed or simulated."""

import shlex
from typing import TYPE_CHECKING

from foldcar.evidence.design_evidence import in_family
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.stopping import MIN_CHANCE
from foldcar.statistics.words import count
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

if TYPE_CHECKING:
    from foldcar.report.reported_experiment import ReportedExperiment

# At most so many different messages of failed runs, and skipped cars, are shown.
SHOWN = 3


def remarks(store: Store, experiment: "ReportedExperiment") -> list[str]:
    """Return the remarks on an experiment. Raises StoreError."""
    info, evidence = experiment.info, experiment.evidence
    counts = dict(zip(OUTCOMES, evidence.outcome_counts.sum(axis=0).tolist(), strict=True))
    sentences = stopped_remarks(info)
    if counts["terminated"] and info.success_defined:
        sentences.append(
            f"The program itself ended {counts['terminated']:,} of {count(info.stored_runs, 'run')}; "
            f"{'it counts' if counts['terminated'] == 1 else 'they count'} as not passed."
        )
    if info.skipped:
        rest_text = f"; and {len(info.skipped) - SHOWN} more" if len(info.skipped) > SHOWN else ""
        shown = "; ".join(info.skipped[:SHOWN]) + rest_text
        sentences.append(f"{count(len(info.skipped), 'car')} of the family cannot be built: {shown}.")
    outside = sum(not in_family(info, trial.vehicle_type, trial.design) for trial in experiment.trials)
    if outside:
        verb = "counts" if outside == 1 else "count"
        sentences.append(f"{count(outside, 'trial')} of cars that do not belong to this family {verb} in no rate here.")
    return [*experiment.selection.remarks, *sentences, *_failures(store, info, counts["failed"])]


def _failures(store: Store, info: ExperimentInfo, failed: int) -> list[str]:
    """Return a remark on failed runs, with their messages; an empty list without any."""
    if not failed:
        return []
    messages = store.failures([info.id])
    shown = "; ".join(f"{number} x {message}" for message, number in messages[:SHOWN])
    rest_text = f"; and {len(messages) - SHOWN} other messages" if len(messages) > SHOWN else ""
    command = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    verb = "counts" if failed == 1 else "count"
    counted = f", and {verb} as not passed" if info.success_defined else ""
    return [f"{failed:,} of {count(info.stored_runs, 'run')} failed{counted}: {shown}{rest_text}. List them: {command}"]


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """Return remarks on how a search or a stopping rule affects the rates; none after a sweep of all runs."""
    if info.searched:
        early = (
            " It stopped early with designs that were worse than the best. At most 10 % of designs as good as the best "
            "are stopped wrongly."
        )
        return [
            "A search chose these designs by their rates, so the rates of the best are biased upwards. Trust the rates "
            "in fresh environments." + (early if len(info.objectives) == 1 else "")
        ]
    if info.until is None:
        return []
    undecided = info.designs - info.decided
    are, rest = "is" if undecided == 1 else "are", ""
    if undecided:
        abandoned = f", or fewer if the chance that all would decide fell below {100 * MIN_CHANCE:g} %"
        why = abandoned if info.until.thresholds else ""
        rest = f"; {undecided} {are} undecided, simulated in {count(info.environments, 'environment')}{why}"
    if info.stored_runs < info.planned_runs:
        rest = f"; {undecided} {are} not yet" if undecided else ""
    reference = "the thresholds" if info.until.thresholds else "50 %"
    most = info.designs * info.environments
    verb, were = "is" if 1 in (info.decided, info.designs) else "are", "was" if info.stored_runs == 1 else "were"
    return [
        f"The sweep stopped simulating a design when {info.until.text}: {info.decided:,} of "
        f"{count(info.designs, 'design')} {verb} decided{rest}. {info.stored_runs:,} of at most {count(most, 'run')} "
        f"{were} made.",
        "Intervals are anytime-valid (Beta-binomial mixture): each holds at whatever number of runs its design stopped. "
        "They hold for single designs, not jointly. Rates of designs that stopped early lie on average "
        f"somewhat too far from {reference}. Rates over several designs give each design the same weight.",
    ]
