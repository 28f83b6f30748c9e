"""Simulates a sweep: every design of every experiment in every environment, and runs in other realities.

Runs that the store has are not simulated again.

Input: a study, a store's path, a simulator. Output: rows in the store and their counts. Only the calling thread samples,
plans and writes; other threads wait for simulator processes. Scenic runs beside the simulation of dynamic programs; all
others run in carsim's batch.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.fingerprint import scenic_version
from foldcar.scenes.success import SuccessRule
from foldcar.shown_text import decoded
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ENGINES, SIDE_VIEW
from foldcar.simulation.results import outcome_of
from foldcar.statistics.stopping import StoppingRule
from foldcar.statistics.words import count
from foldcar.store.info import unlike_sides_text
from foldcar.store.writer import PlannedExperiment, PlannedRun, StoreWriter, write_store
from foldcar.study.chunks import FinishedRun, Simulators, planned_pool
from foldcar.study.environments import Environment
from foldcar.study.experiment_runs import ExperimentRuns, Progress, StoredSamples
from foldcar.study.experiments import Experiment, Study
from foldcar.study.planned_designs import PlannedDesigns, planned_designs
from foldcar.study.reality_draws import MAX_SCENES
from foldcar.study.reality_runs import (
    RealityCounts,
    RealitySimulation,
    next_number,
    reality_facts,
    reality_spread,
    why_no_realities,
)
from foldcar.study.side_view_check import side_view_limits
from foldcar.study.stopping import design_states
from foldcar.version import __version__

# Number of unbuildable cars that are announced by name.
SHOWN_SKIPPED = 5


@dataclass(frozen=True)
class Sweep:
    """A planned sweep: ``carsim`` simulates the runs of ``study`` that ``store`` lacks.

    The store records ``command`` as its origin. ``environment_of`` creates an experiment's environment; a reality
    has its own. ``until`` has the stopping rules by experiment. ``realities`` is the number of each experiment's runs in
    other realities; None lets the error decide with which the success rate is learned from them.
    """

    study: Study
    store: Path
    carsim: Carsim
    command: str
    environment_of: Callable[[Experiment], Environment] = Environment
    until: Mapping[str, StoppingRule] = field(default_factory=dict)
    realities: int | None = None

    @cached_property
    def environments(self) -> list[Environment]:
        """The environments of the study's experiments, in their order."""
        return [self.environment_of(experiment) for experiment in self.study.experiments]

    @cached_property
    def designs(self) -> dict[str, PlannedDesigns]:
        """The checked designs of every experiment by its id. Raises FoldcarError."""
        return planned_designs(self.study, self.store, self.carsim.parameter_table())

    @cached_property
    def progress(self) -> Progress:
        """The counts of runs; ``total`` includes runs that are already stored."""
        return Progress(
            total=sum(len(self.designs[experiment.id]) * experiment.environments for experiment in self.study.experiments)
        )

    def run(
        self,
        simulators: Simulators | int,
        report: Callable[[Progress], None] = lambda progress: None,
        announce: Callable[[str], None] = lambda line: None,
    ) -> Progress:
        """Simulate the missing runs on ``simulators``: an object, or the number of simulators on this machine.

        ``report`` is called after every step. ``announce`` is called before the first run with lines about the sweep.
        Nothing is written before every design and, for a new store, every environment has been checked. Raises
        FoldcarError.
        """
        counts, carsim = self.progress, self.carsim
        planned = list(zip(self.study.experiments, self.environments, strict=True))
        if not self.store.exists():
            for environment in self.environments:
                environment.sample(0)
        if self.until:
            self._check_success()
        side_view_texts = {}
        if carsim.engine == ENGINES[SIDE_VIEW].title:
            side_view_texts = {
                experiment.id: side_view_limits(carsim, experiment, environment) for experiment, environment in planned
            }
        with write_store(self.store) as writer:
            writer.begin_study(study_facts(self.study, carsim, self.command), carsim.build)
            plans = [
                plan_experiment(
                    experiment, environment, writer, self.designs[experiment.id], self.until.get(experiment.id),
                    carsim.engine, unlike=side_view_texts.get(experiment.id, ""), realities=self.realities,
                )
                for experiment, environment in planned
            ]  # fmt: skip
            for line in self._announced(plans, side_view_texts):
                announce(line)
            counts.judged = sum(
                len(self.designs[plan.id]) * plan.environments for plan in plans if plan.facts["success_defined"]
            )
            # One pool for all experiments, so that simulators stay busy from one experiment to the next.
            with planned_pool(writer, simulators) as pool:
                for (experiment, environment), plan in zip(planned, plans, strict=True):
                    dynamic = writer.is_dynamic(plan.environment_id, partial(getattr, environment, "dynamic"))
                    rule, earlier_rejected = self.until.get(plan.id), counts.rejected
                    with environment.runner(carsim, dynamic) as runner, pool.using(runner):
                        runs = ExperimentRuns(
                            plan, len(self.designs[plan.id]), environment, dynamic, writer, pool, counts, report
                        )
                        for finished in runs.all() if rule is None else runs.until(rule):
                            self._keep(finished, writer, report)
                        if rule is not None:
                            counts.states += design_states(experiment, rule, writer.design_counts(plan.id))
                        if runner is not carsim:
                            # This runner is closed at the end of its experiment, so its chunks must finish first.
                            for finished in pool.finish():
                                self._keep(finished, writer, report)
                    # Only dynamic programs reject runs, and all runs of those are finished here.
                    if plan.facts["success_defined"]:
                        counts.judged -= counts.rejected - earlier_rejected
                for finished in pool.finish():
                    self._keep(finished, writer, report)
            counts.ended_s = time.perf_counter()
            for (experiment, environment), plan in zip(planned, plans, strict=True):
                self._simulate_realities(experiment, environment, plan, writer, simulators, report)
        if self.until:
            counts.judged = counts.total - counts.rejected
        return counts

    def _check_success(self) -> None:
        """Raise FoldcarError if an experiment does not define when a run has passed."""
        for experiment, environment in zip(self.study.experiments, self.environments, strict=True):
            if not environment.success.defined:
                raise FoldcarError(
                    f"{experiment.place}: --until needs a definition of success: {environment.success.text}"
                )

    def _announced(self, plans: Sequence[PlannedExperiment], side_view_texts: Mapping[str, str]) -> Iterator[str]:
        """Yield lines about the sweep: rules of success with their experiments, engine notes, and skipped cars."""
        experiments: dict[str, list[str]] = {}
        for plan in plans:
            experiments.setdefault(plan.facts["success_rule"], []).append(plan.id)
        for rule, names in experiments.items():
            yield f"experiment{'s' if len(names) > 1 else ''} {', '.join(names)}: {rule}"
        for experiment, environment in zip(self.study.experiments, self.environments, strict=True):
            for text in environment.notes():
                yield f"experiment {experiment.id}: sample 0: {text}"
        for name, text in side_view_texts.items():
            if text:
                yield f"experiment {name}: {unlike_sides_text(text)}"
        for experiment in self.study.experiments:
            skipped = experiment.family.skipped
            if skipped:
                number = len(experiment.family) + len(skipped)
                are = "is" if len(skipped) == 1 else "are"
                start = f"experiment {experiment.id}: {len(skipped)} of {count(number, 'car')}"
                yield f"{start} cannot be built and {are} skipped:"
                yield from (f"  {car}" for car in skipped[:SHOWN_SKIPPED])
            if len(skipped) > SHOWN_SKIPPED:
                yield f"  and {len(skipped) - SHOWN_SKIPPED} more, which `foldcar sweep --dry-run` lists"

    def _simulate_realities(
        self,
        experiment: Experiment,
        environment: Environment,
        plan: PlannedExperiment,
        writer: StoreWriter,
        simulators: Simulators | int,
        report: Callable[[Progress], None],
    ) -> None:
        """Simulate an experiment's runs in other realities: as many as planned, or as its learning needs."""
        counts = RealityCounts(left_out=plan.facts.get("no_realities", ""))
        self.progress.realities[plan.id] = counts
        number: int | None = plan.facts.get("realities")
        if number is None:
            return
        writer.spread(plan.facts["reality_spread"])
        # With a stopping rule, fewer samples may be stored.
        StoredSamples(environment, writer, dynamic=False).reach(min(plan.environments, MAX_SCENES) - 1)
        with environment.runner(self.carsim, dynamic=False) as runner:
            simulation = RealitySimulation(experiment, writer, simulators, runner, counts, lambda: report(self.progress))
            while number is not None:
                # Stored first, so that an interrupted sweep is known to be unfinished.
                writer.update_facts(plan.id, realities=number)
                simulation.simulate(number)
                counts.error = simulation.error()
                number = next_number(number, counts.error) if self.realities is None else None

    def _keep(
        self, finished: list[FinishedRun[PlannedRun]], writer: StoreWriter, report: Callable[[Progress], None]
    ) -> None:
        """Store a finished chunk, count its outcomes and report the progress."""
        writer.add_results((run.run, run.answer) for run in finished)
        self.progress.new += len(finished)
        for run in finished:
            self.progress.count(outcome_of(run.answer), run.count)
        report(self.progress)


