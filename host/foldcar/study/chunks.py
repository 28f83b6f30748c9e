"""Gives runs in chunks to several simulators, on this machine or on others (foldcar.study.cluster).

Input: single runs. Output: chunks as they finish. Chunks grow until one takes about a second. At the end of a sweep they
shrink, so that all simulators finish at about the same time.
"""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

from foldcar.simulation.runner import Runner, RunRequest
from foldcar.store.writer import PlannedRun, StoreWriter


class Simulators(Protocol):
    """Workers that run chunks. Several threads call the methods at the same time; each chunk has its thread for `run`."""

    # The wall time that a chunk should take, in s.
    chunk_s: float
    # Upper limit of `count`.
    max_count: int

    @property
    def count(self) -> int:
        """The number of chunks that can run at the same time now, at least 1."""

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """Return the answers of ``runner.run`` and the time of simulation (s). Raises FoldcarError."""

    def stop(self, runner: Runner) -> None:
        """Stop what ``runner`` is running; its `run` raises FoldcarError."""


class LocalSimulators:
    """Up to ``jobs`` simulators on this machine."""

    chunk_s = 0.7

    def __init__(self, jobs: int) -> None:
        self.count = self.max_count = jobs

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """Return the answers of ``runner.run`` and the time of simulation (s). Raises FoldcarError."""
        start_s = time.perf_counter()
        answers = runner.run(bodies, scenes, requests)
        return answers, time.perf_counter() - start_s

    def stop(self, runner: Runner) -> None:
        """Stop what ``runner`` is running; its `run` raises FoldcarError."""
        runner.stop()


FIRST_CHUNK_RUNS = 8
MIN_CHUNK_RUNS = 4
MAX_CHUNK_RUNS = 512

R = TypeVar("R")
# What a chunk of runs needs: bodies and scenes by their ids in carsim's input, and the requests.
ChunkInputs = tuple[Mapping[str, str], Mapping[str, str], list[RunRequest]]


@dataclass(frozen=True, slots=True)
class FinishedRun(Generic[R]):
    """A run with its answer; ``count`` equal runs of the study share the answer."""

    run: R
    answer: Mapping[str, Any]
    count: int


@dataclass(frozen=True)
class _Chunk(Generic[R]):
    """A finished chunk: its runs and their answers, in the same order; ``seconds`` is the time of simulation."""

    runner: Runner
    runs: list[R]
    answers: list[dict[str, Any]]
    seconds: float


