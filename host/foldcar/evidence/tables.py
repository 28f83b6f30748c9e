"""Comparisons and selections as objects for JSON and as CSV files; names end with units, fractions are 0 to 1."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas

from foldcar.belief.answers import Unknown
from foldcar.evidence.adviser import PlannedStep, Selection
from foldcar.evidence.comparison import Comparison, DesignComparison, ExperimentComparison
from foldcar.outputs import atomic_file
from foldcar.shown_text import spreadsheet_cell
from foldcar.statistics.gap import Gap
from foldcar.statistics.rate import Rate

RATES = ("simulated", "driven", "built")
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
    names = ("threshold", "works", "learn", "grounds", "enough", "gain", "environments", "remarks")
    plain = {name: getattr(selection, name) for name in names}
    leader = None if selection.leader is None else dict(selection.leader)
    steps = [asdict(replace(step, design=None)) | {"design": _plain(step.design)} for step in selection.steps]
    return {"experiment": selection.info.id, **plain, "leader": leader, "steps": steps}


def write_selection(selections: Sequence[Selection], file: Path) -> None:
    """Write a row for each step as CSV, atomically. Raises FoldcarError."""
    _write(
        [_step_row(selection, rank, step) for selection in selections for rank, step in enumerate(selection.steps, 1)],
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
        "unknowns": [_unknown(unknown) for unknown in experiment.unknowns],
        "designs": [
            {
                "vehicle_type": design.evidence.vehicle_type,
                "design": dict(design.design),
                "label": design.label,
                "swept": design.evidence.swept,
                **_counts(design),
                **{name: _object(getattr(design, name)) for name in (*RATES, "gap")},
                "verdict": design.verdict,
                "simulated_outcomes": dict(design.evidence.outcomes),
                "trial_outcomes": dict(design.driven_outcomes),
            }
            for design in experiment.designs
        ],
    }


def _object(estimate: Rate | Gap | None) -> dict[str, Any] | None:
    return None if estimate is None else asdict(estimate)


def _unknown(unknown: Unknown) -> dict[str, Any]:
    """Return what the trials have taught about a parameter, in the parameter's unit."""
    parameter = unknown.parameter
    return {
        **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "source")},
        **{name: getattr(unknown, name) for name in ("shift", "narrowed", "measured", "wrong")},
        "before": asdict(unknown.before),
        "after": asdict(unknown.after),
    }


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
    row |= {**_counts(design), "verdict": design.verdict}
    row |= _ends({name: getattr(design, name) for name in (*RATES, "gap")})
    outcomes: Mapping[str, Mapping[str, int]] = {"runs": design.evidence.outcomes, "trials": design.driven_outcomes}
    return row | {f"{source}_{name}": number for source, counts in outcomes.items() for name, number in counts.items()}


def _step_row(selection: Selection, rank: int, step: PlannedStep) -> dict[str, Any]:
    """Return the row of a step: rank, design, gain, cost, rates with intervals."""
    row: dict[str, Any] = {"experiment": selection.info.id, "rank": rank, "step": step.text, "kind": step.kind}
    row |= {name: getattr(step, name) for name in ("gain", "minutes", "trials", "sheets")} | dict(step.design or {})
    return row | _ends({"simulated": step.simulated, "built": step.built})


def _plain(design: Mapping[str, Any] | None) -> dict[str, Any] | None:
    return None if design is None else dict(design)


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
