"""Simulates designs of one experiment on demand, one by one, and stores the runs as a sweep does.

Runs have the same keys as a sweep's, so that a sweep and a search reuse each other's runs. The store keeps the
experiment's earlier designs and adds those that are tried.
"""

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from foldcar.car.body import TableRow
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import has_passed
from foldcar.store.writer import PlannedExperiment, PlannedRun, StoreWriter
from foldcar.study.chunks import ChunkPool, FinishedRun, Simulators, planned_pool
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiment_runs import StoredSamples
from foldcar.study.experiments import Experiment
from foldcar.study.plan import SearchOptions, plan_experiment
from foldcar.study.planned_designs import PlannedDesigns, planned_design

# The values of a family's parameters, in the order of its choices.
Values = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RunRow:
    """The stored result of a run; a failed run has no numbers."""

    outcome: str
    elapsed_time_s: float | None
    consumed_energy_j: float | None

    @property
    def passed(self) -> bool | None:
        """Whether the run met its environment's definition of success; None if the run was rejected."""
        return has_passed(self.outcome)


def fresh_id(experiment: str) -> str:
    """Return the name in the store of a searched experiment in new environments."""
    return f"{experiment} fresh"


@dataclass
class DesignSimulator:
    """Simulates designs of one experiment in its environment. Create it with :func:`open_simulator`."""

    _experiment: Experiment
    _environment: ExperimentEnvironment
    _writer: StoreWriter
    _pool: ChunkPool[PlannedRun]
    _samples: StoredSamples
    _table: dict[str, TableRow]
    _report_runs: Callable[[int], None]
    _objectives: Sequence[str]
    _plan: PlannedExperiment | None = None
    _positions: dict[Values, int] = field(default_factory=dict)
    # Whether a sweep has made every run of every design, so that no run depends on what the search chooses.
    _is_swept: bool = False

    def rows(self, values: Values, samples: Sequence[int]) -> list[RunRow]:
        """Return the results of a design in these samples, in their order. Simulate those that are not stored.

        The design must be buildable. Raises FoldcarError if a simulator fails.
        """
        plan = self._plan_with(values)
        runs: list[PlannedRun] = []
        for index, sample in enumerate(samples):
            run = self._planned_run(plan, values, sample)
            runs.append(run)
            has_result = run.outcome is not None
            if has_result or self._pool.share_running(run):
                continue
            for finished in self._pool.add(run, runs_left=len(samples) - index):
                self._keep(finished)
        for finished in self._pool.finish():
            self._keep(finished)
        results = [self._writer.result(run) for run in runs]
        return [RunRow(result["outcome"], result["elapsed_time_s"], result["consumed_energy_j"]) for result in results]

    def _planned_run(self, plan: PlannedExperiment, values: Values, sample: int) -> PlannedRun:
        """Return the run of a design in a sample of the environment. Draw and store the sample first if necessary."""
        self._samples.store_up_to(sample)
        position = self._positions[values]
        for run in self._writer.planned_runs(plan, sample):
            if run.design == position:
                return run
        raise AssertionError("the plan has each of its designs in every sample")

    def finish(self, skipped: Sequence[Values] = ()) -> None:
        """Store the designs in the family's order; ``skipped`` are designs that cannot be built."""
        # The designs of a sweep are in this order already.
        if self._positions and not self._is_swept:
            self._store_experiment(sorted({*self._positions, *skipped}))

    def _plan_with(self, values: Values) -> PlannedExperiment:
        """Return the stored experiment. Add this design to its designs first if it is not among them."""
        if self._plan is None:
            self._plan = self._store_experiment([*self._adopt_stored_designs(), values])
        if values not in self._positions:
            position = len(self._positions)
            design = self._experiment.family.design(values)
            planned = planned_design(self._experiment, design, self._table)
            self._writer.add_design(self._experiment.id, position, planned)
            self._positions[values] = position
        return self._plan

    def _store_experiment(self, members: Sequence[Values]) -> PlannedExperiment:
        """Store the experiment with these designs, in this order, instead of its earlier designs. Return its plan.

        An experiment that was swept completely keeps all designs, and stays a sweep.
        """
        family = self._experiment.family
        objectives = self._objectives
        if self._is_swept:
            # A sweep chooses no design by objectives.
            objectives = ()
        else:
            distinct_members = dict.fromkeys(members)
            family = family.only(distinct_members)
        experiment = replace(self._experiment, family=family)
        designs = PlannedDesigns(experiment, self._table, None)
        options = SearchOptions(objectives)
        plan = plan_experiment(experiment, self._environment, self._writer, designs, options)
        buildable = [values for values in family.value_combinations() if family.error(values) is None]
        self._positions = {values: position for position, values in enumerate(buildable)}
        return plan

    def _adopt_stored_designs(self) -> list[Values]:
        """Return the family's designs that an earlier sweep or search has stored in the experiment.

        This also notes whether that was a complete sweep, which has all designs that can be built and all their runs.
        The stored experiment may have more environments than this one. Then the number of environments of this one is
        raised to that of the stored one.
        """
        environment_id = self._writer.environment(self._environment.fingerprint)
        spread_id = self._writer.spread(self._environment.spread_fingerprint)
        sweep = self._writer.last_sweep(self._experiment.id, environment_id, spread_id)
        if sweep is None:
            return []
        environments = max(sweep.environments, self._experiment.environments)
        self._experiment = replace(self._experiment, environments=environments)
        family = self._experiment.family
        designs: list[Values] = []
        for parameters in sweep.designs:
            # A design of an earlier family may lack a parameter. NaN equals none of the family's values.
            values = tuple(parameters.get(column, math.nan) for column in family.columns())
            if family.has(values):
                designs.append(values)
        facts = self._writer.experiment_facts(self._experiment.id)
        buildable_designs = family.combinations - len(facts["skipped"])
        # The stored designs are those of this family, neither fewer nor others.
        has_all_designs = len(designs) == buildable_designs and len(sweep.designs) == buildable_designs
        stored_runs = sum(self._writer.design_counts(self._experiment.id).runs)
        has_all_runs = stored_runs == len(designs) * environments
        self._is_swept = has_all_designs and has_all_runs and not facts.get("searched")
        return designs

    def _keep(self, finished: list[FinishedRun[PlannedRun]]) -> None:
        """Store the results of finished runs and report how many they are."""
        self._writer.add_results((run.run, run.answer) for run in finished)
        self._report_runs(len(finished))


@contextlib.contextmanager
def open_simulator(
    experiment: Experiment,
    environment: ExperimentEnvironment,
    writer: StoreWriter,
    carsim: Carsim,
    simulators: Simulators | int,
    report_runs: Callable[[int], None],
    objectives: Sequence[str],
) -> Iterator[DesignSimulator]:
    """Yield the DesignSimulator of an experiment in its ``environment``. Raises FoldcarError.

    After each finished chunk of runs, ``report_runs`` is called with the number of runs in the chunk. ``objectives`` are
    the names of what a search optimises, such as "success"; they are stored with the experiment. They are empty for runs
    that only test designs which were chosen before.
    """
    environment_id = writer.environment(environment.fingerprint)
    dynamic = writer.is_dynamic(environment_id, lambda: environment.dynamic)
    samples = StoredSamples(environment, writer, dynamic)
    table = carsim.parameter_table()
    with (
        planned_pool(writer, simulators) as pool,
        environment.runner(carsim, dynamic) as runner,
        pool.using(runner),
    ):
        yield DesignSimulator(experiment, environment, writer, pool, samples, table, report_runs, objectives)
