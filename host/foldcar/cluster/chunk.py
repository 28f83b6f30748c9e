"""What a worker does with a chunk: the only function that a sweep asks workers to run."""

import socket
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from foldcar.cluster.recipe import Made, Recipe
from foldcar.errors import FoldcarError
from foldcar.simulation.runner import RunRequest


@dataclass(frozen=True, slots=True)
class Simulated:
    """Answers in the order of the requests, and how long they took (s)."""

    answers: list[dict[str, Any]]
    seconds: float


@dataclass(frozen=True, slots=True)
class Unfit:
    """The worker on ``host`` cannot make the sweep's runs at all."""

    host: str
    why: str


@dataclass(frozen=True, slots=True)
class Late:
    """The chunk was ended after ``limit_s``."""

    limit_s: float


@dataclass(frozen=True, slots=True)
class Refused:
    """The simulator refused the chunk, or broke down over it."""

    host: str
    why: str


_kept = threading.local()


def run_chunk(
    recipe: Recipe,
    bodies: Mapping[str, str],
    scenes: Mapping[str, str],
    requests: Sequence[RunRequest],
    limit_s: float,
) -> Simulated | Unfit | Late | Refused:
    """The chunk's runs. Each thread of a worker keeps the runner of the recipe that it had last."""
    late = threading.Event()
    try:
        made = _made(recipe)
    except (FoldcarError, OSError) as error:
        return Unfit(socket.gethostname(), str(error))

    def end() -> None:
        late.set()
        made.stop()

    timer = threading.Timer(limit_s, end)
    timer.daemon = True
    start_s = time.perf_counter()
    timer.start()
    try:
        answers = made.run(bodies, scenes, requests)
    except FoldcarError as error:
        _drop()
        return Late(limit_s) if late.is_set() else Refused(socket.gethostname(), str(error))
    finally:
        timer.cancel()
    return Simulated(answers, time.perf_counter() - start_s)


def _made(recipe: Recipe) -> Made:
    made: Made | None = getattr(_kept, "made", None)
    if made is None or not made.fits(recipe):
        _drop()
        made = _kept.made = Made(recipe)
    return made


def _drop() -> None:
    made: Made | None = getattr(_kept, "made", None)
    _kept.made = None
    if made is not None:
        made.close()
