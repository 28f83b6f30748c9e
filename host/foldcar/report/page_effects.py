"""Effects and importance of parameters, and values of the environment that separate passed from failed runs, as rows."""

from collections.abc import Sequence
from typing import Any

import numpy
from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.evidence.evidence import Evidence
from foldcar.report.environment_values import EnvironmentValues
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.effects import Effect, Effects, fit_effects
from foldcar.statistics.separation import binned, separations
from foldcar.statistics.words import count

DIGITS = 4


def read_effects(evidence: Evidence) -> tuple[Effects | None, list[int]]:
    """Fit the smooth model of the parameters with several values in the runs; return it and the indices of these.

    The model is None if there are too few designs, or success is undefined.
    """
    swept = [design for design in evidence.family if design.swept]
    has_runs = numpy.array([design.runs > 0 for design in swept])
    indices = []
    for index, name in enumerate(evidence.values):
        if len({design.design[name] for design in swept if design.runs}) > 1:
            indices.append(index)
    names = [list(evidence.values)[index] for index in indices]
    # Fewer designs cannot separate the effects of so many parameters.
    if not names or has_runs.sum() < 2 ** len(names) or not evidence.info.success_defined:
        return None, indices
    runs = evidence.runs.counted
    x = [[float(design.design[name]) for name in names] for design in swept]
    try:
        with threadpool_limits(1):
            return fit_effects(x, runs.design, runs.sample, runs.outcome == OUTCOMES.index("passed")), indices
    except FoldcarError:
        return None, indices


def effect_rows(evidence: Evidence, effects: Effects, indices: list[int]) -> list[dict[str, Any]]:
    """Return a row with the effect of each parameter, as page_data.py describes it."""
    result = []
    for index, parameter in enumerate(indices):
        effect = effects.effect(index)
        curves = effect.curves.round(DIGITS).tolist() if len(indices) > 1 else []
        curve_data = {key: getattr(effect, key).round(DIGITS).tolist() for key in ("mean", "low", "high")}
        result.append(
            {
                "parameter": parameter,
                "grid": effect.grid.tolist(),
                **curve_data,
                "level": [round(end, DIGITS) for end in effect.level],
                "curves": curves,
                "over": combinations_text(effect, len(indices)),
            }
        )
    return result


def combinations_text(effect: Effect, parameters: int) -> str:
    """Describe the combinations that an effect is a mean over; "" with a single parameter."""
    if parameters < 2:
        return ""
    number = f"{count(effect.combinations, 'combination')} of the other parameters"
    if effect.run:
        return f"mean over the same {number}, each of which was run at every value"
    return f"mean over the same {number} by the smooth model: hardly any was run at every value"


def importance_rows(effects: Effects, indices: Sequence[int]) -> list[dict[str, Any]]:
    """Return a row with the importance of each parameter, the greatest first; no rows for a single parameter."""
    if len(indices) < 2:
        return []
    # Empty if success does not vary; then there are no rows.
    importances = effects.importance()
    rows = [
        {"parameter": parameter, **{key: round(getattr(importance, key), DIGITS) for key in ("share", "low", "high")}}
        for parameter, importance in zip(indices, importances, strict=False)
    ]
    return sorted(rows, key=lambda row: -row["share"])


def cause_rows(evidence: Evidence, values: EnvironmentValues) -> list[dict[str, Any]]:
    """Return a row for each value that separates passed from failed runs, the best first, with success over it."""
    if not evidence.info.success_defined:
        return []
    runs = evidence.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    # Values in the units of readers, for the bins.
    shown, rows = values.shown, []
    for separation in separations(values.values, runs.design, runs.sample, passed):
        column = values.columns[separation.column]
        bins = [
            {"from": float(f"{bin.first:.6g}"), "to": float(f"{bin.last:.6g}"), "runs": bin.runs, "passed": bin.passed}
            for bin in binned(shown[:, separation.column], runs.sample, passed)
        ]
        facts = {"name": column.name, "label": column.label, "unit": column.unit, "rises": separation.difference > 0}
        shares = {"separation": separation.share, "low": separation.low, "high": separation.high}
        rows.append({**facts, **{key: round(share, DIGITS) for key, share in shares.items()}, "bins": bins})
    return rows
