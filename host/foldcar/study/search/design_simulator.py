"""Simulates designs of one experiment on demand, one by one, and stores the runs as a sweep does.

Runs have the same keys as a sweep's, so that a sweep and a search reuse each other's runs. The store keeps the
experiment's earlier designs and adds those that are tried.
"""

import contextlib
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
    _simulated: Callable[[int], None]
    _searched: Sequence[str]
    _plan: PlannedExperiment | None = None
    _positions: dict[Values, int] = field(default_factory=dict)

    def rows(self, values: Values, samples: Sequence[int]) -> list[RunRow]:
        """Return a buildable design's results in these samples, in order; simulate missing ones. Raises FoldcarError."""
        plan, position = self._plan_and_position(values)
        runs: list[PlannedRun] = []
        for index, sample in enumerate(samples):
            self._samples.reach(sample)
            (run,) = (run for run in self._writer.planned_runs(plan, sample) if run.design == position)
            runs.append(run)
            if run.outcome is None and not self._pool.joins(run):
                for finished in self._pool.add(run, runs_left=len(samples) - index):
                    self._keep(finished)
        for finished in self._pool.finish():
            self._keep(finished)
        results = [self._writer.result(run) for run in runs]
        return [RunRow(result["outcome"], result["elapsed_time_s"], result["consumed_energy_j"]) for result in results]

    def finish(self, skipped: Sequence[Values] = ()) -> None:
        """Store the designs in the family's order; ``skipped`` are designs that cannot be built."""
        if self._positions:
            self._store_experiment(sorted({*self._positions, *skipped}))

    def _plan_and_position(self, values: Values) -> tuple[PlannedExperiment, int]:
        """Return the stored experiment, and a design's position in it; a new design is added to the store."""
        if self._plan is None:
            self._store_experiment([*self._stored_designs(), values])
        assert self._plan is not None
        if values not in self._positions:
            design = self._experiment.family.design(values)
            self._positions[values] = len(self._positions)
            planned = planned_design(self._experiment, design, self._table)
            self._writer.add_design(self._experiment.id, self._positions[values], planned)
        return self._plan, self._positions[values]

    def _store_experiment(self, members: Sequence[Values]) -> None:
        """Store the experiment with these designs in this order, replacing its earlier designs."""
        family = self._experiment.family.only(dict.fromkeys(members))
        experiment = replace(self._experiment, family=family)
        designs = PlannedDesigns(experiment, self._table, None)
        self._plan = plan_experiment(experiment, self._environment, self._writer, designs, SearchOptions(self._searched))
        built = [values for values in dict.fromkeys(members) if family.error(values) is None]
        self._positions = {values: position for position, values in enumerate(built)}

    def _stored_designs(self) -> list[Values]:
        """Return the family's designs that an earlier sweep or search has stored in the experiment.

        The experiment keeps the larger number of environments.
        """
        environment_id = self._writer.environment(self._environment.fingerprint)
        spread_id = self._writer.spread(self._environment.spread_fingerprint)
        environments, designs = self._writer.swept(self._experiment.id, environment_id, spread_id)
        self._experiment = replace(self._experiment, environments=max(environments, self._experiment.environments))
        family = self._experiment.family
        # A stored design may lack a column of the family; with NaN for it, it is none of the family's designs.
        stored_values = [tuple(design.get(column, float("nan")) for column in family.columns()) for design in designs]
        return [values for values in stored_values if family.has(values)]

    def _keep(self, finished: list[FinishedRun[PlannedRun]]) -> None:
        """Store a finished chunk and report its number of runs."""
        self._writer.add_results((run.run, run.answer) for run in finished)
        self._simulated(len(finished))


@contextlib.contextmanager
def open_simulator(
    experiment: Experiment,
    environment: ExperimentEnvironment,
    writer: StoreWriter,
    carsim: Carsim,
    simulators: Simulators | int,
    simulated: Callable[[int], None],
    searched: Sequence[str],
) -> Iterator[DesignSimulator]:
    """Yield the DesignSimulator of an experiment in its ``environment``. Raises FoldcarError.

    ``simulated`` is called with numbers of new runs. ``searched`` names the objectives by which a search chooses designs
    from these runs; empty if it does not.
    """
    dynamic = writer.is_dynamic(writer.environment(environment.fingerprint), lambda: environment.dynamic)
    samples, table = StoredSamples(environment, writer, dynamic), carsim.parameter_table()
    with (
        planned_pool(writer, simulators) as pool,
        environment.runner(carsim, dynamic) as runner,
        pool.using(runner),
    ):
        yield DesignSimulator(experiment, environment, writer, pool, samples, table, simulated, searched)
