"""The way from `--scheduler` to simulators: a Dask scheduler at an address, or a cluster of this machine's own.

Security is Dask's: tls:// addresses take keys and certificates from its configuration (distributed.comm.tls).
"""

import contextlib
import logging
import re
import warnings
from collections.abc import Callable, Iterator
from typing import Any

from foldcar.cluster.local_cluster import local_cluster
from foldcar.cluster.places import Places
from foldcar.cluster.workers import ClusterSimulators
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.simulation.carsim import Carsim
from foldcar.study.limits import MOST_JOBS

LOCAL = "local"
CONNECT_S = 10
# How long a sweep waits while there is no worker or no scheduler: in Dask's configuration, `foldcar.wait`.
WAIT = "10 minutes"


@contextlib.contextmanager
def open_cluster(scheduler: str, carsim: Carsim, say: Callable[[str], None]) -> Iterator[ClusterSimulators]:
    """Simulators at ``scheduler``: an address as tcp://host:8786, ``local`` or ``local:N`` with N workers.

    ``say`` is given a line when workers are missing, refused or hang. FoldcarError.
    """
    workers = _local_workers(scheduler)
    # Its messages are for those who run a cluster; what concerns a sweep is said by `say`.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    import dask
    import distributed

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", module="distributed")
    wait_s = float(dask.utils.parse_timedelta(dask.config.get("foldcar.wait", WAIT)))
    with contextlib.ExitStack() as stack:
        address = scheduler if workers is None else stack.enter_context(local_cluster(workers))
        _check(distributed, scheduler, address)
        # The time for which it tries to connect again.
        client = distributed.Client(address, timeout=wait_s, set_as_default=False)
        stack.callback(client.close, timeout=CONNECT_S)
        places = stack.enter_context(Places(client, address, say, wait_s))
        yield ClusterSimulators(client, places, carsim)


def check_scheduler(scheduler: str | None, jobs: int | None) -> None:
    """FoldcarError if the option's value is none, or stands beside ``--jobs``."""
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
    if head == LOCAL and re.fullmatch(r"[0-9]{1,9}", tail) and 1 <= int(tail) <= MOST_JOBS:
        return int(tail)
    if head == LOCAL:
        raise FoldcarError(f"--scheduler: {scheduler}: is not local:N with N from 1 to {MOST_JOBS}")
    if not re.fullmatch(r"([a-z]+://)?(\[[0-9a-fA-F:.%\w]+\]|[^\s:/\[\]]+):[0-9]{1,5}", scheduler):
        raise FoldcarError(f"--scheduler: '{scheduler}' is neither local nor an address, as tcp://10.0.0.1:8786")
    return None


def _check(distributed: Any, scheduler: str, address: str) -> None:
    """FoldcarError if nothing answers there, or another version of Dask."""
    try:
        with distributed.Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            there = client.get_versions()["scheduler"]["packages"]["distributed"]
    except Exception as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise FoldcarError(f"--scheduler: {scheduler}: no Dask scheduler answers there: {why}") from None
    if there != distributed.__version__:
        raise FoldcarError(
            f"--scheduler: {scheduler}: runs distributed {there}, here is {distributed.__version__}: install the same"
        )
