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
# Number of characters of a program's message that an error shows.
MAX_MESSAGE_LENGTH = 200


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
        if self.reality.strip() in ("", "{}"):
            return self.settings
        settings_after_brace = self.settings.lstrip()[1:]
        return f'{{"reality": {self.reality}, {settings_after_brace}'


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
    """Describe how a process ended, with the last line of its ``messages`` (its standard error).

    ``return_code`` is negative for a signal, as in subprocess.

    Example: process_ending(-11) is "killed by SIGSEGV", process_ending(3, "no memory") is "exit code 3 (no memory)"
    """
    ending = f"exit code {return_code}" if return_code >= 0 else f"killed by {_signal_name(-return_code)}"
    lines = messages.strip().splitlines()
    if not lines:
        return ending
    return f"{ending} ({lines[-1][:MAX_MESSAGE_LENGTH]})"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


T = TypeVar("T")


def side_by_side(calls: Iterable[Callable[[], T]], jobs: int, stop: Callable[[], None]) -> Iterator[T]:
    """Run ``calls`` in threads, ``jobs`` at a time, and yield their results in order.

    If a call fails, ``stop`` is called, which must make the running calls fail, too.
    """
    # Half of the submitted calls run. The others wait, so that a thread that has finished one can begin the next.
    max_submitted = 2 * jobs
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="carsim")
    submitted: deque[Future[T]] = deque()
    try:
        for call in calls:
            submitted.append(pool.submit(call))
            if len(submitted) == max_submitted:
                oldest = submitted.popleft()
                yield oldest.result()
        for future in submitted:
            yield future.result()
    except BaseException:
        stop()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
