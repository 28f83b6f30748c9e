"""What runs chunks of runs: carsim's batch, or Scenic beside carsim. The interface of both."""

import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from foldcar.errors import FoldcarError

# Between the rows of a path that is drawn.
PATH_INTERVAL_S = 0.02
# The same of a compact path (docs/carsim.md), of which many are kept.
KEPT_INTERVAL_S = 0.05


class CarsimError(FoldcarError):
    """The simulator is missing, broke down, or refused what it was given."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """One run: keys of the chunk's bodies and scenes, the settings as a JSON object, a name for errors.

    ``sample`` is the sample of the environment that the scene is. ``compact_path``: carsim answers with the path, too, in
    its compact form; Scenic beside it does not.
    """

    body: str
    scene: str
    settings: str
    label: str
    sample: int
    compact_path: bool = False


class Runner(Protocol):
    """Runs chunks. Called from several threads at once.

    A process that dies takes only its run with it: that run is simulated once more in a new process, and has failed
    if it dies again.
    """

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order; ``{"error": message}`` for a run that failed. FoldcarError.

        ``bodies`` and ``scenes`` map ids to JSON objects as text.
        """

    def stop(self) -> None:
        """End what runs at the moment; its `run` raises FoldcarError."""


def process_ending(return_code: int, messages: str = "") -> str:
    """``killed by SIGSEGV`` or ``exit code 3``, and in brackets the last line of ``messages``, its standard error.

    ``return_code`` is subprocess's: negative for a signal.
    """
    how = f"exit code {return_code}" if return_code >= 0 else f"killed by {_signal_name(-return_code)}"
    last = (messages.strip().splitlines() or [""])[-1][:200]
    return f"{how} ({last})" if last else how


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


T = TypeVar("T")


def side_by_side(calls: Iterable[Callable[[], T]], jobs: int, stop: Callable[[], None]) -> Iterator[T]:
    """The results of ``calls`` in order, ``jobs`` at a time; ``stop`` ends those that run if one fails or nobody waits.

    ``calls`` is read in the caller's thread, one call ahead of every simulator: no texts pile up, and nobody is idle.
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
