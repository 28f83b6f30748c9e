"""The path of a trial's car by its log: a simulated car's path, or a built car's roll and pitch by its IMU.

Input: a trial of the store. Output: rows of time (s), x, y, z (m), heading, pitch, roll (rad); a path, or angles
over time, or a sentence that says why both are missing.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.link.connection import CAR_SYSTEM
from foldcar.link.tlog import read_tlog, trial_start_s
from foldcar.store.log_files import intact_log
from foldcar.store.reader import Store
from foldcar.store.trial_records import LONGEST_S, Trial

Rows = NDArray[numpy.float64]
# Interval between the points of a drawn path.
INTERVAL_S = 0.05
ROUNDING_S = 1e-9
# The column of headings in the rows of a path.
HEADING_COLUMN = 4


@dataclass(frozen=True)
class TrialPath:
    """The path of a trial's car: one of ``rows``, ``attitude`` and ``missing`` is set.

    ``rows`` (n, 7) are time (s), x, y, z (m), heading, pitch, roll (rad). ``attitude`` has time (s), pitch and roll (rad)
    of a car whose position is unknown. ``missing`` is the reason why both are unknown.
    """

    rows: Rows | None = None
    attitude: tuple[tuple[float, float, float], ...] = ()
    missing: str = ""


def trial_path(store: Store, trial: Trial) -> TrialPath:
    """Return the path of a trial's car from the trial's log.

    If the log has no positions, the attitude of the car is returned; if it has neither, the reason why both are missing.
    """
    if trial.log is None:
        return TrialPath(missing="it has no log" if trial.source is None else "it was imported, without a log")
    try:
        file = intact_log(store.path, trial.id, trial.log, trial.log_sha256)
        if file is None:
            return TrialPath(missing=f"its log {trial.log} is missing")
        messages = [message for _, message in read_tlog(file)]
    except FoldcarError as error:
        return TrialPath(missing=f"its log cannot be used ({error})")
    start_s = trial_start_s(messages)
    if start_s is None:
        return TrialPath(missing="its log has no running trial")
    rows = _reported_path(messages, start_s)
    if rows is None:
        return _attitudes(messages, start_s)
    return TrialPath(rows=_resampled(rows))


def _reported_path(messages: list[Any], start_s: float) -> Rows | None:
    """Return the rows of a :class:`TrialPath`: the path that a simulated car reported, up to its outcome.

    Returns None if a built car drove, because it does not know its position.
    """
    states = [message for message in messages if message.get_type() == "FOLDCAR_TRUTH"]
    end_s = LONGEST_S
    for state in states:
        if state.outcome and math.isfinite(state.outcome_time):
            end_s = min(end_s, float(state.outcome_time))
    row_by_time: dict[float, tuple[float, ...]] = {}
    for state in states:
        time_s = state.time_usec / 1e6 - start_s
        row = (time_s, state.x, state.y, state.z, state.heading, state.pitch, state.roll)
        # A damaged log may have any numbers.
        if all(math.isfinite(value) for value in row) and 0 <= time_s <= end_s:
            row_by_time[time_s] = row
    if len(row_by_time) < 2:
        return None
    rows = numpy.array([row for _, row in sorted(row_by_time.items())])
    # Headings jump from π to -π. Without the jumps, so that they may exceed π, they can be interpolated.
    rows[:, HEADING_COLUMN] = numpy.unwrap(rows[:, HEADING_COLUMN])
    return rows


def _resampled(rows: Rows) -> Rows:
    """Return the path, linearly interpolated, every INTERVAL_S from 0 s on, and at its end."""
    times_s, columns = rows[:, 0], rows[:, 1:]
    end_s = float(times_s[-1])
    regular_times_s = numpy.arange(0, end_s, INTERVAL_S)
    # The last regular time may be the end, except for rounding errors. It must not appear twice.
    regular_times_s = regular_times_s[regular_times_s < end_s - ROUNDING_S]
    new_times_s = numpy.append(regular_times_s, end_s)
    new_columns = [numpy.interp(new_times_s, times_s, column) for column in columns.T]
    return numpy.column_stack([new_times_s, *new_columns])


def _attitudes(messages: list[Any], start_s: float) -> TrialPath:
    """Return pitch and roll of a built car during a trial, or the reason why there is no path.

    Only a car with an IMU sends them. ``messages`` are those of its log. ``start_s`` is when the trial began, in seconds
    since the car booted. The path's times count from then.
    """
    attitudes = []
    for message in messages:
        if message.get_type() != "ATTITUDE" or message.get_srcSystem() != CAR_SYSTEM:
            continue
        # Milliseconds and milliradians suffice for a drawing.
        time_s = round(message.time_boot_ms / 1000 - start_s, 3)
        pitch_rad, roll_rad = round(message.pitch, 3), round(message.roll, 3)
        if time_s >= 0 and math.isfinite(pitch_rad) and math.isfinite(roll_rad):
            attitudes.append((time_s, pitch_rad, roll_rad))
    if len(attitudes) < 2:
        return TrialPath(missing="its log has no path, because a built car without an IMU does not measure its position")
    return TrialPath(attitude=tuple(attitudes))
