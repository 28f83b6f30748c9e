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
    terminated = counts["terminated"]
    if terminated and info.success_defined:
        they_count = "it counts" if terminated == 1 else "they count"
        sentences.append(
            f"The program itself ended {terminated:,} of {count(info.stored_runs, 'run')}; {they_count} as not passed."
        )
    if info.skipped:
        reasons = "; ".join(info.skipped[:SHOWN])
        if len(info.skipped) > SHOWN:
            reasons += f"; and {len(info.skipped) - SHOWN} more"
        sentences.append(f"{count(len(info.skipped), 'car')} of the family cannot be built: {reasons}.")
    outside = sum(not in_family(info, trial.vehicle_type, trial.design) for trial in experiment.trials)
    if outside:
        verb = "counts" if outside == 1 else "count"
        sentences.append(f"{count(outside, 'trial')} of cars that do not belong to this family {verb} in no rate here.")
    return [*experiment.selection.remarks, *sentences, *_failures(store, info, counts["failed"])]


def _failures(store: Store, info: ExperimentInfo, failed: int) -> list[str]:
    """Return a remark on failed runs, with their messages; an empty list without any."""
    if not failed:
        return []
    counted_messages = store.failures([info.id])
    messages = "; ".join(f"{number} x {message}" for message, number in counted_messages[:SHOWN])
    if len(counted_messages) > SHOWN:
        messages += f"; and {len(counted_messages) - SHOWN} other messages"
    consequence = ""
    if info.success_defined:
        verb = "counts" if failed == 1 else "count"
        consequence = f", and {verb} as not passed"
    command = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    return [f"{failed:,} of {count(info.stored_runs, 'run')} failed{consequence}: {messages}. List them: {command}"]


def _undecided_text(info: ExperimentInfo) -> str:
    """Return the part of the sentence "3 of 5 designs are decided" about the other 2 designs; "" if all are decided.

    While the sweep is not finished, they are not decided yet. Afterwards the part says how many environments they had.
    """
    undecided = info.designs - info.decided
    if not undecided:
        return ""
    are = "is" if undecided == 1 else "are"
    if info.stored_runs < info.planned_runs:
        return f"; {undecided} {are} not decided yet"
    text = f"; {undecided} {are} undecided, simulated in {count(info.environments, 'environment')}"
    if info.until is not None and info.until.thresholds:
        text += f", or fewer if the chance that all would decide fell below {100 * MIN_CHANCE:g} %"
    return text


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """Return remarks on how a search or a stopping rule affects the rates; an empty list if all runs were made."""
    if info.searched:
        remark = (
            "A search chose these designs by their rates, so the rates of the best are biased upwards. Trust the rates "
            "in fresh environments."
        )
        if len(info.objectives) == 1:
            remark += (
                " The search stopped designs early that were worse than the best. A design that is as good as the best "
                "is stopped with a probability of at most 10 %."
            )
        return [remark]
    if info.until is None:
        return []
    max_runs = info.designs * info.environments
    decided_verb = "is decided" if info.decided == 1 or info.designs == 1 else "are decided"
    made_verb = "was made" if info.stored_runs == 1 else "were made"
    reference = "the thresholds" if info.until.thresholds else "50 %"
    return [
        f"The sweep stopped simulating a design when {info.until.text}: {info.decided:,} of "
        f"{count(info.designs, 'design')} {decided_verb}{_undecided_text(info)}. {info.stored_runs:,} of at most "
        f"{count(max_runs, 'run')} {made_verb}.",
        "Intervals are anytime-valid (Beta-binomial mixture): each holds at whatever number of runs its design stopped. "
        "They hold for single designs, not jointly. Rates of designs that stopped early lie on average "
        f"somewhat too far from {reference}. Rates over several designs give each design the same weight.",
    ]
