"""Runs chunks at the places of a cluster, each elsewhere again if its worker goes, hangs or cannot run it.

A chunk that has cost two workers is halved, and so on, until the run that does it is alone; that one has failed when it
has cost LOSSES workers. What kills the simulator only is dealt with at the worker, as in a local sweep.
"""

import itertools
import json
import threading
import time
import uuid
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from foldcar.cluster.chunk import Recipe, Simulated, Trouble, recipe_of, run_chunk
from foldcar.cluster.places import Place, Places
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.simulation.runner import CarsimError, Runner, RunRequest

# Workers that a run alone may cost, and a chunk whole.
LOSSES = 3
CHUNK_LOSSES = 2
# Wall time of a chunk: 60 s (the aim is 2.5 s) and a hundredth of the time that its runs may drive; carsim is some
# hundred times as fast as real time. A run alone gets 180 s, more than Scenic beside it gets, and that time whole.
CHUNK_LIMIT_S, CHUNK_SHARE = 60.0, 0.01
RUN_LIMIT_S, RUN_SHARE = 180.0, 1.0
# How much later than its limit a worker may say that the chunk was late, before it counts as hung.
SILENCE_S = 30.0
RETRY_S = 0.5
# To fetch the answers of a chunk that has ended.
GATHER_S = 60.0


@dataclass
class _Part:
    """Runs of a chunk that are simulated together, how many workers they cost, and which those are."""

    requests: Sequence[RunRequest]
    losses: int = 0
    avoided: set[str] = field(default_factory=set)

    def has_cost(self, worker: str, how: str) -> str:
        """Count the loss; gives ``how`` the simulation did it."""
        self.losses += 1
        self.avoided.add(worker)
        return how


class ClusterSimulators:
    """Simulators (foldcar.study.chunks) at ``places`` of ``client``; ``carsim`` is the sweep's."""

    chunk_s = 2.5
    # Threads that wait for chunks, on this machine.
    most = 1024

    def __init__(self, client: Any, places: Places, carsim: Carsim) -> None:
        self._client, self._places, self._carsim = client, places, carsim
        self._recipes: dict[Runner, Recipe] = {}
        self._numbers = itertools.count()
        self._name = f"foldcar-{uuid.uuid4().hex[:12]}"
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """As in Simulators."""
        return min(max(1, self._places.count), self.most)

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """As in Simulators."""
        with self._lock:
            if runner not in self._recipes:
                self._recipes[runner] = recipe_of(runner, self._carsim)
        answers: list[dict[str, Any]] = []
        seconds = 0.0
        parts = deque([_Part(list(requests))])
        while parts:
            part = parts.popleft()
            found = self._attempt(self._recipes[runner], bodies, scenes, part)
            if isinstance(found, Simulated):
                answers += found.answers
                seconds += found.seconds
            elif len(part.requests) == 1 and part.losses >= LOSSES:
                answers.append({"error": f"the simulation {found}, {part.losses} times"})
            elif len(part.requests) > 1 and part.losses >= CHUNK_LOSSES:
                # The halves have cost a worker each already: the next one halves them again.
                half = len(part.requests) // 2
                losses = CHUNK_LOSSES - 1
                parts.extendleft([_Part(part.requests[half:], losses), _Part(part.requests[:half], losses)])
            else:
                parts.appendleft(part)
        return answers, seconds

    def stop(self, runner: Runner) -> None:
        """As in Simulators."""
        self._places.stop("stopped")

    def _attempt(
        self, recipe: Recipe, bodies: Mapping[str, str], scenes: Mapping[str, str], part: _Part
    ) -> Simulated | str:
        """The part's runs at one place; else, with its losses counted, what the simulation did to its worker."""
        place = self._places.take(part.avoided)
        limit_s = _limit_s(part.requests)
        needed = {one.body for one in part.requests}, {one.scene for one in part.requests}
        try:
            future = self._client.submit(
                run_chunk, recipe, _only(bodies, needed[0]), _only(scenes, needed[1]), part.requests, limit_s,
                key=f"{self._name}-{next(self._numbers)}", workers=[place.worker], pure=False,
            )  # fmt: skip
        except Exception:
            # Without a scheduler; Places says when that is for good.
            time.sleep(RETRY_S)
            self._places.give(place)
            return ""
        future.add_done_callback(lambda _: place.changed.set())
        if not place.changed.wait(limit_s + SILENCE_S):
            self._places.await_answer(place, future, limit_s + SILENCE_S)
            return part.has_cost(place.worker, "made its worker hang")
        try:
            return self._ending(place, future, part)
        finally:
            future.cancel()
            self._places.give(place)

    def _ending(self, place: Place, future: Any, part: _Part) -> Simulated | str:
        """What has come of a chunk that has ended or whose worker is gone. CarsimError if the simulator refused it."""
        try:
            found = future.result(GATHER_S) if future.status == "finished" else None
        except Exception:
            # The worker has gone with its answers, or the scheduler.
            found = None
        if isinstance(found, Simulated) and _sound(found, part.requests):
            return found
        if isinstance(found, Trouble):
            if found.kind == "refused":
                raise CarsimError(f"worker {place.worker} ({found.host}): {found.why}")
            if found.kind == "late":
                return part.has_cost(place.worker, found.why)
            self._places.refuse(place.worker, found.host, found.why)
        elif place.gone:
            return part.has_cost(place.worker, "ended its worker")
        elif found is not None or future.status == "error":
            why = "its answers are no results" if found is not None else f"it cannot run chunks: {future.exception()!r}"
            self._places.refuse(place.worker, "another foldcar", why)
        else:
            # The connection to the scheduler was lost, and the chunk with it: once more, and nobody's fault.
            time.sleep(RETRY_S)
        return ""


def _only(texts: Mapping[str, str], names: set[str]) -> dict[str, str]:
    return {name: text for name, text in texts.items() if name in names}


def _limit_s(requests: Sequence[RunRequest]) -> float:
    """The wall time that a worker has for these runs."""
    driving_s = sum(_time_limit_s(one.settings) for one in requests)
    if len(requests) == 1:
        return RUN_LIMIT_S + RUN_SHARE * driving_s
    return CHUNK_LIMIT_S + CHUNK_SHARE * driving_s


@lru_cache(4096)
def _time_limit_s(settings: str) -> float:
    return float(json.loads(settings)["time_limit_s"])


def _sound(found: Simulated, requests: Sequence[RunRequest]) -> bool:
    """Whether these are as many answers as there are requests, each as carsim gives it."""
    return len(found.answers) == len(requests) and all(
        isinstance(one.get("error"), str) or (one.get("outcome") in OUTCOMES and all(name in one for name in NUMBERS))
        for one in found.answers
    )
