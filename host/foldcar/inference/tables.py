"""Comparisons and selections as objects for JSON and as CSV files; names end with their units, shares are 0 to 1."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas

from foldcar.inference.comparison import Comparison, DesignComparison, ExperimentComparison
from foldcar.inference.selecting import Recommendation, Selection
from foldcar.outputs import atomic_file
from foldcar.shown_text import spreadsheet_cell
from foldcar.statistics.gap import Gap
from foldcar.statistics.rate import Rate

RATES = ("simulated", "driven", "further_car", "pooled")
ENDS = {"": "value", "_low": "low", "_high": "high"}


def comparison_object(found: Comparison) -> dict[str, Any]:
    """The comparison as plain data; what is unknown is None."""
    return {
        "sentence": found.sentence,
        "margin": found.margin,
        "experiments": [_experiment_object(experiment) for experiment in found.experiments],
        "trials_alone": list(found.alone),
    }


def write_comparison(found: Comparison, file: Path) -> None:
    """Write a row for each design of each experiment as CSV, atomically. Raises FoldcarError."""
    _write(
        [_compared(experiment.info.id, design) for experiment in found.experiments for design in experiment.designs], file
    )


def selection_object(one: Selection) -> dict[str, Any]:
    """The selection as plain data; what is unknown is None."""
    plain = {
        name: getattr(one, name)
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
    plain["undecided"] = [{**asdict(design), "design": dict(design.design)} for design in one.undecided]
    designs = [{**asdict(design), "design": dict(design.design)} for design in one.recommendations]
    leader = None if one.leader is None else dict(one.leader)
    return {"experiment": one.info.id, **plain, "leader": leader, "recommendations": designs}


def write_selection(found: Sequence[Selection], file: Path) -> None:
    """Write a row for each recommended design as CSV, atomically. Raises FoldcarError."""
    _write(
        [
            _selected(one, rank, recommendation)
            for one in found
            for rank, recommendation in enumerate(one.recommendations, 1)
        ],
        file,
    )


def _experiment_object(one: ExperimentComparison) -> dict[str, Any]:
    info = one.info
    return {
        "experiment": info.id,
        **{name: getattr(info, name) for name in ("vehicle_type", "scenic_program", "carsim_build")},
        "verdict": one.verdict,
        "sentence": one.sentence,
        "mean_gap": _object(one.mean_gap),
        "ranks": None if one.ranks is None else asdict(one.ranks),
        "remarks": list(one.remarks),
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
            for design in one.designs
        ],
    }


def _object(found: Rate | Gap | None) -> dict[str, Any] | None:
    return None if found is None else asdict(found)


def _counts(one: DesignComparison) -> dict[str, int]:
    evidence = one.evidence
    return {
        "runs": evidence.runs,
        "runs_passed": evidence.runs_passed,
        "trials": len(evidence.trials),
        "trials_passed": evidence.trials_passed,
        "cars": one.cars,
        "aborted": evidence.aborted,
        "paired": one.paired,
        "agreeing": one.agreeing,
    }


def _compared(experiment: str, one: DesignComparison) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": experiment, "vehicle_type": one.evidence.vehicle_type, **one.design}
    row |= {**_counts(one), "gap_is_paired": one.gap_is_paired, "verdict": one.verdict}
    row |= _ends({name: getattr(one, name) for name in (*RATES, "gap")})
    outcomes: Mapping[str, Mapping[str, int]] = {"runs": one.evidence.outcomes, "trials": one.driven_outcomes}
    return row | {f"{what}_{name}": number for what, counts in outcomes.items() for name, number in counts.items()}


def _selected(one: Selection, rank: int, design: Recommendation) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": one.info.id, "rank": rank, **design.design, "place": design.place}
    row |= {name: getattr(design, name) for name in ("reason", "built", "trials_done", "cars", "trials")}
    row |= _ends({"simulated": design.simulated, "expected": design.expected})
    row |= {part: None if design.cost is None else getattr(design.cost, part) for part in ("sheets", "minutes")}
    return row | {"environments": " ".join(str(sample) for sample in one.environments[: design.trials])}


def _ends(found: Mapping[str, Rate | Gap | None]) -> dict[str, float | None]:
    return {
        f"{name}{end}": None if one is None else getattr(one, part)
        for name, one in found.items()
        for end, part in ENDS.items()
    }


def _write(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """The rows under all their names, in order of appearance."""
    columns = list(dict.fromkeys(name for row in rows for name in row)) or ["experiment"]
    # As objects, so that whole numbers stay whole beside missing ones.
    cells = [[spreadsheet_cell(row.get(name)) for name in columns] for row in rows]
    table = pandas.DataFrame(cells, columns=columns, dtype=object)
    with atomic_file(file) as binary:
        table.to_csv(binary, index=False, lineterminator="\n")