class ChunkPool(Generic[R]):
    """A pool of threads; each waits for one simulator at a time. Only the caller's thread reads the store.

    ``simulators`` is an object, or the number of simulators on this machine. Runs go to the runner of :meth:`using`.
    ``inputs_of`` returns the simulator's input of runs, ``key_of`` what determines a run's result.
    """

    def __init__(
        self,
        simulators: Simulators | int,
        inputs_of: Callable[[Sequence[R]], ChunkInputs],
        key_of: Callable[[R], Hashable],
    ) -> None:
        # The simulator's input of some runs, and what determines the result of a run.
        self._inputs_of = inputs_of
        self._key_of = key_of
        self._simulators = LocalSimulators(simulators) if isinstance(simulators, int) else simulators
        self._pool = ThreadPoolExecutor(self._simulators.max_count, thread_name_prefix="carsim")
        # The chunks that are being simulated, each with its runner.
        self._futures: dict[Future[_Chunk[R]], Runner] = {}
        # What simulates the runs that are added now; None if none may be added.
        self._runner: Runner | None = None
        # The chunk that is being filled, and the number of runs at which it is submitted.
        self._chunk: list[R] = []
        self._chunk_runs = FIRST_CHUNK_RUNS
        # For each result that is being computed: how many runs of the study need it.
        self._in_flight: Counter[Hashable] = Counter()

    def __enter__(self) -> "ChunkPool[R]":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self._abandon()
        self._pool.shutdown()

    @contextlib.contextmanager
    def using(self, runner: Runner) -> Iterator[None]:
        """Simulate the runs that are added within the block with ``runner``.

        Runs are simulated in chunks. Some chunks may still be running at the end of the block: see :meth:`finish`.
        """
        if runner is not self._runner:
            if self._chunk:
                self._submit()
            self._runner, self._chunk_runs = runner, FIRST_CHUNK_RUNS
        try:
            yield
        except BaseException:
            # The caller will close the runner, so its chunks must stop first.
            self._abandon()
            raise

    def share_running(self, run: R) -> bool:
        """Let this run share the result of an equal run that is in progress. Return False if there is none."""
        key = self._key_of(run)
        if key not in self._in_flight:
            return False
        self._in_flight[key] += 1
        return True

    def add(self, run: R, runs_left: int) -> Iterator[list[FinishedRun[R]]]:
        """Add a run to the present chunk, and submit the chunk to the simulators when it is large enough.

        If all simulators are busy, this waits, and yields the chunks that finish meanwhile. ``runs_left`` is the number
        of runs of the sweep that have no result yet, including those that were added before.
        """
        # One chunk waits behind every running one, so that no simulator idles while this thread writes.
        max_chunks = 2 * self._simulators.count
        submitted_runs = len(self._in_flight) - len(self._chunk)
        runs_to_submit = runs_left - submitted_runs
        # One run of the study needs this result so far. Equal runs may share it later.
        self._in_flight[self._key_of(run)] = 1
        self._chunk.append(run)
        # Near the end of the sweep chunks shrink, so that all simulators finish at about the same time.
        fair_chunk_runs = max(MIN_CHUNK_RUNS, runs_to_submit // max_chunks)
        if len(self._chunk) >= min(self._chunk_runs, fair_chunk_runs):
            self._submit()
            while len(self._futures) >= max_chunks:
                yield from self._collect()

    def finish(self) -> Iterator[list[FinishedRun[R]]]:
        """Run the remaining runs and yield the remaining chunks."""
        if self._chunk:
            self._submit()
        while self._futures:
            yield from self._collect()

    def _submit(self) -> None:
        """Start simulating the chunk that is being filled: look up its inputs and hand it to a thread."""
        runs, self._chunk = self._chunk, []
        runner = self._runner
        assert runner is not None, "runs are added inside `using`"
        bodies, scenes, requests = self._inputs_of(runs)

        def work() -> _Chunk[R]:
            answers, seconds = self._simulators.run(runner, bodies, scenes, requests)
            return _Chunk(runner, runs, answers, seconds)

        self._futures[self._pool.submit(work)] = runner

    def _collect(self) -> Iterator[list[FinishedRun[R]]]:
        """Wait until a chunk is finished. Yield the runs of each finished chunk, and adapt the size of the next ones."""
        done, _ = wait(self._futures, return_when=FIRST_COMPLETED)
        for future in done:
            del self._futures[future]
            chunk = future.result()
            if chunk.runner is self._runner:
                self._adapt_size(chunk)
            finished_runs = []
            for run, answer in zip(chunk.runs, chunk.answers, strict=True):
                sharing_runs = self._in_flight[self._key_of(run)]
                finished_runs.append(FinishedRun(run, answer, count=sharing_runs))
            yield finished_runs
            # The caller has stored the results by now, so equal runs will be found in the store.
            for run in chunk.runs:
                del self._in_flight[self._key_of(run)]

    def _adapt_size(self, chunk: _Chunk[R]) -> None:
        """Set the size of the next chunks, so that each takes about as long as the simulators want."""
        # The time is a divisor, so it must not be 0.
        runs_per_s = len(chunk.runs) / max(chunk.seconds, 1e-6)
        target_runs = round(self._simulators.chunk_s * runs_per_s)
        # A chunk may have been fast by chance, so the size grows at most fourfold at a time.
        self._chunk_runs = max(1, min(target_runs, 4 * self._chunk_runs, MAX_CHUNK_RUNS))

    def _abandon(self) -> None:
        """Stop running chunks and discard waiting ones."""
        for future in self._futures:
            future.cancel()
        for runner in set(self._futures.values()):
            self._simulators.stop(runner)
        wait(self._futures)
        self._futures.clear()


def planned_pool(writer: StoreWriter, simulators: Simulators | int) -> ChunkPool[PlannedRun]:
    """Return a pool for the planned runs of a store."""
    return ChunkPool(simulators, partial(_planned_inputs, writer), _planned_key)


def _planned_inputs(writer: StoreWriter, runs: Sequence[PlannedRun]) -> ChunkInputs:
    """Look up the simulator's input of planned runs.

    The *reality* of a run is how its car differs from its design, as JSON.
    """
    reality_by_id = writer.texts("variation", (run.variation_id for run in runs))
    realities = [reality_by_id[run.variation_id] for run in runs]
    labels = [f"design {run.design + 1}, sample {run.sample}" for run in runs]
    return stored_inputs(writer, runs, labels, realities)


class StoredRun(Protocol):
    """A run whose inputs are in the store."""

    @property
    def body_id(self) -> int:
        """The number of its car's body in the store."""

    @property
    def scene_id(self) -> int:
        """The number of its scene in the store."""

    @property
    def settings_id(self) -> int:
        """The number of its settings in the store."""

    @property
    def sample(self) -> int:
        """The scene's sample of the environment."""


def stored_inputs(
    writer: StoreWriter, runs: Sequence[StoredRun], labels: Sequence[str], realities: Sequence[str]
) -> ChunkInputs:
    """Look up bodies, scenes and settings of runs, which have these ``labels`` and ``realities`` (JSON)."""
    body_by_id = writer.texts("body", (run.body_id for run in runs))
    scene_by_id = writer.texts("scene", (run.scene_id for run in runs))
    settings_by_id = writer.texts("settings", (run.settings_id for run in runs))
    # Bodies and scenes by their ids in carsim's input.
    bodies = {f"b{body_id}": body for body_id, body in body_by_id.items()}
    scenes = {f"s{scene_id}": scene for scene_id, scene in scene_by_id.items()}
    requests = [
        RunRequest(
            body=f"b{run.body_id}",
            scene=f"s{run.scene_id}",
            settings=settings_by_id[run.settings_id],
            label=label,
            sample=run.sample,
            reality=reality,
        )
        for run, label, reality in zip(runs, labels, realities, strict=True)
    ]
    return bodies, scenes, requests


def _planned_key(run: PlannedRun) -> Hashable:
    """Return what determines a run's result besides the build: ids of body, scene, settings and variation."""
    return run.body_id, run.scene_id, run.settings_id, run.variation_id
