"""The designs of a search with their objectives, for the page: which ones are not dominated.

Values are biased upwards in the environments that chose the design, so only designs with fresh environments may be called
best. The objectives are computed by :mod:`foldcar.study.search.objectives`.
"""

from collections.abc import Sequence

from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import FrontPoint, PageObjective, SearchFront
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.study.search.design_simulator import RunRow
from foldcar.study.search.objectives import OBJECTIVES, Objective, is_dominated


def search_front(evidence: Evidence, areas: Sequence[float | None], fresh: Evidence | None) -> SearchFront | None:
    """Return the designs of a search with their objectives; None if the experiment is not of a search.

    ``areas`` are the designs' sheet areas (cm²), ``fresh`` is the evidence of the best designs in fresh environments.
    """
    info = evidence.info
    objectives = [OBJECTIVES[name] for name in info.objectives if name in OBJECTIVES]
    if not objectives:
        return None
    tried_rows, fresh_rows = _rows(evidence), _rows(fresh) if fresh is not None else []
    points: list[FrontPoint] = []
    for index, rows in enumerate(tried_rows):
        fresh_index = None if fresh is None else fresh.index_of(evidence.family[index])
        own_fresh_rows = fresh_rows[fresh_index] if fresh_index is not None else []
        # Designs that the search abandoned were not tried in all environments: they have no point.
        if own_fresh_rows or len(rows) == max(map(len, tried_rows)):
            is_fresh = bool(own_fresh_rows)
            own_rows = own_fresh_rows if is_fresh else rows
            points.append(_point(index, objectives, own_rows, info.timeout_s, areas[index], is_fresh))
    signs = [-1 if objective.largest else 1 for objective in objectives]
    # Points from the environments of the search are too good, so points are compared only with those of the same kind.
    for is_fresh in (True, False):
        points_alike = [point for point in points if point["fresh"] == is_fresh]
        losses = [_losses(point["values"], signs) for point in points_alike]
        for point, loss in zip(points_alike, losses, strict=True):
            point["beaten"] = is_dominated(loss, losses)
    shown: list[PageObjective] = [
        {"label": objective.meaning, "unit": objective.unit or "%", "better": "more" if objective.largest else "less"}
        for objective in objectives
    ]
    return {"objectives": shown, "points": points}


def _rows(evidence: Evidence) -> list[list[RunRow]]:
    """Return the runs of each design that count."""
    runs = evidence.runs.counted
    rows: list[list[RunRow]] = [[] for _ in evidence.family]
    numbers = (runs.metrics[:, NUMBERS.index(name)].tolist() for name in ("elapsed_time_s", "consumed_energy_j"))
    for design, outcome, time_s, energy_j in zip(runs.design.tolist(), runs.outcome.tolist(), *numbers, strict=True):
        # Rows have None where the arrays have NaN; only NaN differs from itself.
        measured = (None if value != value else value for value in (time_s, energy_j))
        rows[design].append(RunRow(OUTCOMES[outcome], *measured))
    return rows


def _point(
    index: int, objectives: Sequence[Objective], rows: list[RunRow], limit_s: float, area_cm2: float | None, fresh: bool
) -> FrontPoint:
    """Return a design's objectives with their intervals, in the units of the page."""
    # (value, low, high) of each objective.
    triples = []
    for objective in objectives:
        if objective.value is None or objective.interval is None:
            triples.append([area_cm2] * 3)
            continue
        triple = objective.value(rows, limit_s), *objective.interval(rows, limit_s)
        # An objective without unit is a fraction; the page has it in %.
        factor = 1 if objective.unit else 100
        triples.append([float(f"{factor * x:.5g}") if abs(x) != float("inf") else None for x in triple])
    values, low, high = map(list, zip(*triples, strict=True))
    return {"design": index, "values": values, "low": low, "high": high, "fresh": fresh, "beaten": False}


def _losses(values: Sequence[float | None], signs: Sequence[int]) -> list[float]:
    return [float("inf") if value is None else sign * value for sign, value in zip(signs, values, strict=True)]
