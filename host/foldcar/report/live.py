"""Serve a store's page while a sweep or trials write to the store; the page polls for its data.

Threads of the server answer polls; the main thread recomputes the data (:meth:`LiveStudy.follow`). It takes at most
CPU_FRACTION of the machine's time, and none while no page polls. The server answers only GET and HEAD, on the loopback
address. It refuses requests for another host, because another site's name may resolve to this address (DNS rebinding).
"""

import json
import os
import secrets
import sys
import threading
import time
from collections.abc import Callable, Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.store.connection import beside, is_written
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

# Minimum time between recomputations of the data (s); their maximum fraction of the time of all processors.
MIN_INTERVAL_S = 2.0
CPU_FRACTION = 0.03
# A page counts as open for this time after its last poll (s). The last data are served at most this long after the end.
OPEN_S = 10.0
LAST_POLL_S = 8.0
ADDRESS = "127.0.0.1"
# A client that sends nothing for this time (s) is disconnected.
SILENCE_S = 10.0
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class LiveStudy:
    """The page's data of a store that is being written; ``command`` and ``thresholds`` are those of the report."""

    def __init__(
        self,
        path: Path,
        command: Sequence[str] = (),
        thresholds: Sequence[float] = (),
        simulated_trials: bool = False,
    ) -> None:
        self._path, self._command, self._thresholds, self._simulated = path, command, thresholds, simulated_trials
        self._study = b"null"
        # The name differs between servers, so a page of another server has no version of this one.
        self._name, self._number = secrets.token_hex(4), 0
        self._error = ""
        self._seen: tuple[Any, ...] | None = None
        # When the sweep was first seen (s), and its number of runs then: the end is estimated from the runs since.
        self._first: tuple[float, int] | None = None
        self._counts: dict[str, Any] = {"done": 0, "planned": None, "left_s": None, "designs": None, "decided": None}
        # When the data may be computed again, and when a page last polled: at the start no page is open.
        self._next_s = 0.0
        self._polled_s = -OPEN_S
        self._last_answer = ""
        self._polled = threading.Event()
        self._lock = threading.Lock()

    def poll(self, query: str) -> bytes:
        """Return the answer to a page that has the data of version ``query``, as JSON; any thread may call this.

        ``version``; ``study``: the data of page_data.py, null if the page has them; ``state``: "waiting" (nothing is
        stored yet), "running", "killed", "stopped" or "done"; ``done`` and ``planned`` runs; ``left_s`` to the estimated
        end, null if unknown; ``designs`` and how many of them are ``decided``, null without a stopping rule;
        ``changed_s`` since the store was last written; ``error``: why the store cannot be read.
        """
        self._polled_s = time.monotonic()
        self._polled.set()
        changed, state = self._changed_s(), self._state()
        with self._lock:
            version = f"{self._name}-{self._number}"
            status = {"version": version, "state": state, "changed_s": changed, "error": self._error, **self._counts}
            study = b"null" if query == version else self._study
            self._last_answer = f"{version} {state}"
        # The data is JSON already: it is put in before the closing brace.
        return json.dumps(status, separators=(",", ":")).encode()[:-1] + b',"study":' + study + b"}"

    def follow(self, ended: Callable[[], bool] = lambda: False) -> None:
        """Refresh the data while pages poll, until ``ended``; then wait for an open page to poll the last data."""
        while not ended():
            self._polled.wait(0.5)
            if self._polled.is_set() and time.monotonic() >= self._next_s:
                self._polled.clear()
                self.refresh()
            elif self._polled.is_set():
                # A page has polled, but it is too early to compute the data again.
                time.sleep(0.1)
        if time.monotonic() - self._polled_s < OPEN_S:
            self.refresh()
            until = time.monotonic() + LAST_POLL_S
            last = f"{self._name}-{self._number} {self._state()}"
            while self._last_answer != last and time.monotonic() < until:
                time.sleep(0.05)

    def refresh(self) -> None:
        """Compute the data if the store has changed since the last time."""
        begun_s, stamp = time.process_time(), _stamp(self._path)
        if stamp == self._seen:
            return
        try:
            study, infos = self._compute() if self._path.exists() else (b"null", [])
        except FoldcarError as problem:
            self._error = str(problem)
        else:
            with self._lock:
                self._error, self._seen, self._study = "", stamp, study
                self._number += 1
                self._counts = self._counted(infos)
        # So late that computing takes at most CPU_FRACTION of the processors.
        self._next_s = time.monotonic() + max(
            MIN_INTERVAL_S, (time.process_time() - begun_s) / (CPU_FRACTION * usable_processors())
        )

    def _compute(self) -> tuple[bytes, list[ExperimentInfo]]:
        """Compute the page's data from the store, as JSON, and read the experiments; both are returned."""
        # The import takes longer than serving the page.
        from foldcar.report.page_data import page_data, read_experiments

        with Store.open(self._path) as store:
            infos = list(store.info().experiments.values()) if store.holds_study() else []
            experiments = read_experiments(store, self._thresholds, self._simulated)
            shown = [experiment for experiment in experiments if experiment.trials or experiment.info.stored_runs]
            data = page_data(store, self._command, shown) if shown else None
        return json.dumps(data, separators=(",", ":"), allow_nan=False).encode(), infos

    def _counted(self, infos: Sequence[ExperimentInfo]) -> dict[str, Any]:
        """Count runs and decided designs, and estimate the time to the end."""
        done, planned = sum(info.stored_runs for info in infos), sum(info.planned_runs for info in infos)
        until = [info for info in infos if info.until is not None]
        # A search has no planned number of runs.
        open_end = not infos or any(info.searched for info in infos)
        now_s = time.monotonic()
        # The estimate begins anew as long as no sweep runs, so that a pause does not count.
        if self._first is None or not infos or not is_written(self._path):
            self._first = now_s, done
        first_s, first_done = self._first
        # Seconds for each run.
        pace = None if open_end or done == first_done else (now_s - first_s) / (done - first_done)
        return {
            "done": done,
            "planned": None if open_end else planned,
            "left_s": None if pace is None else pace * (planned - done),
            "designs": sum(info.designs for info in until) if until else None,
            "decided": sum(info.decided for info in until) if until else None,
        }

    def _state(self) -> str:
        """Return the state of the sweep, as :meth:`poll` describes it."""
        written, counts = is_written(self._path), self._counts
        if written:
            return "running" if counts["done"] or self._study != b"null" else "waiting"
        if not self._path.exists():
            return "waiting"
        if counts["planned"] is None or counts["done"] >= counts["planned"]:
            return "done"
        # None: the writer was killed. False: it has ended by itself.
        return "killed" if written is None else "stopped"

    def _changed_s(self) -> float | None:
        stamp = _stamp(self._path)
        return None if not stamp else round(max(0.0, time.time() - max(stamp[0] for stamp in stamp) / 1e9), 1)


