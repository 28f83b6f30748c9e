"""Effects and importance of parameters, and values of the environment that separate passed from failed runs, as rows."""

from collections.abc import Sequence

from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.evidence.evidence import Evidence
from foldcar.report.environment_values import EnvironmentValues
from foldcar.report.page_types import Cause, CauseBin, ParameterEffect, ParameterImportance
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.effects import Effect, Effects, fit_effects
from foldcar.statistics.separation import binned, separations
from foldcar.statistics.words import count

DIGITS = 4


def read_effects(evidence: Evidence) -> tuple[Effects | None, list[int]]:
    """Fit a smooth model of how the parameters change success.

    Only parameters that have several values in the runs are in the model. Returns the model, and the indices of these
    parameters among those of ``evidence``. The model is None if there are too few designs, or if success is undefined.
    """
    designs_with_runs = [design for design in evidence.family if design.swept and design.runs]
    indices, names = [], []
    for index, name in enumerate(evidence.values):
        different_values = {design.design[name] for design in designs_with_runs}
        if len(different_values) > 1:
            indices.append(index)
            names.append(name)
    if not names or not evidence.info.success_defined:
        return None, indices
    # Fewer designs cannot separate the effects of so many parameters.
    if len(designs_with_runs) < 2 ** len(names):
        return None, indices
    return _fit(evidence, names), indices


def _fit(evidence: Evidence, names: Sequence[str]) -> Effects | None:
    """Fit a smooth model of the success rate as a function of the parameters ``names`` to the runs.

    Returns None if there are too few runs for it.
    """
    runs = evidence.runs.counted
    has_passed = runs.outcome == OUTCOMES.index("passed")
    parameters = []
    for design in evidence.family:
        if design.swept:
            parameters.append([float(design.design[name]) for name in names])
    try:
        with threadpool_limits(1):
            return fit_effects(parameters, runs.design, runs.sample, has_passed)
    except FoldcarError:
        return None


def effect_rows(effects: Effects, parameters: list[int]) -> list[ParameterEffect]:
    """Return a row for each parameter of the model: how the success rate changes with it.

    ``grid`` are values of the parameter, and ``mean`` is the success rate at each, averaged over combinations of the
    other parameters. ``curves`` are the rates of single combinations, and ``over`` says in words which combinations
    there are. ``low`` and ``high`` are a band for the shape of the mean curve, and ``level`` is an interval for its
    average height. ``parameters`` are the indices of the model's parameters among all parameters of the family.
    """
    rows: list[ParameterEffect] = []
    for index, parameter in enumerate(parameters):
        effect = effects.effect(index)
        rows.append(
            {
                "parameter": parameter,
                "grid": effect.grid.tolist(),
                "mean": effect.mean.round(DIGITS).tolist(),
                "low": effect.low.round(DIGITS).tolist(),
                "high": effect.high.round(DIGITS).tolist(),
                "level": [round(end, DIGITS) for end in effect.level],
                "curves": effect.curves.round(DIGITS).tolist() if len(parameters) > 1 else [],
                "over": combinations_text(effect, len(parameters)),
            }
        )
    return rows


def combinations_text(effect: Effect, parameters: int) -> str:
    """Return a text that says over which combinations of the other parameters an effect is averaged.

    ``parameters`` is the number of parameters. With a single one there are no others, and the text is "".
    """
    if parameters < 2:
        return ""
    combinations = f"{count(effect.combinations, 'combination')} of the other parameters"
    if effect.each_was_run:
        return f"mean over the same {combinations}, each of which was run at every value"
    return f"mean over the same {combinations} by the smooth model, because few of them were run at every value"


def importance_rows(effects: Effects, indices: Sequence[int]) -> list[ParameterImportance]:
    """Return a row with the importance of each parameter, the greatest first; no rows for a single parameter."""
    if len(indices) < 2:
        return []
    rows: list[ParameterImportance] = []
    # If success does not vary, there are no importances.
    for parameter, importance in zip(indices, effects.importance(), strict=False):
        rows.append(
            {
                "parameter": parameter,
                "share": round(importance.share, DIGITS),
                "low": round(importance.low, DIGITS),
                "high": round(importance.high, DIGITS),
            }
        )
    return sorted(rows, key=lambda row: -row["share"])


def cause_rows(evidence: Evidence, values: EnvironmentValues) -> list[Cause]:
    """Return a row for each random value by which passed and failed runs of a design differ, the clearest first.

    ``separation`` says how clearly, with its interval. ``bins`` divide the range of the value, and have the numbers of
    runs and of passed runs in each part. There are no rows if the experiment has no rule for success.
    """
    if not evidence.info.success_defined:
        return []
    runs = evidence.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    values_in_readers_units = values.shown
    rows: list[Cause] = []
    for separation in separations(values.values, runs.design, runs.sample, passed):
        column = values.columns[separation.column]
        bins: list[CauseBin] = []
        for bin in binned(values_in_readers_units[:, separation.column], runs.sample, passed):
            first, last = float(f"{bin.first:.6g}"), float(f"{bin.last:.6g}")
            bins.append({"from": first, "to": last, "runs": bin.runs, "passed": bin.passed})
        rows.append(
            {
                "name": column.name,
                "label": column.label,
                "unit": column.unit,
                "separation": round(separation.share, DIGITS),
                "low": round(separation.low, DIGITS),
                "high": round(separation.high, DIGITS),
                "rises": separation.difference > 0,
                "bins": bins,
            }
        )
    return rows
