"""Gives the runs of one experiment that the store lacks to simulators, sample by sample.

Input: a planned experiment. Output: finished chunks, which the caller stores before it asks for the next. All designs are
simulated in a sample before the next sample begins, so that partial results cover the whole family.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from foldcar.simulation.results import FAILED, PASSED, REJECTED
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.tables import DRAW, SAMPLE
from foldcar.store.writer import PlannedExperiment, PlannedRun, StoreWriter, canonical_json
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.reality_runs import RealityCounts
from foldcar.study.stopping import DesignState, Schedule


@dataclass
class Progress:
    """Counts of a sweep's runs.

    ``total`` is the number of runs that the sweep will have. With a stopping rule it decreases as designs are decided.
    ``new`` runs were simulated. ``reused`` runs were in the store, or are equal to a run in progress and share its
    result. ``passed``, ``rejected`` and ``failed`` count both kinds. ``judged`` runs are in environments that define
    success; when an experiment ends, its rejected runs are subtracted. ``decided`` is the number of designs that a
    stopping rule has decided, and ``states`` are the results of all designs. ``realities`` has the counts of runs in
    other realities, by experiment; no other count includes them. They are simulated when all other runs have ended, at
    ``ended_s``. Times are those of ``time.perf_counter``.
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
        """How long the runs have taken since the start of the sweep, without those in other realities (s)."""
        now_s = time.perf_counter() if self.ended_s is None else self.ended_s
        return now_s - self.started_s

    def count(self, outcome: str | None, runs: int = 1) -> None:
        """Count ``runs`` runs with that outcome; None is the outcome of a run in progress, which is counted later."""
        if outcome == PASSED:
            self.passed += runs
        elif outcome == REJECTED:
            self.rejected += runs
        elif outcome == FAILED:
            self.failed += runs


class StoredSamples:
    """The samples of an environment in the store: each sample's scene, and how its built car differs from the design.

    Samples are drawn and stored when they are first needed. ``dynamic`` is whether the program runs beside the
    simulation.
    """

    def __init__(self, environment: ExperimentEnvironment, writer: StoreWriter, dynamic: bool) -> None:
        self._environment = environment
        self._writer = writer
        self._dynamic = dynamic
        self._environment_id = writer.environment(environment.fingerprint)
        self._spread_id = writer.spread(environment.spread_fingerprint)
        # The samples, by their number in the environment, that an earlier sweep or an import of trials has stored. An
        # import of trials leaves gaps.
        self._stored_scenes = writer.stored_samples(SAMPLE, self._environment_id)
        self._stored_variations = writer.stored_samples(DRAW, self._spread_id)
        # All samples before these are in the store.
        self._next_scene = 0
        self._next_variation = 0
        self._program_is_checked = False

    def store_up_to(self, sample: int) -> None:
        """Store all missing samples up to and including ``sample``: their scenes, and their variations.

        The *variation* of a sample is how its built car differs from its design. Raises FoldcarError if the program has
        an error.
        """
        for number in range(self._next_scene, sample + 1):
            if number not in self._stored_scenes:
                self._check_program()
                scene, objects = self._environment.sample_with_parameters(number)
                self._writer.put_sample(self._environment_id, number, scene, self._dynamic, objects)
            self._next_scene = number + 1
        # Another experiment may have stored variations that both use, so there can be more variations than scenes.
        for number in range(self._next_variation, sample + 1):
            if number not in self._stored_variations:
                variation = self._environment.variation(number)
                self._writer.put_draw(self._spread_id, number, variation, self._environment.variation_identity())
            self._next_variation = number + 1

    def _check_program(self) -> None:
        """Raise FoldcarError if the program does not draw the stored scenes any more.

        The check is made once, before the first new scene. It draws the last stored scene and then the first one, and
        compares them with the store. Drawing them in this order reveals a program whose scenes depend on the scenes that
        it has drawn before.
        """
        from foldcar.scenes.source import other_scene_error

        if self._program_is_checked or not self._stored_scenes:
            return
        self._program_is_checked = True
        for number in (max(self._stored_scenes), min(self._stored_scenes)):
            stored_scene = self._writer.stored_scene(self._environment_id, number)
            drawn_scene = json.loads(canonical_json(self._environment.sample(number)))
            if drawn_scene != stored_scene:
                raise other_scene_error(self._environment.program, number)


@dataclass(frozen=True)
class ExperimentRuns:
    """Simulates the runs of the experiment ``plan``, which has ``design_count`` designs.

    ``dynamic`` is whether Scenic runs beside the simulation. ``report`` is called with ``counts`` after every sample.
    """

    plan: PlannedExperiment
    design_count: int
    environment: ExperimentEnvironment
    dynamic: bool
    writer: StoreWriter
    pool: ChunkPool[PlannedRun]
    counts: Progress
    report: Callable[[Progress], None]

    @cached_property
    def _samples(self) -> StoredSamples:
        return StoredSamples(self.environment, self.writer, self.dynamic)

    def all(self) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate every design in every sample; yield chunks as they finish.

        When this ends, the last chunks may still be running. The caller gets them from the pool.
        """
        every_sample = range(self.plan.environments)
        samples_by_design = dict.fromkeys(range(self.design_count), every_sample)
        yield from self._simulate(samples_by_design, self.counts.total)

    def until(self, rule: StoppingRule) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate each design until a stopping rule closes it; yield chunks as they finish.

        The rule closes a design if its runs have decided whether it is good, or if more runs are unlikely to decide it.
        """
        plan, counts = self.plan, self.counts
        # The counts are those of the whole sweep, with the experiments that were simulated before this one.
        total_if_none_is_closed, decided_before = counts.total, counts.decided
        stored_samples = self.writer.design_counts(plan.id).reached
        schedule = Schedule(rule, plan.environments, stored_samples)
        while batches := schedule.next():
            samples_by_design = {batch.design: batch.samples for batch in batches}
            batch_runs = sum(len(samples) for samples in samples_by_design.values())
            yield from self._simulate(samples_by_design, counts.done + batch_runs)
            yield from self.pool.finish()
            results = {
                design: self.writer.run_counts(plan, design, samples) for design, samples in samples_by_design.items()
            }
            schedule.record(results, batches)
            counts.total = total_if_none_is_closed - schedule.runs_not_needed()
            counts.decided = decided_before + schedule.decided_designs()
            self.report(counts)
        self.writer.end_experiment(plan, int(schedule.runs.sum()))

    def _simulate(self, samples_by_design: Mapping[int, range], total: int) -> Iterator[list[FinishedRun[PlannedRun]]]:
        """Simulate runs that the store lacks, sample by sample; yield chunks as they finish.

        ``samples_by_design`` has the range of samples of each design, by the design's position. ``total`` is the number
        of runs, stored ones included, that the whole sweep will have when these runs are finished.
        """
        first_sample = min(samples.start for samples in samples_by_design.values())
        end_sample = max(samples.stop for samples in samples_by_design.values())
        for sample in range(first_sample, end_sample):
            self._samples.store_up_to(sample)
            for run in self.writer.planned_runs(self.plan, sample):
                if sample not in samples_by_design.get(run.design, ()):
                    continue
                is_stored = run.outcome is not None
                if is_stored or self.pool.share_running(run):
                    self.counts.reused += 1
                    self.counts.count(run.outcome)
                else:
                    runs_left = total - self.counts.done
                    yield from self.pool.add(run, runs_left)
            self.report(self.counts)
