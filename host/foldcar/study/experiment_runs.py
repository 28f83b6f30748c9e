"""The runs of one experiment that the store lacks, given to simulators sample by sample.

Input: a planned experiment. Output: finished chunks, which the caller stores before it asks for the next. All designs are
simulated in one sample before the next, so that partial results cover the whole family.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from foldcar.analysis.stopping import StoppingRule
from foldcar.store.writer import PlannedExperiment, StoreWriter
from foldcar.study.chunks import ChunkPool, FinishedRun
from foldcar.study.environments import Environment
from foldcar.study.progress import Progress
from foldcar.study.stopping import open_designs, rounds


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

    def all(self) -> Iterator[list[FinishedRun]]:
        """Every design in every sample; the last chunks may still be in progress afterwards."""
        yield from self._simulate(range(self.plan.environments), None, self.counts.total)

    def until(self, rule: StoppingRule) -> Iterator[list[FinishedRun]]:
        """Every design until it is decided, in rounds of samples."""
        most, closed, saved = self.plan.environments, 0, 0
        # An empty round at the end: what the last samples have decided.
        for samples in [*rounds(most), range(most, most)]:
            known = self.writer.design_counts(self.plan)
            needed = open_designs(rule, known, samples.start)
            runs = [runs for at, runs in zip(known.positions, known.runs, strict=True) if at not in needed]
            self.counts.decided += len(runs) - closed
            self.counts.total -= most * len(runs) - sum(runs) - saved
            closed, saved = len(runs), most * len(runs) - sum(runs)
            self.report(self.counts)
            if not needed:
                return
            yield from self._simulate(samples, needed, self.counts.done + len(needed) * len(samples))
            yield from self.pool.finish()

    def _simulate(
        self, samples: range, needed: Collection[int] | None, total: int
    ) -> Iterator[list[FinishedRun]]:
        """Simulate the ``needed`` designs (positions; None: all) in ``samples``; then ``total`` runs are counted."""
        plan, environment, writer = self.plan, self.environment, self.writer
        sampled, drawn = writer.sample_count(plan.environment_id), writer.draw_count(plan.spread_id)
        for sample in samples:
            if sample >= sampled:
                scene = environment.sample(sample)
                identity = environment.scene_identity(sample, self.dynamic)
                writer.put_sample(plan.environment_id, sample, scene, identity)
            if sample >= drawn:
                identity = environment.variation_identity()
                writer.put_draw(plan.spread_id, sample, environment.variation(sample), identity)
            for run in writer.planned_runs(plan, sample):
                wanted = needed is None or run.design in needed
                if run.outcome is not None or (wanted and self.pool.joins(run)):
                    self.counts.there += 1
                    self.counts.count(run.outcome)
                elif wanted:
                    yield from self.pool.add(run, total - self.counts.done)
            self.report(self.counts)