def plan_experiment(
    experiment: Experiment,
    environment: Environment,
    writer: StoreWriter,
    designs: PlannedDesigns,
    rule: StoppingRule | None = None,
    engine: str = "",
    searched: Sequence[str] | None = None,
    unlike: str = "",
    realities: int | None = None,
) -> PlannedExperiment:
    """Store an experiment and its family's designs, replacing an earlier one of that id. Raises FoldcarError.

    ``rule`` is its stopping rule, ``engine`` the engine's name. ``searched`` are the objectives of a search, empty in its
    new environments, None without a search. ``unlike`` says what the side view cannot simulate. In ExperimentInfo these
    are ``until``, ``engine``, ``objectives`` and ``unlike_sides``. ``realities`` is as in Sweep.
    """
    first_design = next(iter(experiment.family))
    varied = experiment.family.varied
    environment.recall(writer.program_files(experiment.id), writer.knows_environment)
    environment_id = writer.environment(environment.fingerprint)
    # Use facts that an earlier sweep has stored, so that the program need not be compiled.
    program_facts = writer.environment_facts(environment_id)
    if "terrain_objects" not in program_facts:
        success, objects = environment.success, environment.terrain_objects
        program_facts = {"success_rule": success.text, "success_defined": success.defined, "terrain_objects": objects}
    plan = PlannedExperiment(
        id=experiment.id,
        vehicle=experiment.family.vehicle,
        environment=experiment.environment,
        environment_id=environment_id,
        spread_id=writer.spread(environment.spread_fingerprint),
        environments=experiment.environments,
        facts={
            "vehicle_type": experiment.family.vehicle_type,
            "varied": varied,
            "fixed": {column: value for column, value in first_design.columns.items() if column not in varied},
            "timeout_s": experiment.timeout_s,
            "speed_m_s": experiment.speed_m_s,
            "yaw_rate_rad_s": experiment.yaw_rate_rad_s,
            "scenic_program": experiment.program_name,
            "scenic_params": dict(experiment.scenic_params),
            "seed": experiment.seed,
            "condition": experiment.condition,
            "variation": dict(experiment.variation),
            "variation_seed": experiment.variation_seed,
            "skipped": experiment.family.skipped,
            **{name: program_facts[name] for name in ("success_rule", "success_defined", "terrain_objects")},
            "reality": environment.reality,
            **({"listed_environment": environment.listed_fingerprint} if environment.reality else {}),
            "thresholds": experiment.thresholds,
            **_reality_facts(experiment, environment, writer, program_facts, searched, realities),
            **({} if rule is None else {"until": asdict(rule)}),
            **({"searched": True, "objectives": list(searched)} if searched else {}),
            **({"engine": engine} if engine else {}),
            **({"unlike_sides": unlike} if unlike else {}),
            # Absolute paths may differ on other machines, so files are stored only if all paths are relative.
            **({} if any(Path(name).is_absolute() for name in environment.files) else {"files": dict(environment.files)}),
        },
    )
    # A search adds designs later.
    writer.put_experiment(plan, designs, None if searched else designs.fingerprint)
    return plan


