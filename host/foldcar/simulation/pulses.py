"""The firmware's pulses of a trial, asked of carsim: they follow from the settings alone."""

import json
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from foldcar.simulation.carsim import Carsim


@dataclass(frozen=True)
class PulseTrain:
    """Times from the start of the trial (s) and the eight widths (µs, 0: none) from each on.

    The last change is the firmware's end of the trial.
    """

    times_s: tuple[float, ...]
    widths_us: tuple[tuple[float, ...], ...]

    @property
    def end_s(self) -> float:
        """When the firmware ends the trial."""
        return self.times_s[-1]

    def at(self, t_s: float) -> tuple[float, ...]:
        """The widths at a time."""
        return self.widths_us[max(0, bisect_right(self.times_s, t_s) - 1)]


def ask_pulses(carsim: Carsim, settings: Sequence[Mapping[str, Any]]) -> list[PulseTrain]:
    """The trains of several settings (keys of docs/carsim.md's ``pulses``), in order."""
    lines = [json.dumps({"pulses": {"id": str(index), **_asked(one)}}) for index, one in enumerate(settings)]
    trains = []
    for answer in carsim.answers(lines):
        rows = answer["changes"]
        trains.append(PulseTrain(tuple(row[0] for row in rows), tuple(tuple(row[1:]) for row in rows)))
    return trains


def _asked(settings: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("speed_m_s", "yaw_rate_rad_s", "time_limit_s", "parameters")
    return {key: settings[key] for key in keys if key in settings}
