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


def trials_unlike_runs(store: Store) -> dict[int, str]:
    """Return which trials were driven in another environment or in another way than the runs, by the trial's number.

    The trials of a swept experiment are compared with its nominal runs. Trials of other experiments are not in the
    result, because there is nothing with which to compare them.

    Example: {3: "another environment", 7: "speed 0.05 m/s, not 0.3 m/s"}
    """
    if not store.holds_study():
        return {}
    reasons: dict[int, str] = {}
    for info in store.info().experiments.values():
        if info.id != info.listed_id:
            # A variant, such as the experiment in another engine. It has the trials of the nominal experiment.
            continue
        trials = list(store.trials(info.id))
        if not trials:
            # Reading the bodies and the settings of all designs is slow.
            continue
        reasons |= other_drives(store, info, trials)
        reasons |= dict.fromkeys(store.trials_in_other_environments(info), "another environment")
    return reasons


def other_drives(store: Store, info: ExperimentInfo, trials: Sequence[Trial]) -> dict[int, str]:
    """Return which trials were driven in another way than the runs, and in which way, by the trial's number.

    Trials that were driven like the runs are not in the result.

    Example: {7: "speed 0.05 m/s, not 0.3 m/s"}: trial 7 was driven at 0.05 m/s, the runs of its design at 0.3 m/s.
    """
    drives = read_drives(store, info.id)
    index_of_design = {frozenset(parameters.items()): index for index, parameters in enumerate(drives.parameters)}
    settings_of_trials = store.settings_of_trials()
    result = {}
    for trial in trials:
        settings = json.loads(settings_of_trials.get(trial.id, "{}"))
        has_swept_type = trial.vehicle_type == info.vehicle_type
        design_index = index_of_design.get(frozenset(trial.design.items())) if has_swept_type else None
        if design_index is None:
            # The design was not swept, so the trial is compared with the experiment's settings for all designs.
            expected = {SPEED: info.speed_m_s, YAW_RATE: info.yaw_rate_rad_s, TIME_LIMIT: info.timeout_s}
            differences = list(_setting_differences(trial, settings, expected))
        else:
            expected = drives.value("settings", drives.settings[design_index])
            differences = list(_setting_differences(trial, settings, expected))
            expected_body = drives.value("body", drives.bodies[design_index])
            differences += _body_differences(store, trial, expected_body)
        if differences:
            result[trial.id] = "; ".join(differences)
    return result


def _body_differences(store: Store, trial: Trial, expected_body: Mapping[str, Any]) -> list[str]:
    """Return the first difference between a trial's body and that of the runs, if there is one and the body is known."""
    drive = store.trial_drive(trial.id)
    if drive is None:
        return []
    first_difference = next(_differences(json.loads(drive.body), expected_body), None)
    return [] if first_difference is None else [f"another body: {first_difference}"]


def _setting_differences(trial: Trial, settings: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield a text for each difference between a trial's settings and the settings of the runs.

    ``settings`` are those of the trial; an imported trial lacks some or all of them. ``expected`` are those of the runs.
    """
    for name, label, unit in ((SPEED, "speed", "m/s"), (YAW_RATE, "turn rate", "rad/s")):
        value, expected_value = settings.get(name), expected.get(name)
        if value is None or expected_value is None:
            continue
        if not _equal(value, expected_value):
            yield f"{label} {value:g} {unit}, not {expected_value:g} {unit}"
    limit_difference = _limit_difference(trial, settings, expected[TIME_LIMIT])
    if limit_difference is not None:
        yield limit_difference


def _limit_difference(trial: Trial, settings: Mapping[str, Any], expected_limit_s: float) -> str | None:
    """Return in which way a trial's time limit differs from that of the runs, if this may have changed its outcome.

    Return None if it cannot have changed it. ``settings`` are those of the trial, and ``expected_limit_s`` is the time
    limit of the runs.
    """
    outcome, elapsed_s = trial.outcome, trial.elapsed_time_s
    limit_s = settings.get(TIME_LIMIT, expected_limit_s)
    lower_limit_s = min(limit_s, expected_limit_s) + LIMIT_OVERRUN_S
    # If a trial ended before both limits, the limits have no effect on its outcome.
    ended_before_both = elapsed_s is not None and elapsed_s <= lower_limit_s and outcome != "timeout"
    if not _equal(limit_s, expected_limit_s) and not ended_before_both:
        return f"time limit {limit_s:g} s, not {expected_limit_s:g} s"
    if elapsed_s is None:
        return None
    if outcome == "passed" and elapsed_s > lower_limit_s:
        return f"passed after {elapsed_s:g} s, above the time limit of {expected_limit_s:g} s"
    # An imported trial has no settings. If it timed out, its time shows which limit it had.
    is_imported = not settings
    if is_imported and outcome == "timeout" and elapsed_s < expected_limit_s - STOPWATCH_ERROR_S:
        return f"timed out after {elapsed_s:g} s, below the time limit of {expected_limit_s:g} s"
    return None


def _differences(value: Any, expected: Any, place: str = "") -> Iterator[str]:
    """Yield the differences of two JSON values, such as "wheels.0.radius_m 0.02, not 0.03".

    The values may be parts of larger JSON values. ``place`` is their path there: keys and indices, joined by dots.
    """
    if isinstance(value, Mapping) and isinstance(expected, Mapping):
        keys = dict.fromkeys([*value, *expected])
        for key in keys:
            place_of_key = f"{place}.{key}" if place else str(key)
            yield from _differences(value.get(key), expected.get(key), place_of_key)
    elif isinstance(value, list) and isinstance(expected, list) and len(value) == len(expected):
        for index, (item, expected_item) in enumerate(zip(value, expected, strict=True)):
            yield from _differences(item, expected_item, f"{place}.{index}")
    elif not _equal(value, expected):
        yield f"{place} {_short(value)}, not {_short(expected)}"


def _equal(a: Any, b: Any) -> bool:
    """Return whether two JSON values are equal; numbers may differ by RELATIVE_TOLERANCE."""
    # In Python a bool is an int, too.
    has_bool = isinstance(a, bool) or isinstance(b, bool)
    if isinstance(a, int | float) and isinstance(b, int | float) and not has_bool:
        return bool(abs(a - b) <= RELATIVE_TOLERANCE * max(abs(a), abs(b)))
    return bool(a == b)


def _short(value: Any) -> str:
    """Return a JSON value as a short text; a list or an object as its number of values, such as "4 values"."""
    if isinstance(value, list | Mapping):
        return f"{len(value)} values"
    if isinstance(value, float):
        return f"{value:g}"
    return json.dumps(value)
