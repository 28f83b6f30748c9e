"""Summarises a drive from its log: duration, tilt, turn, shocks, the battery.

Input: a .tlog. Output: LogFeatures; a value is None if the log does not contain it (no IMU, no battery voltage, no end).

The car's filter pulls its angles towards the accelerometer's vertical, with a time constant T (0.5 s). While the car
accelerates, this gives a wrong pitch. The error d is estimated from the samples and subtracted:

    d' = (acc - pitch) / T - d / L    (acc: pitch by the accelerometer; L: forgetting time, because gyros drift)

While the car is shaken, the firmware ignores the accelerometer (firmware/lib/attitude), and so does this estimate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy

from foldcar.link.connection import CAR_SYSTEM
from foldcar.link.tlog import read_tlog, trial_start_s

# T and L of the head.
FILTER_S, FORGETTING_S = 0.5, 3.0
# The car is shaken if its total acceleration differs from gravity by more than this.
GRAVITY_M_S2, SHAKING_M_S2 = 9.81, 3.0
MILLI_G_M_S2 = 0.00980665
# A shock is more than wheels can cause on level ground: at a friction of 0.75, the total acceleration is 1.25 g.
SHOCK_FRACTION = 0.25
# Error of the largest tilts, because ten samples a second miss the peaks between them.
TILT_ERROR_RAD = 0.04
# The car integrates its rotation about the vertical. Rolling and pitching alternately adds up to half of roll × pitch to
# the integral (the solid angle that the axes enclose) without changing the heading.
HEADING_ERROR_RAD, HEADING_ERROR_FACTOR = 0.015, 0.5
# SYS_STATUS has this voltage if the car cannot measure it.
UNREADABLE_MV = 65535


@dataclass(frozen=True, slots=True)
class LogFeatures:
    """Features of a trial from its start until the car was stopped; errors are standard deviations.

    ``max_roll_rad`` (left side up) and ``max_pitch_rad`` (nose up) have the largest absolute values;
    ``heading_change_rad`` (to the left) is that at the end. ``shocks_s`` are the times of shocks. ``battery_sag_v`` is
    the voltage before the start minus the lowest voltage of the drive. ``servo_battery_v`` and ``servo_battery_rest_v``
    are the mean voltages of the servos' battery during and before the drive.
    """

    elapsed_time_s: float | None = None
    max_roll_rad: float | None = None
    max_pitch_rad: float | None = None
    tilt_error_rad: float | None = None
    heading_change_rad: float | None = None
    heading_error_rad: float | None = None
    shocks_s: tuple[float, ...] | None = None
    battery_sag_v: float | None = None
    servo_battery_v: float | None = None
    servo_battery_rest_v: float | None = None


def log_features(file: Path) -> LogFeatures:
    """Return the features of the last trial in a log; those that the log does not contain are None. Raises LogError."""
    messages = [message for _, message in read_tlog(file) if message.get_srcSystem() == CAR_SYSTEM]
    start_s = trial_start_s(messages)
    if start_s is None:
        return LogFeatures()
    trial = [message for message in messages if message.get_type() == "FOLDCAR_TRIAL"][-1]
    elapsed_s = trial.elapsed_ms / 1000 if trial.end else None
    duration_s = math.inf if elapsed_s is None else elapsed_s
    motion = _motion(messages, start_s, duration_s)
    roll = pitch = None
    if motion.tilts is not None:
        # The largest tilts of the drive, with their signs.
        roll, pitch = (float(max(column, key=abs)) for column in motion.tilts.T)
    sag_v = _sag_v(messages, start_s, duration_s)
    servo_v, rest_v = _servo_battery_v(messages, start_s, duration_s)
    if roll is None or pitch is None:
        return LogFeatures(elapsed_s, battery_sag_v=sag_v, servo_battery_v=servo_v, servo_battery_rest_v=rest_v)
    heading_error = HEADING_ERROR_RAD + HEADING_ERROR_FACTOR * abs(roll * pitch)
    return LogFeatures(
        elapsed_s,
        max_roll_rad=roll,
        max_pitch_rad=pitch,
        tilt_error_rad=TILT_ERROR_RAD,
        heading_change_rad=motion.turned_rad,
        heading_error_rad=heading_error,
        shocks_s=motion.shocks_s,
        battery_sag_v=sag_v,
        servo_battery_v=servo_v,
        servo_battery_rest_v=rest_v,
    )


class _Motion(NamedTuple):
    """What the IMU says of a drive; every field is None if it has no data before the drive or in it.

    ``tilts`` (n, 2) are roll and pitch (rad), where the pitch is corrected for the error of the car's filter.
    ``turned_rad`` is the change of the heading. ``shocks_s`` are the times of shocks since the start.
    """

    tilts: Any = None
    turned_rad: float | None = None
    shocks_s: tuple[float, ...] | None = None


def _motion(messages: Sequence[Any], start_s: float, duration_s: float) -> _Motion:
    """Return the motion in a drive that begins at ``start_s`` (time since boot) and takes ``duration_s``."""
    attitudes = {message.time_boot_ms: message for message in messages if message.get_type() == "ATTITUDE"}
    samples = {message.time_boot_ms: message for message in messages if message.get_type() == "SCALED_IMU"}
    common_ms = sorted(attitudes.keys() & samples.keys())
    # A row has the time since the start (s), the message ATTITUDE and the message SCALED_IMU of this time.
    rows = [(ms / 1000 - start_s, attitudes[ms], samples[ms]) for ms in common_ms]
    # The second before the start is needed for the filter's error and the first heading.
    rows = [row for row in rows if -1.0 <= row[0] <= duration_s]
    rows_before, rows_during = [row for row in rows if row[0] <= 0], [row for row in rows if row[0] > 0]
    if not rows_before or not rows_during:
        return _Motion()
    # The accelerometer shows the error of the car's pitch while it measures little but gravity. At all other times the
    # error is forgotten slowly.
    filter_error, tilts, shocks = 0.0, [], []
    last_s = rows[0][0]
    for time_s, attitude, sample in rows:
        # MAVLink's axes are forward, right, down.
        x, y, z = (MILLI_G_M_S2 * value for value in (sample.xacc, -sample.yacc, -sample.zacc))
        total_m_s2 = math.sqrt(x * x + y * y + z * z)
        # After a long gap the whole error is forgotten.
        step_s, last_s = min(time_s - last_s, FORGETTING_S), time_s
        filter_error -= filter_error * step_s / FORGETTING_S
        if abs(total_m_s2 - GRAVITY_M_S2) < SHAKING_M_S2:
            accelerometer_pitch = math.asin(max(-1.0, min(1.0, x / total_m_s2)))
            filter_error += (accelerometer_pitch - attitude.pitch) * step_s / FILTER_S
        if time_s > 0:
            tilts.append((attitude.roll, attitude.pitch - filter_error))
            if abs(total_m_s2 / GRAVITY_M_S2 - 1) > SHOCK_FRACTION:
                shocks.append(round(time_s, 3))
    yaws = numpy.unwrap([attitude.yaw for _, attitude, _ in (rows_before[-1], *rows_during)])
    # MAVLink's yaw is clockwise.
    return _Motion(tilts=numpy.array(tilts), turned_rad=float(yaws[0] - yaws[-1]), shocks_s=tuple(shocks))


def _sag_v(messages: Sequence[Any], start_s: float, duration_s: float) -> float | None:
    """Return the battery voltage before the start minus the lowest one of the drive (V); None if unknown."""
    readings = [
        (time_s, message.voltage_battery / 1000)
        for time_s, message in _timed(messages, start_s, "SYS_STATUS")
        if 0 < message.voltage_battery < UNREADABLE_MV
    ]
    before_v = [volts for time_s, volts in readings if time_s <= 0]
    during_v = [volts for time_s, volts in readings if 0 < time_s <= duration_s]
    if not before_v or not during_v:
        return None
    return float(round(before_v[-1] - min(during_v), 3))


def _servo_battery_v(messages: Sequence[Any], start_s: float, duration_s: float) -> tuple[float | None, float | None]:
    """Return the mean voltages (V) of the servos' battery during and before the drive; None if unknown."""
    readings = [(time_s, message.voltages[0] / 1000) for time_s, message in _timed(messages, start_s, "BATTERY_STATUS")]
    during_v = [volts for time_s, volts in readings if 0 < time_s <= duration_s]
    before_v = [volts for time_s, volts in readings if time_s <= 0]
    return _mean_v(during_v), _mean_v(before_v)


def _mean_v(voltages: Sequence[float]) -> float | None:
    """Return the mean of voltages (V), rounded to 1 mV; None if there are none."""
    if not voltages:
        return None
    return round(sum(voltages) / len(voltages), 3)


def _timed(messages: Sequence[Any], start_s: float, kind: str) -> list[tuple[float, Any]]:
    """Return the messages of type ``kind`` with times since ``start_s`` (s).

    Such messages have no time of their own: each gets that of the last message before it that has a time.
    """
    time_s = -math.inf
    timed = []
    for message in messages:
        if hasattr(message, "time_boot_ms"):
            time_s = message.time_boot_ms / 1000 - start_s
        if message.get_type() == kind:
            timed.append((time_s, message))
    return timed
