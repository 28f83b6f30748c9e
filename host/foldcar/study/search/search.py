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
# A seed with this bit flipped gives the new environments, by which no design is chosen.
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
    """One of the best designs, with its objectives in the environments of the search and in new environments.

    ``chosen_by`` are the objectives in the environments of the search; by them the design was chosen, so they flatter it.
    ``fresh`` are those in new environments, with their 95 % ``intervals``. A fresh value is None if every run was
    rejected. An objective that is computed from the design alone has no interval.
    """

    design: Mapping[str, float]
    chosen_by: tuple[float, ...]
    fresh: tuple[float | None, ...]
    intervals: tuple[tuple[float, float] | None, ...]


@dataclass
class SearchResult:
    """The counts and the result of a search.

    ``planned`` is the number of designs that the search may try, and ``designs`` how many it has tried. ``runs`` is the
    number of their runs, stored ones included, and ``new`` the number of runs that were simulated now. ``exhausted`` is
    whether every design of the family was tried. ``unbuildable`` has the reason for each design that cannot be built.
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
    """Return the study with two experiments: its own, and a copy of it with new environments and new built cars.

    The search chooses designs in the first and tests the best of them in the second. Raises FoldcarError if the study has
    several experiments.
    """
    if len(study.experiments) > 1:
        names = ", ".join(experiment.id for experiment in study.experiments)
        raise FoldcarError(f"{study.listing_name}: experiments: has several; choose one with --experiment: {names}")
    if plan.over_realities:
        study = study_over_realities(study)
    (searched,) = study.experiments
    fresh_experiment = replace(
        searched,
        id=fresh_id(searched.id),
        environments=plan.fresh,
        seed=_other_seed(searched.seed),
        variation_seed=_other_seed(searched.variation_seed),
    )
    return replace(study, experiments=(searched, fresh_experiment))


def _other_seed(seed: int) -> int:
    """Return another seed, which gives other environments and cars. Equal seeds give equal other seeds."""
    return (seed ^ FRESH_BIT) & MAX_SEED


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
    """Search a family for its best designs, and test these in new environments.

    ``study`` is that of :func:`searched_study`. After every step, ``result`` is updated and ``report`` is called with it.
    Raises FoldcarError.
    """
    experiment, fresh = study.experiments
    environment_of = RandomRealities if plan.over_realities else ExperimentEnvironment
    environment = environment_of(experiment)
    _check_plan(experiment, environment, plan)
    objectives = [objective.name for objective in plan.objectives]

    def report_runs(runs: int) -> None:
        """Count new runs and report them."""
        result.new += runs
        report(result)

    with write_store(store) as writer:
        writer.begin_study(study_facts(study, carsim, command), carsim.build)
        proposals = Proposals(experiment.family, plan.objectives)
        with open_simulator(experiment, environment, writer, carsim, simulators, report_runs, objectives) as simulator:
            _try_designs(experiment, plan, proposals, simulator, result, report)
            simulator.finish(list(proposals.unbuildable))
        best = proposals.best(plan.best)
        with open_simulator(fresh, environment_of(fresh), writer, carsim, simulators, report_runs, ()) as simulator:
            for tried in best:
                rows = _without_rejected(simulator.rows(tried.values, range(plan.fresh)))
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
    """Try proposed designs until the plan's number is reached or no design is left. Update ``result``.

    Each design is simulated batch by batch of the environments. It is pruned, which means stopped, after a batch that
    shows that it is probably worse than the best design so far.
    """
    while result.designs < plan.designs:
        values = proposals.next()
        if values is None:
            result.exhausted = True
            return
        all_rows: list[RunRow] = []
        pruned = False
        for batch in batches(experiment.environments):
            all_rows += simulator.rows(values, batch)
            if len(all_rows) < experiment.environments and plan.prunes:
                pruned = proposals.is_worse(all_rows, experiment.timeout_s)
            if pruned:
                break
        result.runs += len(all_rows)
        rows = _without_rejected(all_rows)
        if not rows:
            proposals.refuse(no_rate_text(len(all_rows)))
            continue
        mean_time_s = _value(OBJECTIVES["time"], experiment, values, rows)
        objectives = [_value(objective, experiment, values, rows) for objective in plan.objectives]
        proposals.tell(objectives, all_rows, pruned, mean_time_s)
        result.designs += 1
        if pruned:
            result.pruned += 1
        elif result.best_so_far is None:
            result.best_so_far = objectives[0]
        else:
            result.best_so_far = min(result.best_so_far, objectives[0], key=plan.objectives[0].loss)
        report(result)


def _value(objective: Objective, experiment: Experiment, values: Values, rows: Sequence[RunRow]) -> float:
    """Return the value of an objective for a design with these results, which must not be rejected runs."""
    if objective.value is None:
        # The area of the film is the only objective that follows from the design alone.
        return film_area_cm2(folded_car(experiment.family.design(values)))
    return objective.value(rows, experiment.timeout_s)


def _judged(experiment: Experiment, plan: Plan, tried: Tried, rows: Sequence[RunRow]) -> Judged:
    """Return one of the best designs with its objectives in the environments of the search and in new environments.

    ``rows`` are its results in the new environments, without rejected runs.
    """
    fresh: list[float | None] = []
    intervals: list[tuple[float, float] | None] = []
    for objective in plan.objectives:
        if objective.needs_runs and not rows:
            # All runs in new environments were rejected.
            fresh.append(None)
            intervals.append(None)
            continue
        fresh.append(_value(objective, experiment, tried.values, rows))
        intervals.append(objective.interval(rows, experiment.timeout_s) if objective.interval else None)
    return Judged(
        design=experiment.family.design(tried.values).columns,
        chosen_by=tried.objectives,
        fresh=tuple(fresh),
        intervals=tuple(intervals),
    )


def _without_rejected(rows: Sequence[RunRow]) -> list[RunRow]:
    """Return the results of the runs that were not rejected."""
    return [row for row in rows if row.passed is not None]


def batches(environments: int) -> list[range]:
    """Divide the samples of an experiment into BATCHES ranges of about equal size. Pruning is checked between them."""
    size = math.ceil(environments / BATCHES)
    return [range(first, min(first + size, environments)) for first in range(0, environments, size)]


def _check_plan(experiment: Experiment, environment: ExperimentEnvironment, plan: Plan) -> None:
    """Raise FoldcarError if the plan cannot be carried out for the experiment.

    The objective BUILT is the success rate of built cars. It is averaged over *realities*, possible values of the
    simulator's uncertain parameters. The objective success is that of *nominal* simulation, with a single value of each
    parameter.
    """
    names = [objective.name for objective in plan.objectives]
    if not any(objective.needs_runs for objective in plan.objectives):
        raise FoldcarError(f"--objective sheet-area: needs no simulation; add an objective such as {BUILT}")
    if BUILT in names and "success" in names:
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
