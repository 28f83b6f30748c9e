"""Sweeps that stop when they know: which designs still need runs, round by round.

A round is some samples, simulated for the designs that are undecided on all earlier ones. Rounds begin and end at the
same samples in every sweep, and a design's own results alone decide on it: so the same runs are made whatever the number
of simulators, and in a sweep that was interrupted and resumed.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from foldcar.analysis.anytime import anytime_interval
from foldcar.analysis.stopping import StoppingRule
from foldcar.errors import FoldcarError
from foldcar.store.design_counts import DesignCounts
from foldcar.study.experiments import Experiment, Study

# Samples of a round; later rounds grow with the samples before, so that simulators seldom wait for the last runs of one.
ROUND_SAMPLES = 5
ROUND_SHARE = 0.05
# Percentage points: an interval of half this width and more is known without a run.
MOST_POINTS = 50
LEAST_POINTS = 0.1


@dataclass(frozen=True)
class DesignState:
    """What a sweep knows of a design: its counts and its anytime-valid interval (``low``, ``high``), 0 to 1."""

    experiment: str
    design: Mapping[str, float]
    runs: int
    passed: int
    low: float
    high: float
    decided: bool


def stopping_rules(until: str, study: Study) -> dict[str, StoppingRule]:
    """The rules of ``--until``, ``decided`` or as ``5pp``, by the experiment's id. FoldcarError."""
    if until == "decided":
        for experiment in study.experiments:
            if not experiment.thresholds:
                what = "is missing; --until decided needs it, as 0.75 or [0.5, 0.75]"
                raise FoldcarError(f"{experiment.place}.params.threshold: {what}")
        return {experiment.id: StoppingRule(None, experiment.thresholds) for experiment in study.experiments}
    points = re.fullmatch(r"(\d+(?:\.\d+)?) ?pp", until)
    if points is None:
        raise FoldcarError(f"--until: '{until}' is neither decided nor percentage points, as 5pp")
    width = float(points[1])
    if not LEAST_POINTS <= width < MOST_POINTS:
        raise FoldcarError(f"--until: {until} is not from {LEAST_POINTS}pp to below {MOST_POINTS}pp")
    return {experiment.id: StoppingRule(width / 100, ()) for experiment in study.experiments}


def rounds(environments: int) -> Iterator[range]:
    """The samples 0 to ``environments`` - 1 in rounds."""
    start = 0
    while start < environments:
        end = min(environments, start + max(ROUND_SAMPLES, int(ROUND_SHARE * start)))
        yield range(start, end)
        start = end


def open_designs(rule: StoppingRule, counts: DesignCounts, samples: int) -> set[int]:
    """Positions of the designs that need more than the first ``samples``.

    Those that are undecided, and those of which later samples are stored: they are judged by all that is known of them.
    """
    decided = rule.decided(counts.passed, counts.runs).tolist()
    known = zip(counts.positions, counts.reached, decided, strict=True)
    return {position for position, reached, done in known if reached > samples or not done}


def design_states(experiment: Experiment, rule: StoppingRule, counts: DesignCounts) -> list[DesignState]:
    """What is known of each design of the experiment."""
    low, high = anytime_interval(counts.passed, counts.runs, rule.confidence)
    decided = rule.decided(counts.passed, counts.runs)
    columns = [design.columns for design in experiment.family]
    known = zip(columns, counts.runs, counts.passed, low.tolist(), high.tolist(), decided.tolist(), strict=True)
    return [DesignState(experiment.id, *one) for one in known]
