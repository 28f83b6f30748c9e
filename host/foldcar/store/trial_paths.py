"""Where a trial's car was: a simulated car's path by its log, of a built one by a film, else its IMU's roll and pitch.

Input: a trial of the store. Output: rows of time (s), x, y, z (m), heading, pitch, roll (rad); a compact path, or angles
over time, or a sentence that says why there is neither.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.link.connection import CAR_SYSTEM
from foldcar.link.tlog import read_tlog, trial_start_s
from foldcar.simulation.compact_path import compact_path
from foldcar.simulation.runner import KEPT_INTERVAL_S as INTERVAL_S
from foldcar.store.log_files import intact_log
from foldcar.store.reader import Store
from foldcar.store.trial_records import LONGEST_S, Track, Trial

Rows = NDArray[numpy.float64]


@dataclass(frozen=True)
class TrialPath:
    """``path`` of ``rows`` rows until ``end_s``, or ``attitude`` (s; pitch, roll in rad), or why both are ``missing``.

    ``film_error`` of a filmed path: standard deviations of the place (m) and of the start (s).
    """

    path: bytes | None = None
    rows: int = 0
    end_s: float = 0.0
    attitude: tuple[tuple[float, float, float], ...] = ()
    missing: str = ""
    film_error: tuple[float, float] | None = None


def trial_path(store: Store, trial: Trial) -> TrialPath:
    """Where the car of ``trial`` was by its log, or else by a film; how it tilted, where neither has a path."""
    logged = _logged(store, trial)
    if not isinstance(logged, TrialPath):
        return _compacted(logged)
    track = store.track(trial.id)
    filmed = _filmed(track)
    if track is None or filmed is None:
        return logged
    return replace(_compacted(filmed), film_error=_film_error(track))


def trial_rows(store: Store, trial: Trial) -> Rows | None:
    """The rows (rows, 7) of the path of ``trial`` by a film, else by a simulated car's log; None without."""
    filmed = _filmed(store.track(trial.id))
    if filmed is not None:
        return filmed
    logged = _logged(store, trial)
    return None if isinstance(logged, TrialPath) else logged


def _logged(store: Store, trial: Trial) -> Rows | TrialPath:
    """What the log of ``trial`` tells of the car's movement."""
    if trial.log is None:
        return TrialPath(missing="it has no log" if trial.source is None else "it was imported, without a log")
    try:
        file = intact_log(store.path, trial.id, trial.log, trial.log_sha256)
        if file is None:
            return TrialPath(missing=f"its log {trial.log} is gone")
        messages = [message for _, message in read_tlog(file)]
    except FoldcarError as error:
        return TrialPath(missing=f"its log cannot be used ({error})")
    start_s = trial_start_s(messages)
    if start_s is None:
        return TrialPath(missing="its log has no trial that runs")
    driven = _driven(messages, start_s)
    return _felt(messages, start_s) if driven is None else driven


def _driven(messages: list[Any], start_s: float) -> Rows | None:
    rows = {}
    end_s = LONGEST_S
    for message in messages:
        if message.get_type() == "FOLDCAR_TRUTH":
            place = (message.x, message.y, message.z, message.heading, message.pitch, message.roll)
            time_s = message.time_usec / 1e6 - start_s
            if all(map(math.isfinite, place)) and 0 <= time_s <= end_s:
                rows[time_s] = place
            if message.outcome and math.isfinite(message.outcome_time):
                end_s = min(end_s, float(message.outcome_time))
    return _path([(time_s, *place) for time_s, place in sorted(rows.items()) if time_s <= end_s])


def _filmed(track: Track | None) -> Rows | None:
    return _path([] if track is None else [row[:7] for row in track.rows if row[0] >= 0])


def _path(rows: Sequence[Sequence[float]]) -> Rows | None:
    """The rows with headings that go on beyond a half turn; None if they are too few for a path."""
    if len(rows) < 2:
        return None
    result = numpy.array(rows)
    result[:, 4] = numpy.unwrap(result[:, 4])
    return result


def _film_error(track: Track) -> tuple[float, float]:
    """How well place (m) and start (s) of a filmed path are known, as standard deviations."""
    rows = numpy.array([row for row in track.rows if row[0] >= 0])
    # Of a row: the variances of x and y.
    own_m = math.sqrt(float(numpy.median(numpy.maximum(rows[:, 7], rows[:, 10]))))
    place_m = math.hypot(own_m, max(track.facts["frame_error_m"]))
    return round(place_m, 4), round(track.facts["start_error_s"], 3)


def _compacted(rows: Rows) -> TrialPath:
    last_s = float(rows[-1, 0])
    at = numpy.append(numpy.arange(0, last_s - 1e-9, INTERVAL_S), last_s)
    path = numpy.column_stack([at, *(numpy.interp(at, rows[:, 0], column) for column in rows[:, 1:].T)])
    return TrialPath(compact_path(path.tolist()), len(path), last_s)


def _felt(messages: list[Any], start_s: float) -> TrialPath:
    felt = [
        (round(message.time_boot_ms / 1000 - start_s, 3), round(message.pitch, 3), round(message.roll, 3))
        for message in messages
        if message.get_type() == "ATTITUDE" and message.get_srcSystem() == CAR_SYSTEM
    ]
    during = tuple(one for one in felt if one[0] >= 0 and all(map(math.isfinite, one)))
    if len(during) < 2:
        return TrialPath(missing="a built car without an IMU does not know where it is: its log has no path")
    return TrialPath(attitude=during, end_s=during[-1][0])
