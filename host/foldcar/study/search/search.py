"""The search: tries proposed designs, and tests the best ones in new environments.

With the objective ``built``, each sample is simulated in a random reality of its own, so that rates are expected over
realities; the best designs are then tested in new realities, too.

Input: an experiment of a listing. Output: runs in the store with a sweep's keys, and a SearchResult. The best of many
designs was also lucky in the environments that chose it, so only runs in new environments give its rate without bias.
Stored runs are not simulated again, so that an interrupted search continues.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from foldcar.car.folded.weight import film_area_cm2
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import no_rate_text
from foldcar.statistics.words import design_text
from foldcar.store.writer import write_store
from foldcar.study.chunks import Simulators
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, ListedStudy
from foldcar.study.limits import MAX_SEED
from foldcar.study.plan import study_facts
from foldcar.study.random_realities import RandomRealities, study_over_realities
from foldcar.study.search.design_simulator import DesignSimulator, RunRow, Values, fresh_id, open_simulator
from foldcar.study.search.objectives import BUILT, OBJECTIVES, Objective
from foldcar.study.search.proposals import Proposals, Tried

# Number of batches of a design's environments; pruning is checked after each.
BATCHES = 10
# Flipping this bit of the seed gives new environments, by which no design is chosen.
FRESH_BIT = 1 << 40


@dataclass(frozen=True)
class Plan:
    """The settings of a search with at most ``designs`` designs.

    The ``best`` designs are tested in ``fresh`` new environments.
    """

    objectives: tuple[Objective, ...]
    designs: int
    best: int = 3
    fresh: int = 200

    @property
    def prunes(self) -> bool:
        """Whether designs that are probably worse than the best are stopped early: only one objective has an order."""
        return len(self.objectives) == 1

    @property
    def over_realities(self) -> bool:
        """Whether each sample is simulated in a random reality of its own: for all objectives or for none."""
        return any(objective.name == BUILT for objective in self.objectives)


@dataclass(frozen=True)
class Judged:
    """One of the best designs: the objectives' values that chose it, and ``fresh`` ones with 95 % ``intervals``.

    Fresh values are from new environments; None if every run was rejected. A value that depends on the design only has
    no interval.
    """

    design: Mapping[str, float]
    chosen_by: tuple[float, ...]
    fresh: tuple[float | None, ...]
    intervals: tuple[tuple[float, float] | None, ...]


@dataclass
class SearchResult:
    """The counts and the result of a search.

    ``runs`` counts runs of tried designs, ``new`` all simulated runs. ``exhausted`` is whether every design was tried.
    ``unbuildable`` has the reasons by design.
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


def searched_study(study: ListedStudy, plan: Plan) -> ListedStudy:
    """Return the study with its only experiment, and the same experiment with the plan's new samples and built cars.

    Raises FoldcarError if the study has several experiments.
    """
    if len(study.experiments) > 1:
        names = ", ".join(experiment.id for experiment in study.experiments)
        raise FoldcarError(f"{study.listing_name}: experiments: has several; choose one with --experiment: {names}")
    (searched,) = (study_over_realities(study) if plan.over_realities else study).experiments
    fresh_experiment = replace(
        searched,
        id=fresh_id(searched.id),
        environments=plan.fresh,
        seed=(searched.seed ^ FRESH_BIT) & MAX_SEED,
        variation_seed=(searched.variation_seed ^ FRESH_BIT) & MAX_SEED,
    )
    return replace(study, experiments=(searched, fresh_experiment))


def search(
    study: ListedStudy,
    plan: Plan,
    store: Path,
    carsim: Carsim,
    simulators: Simulators | int,
    command: str,
    result: SearchResult,
    report: Callable[[SearchResult], None] = lambda result: None,
) -> None:
    """Search the family of the first experiment of :func:`searched_study`; the second has the new environments.

    ``result`` is updated, and ``report`` called, after every step. Raises FoldcarError.
    """
    experiment, fresh = study.experiments
    environment_of = RandomRealities if plan.over_realities else ExperimentEnvironment
    environment = environment_of(experiment)
    _check(experiment, environment, plan)
    names = [objective.name for objective in plan.objectives]

    def simulated(runs: int) -> None:
        result.new += runs
        report(result)

    with write_store(store) as writer:
        writer.begin_study(study_facts(study, carsim, command), carsim.build)
        proposals = Proposals(experiment.family, plan.objectives)
        with open_simulator(experiment, environment, writer, carsim, simulators, simulated, names) as simulator:
            _try_designs(experiment, plan, proposals, simulator, result, report)
            simulator.finish(list(proposals.unbuildable))
        best = proposals.best(plan.best)
        with open_simulator(fresh, environment_of(fresh), writer, carsim, simulators, simulated, ()) as simulator:
            for tried in best:
                rows = _counted(simulator.rows(tried.values, range(plan.fresh)))
                result.best.append(_judged(experiment, plan, tried, rows))
                report(result)
    for values, reason in proposals.unbuildable.items():
        columns = dict(zip(experiment.family.columns(), values, strict=True))
        result.unbuildable[design_text({name: columns[name] for name in experiment.family.varied})] = reason


