"""Runs chunks in a few simulator processes at once: a bounded window, results as they come.

Input: runs one by one. Output: finished chunks. Chunks grow until one takes about a second, and shrink at the
end so that no process runs on alone.
"""

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from foldcar.carsim import Carsim, RunRequest
from foldcar.store_writer import PlannedRun, StoreWriter

TARGET_CHUNK_S = 0.7
FIRST_CHUNK_RUNS = 8
LEAST_CHUNK_RUNS = 4
MAX_CHUNK_RUNS = 512

Finished = list[tuple[PlannedRun, Mapping[str, Any]]]


@dataclass(frozen=True)
class _Answer:
    runs: list[PlannedRun]
    results: list[dict[str, Any]]
    seconds: float


class ChunkPool:
    """Workers that each drive one carsim process at a time; the store is read in the caller's thread."""

    def __init__(self, carsim: Carsim, writer: StoreWriter, jobs: int) -> None:
        self._carsim = carsim
        self._writer = writer
        self._jobs = jobs
        self._pool = ThreadPoolExecutor(jobs, thread_name_prefix="carsim")
        self._futures: set[Future[_Answer]] = set()
        self._chunk: list[PlannedRun] = []
        self._chunk_runs = FIRST_CHUNK_RUNS
        self._in_flight: set[tuple[int, int, int]] = set()

    def __enter__(self) -> "ChunkPool":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            for future in self._futures:
                future.cancel()
            self._carsim.stop()
        self._pool.shutdown()

    def knows(self, run: PlannedRun) -> bool:
        """Whether the same body, scene and settings are under way already."""
        return _key(run) in self._in_flight

    def add(self, run: PlannedRun, runs_left: int) -> Iterator[Finished]:
        """Take a run; gives chunks that finished while this one had to wait for room.

        ``runs_left`` counts the runs without result, those given to this pool included.
        """
        not_submitted = runs_left - len(self._in_flight) + len(self._chunk)
        self._in_flight.add(_key(run))
        self._chunk.append(run)
        if len(self._chunk) >= min(
            self._chunk_runs, max(LEAST_CHUNK_RUNS, not_submitted // (2 * self._jobs))
        ):
            self._submit()
            # One chunk waits behind every running one, so that no worker idles while this thread writes.
            while len(self._futures) >= 2 * self._jobs:
                yield from self._collect()

    def finish(self) -> Iterator[Finished]:
        """Run what is left; gives the remaining chunks."""
        if self._chunk:
            self._submit()
        while self._futures:
            yield from self._collect()

    def _submit(self) -> None:
        runs, self._chunk = self._chunk, []
        bodies = {f"b{key}": self._writer.text("body", key) for key in {run.body_id for run in runs}}
        scenes = {f"s{key}": self._writer.text("scene", key) for key in {run.scene_id for run in runs}}
        settings = {key: self._writer.text("settings", key) for key in {run.settings_id for run in runs}}
        requests = [
            RunRequest(
                f"b{run.body_id}",
                f"s{run.scene_id}",
                settings[run.settings_id],
                f"design {run.design + 1}, sample {run.sample}",
            )
            for run in runs
        ]

        def work() -> _Answer:
            start_s = time.perf_counter()
            results = self._carsim.run(bodies, scenes, requests)
            return _Answer(runs, results, time.perf_counter() - start_s)

        self._futures.add(self._pool.submit(work))

    def _collect(self) -> Iterator[Finished]:
        done, self._futures = wait(self._futures, return_when=FIRST_COMPLETED)
        for future in done:
            answer = future.result()
            wanted = round(TARGET_CHUNK_S / max(answer.seconds, 1e-6) * len(answer.runs))
            self._chunk_runs = max(1, min(wanted, 4 * self._chunk_runs, MAX_CHUNK_RUNS))
            yield list(zip(answer.runs, answer.results, strict=True))
            self._in_flight.difference_update(map(_key, answer.runs))


def _key(run: PlannedRun) -> tuple[int, int, int]:
    return run.body_id, run.scene_id, run.settings_id
