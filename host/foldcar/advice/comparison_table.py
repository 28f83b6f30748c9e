"""A comparison as an object for JSON and as a CSV file; names end with their units, shares are 0 to 1."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from foldcar.advice.comparison import Comparison, DesignComparison, ExperimentComparison, TrialsAlone
from foldcar.advice.csv_rows import write_csv
from foldcar.analysis.gap import Gap
from foldcar.analysis.rate import Rate

COUNTS = ("runs", "runs_passed", "trials", "trials_passed", "aborted", "paired", "agreeing")
RATES = ("simulated", "driven", "rectified", "pooled")


def comparison_object(found: Comparison) -> dict[str, Any]:
    """The comparison as plain data; what is unknown is None."""
    return {
        "sentence": found.sentence,
        "margin": found.margin,
        "experiments": [_experiment_object(one) for one in found.experiments],
        "trials_alone": [_alone_object(one) for one in found.alone],
    }


def write_comparison(found: Comparison, file: Path) -> None:
    """Write a row for each design of each experiment as CSV, atomically. FoldcarError."""
    rows = [row for one in found.experiments for row in map(_csv_row, [one] * len(one.designs), one.designs)]
    write_csv(rows, file)


def _experiment_object(one: ExperimentComparison) -> dict[str, Any]:
    return {
        "experiment": one.info.id,
        "vehicle_type": one.info.vehicle_type,
        "scenic_program": one.info.scenic_program,
        "carsim_build": one.info.carsim_build,
        "verdict": one.verdict,
        "sentence": one.sentence,
        "mean_gap": _interval_object(one.mean_gap),
        "ranks": None if one.ranks is None else asdict(one.ranks),
        "remarks": list(one.remarks),
        "designs": [_design_object(design) for design in one.designs],
    }


def _design_object(one: DesignComparison) -> dict[str, Any]:
    return {
        "vehicle_type": one.evidence.vehicle_type,
        "design": dict(one.design),
        "label": one.label,
        "swept": one.evidence.swept,
        **_counts(one),
        **{name: _interval_object(getattr(one, name)) for name in RATES},
        "gap": _interval_object(one.gap),
        "verdict": one.verdict,
        "simulated_outcomes": dict(one.evidence.outcomes),
        "trial_outcomes": dict(one.driven_outcomes),
    }


def _alone_object(one: TrialsAlone) -> dict[str, Any]:
    designs = [
        {"label": label, "trials_passed": passed, "driven": _interval_object(rate)}
        for label, passed, rate in one.designs
    ]
    return {"experiment": one.experiment, "sentence": one.sentence, "designs": designs}


def _csv_row(experiment: ExperimentComparison, one: DesignComparison) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": experiment.info.id, "vehicle_type": one.evidence.vehicle_type, **one.design}
    row |= {**_counts(one), "verdict": one.verdict}
    for name in (*RATES, "gap"):
        found: Rate | Gap | None = getattr(one, name)
        row |= {f"{name}{end}": None if found is None else repr(getattr(found, part)) for end, part in ENDS.items()}
    outcomes: Mapping[str, Mapping[str, int]] = {"runs": one.evidence.outcomes, "trials": one.driven_outcomes}
    return row | {f"{what}_{name}": number for what, counts in outcomes.items() for name, number in counts.items()}


ENDS = {"": "value", "_low": "low", "_high": "high"}


def _counts(one: DesignComparison) -> dict[str, int]:
    evidence = one.evidence
    numbers = (
        evidence.runs, evidence.runs_passed, len(evidence.trials), evidence.trials_passed, evidence.aborted, one.paired,
        one.agreeing,
    )  # fmt: skip
    return dict(zip(COUNTS, numbers, strict=True))


def _interval_object(found: Rate | Gap | None) -> dict[str, Any] | None:
    return None if found is None else asdict(found)
