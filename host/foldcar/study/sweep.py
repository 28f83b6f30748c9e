"""Simulates a sweep: every design of every experiment in every environment, and then runs in other realities.

Input: a study, a store's path, a simulator. Output: rows in the store, and counts. Runs that the store has are not
simulated again. Only the calling thread samples scenes, plans runs and writes; other threads wait for simulators.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ENGINES, SIDE_VIEW
from foldcar.simulation.results import outcome_of
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.writer import PlannedExperiment, PlannedRun, StoreWriter, write_store
from foldcar.study import announcement
from foldcar.study.chunks import ChunkPool, FinishedRun, Simulators, planned_pool
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiment_runs import ExperimentRuns, Progress, StoredSamples
from foldcar.study.experiments import Experiment, ListedStudy
from foldcar.study.plan import SweepOptions, plan_experiment, study_facts
from foldcar.study.planned_designs import PlannedDesigns, planned_designs
from foldcar.study.reality_draws import MAX_SCENES
from foldcar.study.reality_runs import RealityCounts, RealitySimulation, next_number
from foldcar.study.side_view_check import side_view_limits
from foldcar.study.stopping import design_states


@dataclass(frozen=True)
class Sweep:
    """A sweep that is planned: ``carsim`` will simulate the runs of ``study`` that ``store`` lacks.

    The store keeps ``command`` as the origin of its runs. ``environment_of`` creates the environment of an experiment;
    another function of this kind simulates in another reality. ``until`` has stopping rules by the experiment's id.
    ``realities`` is the number of runs in other realities for each experiment; None lets their error decide.
    """

    study: ListedStudy
    store: Path
    carsim: Carsim
    command: str
    environment_of: Callable[[Experiment], ExperimentEnvironment] = ExperimentEnvironment
    until: Mapping[str, StoppingRule] = field(default_factory=dict)
    realities: int | None = None

    @cached_property
    def environments(self) -> list[ExperimentEnvironment]:
        """The environments of the study's experiments, in their order."""
        return [self.environment_of(experiment) for experiment in self.study.experiments]

    @cached_property
    def designs(self) -> dict[str, PlannedDesigns]:
        """The checked designs of every experiment, by its id. Raises FoldcarError."""
        return planned_designs(self.study, self.store, self.carsim.parameter_table())

    @cached_property
    def progress(self) -> Progress:
        """The counts of runs; ``total`` includes runs that are already stored."""
        total = 0
        for experiment in self.study.experiments:
            total += len(self.designs[experiment.id]) * experiment.environments
        return Progress(total=total)

    def run(
        self,
        simulators: Simulators | int,
        report: Callable[[Progress], None] = lambda progress: None,
        announce: Callable[[str], None] = lambda line: None,
    ) -> Progress:
        """Simulate the runs that the store lacks. Return the counts, which grow while the sweep runs.

        ``simulators`` is an object, or the number of simulators on this machine. ``announce`` is called with lines about
        the sweep before its first run, and ``report`` with the counts after every step. Raises FoldcarError. If a design
        cannot be built or a new environment's program has an error, this happens before anything is written.
        """
        # This is slow, because only designs that can be built have runs. To find them, all designs are folded.
        counts = self.progress
        self._check_environments()
        limits_by_experiment = self._side_view_limits()
        with write_store(self.store) as writer:
            writer.begin_study(study_facts(self.study, self.carsim, self.command), self.carsim.build)
            experiments = [
                self._store_plan(experiment, environment, writer, limits_by_experiment.get(experiment.id, ""))
                for experiment, environment in zip(self.study.experiments, self.environments, strict=True)
            ]
            for line in self._announcement(experiments, limits_by_experiment):
                announce(line)
            simulation = _Simulation(self, writer, simulators, report)
            simulation.simulate_study(experiments)
            for experiment in experiments:
                simulation.simulate_realities(experiment)
        return counts

    def _check_environments(self) -> None:
        """Raise FoldcarError if a program has an error, or defines no success although a stopping rule needs it."""
        if not self.store.exists():
            # Sample each program once, so that no store is created if one of them has an error.
            for environment in self.environments:
                environment.sample(0)
        if self.until:
            for experiment, environment in zip(self.study.experiments, self.environments, strict=True):
                if not environment.success.defined:
                    reason = environment.success.text
                    raise FoldcarError(f"{experiment.place}: --until needs a definition of success: {reason}")

    def _side_view_limits(self) -> dict[str, str]:
        """Return for each experiment, by its id, a text about what the side view cannot simulate in it.

        Only the side view, which simulates a car in a plane, has such limits. For other engines the result is empty.
        """
        if self.carsim.engine != ENGINES[SIDE_VIEW].title:
            return {}
        return {
            experiment.id: side_view_limits(self.carsim, experiment, environment)
            for experiment, environment in zip(self.study.experiments, self.environments, strict=True)
        }

    def _store_plan(
        self, experiment: Experiment, environment: ExperimentEnvironment, writer: StoreWriter, limits: str
    ) -> "_SweptExperiment":
        """Store the plan of an experiment and its designs, before any run. Raises FoldcarError.

        ``limits`` says what the engine cannot simulate.
        """
        rule = self.until.get(experiment.id)
        designs = self.designs[experiment.id]
        options = SweepOptions(self.carsim.engine, limits, rule, self.realities)
        plan = plan_experiment(experiment, environment, writer, designs, options)
        return _SweptExperiment(experiment, environment, plan, len(designs), rule)

    def _announcement(
        self, experiments: Sequence["_SweptExperiment"], limits_by_experiment: Mapping[str, str]
    ) -> Iterator[str]:
        """Yield what a person should know before the first run."""
        yield from announcement.success_lines([experiment.plan for experiment in experiments])
        for experiment in experiments:
            yield from announcement.environment_lines(experiment.experiment, experiment.environment)
        yield from announcement.engine_lines(limits_by_experiment)
        for experiment in experiments:
            yield from announcement.skipped_lines(experiment.experiment)


