"""The interface of carsim's batch and of Scenic beside carsim, which run chunks of runs."""

import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from foldcar.errors import FoldcarError

# Interval between the rows of a path that is drawn.
PATH_INTERVAL_S = 0.02


class CarsimError(FoldcarError):
    """The simulator is missing, crashed, or refused its input."""


class InputRefusedError(CarsimError):
    """The simulator refused its input; ``reason`` begins with the path of the value at fault, as ``scene.friction``."""

    def __init__(self, binary: Path, label: str, reason: str) -> None:
        super().__init__(f"{binary} refuses {label}: {reason}")
        self.reason = reason


@dataclass(frozen=True, slots=True)
class RunRequest:
    """One run of a chunk: the ids of its ``body`` and ``scene``, its ``settings`` as a JSON object.

    ``label`` names the run in errors. ``sample`` is the scene's sample of the environment. ``reality`` is a JSON object
    with the differences of the real car and ground from body and scene.
    """

    body: str
    scene: str
    settings: str
    label: str
    sample: int
    reality: str = ""

    @property
    def keys(self) -> str:
        """The settings, and the reality if it is not nominal, as the JSON object of carsim's run line."""
        is_nominal = self.reality.strip() in ("", "{}")
        return self.settings if is_nominal else f'{{"reality": {self.reality}, {self.settings.lstrip()[1:]}'


class Runner(Protocol):
    """Runs chunks; several threads may call it at the same time.

    If a process dies, its current run is retried in a new process, and has failed if that dies, too.
    """

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Return answers to ``requests`` in order; ``{"error": message}`` for a failed run. Raises FoldcarError.

        ``bodies`` and ``scenes`` map ids to JSON objects as text.
        """

    def stop(self) -> None:
        """Stop all running calls of `run`, which raise FoldcarError."""


def process_ending(return_code: int, messages: str = "") -> str:
    """Return how a process ended: ``killed by SIGSEGV`` or ``exit code 3``, with the last of its messages in brackets.

    ``return_code`` is negative for a signal, as in subprocess; ``messages`` is its standard error.
    """
    ending = f"exit code {return_code}" if return_code >= 0 else f"killed by {_signal_name(-return_code)}"
    last_line = (messages.strip().splitlines() or [""])[-1][:200]
    return f"{ending} ({last_line})" if last_line else ending


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


T = TypeVar("T")


def side_by_side(calls: Iterable[Callable[[], T]], jobs: int, stop: Callable[[], None]) -> Iterator[T]:
    """Run ``calls`` in threads, ``jobs`` at a time, and yield their results in order.

    If a call fails, ``stop`` is called to stop the others. ``calls`` is read in the caller's thread, one call ahead for
    each simulator, so that few texts are in memory, and no simulator is idle.
    """
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="carsim")
    waiting: deque[Future[T]] = deque()
    try:
        for call in calls:
            waiting.append(pool.submit(call))
            if len(waiting) == 2 * jobs:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BaseException:
        stop()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
