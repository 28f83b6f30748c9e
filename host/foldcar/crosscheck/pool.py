"""Many runs in MuJoCo, in several processes.

Input: tasks. Output: their indices and results as they finish. A run that leaves the finite numbers is a
result with the outcome ``failed``.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from foldcar.crosscheck.mujoco_car import DEFAULTS, EngineOptions, import_mujoco
from foldcar.crosscheck.mujoco_run import run_mujoco
from foldcar.errors import FoldcarError
from foldcar.models.ground import HeightGrid
from foldcar.simulation.carsim_limits import TrialRules
from foldcar.simulation.pulses import PulseTrain

# Tasks handed out ahead, a worker: enough to keep it busy, few enough that the first results come at once.
AHEAD = 4


@dataclass(frozen=True)
class Task:
    """One run in MuJoCo."""

    body: Mapping[str, Any]
    scene: Mapping[str, Any]
    pulses: PulseTrain
    rules: TrialRules
    grid: HeightGrid | None = None
    options: EngineOptions = DEFAULTS


def run_all(tasks: Iterable[Task], jobs: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Run the tasks in ``jobs`` processes; yields index and result in the order of finishing.

    Ends its processes when it is closed or interrupted; what has been yielded is whole. FoldcarError if one of them is
    ended from outside.
    """
    import_mujoco()
    if jobs == 1:
        for index, task in enumerate(tasks):
            yield index, _run(task)
        return
    pool = ProcessPoolExecutor(jobs, initializer=_end_with_the_parent)
    waiting: dict[Future[dict[str, Any]], int] = {}
    following = iter(enumerate(tasks))
    try:
        while True:
            while len(waiting) < AHEAD * jobs:
                numbered = next(following, None)
                if numbered is None:
                    break
                waiting[pool.submit(_run, numbered[1])] = numbered[0]
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()
    except BrokenProcessPool:
        raise FoldcarError("a process that simulates with MuJoCo was ended from outside") from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _run(task: Task) -> dict[str, Any]:
    try:
        return run_mujoco(task.body, task.scene, task.pulses, task.rules, task.grid, task.options)
    except FoldcarError as error:
        return {"outcome": "failed", "message": str(error)}


def _end_with_the_parent() -> None:
    """Leave Ctrl-C to the parent, and end at once when it has ended in whatever way."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
