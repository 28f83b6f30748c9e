"""Finds the voltage of the servos' supply in the logs of trials, with which torque and speed of the servos grow.

Input: the trials of a store, the body of their car. Output: the voltage relative to the design's, and a
sentence about it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from foldcar.errors import FoldcarError
from foldcar.link.log_features import LogFeatures, log_features
from foldcar.statistics.words import count
from foldcar.store.log_files import intact_log
from foldcar.store.trial_records import Trial

# Servos hardly turn below, and break above; a reading beyond is an error of the divider.
MIN_RATIO, MAX_RATIO = 0.6, 1.4


@dataclass(frozen=True, slots=True)
class MeasuredSupply:
    """``ratio`` is the measured voltage divided by the design's, None if unknown; ``note`` is a sentence about it."""

    ratio: float | None = None
    note: str | None = None


def measured_supply(store: Path, trials: Iterable[Trial], body: Mapping[str, Any]) -> MeasuredSupply:
    """Compare the voltage of the servos' battery in the trials' logs with that of the design.

    The result has the ratio of the mean measured voltage to the design's, and a note. Both are None if no log has the
    voltage. The ratio alone is None if it is implausible. Trials without an intact log are left out.

    A log has the voltage at rest and the voltage while driving. If the simulated body has a resistance of its supply, its
    voltage is the one at rest, because the simulator lowers it under load. Otherwise its voltage is the one under load.
    """
    under_load = not body.get("supply_resistance_ohm")
    voltages = []
    for trial in trials:
        features = _intact_log_features(store, trial)
        if features is None:
            continue
        voltage = features.servo_battery_v if under_load else features.servo_battery_rest_v
        if voltage:
            voltages.append(voltage)
    if not voltages:
        return MeasuredSupply()
    mean_v, design_v = float(np.mean(voltages)), float(body["supply_v"])
    ratio = mean_v / design_v
    load = "while driving" if under_load else "at rest"
    measured = f"The servos' supply had {mean_v:.2f} V {load} in {count(len(voltages), 'trial')}"
    if not MIN_RATIO <= ratio <= MAX_RATIO:
        return MeasuredSupply(None, f"{measured}, which is not used: the design has {design_v:g} V; check SERVO_DIVIDER.")
    return MeasuredSupply(
        ratio, f"{measured}, the design has {design_v:g} V: torque and speed of the servos are scaled by {ratio:.2f}."
    )


def _intact_log_features(store: Path, trial: Trial) -> LogFeatures | None:
    """Return what the log of a trial tells about its drive; None without an intact log."""
    if not trial.log:
        return None
    try:
        log = intact_log(store, trial.id, trial.log, trial.log_sha256)
        return log_features(log) if log else None
    except FoldcarError:
        return None
