"""From `--scheduler` to simulators: chunks of runs at the workers of a Dask scheduler.

Dask repeats a chunk whose worker dies at another worker. A chunk that ends several workers is halved, until the run that
does it is alone and has failed. Security is Dask's: tls:// addresses take keys and certificates from its configuration
(distributed.comm.tls), a cluster of this machine makes its own for as long as it runs.
"""

import contextlib
import importlib.metadata
import logging
import re
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.installation import require, usable_processors
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner, RunRequest
from foldcar.study.cluster.chunk import Recipe, fault_of_worker, recipe_of, run_chunk
from foldcar.study.limits import MAX_JOBS
from foldcar.version import __version__

LOCAL = "local"
CONNECT_S = 10
LOOK_S = 1.0
# How long a sweep waits for a worker: in Dask's configuration, `foldcar.wait`.
WAIT = "10 minutes"
# Of a chunk at which a worker raises an error.
RETRIES = 2


def check_scheduler(scheduler: str | None, jobs: int | None) -> None:
    """FoldcarError if ``scheduler`` is neither ``local`` nor an address, or stands beside ``--jobs``."""
    if scheduler is None:
        return
    if jobs is not None:
        raise FoldcarError("--jobs: says nothing with --scheduler, whose workers simulate; local:N starts N of them")
    _local_workers(scheduler)


def _local_workers(scheduler: str) -> int | None:
    """How many workers to start here; None for an address."""
    if scheduler == LOCAL:
        return usable_processors()
    head, _, tail = scheduler.partition(":")
    if head == LOCAL and re.fullmatch(r"[0-9]{1,9}", tail) and 1 <= int(tail) <= MAX_JOBS:
        return int(tail)
    if head == LOCAL:
        raise FoldcarError(f"--scheduler: {scheduler}: is not local:N with N from 1 to {MAX_JOBS}")
    if not re.fullmatch(r"([a-z]+://)?(\[[0-9a-fA-F:.%\w]+\]|[^\s:/\[\]]+):[0-9]{1,5}", scheduler):
        raise FoldcarError(f"--scheduler: '{scheduler}' is neither local nor an address, as tcp://10.0.0.1:8786")
    return None


@contextlib.contextmanager
def open_cluster(scheduler: str, carsim: Carsim, say: Callable[[str], None]) -> Iterator["ClusterSimulators"]:
    """Simulators at ``scheduler``: an address as tcp://host:8786, ``local`` or ``local:N`` with N workers.

    ``say`` is given a line when workers are missing or cannot run the sweep. FoldcarError.
    """
    workers = _local_workers(scheduler)
    require("cluster")
    import dask
    import distributed

    # Dask's messages are for those who run a cluster.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", module="distributed")
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="foldcar-", ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({"temporary-directory": folder}))
        place: Any = scheduler
        if workers is not None:
            with _without_ctrl_c():
                cluster = distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, security=distributed.Security.temporary(), memory_limit=0,
                    dashboard_address=None, worker_dashboard_address=None, silence_logs=logging.CRITICAL,
                )  # fmt: skip
            place = stack.enter_context(cluster)
        try:
            client = stack.enter_context(distributed.Client(place, timeout=CONNECT_S, set_as_default=False))
            there = client.get_versions()["scheduler"]["packages"]["distributed"]
        except Exception as error:
            why = " ".join(str(error).split())[:200] or type(error).__name__
            raise FoldcarError(f"--scheduler: {scheduler}: no Dask scheduler answers there: {why}") from None
        if there != (here := distributed.__version__):
            raise FoldcarError(f"--scheduler: {scheduler}: runs distributed {there}, here is {here}: install the same")
        yield ClusterSimulators(client, carsim, say)


@contextlib.contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Let processes that the block starts ignore Ctrl-C: it is for the command, which ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


