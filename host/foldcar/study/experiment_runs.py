"""The runs of one experiment that the store lacks, given to simulators sample by sample.

Input: a planned experiment. Output: finished chunks, which the caller stores before it asks for the next. All designs are
simulated in one sample before the next, so that partial results cover the whole family.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from foldcar.analysis.stopping import StoppingRule
from foldcar.store.writer import PlannedExperiment, StoreWriter
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import Environment
from foldcar.study.progress import Progress
from foldcar.study.schedule import Schedule
from foldcar.study.stored_samples import StoredSamples


@dataclass(frozen=True)
class ExperimentRuns:
    """``report`` is called after every sample; ``dynamic`` says whether Scenic runs beside the simulation."""

    plan: PlannedExperiment
    environment: Environment
    dynamic: bool
    writer: StoreWriter
    pool: ChunkPool
    counts: Progress
    report: Callable[[Progress], None]

    @cached_property
    def _samples(self) -> StoredSamples:
        return StoredSamples(self.environment, self.writer, self.dynamic)

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
            wanted = {one.design: one.samples for one in batches}
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
                    yield from self.pool.add(run, total - self.counts.done)
            self.report(self.counts)
