"""The places of a cluster: one for each thread of each worker that may run chunks, as workers come and go."""

import contextlib
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from foldcar.errors import FoldcarError

LOOK_S = 0.5


@dataclass(eq=False, slots=True)
class Place:
    """A thread of the worker at that address. ``changed`` is set when its chunk has ended or the worker is gone."""

    worker: str
    changed: threading.Event = field(default_factory=threading.Event)
    gone: bool = False


class Places:
    """Asks the scheduler of ``client`` twice a second which workers there are. A context manager; for several threads.

    ``say`` is given lines on what happens to workers. When there is no worker to be had for ``wait_s``, or no scheduler,
    :meth:`take` raises FoldcarError.
    """

    def __init__(self, client: Any, address: str, say: Callable[[str], None], wait_s: float) -> None:
        self._client, self._address, self._say, self._wait_s = client, address, say, wait_s
        self._changed = threading.Condition(threading.RLock())
        self._free: list[Place] = []
        self._all: set[Place] = set()
        # Places of workers that hang, with the chunks that they have not answered.
        self._hung: dict[Place, Any] = {}
        # Workers that get no more chunks, and why.
        self._refused: dict[str, str] = {}
        self._since_s = time.monotonic()
        self._said_waiting = False
        self._failure = ""
        self._closed = False
        self._thread = threading.Thread(target=self._watch, name="workers", daemon=True)

    def __enter__(self) -> "Places":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    @property
    def count(self) -> int:
        """How many places there are."""
        return len(self._all)

    def take(self, avoided: Collection[str]) -> Place:
        """Wait for a free place, best not one of the ``avoided`` workers'."""
        with self._changed:
            while not self._failure:
                others = [place for place in self._free if place.worker not in avoided]
                no_others = all(place.worker in avoided for place in self._all)
                if chosen := others or (self._free if no_others else []):
                    place = chosen[0]
                    self._free.remove(place)
                    place.changed.clear()
                    return place
                self._changed.wait()
            raise FoldcarError(self._failure)

    def give(self, place: Place) -> None:
        """The place is free again."""
        with self._changed:
            if place in self._all:
                self._free.append(place)
                self._changed.notify_all()

    def await_answer(self, place: Place, chunk: Any, limit_s: float) -> None:
        """The place's worker hangs: it is free again when ``chunk``, a future, has ended after all."""
        with self._changed:
            if place not in self._all:
                return
            self._all.remove(place)
            self._hung[place] = chunk
        self._say(f"worker {place.worker} hangs: no answer for {limit_s:g} s; its chunk is given to another")
        chunk.add_done_callback(lambda _: self._answered(place))

    def refuse(self, worker: str, host: str, why: str) -> None:
        """Give the worker no more chunks; says it once."""
        with self._changed:
            if worker in self._refused:
                return
            self._refused[worker] = why
            self._remove(worker)
        self._say(f"worker {worker} ({host}) gets no runs: {why}")

    def stop(self, failure: str) -> None:
        """From now on `take` raises FoldcarError; whoever waits for a chunk sees its place gone."""
        with self._changed:
            self._failure = self._failure or failure
            for worker in {place.worker for place in self._all}:
                self._remove(worker)

    def _answered(self, place: Place) -> None:
        with self._changed:
            if self._hung.pop(place, None) is not None and not place.gone:
                self._all.add(place)
                self.give(place)

    def _watch(self) -> None:
        while not self._closed:
            threads = self._threads()
            with self._changed:
                if self._closed:
                    return
                if threads is not None:
                    self._update(threads)
                line = self._waiting()
            if line:
                self._say(line)
            with self._changed:
                self._changed.wait_for(lambda: self._closed, LOOK_S)

    def _threads(self) -> dict[str, int] | None:
        """Every worker's threads by its address; None while the scheduler does not answer."""
        with contextlib.suppress(Exception):
            threads: dict[str, int] = self._client.nthreads()
            return threads
        if self._client.status in ("closing", "closed"):
            self.stop(f"scheduler {self._address}: is gone; the same command resumes")
        return None

    def _update(self, threads: dict[str, int]) -> None:
        known = {place.worker for place in (*self._all, *self._hung)}
        for worker in known - threads.keys():
            self._remove(worker)
        # Another worker may come at the same address.
        self._refused = {worker: why for worker, why in self._refused.items() if worker in threads}
        if self._failure:
            return
        for worker in threads.keys() - known - self._refused.keys():
            places = [Place(worker) for _ in range(threads[worker])]
            self._all.update(places)
            self._free += places
        self._changed.notify_all()

    def _remove(self, worker: str) -> None:
        for place in [place for place in (*self._all, *self._hung) if place.worker == worker]:
            self._all.discard(place)
            self._hung.pop(place, None)
            place.gone = True
            place.changed.set()
        self._free = [place for place in self._free if not place.gone]
        self._changed.notify_all()

    def _waiting(self) -> str:
        """What there is to say while there is no worker."""
        now_s = time.monotonic()
        if self._all:
            self._since_s, self._said_waiting = now_s, False
            return ""
        refused = f" that may run this sweep ({len(self._refused)} may not)" if self._refused else ""
        what = f"scheduler {self._address}: there is no worker{refused}"
        if now_s - self._since_s > self._wait_s:
            self.stop(f"{what} for {self._wait_s:g} s; the same command resumes")
            return ""
        if self._said_waiting:
            return ""
        self._said_waiting = True
        return f"{what}; waiting up to {self._wait_s:g} s"