class ClusterSimulators:
    """Simulators (foldcar.study.chunks) at the workers of ``client``; ``carsim`` is the sweep's."""

    chunk_s = 2.5
    # Threads that wait for chunks, on this machine.
    most = 1024

    def __init__(self, client: Any, carsim: Carsim, say: Callable[[str], None]) -> None:
        import dask

        self._client, self._carsim, self._say = client, carsim, say
        self._wait_s = float(dask.utils.parse_timedelta(dask.config.get("foldcar.wait", WAIT)))
        self._lock = threading.RLock()
        self._stopped = threading.Event()
        self._recipes: dict[Runner, Recipe] = {}
        # Each worker's threads, and why it cannot run a recipe ("": it can).
        self._threads: dict[str, int] = {}
        self._looked_s = -LOOK_S
        self._faults: dict[tuple[Recipe, str], str] = {}

    @property
    def count(self) -> int:
        """As in Simulators."""
        faulty = {worker for (_, worker), fault in self._faults.items() if fault}
        threads = sum(threads for worker, threads in self._threads.items() if worker not in faulty)
        return min(max(1, threads), self.most)

    def stop(self, runner: Runner) -> None:
        """As in Simulators."""
        self._stopped.set()

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """As in Simulators."""
        import distributed

        with self._lock:
            if runner not in self._recipes:
                self._recipes[runner] = recipe_of(runner, self._carsim)
        chunk = bodies, scenes, requests
        try:
            return self._result(self._recipes[runner], chunk)
        except distributed.KilledWorker:
            if len(requests) == 1:
                return [{"error": "the simulation ended its worker each time"}], 0.0
            half = len(requests) // 2
            first, second = (self.run(runner, bodies, scenes, part) for part in (requests[:half], requests[half:]))
            return first[0] + second[0], first[1] + second[1]
        except (OSError, distributed.client.FutureCancelledError) as error:
            why = str(error) or type(error).__name__
            raise FoldcarError(f"--scheduler: it does not answer any more: {why}; the same command resumes") from error

    def _result(self, recipe: Recipe, chunk: tuple[Any, ...]) -> tuple[list[dict[str, Any]], float]:
        """What `run_chunk` returns at one of the workers that can run the recipe."""
        while True:
            workers, done = self._await_workers(recipe), threading.Event()
            future = self._client.submit(run_chunk, recipe, *chunk, workers=workers, retries=RETRIES, pure=False)
            future.add_done_callback(lambda _, done=done: done.set())
            # Dask waits for the named workers, also for ever.
            while not done.wait(LOOK_S) and self._threads.keys() & workers:
                self._look()
            if done.is_set():
                answers: tuple[list[dict[str, Any]], float] = future.result()
                return answers
            future.cancel()

    def _await_workers(self, recipe: Recipe) -> list[str]:
        """The workers that can run the recipe. FoldcarError if there is none for a long time, or after `stop`."""
        begun_s, waits = time.monotonic(), False
        while True:
            with self._lock:
                self._look()
                self._check(recipe)
                if workers := [worker for worker in self._threads if not self._faults[recipe, worker]]:
                    return workers
            none = f"there is no worker{' that can run this sweep' if self._threads else ''}"
            if time.monotonic() - begun_s > self._wait_s:
                raise FoldcarError(f"--scheduler: {none} for {self._wait_s:g} s; the same command resumes")
            if not waits:
                waits = True
                self._say(f"--scheduler: {none}; waiting up to {self._wait_s:g} s")
            self._stopped.wait(LOOK_S)

    def _look(self) -> None:
        """Ask the scheduler for its workers, at most once in LOOK_S. FoldcarError after `stop`."""
        if self._stopped.is_set():
            raise FoldcarError("stopped")
        with self._lock:
            if time.monotonic() - self._looked_s >= LOOK_S:
                self._threads, self._looked_s = self._client.nthreads(), time.monotonic()

    def _check(self, recipe: Recipe) -> None:
        """Find out of new workers whether they can run the recipe; name those that cannot."""
        new = [worker for worker in self._threads if (recipe, worker) not in self._faults]
        if not new:
            return
        # A function of Python's: a worker without foldcar can receive it.
        versions = self._client.run(importlib.metadata.version, "foldcar", workers=new, on_error="return")
        same = [worker for worker in new if versions.get(worker) == __version__]
        faults = self._client.run(fault_of_worker, recipe, workers=same, on_error="return") if same else {}
        for worker in new:
            version = versions.get(worker)
            if worker in faults:
                fault = str(faults[worker])
            elif isinstance(version, str):
                fault = f"it has foldcar {version}, here is {__version__}: install the same there"
            else:
                fault = f"it has no foldcar: pip install 'foldcar[cluster]=={__version__}' in its environment"
            named = any(self._faults[other] for other in self._faults if other[1] == worker)
            self._faults[recipe, worker] = fault
            if fault and not named:
                self._say(f"worker {worker} gets no runs: {fault}")
