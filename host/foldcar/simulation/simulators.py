"""Where chunks of runs are simulated: on this machine, or on others (foldcar.cluster). The interface of both."""

import time
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from foldcar.simulation.runner import Runner, RunRequest


class Simulators(Protocol):
    """Places for chunks. Its methods are called from several threads at once, `run` from one for each chunk."""

    # The wall time that a chunk should take, in s.
    chunk_s: float
    # Chunks that may ever run at a time.
    most: int

    @property
    def count(self) -> int:
        """Chunks that run at a time now, at least 1."""

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """The answers of ``runner.run``, and how long it took to simulate them (s). FoldcarError."""

    def stop(self, runner: Runner) -> None:
        """End what ``runner`` runs at the moment; its `run` raises FoldcarError."""


class LocalSimulators:
    """As many simulators as ``jobs`` on this machine."""

    chunk_s = 0.7

    def __init__(self, jobs: int) -> None:
        self.count = self.most = jobs

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """As in Simulators."""
        start_s = time.perf_counter()
        answers = runner.run(bodies, scenes, requests)
        return answers, time.perf_counter() - start_s

    def stop(self, runner: Runner) -> None:
        """As in Simulators."""
        runner.stop()
