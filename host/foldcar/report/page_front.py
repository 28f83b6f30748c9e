"""The designs of a search with their objectives, for the page: which ones are not dominated.

Values are biased upwards in the environments that chose the design, so only designs with fresh environments may be called
best. The objectives are computed by :mod:`foldcar.study.search.objectives`.
"""

import math
from collections.abc import Sequence

from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import FrontPoint, PageObjective, SearchFront
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.study.search.design_simulator import RunRow
from foldcar.study.search.objectives import OBJECTIVES, Objective, is_dominated


def search_front(evidence: Evidence, areas: Sequence[float | None], fresh: Evidence | None) -> SearchFront | None:
    """Return the designs of a search as points with the values of their objectives.

    ``areas`` are the areas of film of the designs (cm²). ``fresh`` is the evidence of the best designs in new, "fresh"
    environments. If a design has fresh runs, its point comes from these. Returns None if the experiment is no search.
    """
    info = evidence.info
    objectives = [OBJECTIVES[name] for name in info.objectives if name in OBJECTIVES]
    if not objectives:
        return None
    searched_runs = _runs_by_design(evidence)
    max_runs = max((len(runs) for runs in searched_runs), default=0)
    fresh_runs = [] if fresh is None else _runs_by_design(fresh)
    points: list[FrontPoint] = []
    for index, design in enumerate(evidence.family):
        fresh_index = None if fresh is None else fresh.index_of(design)
        runs = [] if fresh_index is None else fresh_runs[fresh_index]
        is_fresh = bool(runs)
        if not is_fresh:
            runs = searched_runs[index]
            # If the search has stopped a design early, its runs are not in all environments, so it has no point.
            if len(runs) < max_runs:
                continue
        points.append(_point(index, objectives, runs, info.timeout_s, areas[index], is_fresh))

    # In the environments of the search, the best designs look too good. So these points are not compared with fresh ones.
    for is_fresh in (True, False):
        points_alike = [point for point in points if point["fresh"] == is_fresh]
        losses = [_losses(point["values"], objectives) for point in points_alike]
        for point, loss in zip(points_alike, losses, strict=True):
            point["beaten"] = is_dominated(loss, losses)
    page_objectives: list[PageObjective] = []
    for objective in objectives:
        page_objectives.append(
            {
                "label": objective.meaning,
                "unit": objective.unit or "%",
                "better": "more" if objective.is_maximised else "less",
            }
        )
    return {"objectives": page_objectives, "points": points}


def _runs_by_design(evidence: Evidence) -> list[list[RunRow]]:
    """Return a list of runs for each design of the family. Runs that the program rejected are left out."""
    runs = evidence.runs.counted
    designs, outcomes = runs.design.tolist(), runs.outcome.tolist()
    times_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")].tolist()
    energies_j = runs.metrics[:, NUMBERS.index("consumed_energy_j")].tolist()
    runs_by_design: list[list[RunRow]] = [[] for _ in evidence.family]
    for design, outcome, time_s, energy_j in zip(designs, outcomes, times_s, energies_j, strict=True):
        run = RunRow(OUTCOMES[outcome], _none_if_nan(time_s), _none_if_nan(energy_j))
        runs_by_design[design].append(run)
    return runs_by_design


def _none_if_nan(value: float) -> float | None:
    """Return None for NaN, which stands for an unknown number in arrays."""
    return None if math.isnan(value) else value


def _point(
    index: int, objectives: Sequence[Objective], rows: list[RunRow], limit_s: float, area_cm2: float | None, fresh: bool
) -> FrontPoint:
    """Return the point of a design: the values of its objectives with their intervals, in the units of the page.

    ``index`` is the design's index. ``rows`` are its runs, ``limit_s`` is their time limit, and ``area_cm2`` the area
    of film of the car. ``fresh`` is whether the runs are in environments that the search has not used.
    """
    values: list[float | None] = []
    lows: list[float | None] = []
    highs: list[float | None] = []
    for objective in objectives:
        if objective.value is None or objective.interval is None:
            # The only objective that does not depend on runs is the area, which is known exactly.
            values.append(area_cm2)
            lows.append(area_cm2)
            highs.append(area_cm2)
        else:
            low, high = objective.interval(rows, limit_s)
            values.append(_page_number(objective, objective.value(rows, limit_s)))
            lows.append(_page_number(objective, low))
            highs.append(_page_number(objective, high))
    return {
        "design": index,
        "values": values,
        "low": lows,
        "high": highs,
        "fresh": fresh,
        # Whether another design is better in all objectives is computed when all points are known.
        "beaten": False,
    }


def _page_number(objective: Objective, value: float) -> float | None:
    """Return an objective's value with five digits, a fraction in per cent; None for infinity."""
    if math.isinf(value):
        return None
    # An objective without unit is a fraction.
    factor = 1 if objective.unit else 100
    return float(f"{factor * value:.5g}")


def _losses(values: Sequence[float | None], objectives: Sequence[Objective]) -> list[float]:
    """Return for each objective's value a number that is smaller if the design is better. It is infinite if unknown."""
    losses = []
    for objective, value in zip(objectives, values, strict=True):
        losses.append(math.inf if value is None else objective.loss(value))
    return losses