def _stamp(path: Path) -> tuple[Any, ...]:
    """Return time (ns), size and inode of the store's file and of its log; they change when the store does."""
    result = []
    for file in (path, beside(path, "-wal")):
        try:
            status = file.stat()
        except OSError:
            continue
        # Readers leave an empty log beside the store of a killed sweep.
        if file == path or status.st_size:
            result.append((status.st_mtime_ns, status.st_size, status.st_ino))
    return tuple(result)


class PageServer(ThreadingHTTPServer):
    """Serves ``page`` (HTML), and the answers of ``poll`` to queries; ``port`` 0 takes a free one.

    Raises FoldcarError if the port is taken.
    """

    daemon_threads = True
    # On Windows the option would let two programs have one port.
    allow_reuse_address = os.name == "posix"

    def __init__(self, page: str, poll: Callable[[str], bytes], port: int = 0) -> None:
        try:
            super().__init__((ADDRESS, port), _Handler)
        except OSError as error:
            reason = error.strerror or error
            raise FoldcarError(f"--port {port}: {reason}; name another one, or 0 for a free one") from None
        self.page, self.poll = page.encode(), poll
        self.port = int(self.server_address[1])
        self.url = f"http://{ADDRESS}:{self.port}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore clients that disconnect."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    protocol_version = "HTTP/1.1"
    timeout = SILENCE_S

    def do_GET(self) -> None:
        """Answer the page, its data, or an error."""
        path, _, query = self.path.partition("?")
        # Another site's name may resolve to this address; its pages must not read the study.
        hosts = [f"{name}:{self.server.port}" for name in (ADDRESS, "localhost")]
        if self.headers.get_all("Host", []) not in ([host] for host in hosts):
            self.send_error(HTTPStatus.FORBIDDEN, "not of this page")
        elif path == "/":
            self._send(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif path == "/study.json":
            self._send(HTTPStatus.OK, self.server.poll(query), "application/json")
        else:
            self.send_error(HTTPStatus.NOT_FOUND, "nothing is here")

    def do_HEAD(self) -> None:
        self.do_GET()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse a request in a line of plain text."""
        self._send(HTTPStatus(code), f"{message or HTTPStatus(code).phrase}\n".encode(), "text/plain")

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        """Send an answer with the headers of all answers."""
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        if status != HTTPStatus.OK:
            # The rest of a refused request is not read.
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Log no requests."""
