"""Sweeps that stop when they know: the rules of ``--until``, and what is known of each design at the end."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from foldcar.analysis.rate import anytime_interval
from foldcar.analysis.stopping import StoppingRule
from foldcar.errors import FoldcarError
from foldcar.store.designs import DesignCounts
from foldcar.study.experiments import Experiment, Study

# Percentage points: an interval of half this width and more is known without a run.
MOST_POINTS = 50
LEAST_POINTS = 0.1


@dataclass(frozen=True)
class DesignState:
    """What a sweep knows of a design: its counts and its anytime-valid interval (``low``, ``high``), 0 to 1.

    Of its ``runs``, the ``rejected`` ones tell nothing of it.
    """

    experiment: str
    design: Mapping[str, float]
    runs: int
    rejected: int
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
    points = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?) ?pp", until)
    if points is None:
        raise FoldcarError(f"--until: '{until}' is neither decided nor percentage points, as 5pp")
    width = float(points[1])
    if not LEAST_POINTS <= width < MOST_POINTS:
        raise FoldcarError(f"--until: {until} is not from {LEAST_POINTS}pp to below {MOST_POINTS}pp")
    return {experiment.id: StoppingRule(width / 100, ()) for experiment in study.experiments}


def design_states(experiment: Experiment, rule: StoppingRule, counts: DesignCounts) -> list[DesignState]:
    """What is known of each design of the experiment."""
    low, high = anytime_interval(counts.passed, counts.counted, rule.confidence)
    decided = rule.decided(counts.passed, counts.counted)
    columns = [design.columns for design in experiment.family]
    rejected = [runs - counted for runs, counted in zip(counts.runs, counts.counted, strict=True)]
    known = zip(
        columns, counts.runs, rejected, counts.passed, low.tolist(), high.tolist(), decided.tolist(), strict=True
    )
    return [DesignState(experiment.id, *one) for one in known]
