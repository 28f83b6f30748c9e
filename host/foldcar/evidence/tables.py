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
    rows = []
    for experiment in comparison.experiments:
        rows += [_compared(experiment.info.id, design) for design in experiment.designs]
    _write(rows, file)


def selection_object(selection: Selection) -> dict[str, Any]:
    """Return the advice on which designs to build as plain data, with None for unknown values."""
    return {
        "experiment": selection.info.id,
        "threshold": selection.threshold,
        "works": selection.works,
        "learn": selection.learn,
        "grounds": selection.grounds,
        "enough": selection.enough,
        "gain": selection.gain,
        "environments": selection.environments,
        "remarks": selection.remarks,
        "leader": _plain(selection.leader),
        "steps": [_step_object(step) for step in selection.steps],
    }


def _step_object(step: PlannedStep) -> dict[str, Any]:
    """Return a step as plain data."""
    # asdict leaves a Mapping as it is if it is not a dictionary.
    plain_step = asdict(replace(step, design=None))
    plain_step["design"] = _plain(step.design)
    return plain_step


def write_selection(selections: Sequence[Selection], file: Path) -> None:
    """Write a row for each step as CSV, atomically. Raises FoldcarError."""
    rows = []
    for selection in selections:
        rows += [_step_row(selection, rank, step) for rank, step in enumerate(selection.steps, 1)]
    _write(rows, file)


def _experiment_object(experiment: ExperimentComparison) -> dict[str, Any]:
    """Return the comparison of an experiment as plain data."""
    info = experiment.info
    return {
        "experiment": info.id,
        "vehicle_type": info.vehicle_type,
        "scenic_program": info.scenic_program,
        "carsim_build": info.carsim_build,
        "verdict": experiment.verdict,
        "sentence": experiment.sentence,
        "mean_gap": _object(experiment.mean_gap),
        "ranks": None if experiment.ranks is None else asdict(experiment.ranks),
        "remarks": list(experiment.remarks),
        "unknowns": [_unknown(unknown) for unknown in experiment.unknowns],
        "designs": [_design_object(design) for design in experiment.designs],
    }


def _design_object(design: DesignComparison) -> dict[str, Any]:
    """Return the comparison of a design as plain data."""
    return {
        "vehicle_type": design.evidence.vehicle_type,
        "design": dict(design.design),
        "label": design.label,
        "swept": design.evidence.swept,
        **_counts(design),
        "simulated": _object(design.simulated),
        "driven": _object(design.driven),
        "built": _object(design.built),
        "gap": _object(design.gap),
        "verdict": design.verdict,
        "simulated_outcomes": dict(design.evidence.outcomes),
        "trial_outcomes": dict(design.driven_outcomes),
    }


def _object(estimate: Rate | Gap | None) -> dict[str, Any] | None:
    """Return an estimate as plain data; None if it is unknown."""
    return None if estimate is None else asdict(estimate)


def _unknown(unknown: Unknown) -> dict[str, Any]:
    """Return what the trials have taught about an unknown parameter of the simulator, such as friction.

    ``before`` and ``after`` the trials, it has an estimate in its own unit. ``shift`` is how far the estimate moved, in
    standard deviations, and ``narrowed`` the fraction of the variance that is gone. ``measured`` is a value that somebody
    measured, and ``wrong`` the probability that this measurement is wrong.
    """
    parameter = unknown.parameter
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "meaning": parameter.meaning,
        "source": parameter.source,
        "shift": unknown.shift,
        "narrowed": unknown.narrowed,
        "measured": unknown.measured,
        "wrong": unknown.wrong,
        "before": asdict(unknown.before),
        "after": asdict(unknown.after),
    }


def _counts(design: DesignComparison) -> dict[str, int]:
    """Return the numbers of runs, trials and cars of a design.

    ``paired`` trials were driven in the scene of a simulated run, and ``agreeing`` ones of these ended like the run.
    """
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
    row |= _counts(design)
    row["verdict"] = design.verdict
    row |= _ends({"simulated": design.simulated, "driven": design.driven, "built": design.built, "gap": design.gap})
    row |= {f"runs_{outcome}": number for outcome, number in design.evidence.outcomes.items()}
    row |= {f"trials_{outcome}": number for outcome, number in design.driven_outcomes.items()}
    return row


def _step_row(selection: Selection, rank: int, step: PlannedStep) -> dict[str, Any]:
    """Return the row of a step: rank, design, gain, cost, rates with intervals."""
    row: dict[str, Any] = {
        "experiment": selection.info.id,
        "rank": rank,
        "step": step.text,
        "kind": step.kind,
        "gain": step.gain,
        "minutes": step.minutes,
        "trials": step.trials,
        "sheets": step.sheets,
    }
    if step.design is not None:
        row |= step.design
    return row | _ends({"simulated": step.simulated, "built": step.built})


def _plain(design: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return a design as a dictionary, which JSON can hold; None if there is none."""
    return None if design is None else dict(design)


def _ends(estimates: Mapping[str, Rate | Gap | None]) -> dict[str, float | None]:
    """Return each estimate's value, low and high end in columns NAME, NAME_low and NAME_high; None if unknown."""
    columns: dict[str, float | None] = {}
    for name, estimate in estimates.items():
        columns[name] = None if estimate is None else estimate.value
        columns[f"{name}_low"] = None if estimate is None else estimate.low
        columns[f"{name}_high"] = None if estimate is None else estimate.high
    return columns


def _write(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write rows as CSV; the columns are all their names in order of appearance."""
    columns = list(dict.fromkeys(name for row in rows for name in row)) or ["experiment"]
    # As objects, so that whole numbers stay whole beside missing ones.
    cells = [[spreadsheet_cell(row.get(name)) for name in columns] for row in rows]
    table = pandas.DataFrame(cells, columns=columns, dtype=object)
    with atomic_file(file) as binary:
        table.to_csv(binary, index=False, lineterminator="\n")
