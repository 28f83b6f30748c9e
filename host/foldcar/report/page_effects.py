"""Why designs pass or fail, for the page: effects and importance of parameters, and what separates the environments."""

from collections.abc import Sequence
from typing import Any

import numpy
from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.inference.evidence import Evidence
from foldcar.report.environment_values import EnvironmentValues
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.effects import Effect, Effects, fit_effects
from foldcar.statistics.separation import binned, separations
from foldcar.statistics.words import count

DIGITS = 4


def read_effects(evidence: Evidence) -> tuple[Effects | None, list[int]]:
    """The smooth model of the parameters of which runs have several values, and their places; None: too few."""
    swept = [design for design in evidence.family if design.swept]
    known = numpy.array([design.runs > 0 for design in swept])
    places = []
    for place, name in enumerate(evidence.values):
        if len({design.design[name] for design in swept if design.runs}) > 1:
            places.append(place)
    names = [list(evidence.values)[place] for place in places]
    # Fewer designs cannot tell so many parameters apart.
    if not names or known.sum() < 2 ** len(names) or not evidence.info.success_defined:
        return None, places
    runs = evidence.runs.counted
    x = [[float(design.design[name]) for name in names] for design in swept]
    try:
        with threadpool_limits(1):
            return fit_effects(x, runs.design, runs.sample, runs.outcome == OUTCOMES.index("passed")), places
    except FoldcarError:
        return None, places


def effect_rows(evidence: Evidence, effects: Effects, places: list[int]) -> list[dict[str, Any]]:
    """The effect of each parameter, over the same combinations of the others for each value."""
    result = []
    for at, place in enumerate(places):
        one = effects.effect(at)
        curves = one.curves.round(DIGITS).tolist() if len(places) > 1 else []
        rows = {key: getattr(one, key).round(DIGITS).tolist() for key in ("mean", "low", "high")}
        result.append(
            {
                "parameter": place,
                "grid": one.grid.tolist(),
                **rows,
                "level": [round(end, DIGITS) for end in one.level],
                "curves": curves,
                "over": over(one, len(places)),
            }
        )
    return result


def over(effect: Effect, parameters: int) -> str:
    """Over what an effect is a mean, in words; "" with a single parameter."""
    if parameters < 2:
        return ""
    number = f"{count(effect.combinations, 'combination')} of the other parameters"
    if effect.run:
        return f"mean over the same {number}, each of which was run at every value"
    return f"mean over the same {number} by the smooth model: hardly any was run at every value"


def importance_rows(effects: Effects, places: Sequence[int]) -> list[dict[str, Any]]:
    """The importance of each parameter, the greatest first; none of a single parameter."""
    if len(places) < 2:
        return []
    found = effects.importance()
    rows = [
        {"parameter": place, **{key: round(getattr(one, key), DIGITS) for key in ("share", "low", "high")}}
        for place, one in zip(places, found, strict=False)
    ]
    return sorted(rows, key=lambda row: -row["share"])


def cause_rows(evidence: Evidence, values: EnvironmentValues) -> list[dict[str, Any]]:
    """What separates runs that passed from runs that failed, the best first, with success over it."""
    if not evidence.info.success_defined:
        return []
    runs = evidence.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
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
