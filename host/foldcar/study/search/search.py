"""The search: asks for designs, simulates them, tells what they are worth, and judges the best in fresh environments.

Input: an experiment of a listing. Output: runs in the store under the keys of a sweep's, and a Found. What was best of
many in some environments was lucky there as well: only runs in environments that no design was chosen by say how good it
is. What the store holds is not simulated again: a search that was cut short goes the same way to where it was.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import no_rate_text
from foldcar.statistics.words import design_text
from foldcar.store.writer import write_store
from foldcar.study.chunks import Simulators
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment, Study
from foldcar.study.limits import MAX_SEED
from foldcar.study.search.design_simulator import DesignSimulator, Row, Values, fresh_id, open_simulator
from foldcar.study.search.objectives import OBJECTIVES, Objective, film_area_cm2
from foldcar.study.search.proposals import Proposals, Tried
from foldcar.study.sweep import study_facts

# Looks at a design, each after as many environments.
BATCHES = 10
# Turns a seed into one of environments that nothing is chosen by.
FRESH_BIT = 1 << 40


@dataclass(frozen=True)
class Plan:
    """What is searched for and how: at most ``designs`` designs and, if given, ``runs`` runs.

    The ``best`` are judged in ``fresh`` environments. ``prune``: designs that look worse than the best are left early.
    """

    objectives: tuple[Objective, ...]
    sampler: str
    seed: int
    designs: int
    runs: int | None
    fresh: int
    best: int
    prune: bool


@dataclass(frozen=True)
class Judged:
    """A design of the best: its values while it was chosen, and those in fresh environments with 95 % intervals.

    What follows from the design alone has no interval. A fresh value is None if every run was rejected.
    """

    design: Mapping[str, float]
    chosen_by: tuple[float, ...]
    fresh: tuple[float | None, ...]
    intervals: tuple[tuple[float, float] | None, ...]


@dataclass
class Found:
    """The counts of a search, for its progress, and what it found at its end. ``runs`` are those of the tried designs.

    ``new`` is how many runs were simulated in all; ``exhausted`` says that no more design was found to try.
    """

    planned: int
    designs: int = 0
    pruned: int = 0
    runs: int = 0
    new: int = 0
    best_so_far: float | None = None
    exhausted: bool = False
    unbuildable: dict[str, str] = field(default_factory=dict)
    best: list[Judged] = field(default_factory=list)
    started_s: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        """Time since the start (s)."""
        return time.perf_counter() - self.started_s


def searched_study(study: Study, fresh: int) -> Study:
    """The study's only experiment, and the same in ``fresh`` other samples, with other built cars. FoldcarError."""
    if len(study.experiments) > 1:
        known = ", ".join(experiment.id for experiment in study.experiments)
        raise FoldcarError(f"{study.listing_name}: experiments: has several; choose one with --experiment: {known}")
    (chosen,) = study.experiments
    other = replace(
        chosen,
        id=fresh_id(chosen.id),
        environments=fresh,
        seed=(chosen.seed ^ FRESH_BIT) & MAX_SEED,
        variation_seed=(chosen.variation_seed ^ FRESH_BIT) & MAX_SEED,
    )
    return replace(study, experiments=(chosen, other))


