"""What a reader must know of an experiment that lacks runs on purpose: its sweep stopped early, or it was searched."""

from foldcar.analysis.stopping import LEAST_CHANCE
from foldcar.store.info import ExperimentInfo


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """How many designs are decided, and how to read their rates; nothing after a sweep of all runs."""
    if info.searched:
        early = (
            " It left designs early that did worse than the best, at a risk of 10 % at each of up to ten looks, not in "
            "all: a good one may be among them."
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
        left = f", or left before when those would decide with a chance below {100 * LEAST_CHANCE:g} %"
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