@dataclass(frozen=True)
class _SweptExperiment:
    """An experiment of a sweep, where its cars drive, and how the store knows it.

    ``design_count`` is the number of its designs; ``rule`` stops them early, None for all planned runs.
    """

    experiment: Experiment
    environment: ExperimentEnvironment
    plan: PlannedExperiment
    design_count: int
    rule: StoppingRule | None


@dataclass(frozen=True)
class _Simulation:
    """Simulates the experiments of a sweep, whose store is open as ``writer``, and counts their runs."""

    sweep: Sweep
    writer: StoreWriter
    simulators: Simulators | int
    report: Callable[[Progress], None]

    @property
    def counts(self) -> Progress:
        """The counts of the sweep."""
        return self.sweep.progress

    def simulate_study(self, experiments: Sequence[_SweptExperiment]) -> None:
        """Simulate all nominal runs, which are those with the values of the listing."""
        counts = self.counts
        # A run is judged, as passed or not passed, if its environment defines success and if it is not rejected. How many
        # will be rejected is not known yet.
        for experiment in experiments:
            if experiment.plan.facts["success_defined"]:
                counts.judged += experiment.design_count * experiment.plan.environments
        # One pool for all experiments, so that simulators stay busy from one experiment to the next.
        with planned_pool(self.writer, self.simulators) as pool:
            for experiment in experiments:
                rejected_before = counts.rejected
                self._simulate_experiment(experiment, pool)
                # Only a program that runs during the simulation rejects runs. All runs of such a program are finished at
                # this point.
                rejected_here = counts.rejected - rejected_before
                if experiment.plan.facts["success_defined"]:
                    counts.judged -= rejected_here
            self._finish(pool)
        counts.ended_s = time.perf_counter()
        if self.sweep.until:
            # A stopping rule has made fewer runs than were planned. It needs environments that define success, so all of
            # its runs that are not rejected are judged.
            counts.judged = counts.total - counts.rejected

    def _simulate_experiment(self, experiment: _SweptExperiment, pool: ChunkPool[PlannedRun]) -> None:
        """Give the runs of an experiment to the pool. The last of them may still be running when this returns."""
        environment, plan, rule, carsim = experiment.environment, experiment.plan, experiment.rule, self.sweep.carsim
        is_dynamic = self.writer.is_dynamic(plan.environment_id, lambda: environment.dynamic)
        with environment.runner(carsim, is_dynamic) as runner, pool.using(runner):
            runs = ExperimentRuns(
                plan, experiment.design_count, environment, is_dynamic, self.writer, pool, self.counts, self.report
            )
            chunks = runs.all() if rule is None else runs.until(rule)
            for finished in chunks:
                self._keep(finished)
            if rule is not None:
                design_counts = self.writer.design_counts(plan.id)
                self.counts.states += design_states(experiment.experiment, rule, design_counts)
            if runner is not carsim:
                # The runner of a dynamic program is closed at the end of the block, so its chunks must finish first.
                self._finish(pool)

    def simulate_realities(self, experiment: _SweptExperiment) -> None:
        """Simulate the runs of an experiment in other realities, from which foldcar learns how real cars may behave.

        If the user has asked for a number of runs, this is their number. Otherwise the number grows until the error of
        what is learned from them is small enough.
        """
        plan, environment, writer = experiment.plan, experiment.environment, self.writer
        counts = RealityCounts(left_out=plan.facts.get("no_realities", ""))
        self.counts.realities[plan.id] = counts
        number: int | None = plan.facts.get("realities")
        if number is None:
            return
        # Calling this makes sure that the store has a row for these realities, to which the runs refer.
        writer.spread(plan.facts["reality_spread"])
        # These runs need stored samples. A stopping rule may have left some of them out.
        StoredSamples(environment, writer, dynamic=False).store_up_to(min(plan.environments, MAX_SCENES) - 1)
        with environment.runner(self.sweep.carsim, dynamic=False) as runner:
            simulation = RealitySimulation(
                experiment.experiment, writer, self.simulators, runner, counts, lambda: self.report(self.counts)
            )
            while number is not None:
                # The number is stored first. So an interrupted sweep is known to be unfinished.
                writer.update_facts(plan.id, realities=number)
                simulation.simulate(number)
                counts.error = simulation.error()
                if self.sweep.realities is not None:
                    # The user has asked for this number.
                    return
                number = next_number(number, counts.error)

    def _finish(self, pool: ChunkPool[PlannedRun]) -> None:
        """Wait for all runs of the pool and store them."""
        for finished in pool.finish():
            self._keep(finished)

    def _keep(self, finished: list[FinishedRun[PlannedRun]]) -> None:
        """Store a finished chunk, count its outcomes and report the progress."""
        self.writer.add_results((run.run, run.answer) for run in finished)
        self.counts.new += len(finished)
        for run in finished:
            self.counts.count(outcome_of(run.answer), run.count)
        self.report(self.counts)