def _try_designs(
    experiment: Experiment,
    plan: Plan,
    proposals: Proposals,
    simulator: DesignSimulator,
    result: SearchResult,
    report: Callable[[SearchResult], None],
) -> None:
    """Try proposed designs, batch by batch of their environments, until a limit of the plan is reached."""
    first = plan.objectives[0]
    while result.designs < plan.designs:
        values = proposals.next()
        if values is None:
            result.exhausted = True
            return
        all_rows: list[RunRow] = []
        pruned = False
        for batch in batches(experiment.environments):
            all_rows += simulator.rows(values, batch)
            pruned = (
                plan.prunes
                and len(all_rows) < experiment.environments
                and proposals.is_worse(all_rows, experiment.timeout_s)
            )
            if pruned:
                break
        result.runs += len(all_rows)
        rows = _counted(all_rows)
        if not rows:
            proposals.refuse(no_rate_text(len(all_rows)))
            continue
        mean_time_s = _value(OBJECTIVES["time"], experiment, values, rows)
        values_of_objectives = [_value(objective, experiment, values, rows) for objective in plan.objectives]
        proposals.tell(values_of_objectives, all_rows, pruned, mean_time_s)
        result.designs += 1
        result.pruned += pruned
        if not pruned:
            better = max if first.largest else min
            result.best_so_far = (
                values_of_objectives[0]
                if result.best_so_far is None
                else better(result.best_so_far, values_of_objectives[0])
            )
        report(result)


def _value(objective: Objective, experiment: Experiment, values: Values, rows: Sequence[RunRow]) -> float:
    """Return a design's objective, by its results or, for the area of its sheets, by its pieces."""
    if objective.value is None:
        return film_area_cm2(folded_car(experiment.family.design(values)))
    return objective.value(rows, experiment.timeout_s)


def _judged(experiment: Experiment, plan: Plan, tried: Tried, rows: Sequence[RunRow]) -> Judged:
    """Return a design with its objectives in the environments that chose it, and in new ones, which gave ``rows``."""
    # None stands for an objective that is unknown because all runs were rejected.
    objectives = [objective if rows or objective.value is None else None for objective in plan.objectives]
    return Judged(
        design=experiment.family.design(tried.values).columns,
        chosen_by=tried.objectives,
        fresh=tuple(
            None if objective is None else _value(objective, experiment, tried.values, rows) for objective in objectives
        ),
        intervals=tuple(
            None if objective is None or objective.interval is None else objective.interval(rows, experiment.timeout_s)
            for objective in objectives
        ),
    )


def _counted(rows: Sequence[RunRow]) -> list[RunRow]:
    """Return the rows without rejected runs."""
    return [row for row in rows if row.passed is not None]


def batches(environments: int) -> list[range]:
    """Return the samples of each batch; pruning is checked between batches."""
    size = math.ceil(environments / BATCHES)
    return [range(first, min(first + size, environments)) for first in range(0, environments, size)]


def _check(experiment: Experiment, environment: ExperimentEnvironment, plan: Plan) -> None:
    """Raise FoldcarError if the plan cannot be carried out for the experiment."""
    if all(objective.value is None for objective in plan.objectives):
        raise FoldcarError(f"--objective sheet-area: needs no simulation; add an objective such as {BUILT}")
    if {BUILT, "success"} <= {objective.name for objective in plan.objectives}:
        raise FoldcarError(
            f"--objective: {BUILT} and success cannot be combined: one is over realities, one in nominal simulation; "
            "choose one"
        )
    if experiment.condition is not None:
        raise FoldcarError(
            f"{experiment.place}: environment {experiment.environment} has a condition, which new samples cannot have"
        )
    if not environment.success.defined:
        raise FoldcarError(f"{experiment.place}: {environment.success.text}")
