"""Calls to simulators side by side, a thread each: what they return, in order."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

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