def _reality_facts(
    experiment: Experiment,
    environment: Environment,
    writer: StoreWriter,
    program_facts: Mapping[str, Any],
    searched: Sequence[str] | None,
    requested: int | None,
) -> dict[str, Any]:
    """Return the facts of an experiment on its runs in other realities. ``requested`` is as in Sweep.realities."""
    stored = writer.experiment_facts(experiment.id)
    if searched is not None:
        # A search simulates no other realities, and keeps those of an earlier sweep.
        if stored.get("reality_spread") == reality_spread(experiment):
            return {"realities": stored["realities"], "reality_spread": stored["reality_spread"]}
        return {"no_realities": "a search chose the designs; `foldcar sweep` simulates them in other realities"}
    dynamic = writer.is_dynamic(writer.environment(environment.fingerprint), lambda: environment.dynamic)
    success = SuccessRule(defined=program_facts["success_defined"], text=program_facts["success_rule"])
    reason = why_no_realities(experiment, environment, requested, dynamic, success)
    return {"no_realities": reason} if reason else reality_facts(experiment, requested, stored)


def study_facts(study: Study, carsim: Carsim, command: str) -> dict[str, str]:
    """Return the facts that a store keeps of a sweep: versions, listing, command, time."""
    return {
        "foldcar_version": __version__,
        "scenic_version": scenic_version(),
        "carsim_build": carsim.build,
        "listing_name": decoded(study.listing_name),
        "listing_text": study.listing_text,
        "command": decoded(command),
        "created_utc": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
