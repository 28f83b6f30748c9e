"""The runs of one experiment that the store lacks, given to simulators sample by sample.

Input: a planned experiment. Output: finished chunks, which the caller stores before it asks for the next. All designs are
simulated in one sample before the next, so that partial results cover the whole family.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from foldcar.simulation.results import REJECTED
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.tables import DRAW, SAMPLE
from foldcar.store.writer import PlannedExperiment, StoreWriter, canonical_json
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import Environment
from foldcar.study.kept_paths import KeptPaths
from foldcar.study.stopping import DesignState, Schedule


@dataclass
class Progress:
    """Counts of a sweep's runs: ``new`` were simulated, ``there`` before; ``passed``, ``rejected``, ``failed`` of both.

    ``judged`` of the ``total`` are in environments that define success; rejected ones leave them as experiments end. A
    sweep that stops when it knows lowers the total as designs are ``decided``, and fills ``states`` as experiments end.
    """

    total: int
    judged: int = 0
    new: int = 0
    there: int = 0
    passed: int = 0
    rejected: int = 0
    failed: int = 0
    decided: int = 0
    states: list[DesignState] = field(default_factory=list)
    started_s: float = field(default_factory=time.perf_counter)

    @property
    def done(self) -> int:
        """Runs that are in the store or share the result of a run in progress."""
        return self.new + self.there

    @property
    def seconds(self) -> float:
        """Time since the start of the sweep (s)."""
        return time.perf_counter() - self.started_s

    def count(self, outcome: str | None, runs: int = 1) -> None:
        """Count ``runs`` runs of the study with that outcome."""
        self.passed += runs * (outcome == "passed")
        self.rejected += runs * (outcome == REJECTED)
        self.failed += runs * (outcome == "failed")


class StoredSamples:
    """``dynamic`` says whether the program runs beside the simulation."""

    def __init__(self, environment: Environment, writer: StoreWriter, dynamic: bool) -> None:
        self._environment, self._writer, self._dynamic = environment, writer, dynamic
        self._environment_id = writer.environment(environment.fingerprint)
        self._spread_id = writer.spread(environment.spread_fingerprint)
        self._scenes = self._first_scenes = writer.sample_count(SAMPLE, self._environment_id)
        self._draws = writer.sample_count(DRAW, self._spread_id)

    def reach(self, sample: int) -> None:
        """Store what is not there of all samples up to this one. FoldcarError if the program is at fault."""
        environment, writer = self._environment, self._writer
        if sample >= self._scenes == self._first_scenes:
            # The last first: what depends on the number of samples drawn before then shows.
            for k in sorted({self._scenes - 1, 0} if self._scenes else (), reverse=True):
                self._confirm(k)
        for k in range(self._scenes, sample + 1):
            scene = environment.sample(k)
            writer.put_sample(self._environment_id, k, scene, self._dynamic)
            self._scenes = k + 1
        for k in range(self._draws, sample + 1):
            writer.put_draw(self._spread_id, k, environment.variation(k), environment.variation_identity())
            self._draws = k + 1

    def _confirm(self, k: int) -> None:
        from foldcar.scenes.source import other_scene

        stored = self._writer.stored_scene(self._environment_id, k)
        if stored != json.loads(canonical_json(self._environment.sample(k))):
            raise other_scene(self._environment.program, k)


@dataclass(frozen=True)
class ExperimentRuns:
    """The runs of ``plan``, which has so many ``designs``.

    ``report`` is called after every sample; ``dynamic`` says whether Scenic runs beside the simulation.
    """

    plan: PlannedExperiment
    designs: int
    environment: Environment
    dynamic: bool
    writer: StoreWriter
    pool: ChunkPool
    counts: Progress
    report: Callable[[Progress], None]

    @cached_property
    def _samples(self) -> StoredSamples:
        return StoredSamples(self.environment, self.writer, self.dynamic)

    @cached_property
    def _paths(self) -> KeptPaths:
        return KeptPaths(self.designs, self.writer.kept_paths(self.plan))

    def all(self) -> Iterator[list[FinishedRun]]:
        """Every design in every sample; the last chunks may still be in progress afterwards."""
        yield from self._simulate(None, self.counts.total)

    def until(self, rule: StoppingRule) -> Iterator[list[FinishedRun]]:
        """Every design until it is decided, or until that is hopeless: in the order and the batches of a schedule."""
        plan, writer = self.plan, self.writer
        known, other = writer.design_counts(plan), writer.multibody_counts(plan)
        schedule = Schedule(rule, plan.environments, known.reached, other)
        most, decided = self.counts.total, self.counts.decided
        while batches := schedule.next():
            wanted = {batch.design: batch.samples for batch in batches}
            yield from self._simulate(wanted, self.counts.done + sum(map(len, wanted.values())))
            yield from self.pool.finish()
            schedule.record({one: writer.run_counts(plan, one, samples) for one, samples in wanted.items()}, batches)
            self.counts.total = most - int((plan.environments - schedule.runs)[schedule.closed].sum())
            self.counts.decided = decided + int((schedule.decided & schedule.closed).sum())
            self.report(self.counts)
        writer.end_experiment(plan, int(schedule.runs.sum()))

    def _simulate(self, wanted: Mapping[int, range] | None, total: int) -> Iterator[list[FinishedRun]]:
        """Simulate the ``wanted`` samples of designs (by position; None: all of all); then ``total`` runs are counted."""
        plan = self.plan
        every = range(plan.environments)
        if wanted is not None:
            every = range(min(one.start for one in wanted.values()), max(one.stop for one in wanted.values()))
        for sample in every:
            self._samples.reach(sample)
            for run in self.writer.planned_runs(plan, sample):
                if wanted is not None and sample not in wanted.get(run.design, ()):
                    continue
                if run.outcome is not None or self.pool.joins(run):
                    self.counts.there += 1
                    self.counts.count(run.outcome)
                else:
                    yield from self.pool.add(run, total - self.counts.done, self._paths)
            self.report(self.counts)
