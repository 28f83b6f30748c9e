"""What a search found, for the page: designs that none beats in all objectives, with values from fresh environments.

Values in the environments that a design was chosen by are too good as a rule: only designs that were judged in fresh
ones are called best. The objectives are those of :mod:`foldcar.study.search.objectives`, by the same functions.
"""

from collections.abc import Sequence
from typing import Any

from foldcar.inference.evidence import Evidence
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.study.search.design_simulator import Row
from foldcar.study.search.objectives import OBJECTIVES, Objective, is_dominated


def search_front(evidence: Evidence, areas: Sequence[float | None], fresh: Evidence | None) -> dict[str, Any] | None:
    """The designs that a search tried in all environments; None if no search made the experiment.

    ``areas`` are the designs' sheet areas (cm²), ``fresh`` the same experiment in fresh environments.
    """
    info = evidence.info
    objectives = [OBJECTIVES[name] for name in info.objectives if name in OBJECTIVES]
    if not objectives:
        return None
    tried, again = _rows(evidence), _rows(fresh) if fresh is not None else []
    points = []
    for index, rows in enumerate(tried):
        at = None if fresh is None else fresh.index_of(evidence.family[index])
        judged = again[at] if at is not None else []
        # Designs that were left early were not tried in all environments.
        if judged or len(rows) == max(map(len, tried)):
            points.append(_point(index, objectives, judged or rows, info.timeout_s, areas[index], bool(judged)))
    signs = [-1 if objective.largest else 1 for objective in objectives]
    for fresh_too in (True, False):
        some = [point for point in points if point["fresh"] == fresh_too]
        losses = [_losses(point["values"], signs) for point in some]
        for one, loss in zip(some, losses, strict=True):
            one["beaten"] = is_dominated(loss, losses)
    shown = [
        {"label": objective.meaning, "unit": objective.unit or "%", "better": "more" if objective.largest else "less"}
        for objective in objectives
    ]
    return {"objectives": shown, "points": points}


def _rows(evidence: Evidence) -> list[list[Row]]:
    """The runs of each design that count."""
    runs = evidence.runs.counted
    rows: list[list[Row]] = [[] for _ in evidence.family]
    numbers = (runs.metrics[:, NUMBERS.index(name)].tolist() for name in ("elapsed_time_s", "consumed_energy_j"))
    for design, outcome, time_s, energy_j in zip(runs.design.tolist(), runs.outcome.tolist(), *numbers, strict=True):
        known = (None if value != value else value for value in (time_s, energy_j))
        rows[design].append(Row(OUTCOMES[outcome], *known))
    return rows


def _point(
    index: int, objectives: Sequence[Objective], rows: list[Row], limit_s: float, area_cm2: float | None, fresh: bool
) -> dict[str, Any]:
    found = []
    for objective in objectives:
        if objective.value is None or objective.interval is None:
            found.append([area_cm2] * 3)
            continue
        numbers, unit = (objective.value(rows, limit_s), *objective.interval(rows, limit_s)), 1 if objective.unit else 100
        found.append([float(f"{unit * x:.5g}") if abs(x) != float("inf") else None for x in numbers])
    values, low, high = map(list, zip(*found, strict=True))
    return {"design": index, "values": values, "low": low, "high": high, "fresh": fresh, "beaten": False}


def _losses(values: Sequence[float | None], signs: Sequence[int]) -> list[float]:
    return [float("inf") if value is None else sign * value for sign, value in zip(signs, values, strict=True)]
