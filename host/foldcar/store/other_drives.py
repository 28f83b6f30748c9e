"""Finds trials that were not driven as the runs were: at another speed, with another time limit or another body.

Such trials say nothing about these runs. A trial that was imported from a table does not say its body, and it says its
settings only if foldcar exported the table. It counts unless these differ, or its time contradicts the runs' time limit.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.trial_records import Trial

SPEED, YAW_RATE, TIME_LIMIT = "speed_m_s", "yaw_rate_rad_s", "time_limit_s"
# Bodies of two versions of foldcar may differ by rounding errors.
RELATIVE_TOLERANCE = 1e-6
# The firmware ends a trial at its first step after the time limit; the longest step takes this time (s).
LIMIT_OVERRUN_S = 0.1
# A person with a stopwatch may be wrong by this time (s).
STOPWATCH_ERROR_S = 1.0


def other_drives(store: Store, info: ExperimentInfo, trials: Sequence[Trial]) -> dict[int, str]:
    """Return what differs from the runs, with both values, of each trial that was driven in another way, by its number.

    Example: {7: "speed 0.05 m/s, not 0.3 m/s"}
    """
    drives = read_drives(store, info.id)
    index = {frozenset(parameters.items()): k for k, parameters in enumerate(drives.parameters)}
    result, settings_of_trials = {}, store.settings_of_trials()
    for trial in trials:
        is_swept_type = trial.vehicle_type == info.vehicle_type
        design = index.get(frozenset(trial.design.items())) if is_swept_type else None
        drive = store.trial_drive(trial.id)
        settings = json.loads(settings_of_trials.get(trial.id, "{}"))
        if design is None:
            # The design was not swept: what the experiment says of all designs.
            expected = {SPEED: info.speed_m_s, YAW_RATE: info.yaw_rate_rad_s, TIME_LIMIT: info.timeout_s}
        else:
            expected = drives.value("settings", drives.settings[design])
        differences = list(_setting_differences(trial, settings, expected))
        if drive is not None and design is not None:
            body, expected_body = json.loads(drive.body), drives.value("body", drives.bodies[design])
            if difference := next(_differences(body, expected_body), None):
                differences.append(f"another body: {difference}")
        if differences:
            result[trial.id] = "; ".join(differences)
    return result


def _setting_differences(trial: Trial, settings: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield the settings of a trial that differ from the ``expected`` ones of the runs; None is unknown."""
    for name, label, unit in ((SPEED, "speed", "m/s"), (YAW_RATE, "turn rate", "rad/s")):
        value, runs_value = settings.get(name), expected.get(name)
        if None not in (value, runs_value) and not _equal(value, runs_value):
            yield f"{label} {value:g} {unit}, not {runs_value:g} {unit}"
    runs_limit_s = expected[TIME_LIMIT]
    limit_s = settings.get(TIME_LIMIT, runs_limit_s)
    time_s = trial.elapsed_time_s
    # A car that stopped within both limits, whether it had passed or tipped, would have done so under either.
    latest_s = min(limit_s, runs_limit_s) + LIMIT_OVERRUN_S
    ended_within_both = time_s is not None and time_s <= latest_s and trial.outcome != "timeout"
    if not _equal(limit_s, runs_limit_s) and not ended_within_both:
        yield f"time limit {limit_s:g} s, not {runs_limit_s:g} s"
    elif time_s is not None:
        if trial.outcome == "passed" and time_s > latest_s:
            yield f"passed after {time_s:g} s, above the time limit of {runs_limit_s:g} s"
        # The time of an imported trial shows a limit that differs.
        elif trial.outcome == "timeout" and not settings and time_s < runs_limit_s - STOPWATCH_ERROR_S:
            yield f"timed out after {time_s:g} s, below the time limit of {runs_limit_s:g} s"


def _differences(value: Any, expected: Any, place: str = "") -> Iterator[str]:
    """Yield the differences of two JSON values, each with its place and both values."""
    if isinstance(value, Mapping) and isinstance(expected, Mapping):
        for key in [*value, *(key for key in expected if key not in value)]:
            yield from _differences(value.get(key), expected.get(key), f"{place}.{key}" if place else str(key))
    elif isinstance(value, list) and isinstance(expected, list) and len(value) == len(expected):
        for number, (item, other) in enumerate(zip(value, expected, strict=True)):
            yield from _differences(item, other, f"{place}.{number}")
    elif not _equal(value, expected):
        yield f"{place} {_short(value)}, not {_short(expected)}"


def _equal(a: Any, b: Any) -> bool:
    """Return whether two values are equal; numbers may differ by rounding."""
    if all(isinstance(number, int | float) and not isinstance(number, bool) for number in (a, b)):
        return bool(abs(a - b) <= RELATIVE_TOLERANCE * max(abs(a), abs(b)))
    return bool(a == b)


def _short(value: Any) -> str:
    """Return a value of a body as a short text."""
    if isinstance(value, list | Mapping):
        return f"{len(value)} values"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value)
