"""A store's page while runs and trials come: what the page polls, made anew as the store changes.

Threads of the server answer polls, the main thread makes the data (:meth:`LiveStudy.follow`). It takes at most
SHARE of the machine's time, and none while nobody polls.
"""

import base64
import json
import secrets
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TextIO

from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.store.connection import beside, is_written
from foldcar.store.info import ExperimentInfo
from foldcar.store.log_files import logs_folder, running_trial_file
from foldcar.store.reader import Store

# Time from one making of the data to the next (s), at least; their share of what all processors do meanwhile.
LEAST_S = 2.0
SHARE = 0.03
# A page that has polled so long ago (s) is open; what has ended is served so long for its last poll.
OPEN_S = 10.0
LAST_POLL_S = 8.0
# A trial's file that was written so long ago (s) was left by a killed program; drawing the placement takes some time.
SILENT_S = 15.0
# Of an answer.
MOST_LETTERS = 1000


class LiveStudy:
    """The page's data of a store that is written. ``command`` is that of the report, ``thresholds`` are its own.

    ``taps`` get what is tapped on the page, a JSON object a line; None: the page offers nothing to tap.
    """

    def __init__(
        self,
        path: Path,
        command: Sequence[str] = (),
        thresholds: Sequence[float] = (),
        simulated_trials: bool = False,
        taps: TextIO | None = None,
    ) -> None:
        self._taps = taps
        self._path, self._command, self._thresholds, self._simulated = path, command, thresholds, simulated_trials
        self._study = b"null"
        # Another server's page has none of its versions.
        self._name, self._number = secrets.token_hex(4), 0
        self._error = ""
        self._seen: tuple[Any, ...] | None = None
        # When the sweep was first seen (s), and how many runs there were: the estimated end goes by the runs since.
        self._first: tuple[float, int] | None = None
        self._counts: dict[str, Any] = {"done": 0, "planned": None, "left_s": None, "designs": None, "decided": None}
        self._next_s = 0.0
        self._polled_s = -OPEN_S
        self._told = ""
        self._wanted = threading.Event()
        self._lock = threading.Lock()

    def poll(self, query: str) -> bytes:
        """What a page that has the data and the picture ``VERSION&NAME`` is sent, as JSON; any thread may ask.

        ``version``; ``study``: the data of page_data.py, null if the page has them; ``state``: "waiting" (nothing is
        stored yet), "running", "killed", "stopped" or "done"; ``done`` and ``planned`` runs, ``left_s`` to the estimated
        end (null: unknown), ``designs`` and how many of them are ``decided`` (null but for sweeps that stop when they
        know), ``changed_s`` since the store was last written, ``error``: why it cannot be read;
        ``taps``: whether answers may be tapped; ``trial``: what a running `foldcar log` says (running.py), with
        ``picture_png`` (base64) if the page lacks it, or null.
        """
        self._polled_s = time.monotonic()
        self._wanted.set()
        changed, state = self._changed_s(), self._state()
        known, _, picture = query.partition("&")
        trial = _running_trial(self._path, picture)
        with self._lock:
            version = f"{self._name}-{self._number}"
            told = {"version": version, "state": state, "changed_s": changed, "error": self._error, **self._counts}
            told |= {"trial": trial, "taps": self._taps is not None}
            study = b"null" if known == version else self._study
            self._told = f"{version} {state}"
        return json.dumps(told, separators=(",", ":")).encode()[:-1] + b',"study":' + study + b"}"

    def tap(self, said: Any) -> bool:
        """Pass on an answer that was tapped: ``question`` (a number) and ``answer`` (a line). Whether it is one."""
        if self._taps is None or not isinstance(said, dict) or said.keys() != {"question", "answer"}:
            return False
        number, answer = said["question"], said["answer"]
        if not isinstance(number, float) or not isinstance(answer, str) or len(answer) > MOST_LETTERS:
            return False
        self._taps.write(json.dumps({"question": number, "answer": " ".join(answer.split())}) + "\n")
        self._taps.flush()
        return True

    def follow(self, ended: Callable[[], bool] = lambda: False) -> None:
        """Make the data whenever the store has changed and a page polls, until ``ended`` and a page has the last ones."""
        while not ended():
            self._wanted.wait(0.5)
            # A drive's row says nothing before its end, and a tap to stop must not wait.
            said = _said(self._path) or {}
            drives = said.get("placed") and not said.get("ended")
            if self._wanted.is_set() and time.monotonic() >= self._next_s and not drives:
                self._wanted.clear()
                self.refresh()
            elif self._wanted.is_set():
                time.sleep(0.1)
        if time.monotonic() - self._polled_s < OPEN_S:
            self.refresh()
            until = time.monotonic() + LAST_POLL_S
            last = f"{self._name}-{self._number} {self._state()}"
            while self._told != last and time.monotonic() < until:
                time.sleep(0.05)

    def refresh(self) -> None:
        """Make the data, unless the store is as it was then."""
        begun_s, seen = time.process_time(), _stamp(self._path)
        if seen == self._seen:
            return
        try:
            study, infos = self._made() if self._path.exists() else (b"null", [])
        except FoldcarError as problem:
            self._error = str(problem)
        else:
            with self._lock:
                self._error, self._seen, self._study = "", seen, study
                self._number += 1
                self._counts = self._counted(infos)
        self._next_s = time.monotonic() + max(LEAST_S, (time.process_time() - begun_s) / (SHARE * usable_processors()))

    def _made(self) -> tuple[bytes, list[ExperimentInfo]]:
        # To import it takes longer than to serve the page.
        from foldcar.report.page_data import page_data, read_experiments

        with Store.open(self._path) as store:
            infos = list(store.info().experiments.values()) if store.holds_study() else []
            experiments = read_experiments(store, self._thresholds, self._simulated)
            some = [one for one in experiments if one.trials or one.info.stored_runs]
            data = page_data(store, self._command, some) if some else None
        return json.dumps(data, separators=(",", ":"), allow_nan=False).encode(), infos

    def _counted(self, infos: Sequence[ExperimentInfo]) -> dict[str, Any]:
        done, planned = sum(info.stored_runs for info in infos), sum(info.planned_runs for info in infos)
        until = [info for info in infos if info.until is not None]
        # A search plans nothing.
        open_end = not infos or any(info.searched for info in infos)
        now_s = time.monotonic()
        if self._first is None or not infos or not is_written(self._path):
            self._first = now_s, done
        first_s, first = self._first
        pace = None if open_end or done == first else (now_s - first_s) / (done - first)
        return {
            "done": done,
            "planned": None if open_end else planned,
            "left_s": None if pace is None else pace * (planned - done),
            "designs": sum(info.designs for info in until) if until else None,
            "decided": sum(info.decided for info in until) if until else None,
        }

    def _state(self) -> str:
        written, counts = is_written(self._path), self._counts
        if written:
            return "running" if counts["done"] or self._study != b"null" else "waiting"
        if not self._path.exists():
            return "waiting"
        if counts["planned"] is None or counts["done"] >= counts["planned"]:
            return "done"
        return "killed" if written is None else "stopped"

    def _changed_s(self) -> float | None:
        seen = _stamp(self._path)
        return None if not seen else round(max(0.0, time.time() - max(one[0] for one in seen) / 1e9), 1)


def _stamp(path: Path) -> tuple[Any, ...]:
    """What changes when the store does: time (ns), size and number of its file and of its log."""
    found = []
    for file in (path, beside(path, "-wal")):
        try:
            status = file.stat()
        except OSError:
            continue
        # Readers leave an empty log beside the store of a killed sweep.
        if file == path or status.st_size:
            found.append((status.st_mtime_ns, status.st_size, status.st_ino))
    return tuple(found)


def _running_trial(store: Path, picture: str) -> dict[str, Any] | None:
    """What a running `foldcar log` says, with the picture of the placement unless it is that one; None without a log."""
    said = _said(store)
    name = "" if said is None else said.get("picture", "")
    if said is not None and name and name != picture:
        try:
            said["picture_png"] = base64.b64encode((logs_folder(store) / Path(name).name).read_bytes()).decode()
        except OSError:
            return None
    return said


def _said(store: Path) -> dict[str, Any] | None:
    file = running_trial_file(store)
    try:
        if time.time() - file.stat().st_mtime > SILENT_S:
            return None
        said: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return said
