"""Gives the runs of one experiment that the store lacks to simulators, sample by sample.

Input: a planned experiment. Output: finished chunks, which the caller stores before it asks for the next. All designs are
simulated in a sample before the next sample begins, so that partial results cover the whole family.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from foldcar.simulation.results import REJECTED
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.tables import DRAW, SAMPLE
from foldcar.store.writer import PlannedExperiment, PlannedRun, StoreWriter, canonical_json
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import Environment
from foldcar.study.reality_runs import RealityCounts
from foldcar.study.stopping import DesignState, Schedule


@dataclass
class Progress:
    """Counts of a sweep's runs.

    ``new`` runs were simulated, ``reused`` ones were in the store or share the result of a run in progress; ``passed``,
    ``rejected`` and ``failed`` count both. ``judged`` of the ``total`` are in environments that define success; when an
    experiment ends, its rejected runs are subtracted. With a stopping rule, ``total`` decreases as designs are
    ``decided``, and ``states`` gets their results. ``realities`` counts runs in other realities by experiment;
    they are in no other count. They are simulated when all other runs have ended, at ``ended_s``.
    """

    total: int
    judged: int = 0
    new: int = 0
    reused: int = 0
    passed: int = 0
    rejected: int = 0
    failed: int = 0
    decided: int = 0
    states: list[DesignState] = field(default_factory=list)
    realities: dict[str, RealityCounts] = field(default_factory=dict)
    started_s: float = field(default_factory=time.perf_counter)
    ended_s: float | None = None

    @property
    def done(self) -> int:
        """The number of runs that are stored or share the result of a run in progress."""
        return self.new + self.reused

    @property
    def seconds(self) -> float:
        """Time of the runs, without those in other realities, since the start of the sweep (s)."""
        return (time.perf_counter() if self.ended_s is None else self.ended_s) - self.started_s

    def count(self, outcome: str | None, runs: int = 1) -> None:
        """Count ``runs`` runs of the study with that outcome."""
        self.passed += runs * (outcome == "passed")
        self.rejected += runs * (outcome == REJECTED)
        self.failed += runs * (outcome == "failed")


class StoredSamples:
    """Stores scenes and cars' variations of an environment's samples as they are needed.

    ``dynamic`` is whether the program runs beside the simulation.
    """

    def __init__(self, environment: Environment, writer: StoreWriter, dynamic: bool) -> None:
        self._environment, self._writer, self._dynamic = environment, writer, dynamic
        self._environment_id = writer.environment(environment.fingerprint)
        self._spread_id = writer.spread(environment.spread_fingerprint)
        # Samples whose scenes an earlier sweep has stored, or an import of trials, which leaves gaps.
        self._stored_scenes = writer.stored_samples(SAMPLE, self._environment_id)
        self._stored_draws = writer.stored_samples(DRAW, self._spread_id)
        # All samples before these are stored now.
        self._next_scene = self._next_draw = 0
        self._is_checked = not self._stored_scenes

    def reach(self, sample: int) -> None:
        """Store all missing samples up to ``sample``. Raises FoldcarError if the Scenic program has an error.

        Before the first new scene, the program must reproduce the last and the first stored scene.
        """
        environment, writer = self._environment, self._writer
        for k in range(self._next_scene, sample + 1):
            if k not in self._stored_scenes:
                self._check_reproduced()
                scene, objects = environment.sample_with_parameters(k)
                writer.put_sample(self._environment_id, k, scene, self._dynamic, objects)
            self._next_scene = k + 1
        # A draw is how the built car of a sample differs from the design. Another experiment may have stored more draws
        # than scenes, or fewer.
        for k in range(self._next_draw, sample + 1):
            if k not in self._stored_draws:
                writer.put_draw(self._spread_id, k, environment.variation(k), environment.variation_identity())
            self._next_draw = k + 1

    def _check_reproduced(self) -> None:
        """Raise FoldcarError if the program now gives another last or first scene than the stored one. Checked once.

        The last comes first: this shows whether samples depend on how many were drawn before.
        """
        from foldcar.scenes.source import other_scene

        if self._is_checked:
            return
        self._is_checked = True
        for k in sorted({max(self._stored_scenes), min(self._stored_scenes)}, reverse=True):
            stored = self._writer.stored_scene(self._environment_id, k)
            if stored != json.loads(canonical_json(self._environment.sample(k))):
                raise other_scene(self._environment.program, k)


@dataclass(frozen=True)
class ExperimentRuns:
    """Simulates the runs of ``plan``, which has ``designs`` designs.

    ``dynamic`` is whether Scenic runs beside the simulation. ``report`` is called with ``counts`` after every sample.
    """

    plan: PlannedExperiment
    designs: int
    environment: Environment
    dynamic: bool
    writer: StoreWriter
    pool: ChunkPool[PlannedRun]
    counts: Progress
    report: Callable[[Progress], None]

    @cached_property
    def _samples(self) -> StoredSamples:
        return StoredSamples(self.environment, self.writer, self.dynamic)

    def all(self) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate every design in every sample; the last chunks may still be running afterwards."""
        yield from self._simulate(None, self.counts.total)

    def until(self, rule: StoppingRule) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate every design, in the batches of a schedule, until the rule decides it or is unlikely to decide it."""
        plan, writer = self.plan, self.writer
        schedule = Schedule(rule, plan.environments, writer.design_counts(plan.id).reached)
        total, decided = self.counts.total, self.counts.decided
        while batches := schedule.next():
            samples_of_design = {batch.design: batch.samples for batch in batches}
            yield from self._simulate(samples_of_design, self.counts.done + sum(map(len, samples_of_design.values())))
            yield from self.pool.finish()
            schedule.record(
                {design: writer.run_counts(plan, design, samples) for design, samples in samples_of_design.items()},
                batches,
            )
            # Runs that closed designs will not get are no longer expected.
            self.counts.total = total - int((plan.environments - schedule.runs)[schedule.closed].sum())
            self.counts.decided = decided + int((schedule.decided & schedule.closed).sum())
            self.report(self.counts)
        writer.end_experiment(plan, int(schedule.runs.sum()))

    def _simulate(
        self, samples_of_design: Mapping[int, range] | None, total: int
    ) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate missing runs, sample by sample; yield chunks as they finish.

        ``samples_of_design`` has the samples to simulate by the design's position; None stands for all samples of all
        designs. ``total`` is the number of the sweep's runs that will be done afterwards.
        """
        plan = self.plan
        all_samples = range(plan.environments)
        if samples_of_design is not None:
            all_samples = range(
                min(samples.start for samples in samples_of_design.values()),
                max(samples.stop for samples in samples_of_design.values()),
            )
        for sample in all_samples:
            self._samples.reach(sample)
            for run in self.writer.planned_runs(plan, sample):
                if samples_of_design is not None and sample not in samples_of_design.get(run.design, ()):
                    continue
                # Reuse a stored result, or share that of an equal run in progress, whose outcome is not known yet.
                if run.outcome is not None or self.pool.joins(run):
                    self.counts.reused += 1
                    self.counts.count(run.outcome)
                else:
                    yield from self.pool.add(run, total - self.counts.done)
            self.report(self.counts)
