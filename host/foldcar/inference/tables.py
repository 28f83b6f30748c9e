"""Comparisons and selections as objects for JSON and as CSV files; names end with units, fractions are 0 to 1."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas

from foldcar.inference.adviser import Recommendation, Selection
from foldcar.inference.comparison import Comparison, DesignComparison, ExperimentComparison
from foldcar.outputs import atomic_file
from foldcar.shown_text import spreadsheet_cell
from foldcar.statistics.gap import Gap
from foldcar.statistics.rate import Rate

RATES = ("simulated", "driven", "further_car", "pooled")
ENDS = {"": "value", "_low": "low", "_high": "high"}


def comparison_object(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as plain data, with None for unknown values."""
    return {
        "sentence": comparison.sentence,
        "margin": comparison.margin,
        "experiments": [_experiment_object(experiment) for experiment in comparison.experiments],
        "trials_alone": list(comparison.unswept),
    }


def write_comparison(comparison: Comparison, file: Path) -> None:
    """Write a row for each design of each experiment as CSV, atomically. Raises FoldcarError."""
    _write(
        [_compared(experiment.info.id, design) for experiment in comparison.experiments for design in experiment.designs],
        file,
    )


def selection_object(selection: Selection) -> dict[str, Any]:
    """Return the selection as plain data, with None for unknown values."""
    plain = {
        name: getattr(selection, name)
        for name in (
            "threshold",
            "precision",
            "enough",
            "loss",
            "gain",
            "sentence",
            "headline",
            "grounds",
            "next_step",
            "environments",
            "telling",
            "remarks",
        )
    }
    plain["undecided"] = [{**asdict(design), "design": dict(design.design)} for design in selection.undecided]
    designs = [{**asdict(design), "design": dict(design.design)} for design in selection.recommendations]
    leader = None if selection.leader is None else dict(selection.leader)
    return {"experiment": selection.info.id, **plain, "leader": leader, "recommendations": designs}


def write_selection(selections: Sequence[Selection], file: Path) -> None:
    """Write a row for each recommended design as CSV, atomically. Raises FoldcarError."""
    _write(
        [
            _recommendation_row(selection, rank, recommendation)
            for selection in selections
            for rank, recommendation in enumerate(selection.recommendations, 1)
        ],
        file,
    )


def _experiment_object(experiment: ExperimentComparison) -> dict[str, Any]:
    """Return the comparison of an experiment as plain data."""
    info = experiment.info
    return {
        "experiment": info.id,
        **{name: getattr(info, name) for name in ("vehicle_type", "scenic_program", "carsim_build")},
        "verdict": experiment.verdict,
        "sentence": experiment.sentence,
        "mean_gap": _object(experiment.mean_gap),
        "ranks": None if experiment.ranks is None else asdict(experiment.ranks),
        "remarks": list(experiment.remarks),
        "designs": [
            {
                "vehicle_type": design.evidence.vehicle_type,
                "design": dict(design.design),
                "label": design.label,
                "swept": design.evidence.swept,
                **_counts(design),
                **{name: _object(getattr(design, name)) for name in (*RATES, "gap")},
                "gap_is_paired": design.gap_is_paired,
                "verdict": design.verdict,
                "simulated_outcomes": dict(design.evidence.outcomes),
                "trial_outcomes": dict(design.driven_outcomes),
            }
            for design in experiment.designs
        ],
    }


def _object(estimate: Rate | Gap | None) -> dict[str, Any] | None:
    return None if estimate is None else asdict(estimate)


def _counts(design: DesignComparison) -> dict[str, int]:
    """Return the numbers of runs, trials and cars of a design."""
    evidence = design.evidence
    return {
        "runs": evidence.runs,
        "runs_passed": evidence.runs_passed,
        "trials": len(evidence.trials),
        "trials_passed": evidence.trials_passed,
        "cars": design.cars,
        "aborted": evidence.aborted,
        "paired": design.paired,
        "agreeing": design.agreeing,
    }


def _compared(experiment: str, design: DesignComparison) -> dict[str, Any]:
    """Return the row of a compared design: its parameters, counts, rates with intervals, numbers by outcome."""
    row: dict[str, Any] = {"experiment": experiment, "vehicle_type": design.evidence.vehicle_type, **design.design}
    row |= {**_counts(design), "gap_is_paired": design.gap_is_paired, "verdict": design.verdict}
    row |= _ends({name: getattr(design, name) for name in (*RATES, "gap")})
    outcomes: Mapping[str, Mapping[str, int]] = {"runs": design.evidence.outcomes, "trials": design.driven_outcomes}
    return row | {f"{source}_{name}": number for source, counts in outcomes.items() for name, number in counts.items()}


def _recommendation_row(selection: Selection, rank: int, design: Recommendation) -> dict[str, Any]:
    """Return the row of a recommended design: rank, parameters, reason, rates with intervals, cost, environments."""
    row: dict[str, Any] = {"experiment": selection.info.id, "rank": rank, **design.design, "place": design.place}
    row |= {name: getattr(design, name) for name in ("reason", "built", "trials_done", "cars", "trials")}
    row |= _ends({"simulated": design.simulated, "expected": design.expected})
    row |= {part: None if design.cost is None else getattr(design.cost, part) for part in ("sheets", "minutes")}
    return row | {"environments": " ".join(str(sample) for sample in selection.environments[: design.trials])}


def _ends(estimates: Mapping[str, Rate | Gap | None]) -> dict[str, float | None]:
    """Return each estimate's value, low and high end in columns NAME, NAME_low and NAME_high."""
    return {
        f"{name}{end}": None if estimate is None else getattr(estimate, part)
        for name, estimate in estimates.items()
        for end, part in ENDS.items()
    }


def _write(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write rows as CSV; the columns are all their names in order of appearance."""
    columns = list(dict.fromkeys(name for row in rows for name in row)) or ["experiment"]
    # As objects, so that whole numbers stay whole beside missing ones.
    cells = [[spreadsheet_cell(row.get(name)) for name in columns] for row in rows]
    table = pandas.DataFrame(cells, columns=columns, dtype=object)
    with atomic_file(file) as binary:
        table.to_csv(binary, index=False, lineterminator="\n")
