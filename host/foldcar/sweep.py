"""A sweep: every design of every experiment in every environment, into the store; nothing is run twice.

Input: a study, a store's path, a simulator. Output: rows in the store and their counts. Runs go sample by
sample, all designs in one before the next, so that what is known early covers the whole family. The calling
thread alone samples, plans and writes; workers only wait for simulator processes.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar import __version__
from foldcar.body import body_json
from foldcar.carsim import Carsim
from foldcar.chunks import ChunkPool, Finished
from foldcar.controller import TableRow
from foldcar.experiments import Experiment, Study
from foldcar.fingerprint import environment_fingerprint, scenic_version
from foldcar.store_writer import PlannedDesign, PlannedExperiment, StoreWriter, write_store


@dataclass
class Progress:
    """Counts of a sweep as it goes; ``done`` runs are in the store or await the result of an equal one."""

    total: int
    new: int = 0
    there: int = 0
    passed: int = 0
    started_s: float = field(default_factory=time.perf_counter)

    @property
    def done(self) -> int:
        """Runs that need no more work."""
        return self.new + self.there

    @property
    def seconds(self) -> float:
        """Time since the sweep began."""
        return time.perf_counter() - self.started_s


class Environment:
    """The scenes of one experiment, compiled only if one is missing."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self._source: Any = None

    def open(self) -> None:
        """Compile the program; FoldcarError if it cannot be."""
        from foldcar.scenes import open_environment

        if self._source is None:
            e = self._experiment
            self._source = open_environment(e.program, dict(e.scenic_params), e.seed)

    def sample(self, k: int) -> dict[str, Any]:
        """Sample ``k`` as a scene object of docs/carsim.md without its id."""
        self.open()
        scene: dict[str, Any] = self._source.sample(k)
        return scene


def sweep(
    study: Study,
    store: Path,
    carsim: Carsim,
    jobs: int,
    command: str,
    report: Callable[[Progress], None] = lambda progress: None,
    progress: Progress | None = None,
) -> Progress:
    """Run what is missing; ``report`` is called after every step. ``progress``, if given, is counted in.

    Nothing is created on disk before every design and, for a new store, every environment has been checked.
    """
    table = carsim.parameter_table()
    counts = progress if progress is not None else Progress(total=planned_total(study))
    for experiment in study.experiments:
        for _ in _designs(experiment, table):
            pass
    environments = [Environment(experiment) for experiment in study.experiments]
    if not store.exists():
        for environment in environments:
            environment.sample(0)
    with write_store(store) as writer:
        writer.begin_study(_facts(study, carsim, command), carsim.build)
        plans = [_plan(experiment, writer, table) for experiment in study.experiments]
        with ChunkPool(carsim, writer, jobs) as pool:
            for plan, environment in zip(plans, environments, strict=True):
                for finished in _run_experiment(plan, environment, writer, pool, counts, report):
                    _keep(finished, writer, counts, report)
            for finished in pool.finish():
                _keep(finished, writer, counts, report)
    return counts


def planned_total(study: Study) -> int:
    """Runs the study consists of, stored or not."""
    return sum(len(experiment.family) * experiment.environments for experiment in study.experiments)


def _run_experiment(
    plan: PlannedExperiment,
    environment: Environment,
    writer: StoreWriter,
    pool: ChunkPool,
    counts: Progress,
    report: Callable[[Progress], None],
) -> Iterator[Finished]:
    stored_samples = writer.sample_count(plan.environment_id)
    for sample in range(plan.environments):
        if sample >= stored_samples:
            writer.put_sample(plan.environment_id, sample, environment.sample(sample))
        for run in writer.planned_runs(plan, sample):
            if run.outcome is not None or pool.knows(run):
                counts.there += 1
                counts.passed += run.outcome == "passed"
                continue
            yield from pool.add(run, counts.total - counts.done)
        report(counts)


def _keep(
    finished: Finished, writer: StoreWriter, counts: Progress, report: Callable[[Progress], None]
) -> None:
    writer.add_results(finished)
    counts.new += len(finished)
    counts.passed += sum(result["outcome"] == "passed" for _, result in finished)
    report(counts)


def _plan(experiment: Experiment, writer: StoreWriter, table: dict[str, TableRow]) -> PlannedExperiment:
    fingerprint = environment_fingerprint(experiment.program, experiment.scenic_params, experiment.seed)
    first = next(iter(experiment.family))
    varied = experiment.family.varied
    plan = PlannedExperiment(
        id=experiment.id,
        vehicle=experiment.family.vehicle,
        environment=experiment.environment,
        environment_id=writer.environment(fingerprint),
        environments=experiment.environments,
        facts={
            "vehicle_type": experiment.family.type,
            "varied": varied,
            "fixed": {column: value for column, value in first.columns.items() if column not in varied},
            "timeout_s": experiment.timeout_s,
            "speed_m_s": experiment.speed_m_s,
            "yaw_rate_rad_s": experiment.yaw_rate_rad_s,
            "scenic_program": experiment.program_name,
            "scenic_params": dict(experiment.scenic_params),
            "seed": experiment.seed,
        },
    )
    writer.put_experiment(plan, _designs(experiment, table))
    return plan


def _designs(experiment: Experiment, table: dict[str, TableRow]) -> Iterator[PlannedDesign]:
    for design in experiment.family:
        body = body_json(design)
        yield PlannedDesign(design.columns, body, experiment.settings(design, body, table))


def _facts(study: Study, carsim: Carsim, command: str) -> dict[str, str]:
    return {
        "foldcar_version": __version__,
        "scenic_version": scenic_version(),
        "carsim_build": carsim.build,
        "listing_name": study.listing_name,
        "listing_text": study.listing_text,
        "command": command,
        "created_utc": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }
