"""Summarises a drive from its log: duration, tilt, turn, shocks, the battery.

Input: a .tlog. Output: LogFeatures; a value is None if the log does not contain it (no IMU, no battery voltage, no end).

The car's filter pulls its angles towards the accelerometer's vertical, with a time constant T (0.5 s). While the car
accelerates, this gives a wrong pitch. The error d is estimated from the samples and subtracted:

    d' = (acc - pitch) / T - d / L    (acc: pitch by the accelerometer; L: forgetting time, because gyros drift)

While the car is shaken, the firmware ignores the accelerometer (firmware/lib/attitude), and so does this estimate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    last_state = [message for message in messages if message.get_type() == "FOLDCAR_TRIAL"][-1]
    elapsed_s = last_state.elapsed_ms / 1000 if last_state.end else None
    duration_s = math.inf if elapsed_s is None else elapsed_s
    servo_v, servo_rest_v = _servo_battery_v(messages, start_s, duration_s)
    features = LogFeatures(
        elapsed_time_s=elapsed_s,
        battery_sag_v=_sag_v(messages, start_s, duration_s),
        servo_battery_v=servo_v,
        servo_battery_rest_v=servo_rest_v,
    )
    motion = _motion(messages, start_s, duration_s)
    if motion is None:
        return features
    # The largest tilts of the drive, with their signs.
    roll = float(max(motion.rolls, key=abs))
    pitch = float(max(motion.pitches, key=abs))
    return replace(
        features,
        max_roll_rad=roll,
        max_pitch_rad=pitch,
        tilt_error_rad=TILT_ERROR_RAD,
        heading_change_rad=motion.turned_rad,
        heading_error_rad=HEADING_ERROR_RAD + HEADING_ERROR_FACTOR * abs(roll * pitch),
        shocks_s=motion.shocks_s,
    )


class _Motion(NamedTuple):
    """What the IMU says of a drive.

    ``rolls`` and ``pitches`` (rad) have an entry for each measurement; the pitches are corrected for the error of the
    car's filter. ``turned_rad`` is the change of the heading. ``shocks_s`` are the times of shocks since the start.
    """

    rolls: list[float]
    pitches: list[float]
    turned_rad: float
    shocks_s: tuple[float, ...]


class _Measurement(NamedTuple):
    """What the car measured at a time since the start: angles by its filter, and the acceleration.

    Angles are MAVLink's: the yaw is clockwise. Accelerations point forward and in any direction (m/s²).
    """

    time_s: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    forward_m_s2: float
    total_m_s2: float


def _measurements(messages: Sequence[Any], start_s: float) -> list[_Measurement]:
    """Return the measurements of the car's IMU, in the order of their times.

    The angles and the acceleration are in two messages, ATTITUDE and SCALED_IMU, which have the same time.
    """
    attitudes = {message.time_boot_ms: message for message in messages if message.get_type() == "ATTITUDE"}
    samples = {message.time_boot_ms: message for message in messages if message.get_type() == "SCALED_IMU"}
    measurements = []
    for time_ms in sorted(attitudes.keys() & samples.keys()):
        attitude, sample = attitudes[time_ms], samples[time_ms]
        # SCALED_IMU has the acceleration forward, to the right and down.
        forward, right, down = (MILLI_G_M_S2 * component for component in (sample.xacc, sample.yacc, sample.zacc))
        measurements.append(
            _Measurement(
                time_s=time_ms / 1000 - start_s,
                roll_rad=attitude.roll,
                pitch_rad=attitude.pitch,
                yaw_rad=attitude.yaw,
                forward_m_s2=forward,
                total_m_s2=math.sqrt(forward * forward + right * right + down * down),
            )
        )
    return measurements


def _motion(messages: Sequence[Any], start_s: float, duration_s: float) -> _Motion | None:
    """Return the motion in a drive that begins at ``start_s`` (time since boot) and takes ``duration_s``.

    Returns None if the IMU has measured nothing before the drive, or nothing in it.
    """
    # The second before the start is needed for the filter's error and the first heading.
    measurements = []
    for measurement in _measurements(messages, start_s):
        if -1.0 <= measurement.time_s <= duration_s:
            measurements.append(measurement)
    before = [measurement for measurement in measurements if measurement.time_s <= 0]
    during = [measurement for measurement in measurements if measurement.time_s > 0]
    if not before or not during:
        return None
    filter_errors = _filter_errors(measurements)
    # The errors of the measurements in the drive, which come last.
    filter_errors_during = filter_errors[len(before) :]
    shocks = []
    for measurement in during:
        if abs(measurement.total_m_s2 / GRAVITY_M_S2 - 1) > SHOCK_FRACTION:
            shocks.append(round(measurement.time_s, 3))
    # Without jumps from π to -π.
    yaws = numpy.unwrap([measurement.yaw_rad for measurement in (before[-1], *during)])
    return _Motion(
        rolls=[measurement.roll_rad for measurement in during],
        pitches=[m.pitch_rad - error for m, error in zip(during, filter_errors_during, strict=True)],
        # MAVLink's yaw is clockwise.
        turned_rad=float(yaws[0] - yaws[-1]),
        shocks_s=tuple(shocks),
    )


def _filter_errors(measurements: Sequence[_Measurement]) -> list[float]:
    """Return the estimated error (rad) of the pitch that the car's filter had at each measurement.

    The filter moves its pitch towards that of the accelerometer, with the time constant FILTER_S. While the car
    accelerates, the accelerometer's pitch is wrong, so the filter collects an error. This error is the sum of all these
    small movements; it decays with the time constant FORGETTING_S. While the car is shaken, the filter ignores the
    accelerometer.
    """
    errors = []
    error = 0.0
    last_s = measurements[0].time_s
    for measurement in measurements:
        # After a gap of FORGETTING_S or more, nothing is left of the error.
        step_s = min(measurement.time_s - last_s, FORGETTING_S)
        last_s = measurement.time_s
        error -= error * step_s / FORGETTING_S
        is_shaken = abs(measurement.total_m_s2 - GRAVITY_M_S2) >= SHAKING_M_S2
        if not is_shaken:
            sine = measurement.forward_m_s2 / measurement.total_m_s2
            accelerometer_pitch = math.asin(max(-1.0, min(1.0, sine)))
            error += (accelerometer_pitch - measurement.pitch_rad) * step_s / FILTER_S
        errors.append(error)
    return errors


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