def search(
    study: Study,
    plan: Plan,
    store: Path,
    carsim: Carsim,
    simulators: Simulators | int,
    command: str,
    found: Found,
    report: Callable[[Found], None] = lambda found: None,
    environment_of: Callable[[Experiment], Environment] = Environment,
) -> None:
    """Search the family of the first experiment of :func:`searched_study`; the second has the fresh environments.

    ``found`` is updated and ``report`` called after every step. ``environment_of`` makes the environments: those of a
    calibration are others. FoldcarError.
    """
    experiment, fresh = study.experiments
    environment = environment_of(experiment)
    _check(experiment, environment, plan)
    names = [objective.name for objective in plan.objectives]

    def simulated(runs: int) -> None:
        found.new += runs
        report(found)

    with write_store(store) as writer:
        writer.begin_study(study_facts(study, carsim, command), carsim.build)
        proposals = Proposals(experiment.family, plan.objectives, plan.sampler, plan.seed, plan.designs)
        with open_simulator(experiment, environment, writer, carsim, simulators, simulated, names) as simulator:
            _try_designs(experiment, plan, proposals, simulator, found, report)
            simulator.finish(list(proposals.unbuildable))
        best = proposals.best(plan.best)
        with open_simulator(fresh, environment_of(fresh), writer, carsim, simulators, simulated, ()) as simulator:
            for one in best:
                rows = _counted(simulator.rows(one.values, range(plan.fresh)))
                found.best.append(_judged(experiment, plan, one, rows))
                report(found)
    for values, reason in proposals.unbuildable.items():
        columns = dict(zip(experiment.family.columns(), values, strict=True))
        found.unbuildable[design_text({name: columns[name] for name in experiment.family.varied})] = reason


def _try_designs(
    experiment: Experiment,
    plan: Plan,
    proposals: Proposals,
    simulator: DesignSimulator,
    found: Found,
    report: Callable[[Found], None],
) -> None:
    first = plan.objectives[0]
    while found.designs < plan.designs and (plan.runs is None or found.runs + experiment.environments <= plan.runs):
        values = proposals.next()
        if values is None:
            found.exhausted = True
            return
        made: list[Row] = []
        pruned = False
        for batch in batches(experiment.environments):
            made += simulator.rows(values, batch)
            pruned = plan.prune and len(made) < experiment.environments and proposals.worse(made, experiment.timeout_s)
            if pruned:
                break
        found.runs += len(made)
        rows = _counted(made)
        if not rows:
            proposals.refuse(no_rate_text(len(made)))
            continue
        mean_time_s = _value(OBJECTIVES["time"], experiment, values, rows)
        worth = [_value(objective, experiment, values, rows) for objective in plan.objectives]
        proposals.tell(worth, made, pruned, mean_time_s)
        found.designs += 1
        found.pruned += pruned
        if not pruned:
            better = max if first.largest else min
            found.best_so_far = worth[0] if found.best_so_far is None else better(found.best_so_far, worth[0])
        report(found)


def _value(objective: Objective, experiment: Experiment, values: Values, rows: Sequence[Row]) -> float:
    if objective.value is None:
        return film_area_cm2(experiment.family.design(values))
    return objective.value(rows, experiment.timeout_s)


def _judged(experiment: Experiment, plan: Plan, tried: Tried, rows: Sequence[Row]) -> Judged:
    told = [objective if rows or objective.value is None else None for objective in plan.objectives]
    return Judged(
        experiment.family.design(tried.values).columns,
        tried.objectives,
        tuple(None if one is None else _value(one, experiment, tried.values, rows) for one in told),
        tuple(None if one is None or one.interval is None else one.interval(rows, experiment.timeout_s) for one in told),
    )


def _counted(rows: Sequence[Row]) -> list[Row]:
    """The rows that belong in a rate."""
    return [row for row in rows if row.passed is not None]


def batches(environments: int) -> list[range]:
    """The samples that are simulated between looks at a design."""
    size = math.ceil(environments / BATCHES)
    return [range(first, min(first + size, environments)) for first in range(0, environments, size)]


def _check(experiment: Experiment, environment: Environment, plan: Plan) -> None:
    """FoldcarError if the plan has no meaning for the experiment."""
    if all(objective.value is None for objective in plan.objectives):
        raise FoldcarError("--objective sheet-area: needs no simulation; name what the car shall do as well")
    if plan.runs is not None and plan.runs < experiment.environments:
        raise FoldcarError(f"--runs {plan.runs}: one design takes {experiment.environments}, one in each environment")
    if experiment.condition is not None:
        raise FoldcarError(
            f"{experiment.place}: environment {experiment.environment} has a condition: fresh samples would not have it"
        )
    if not environment.success.defined:
        raise FoldcarError(f"{experiment.place}: {environment.success.text}")
