"""A trial in MuJoCo that its caller advances: what `carsim step` is to Scenic (docs/carsim.md), in the second engine.

Input: a body, a scene and settings as JSON text, then times to advance to. Output: states and the result. Times are
met at the next of the firmware's 50 Hz ticks, and a stop is traced back to one of them.
"""

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from foldcar.crosscheck.mujoco_car import EngineOptions
from foldcar.crosscheck.mujoco_run import MujocoTrial
from foldcar.errors import FoldcarError
from foldcar.models.ground import HeightGrid, smooth_ground
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.carsim_step import Advanced, State, TrialFailedError
from foldcar.simulation.pulses import PulseTrain, ask_pulses

# Scenes and settings whose grids and pulses are kept: cases come scene by scene.
KEPT = 32


class SteppedMujoco:
    """One trial at a time; ``binary`` is carsim, which knows the ground's heights and the firmware's pulses."""

    alive = True

    def __init__(self, binary: Path, options: EngineOptions) -> None:
        self._binary = binary
        self._options = options
        self._rules = Carsim(binary).limits().trial
        self._trial: MujocoTrial | None = None
        self._rows: list[tuple[State, dict[str, Any]]] = []

    def start(self, body: str, scene: str, settings: str) -> Advanced:
        """Put the car down and start the trial. TrialFailedError if it leaves the finite numbers."""
        pulses, grid = _pulses(self._binary, settings), _grid(self._binary, scene)
        try:
            self._trial = MujocoTrial(json.loads(body), json.loads(scene), pulses, self._rules, grid, self._options)
        except FoldcarError as error:
            raise TrialFailedError(str(error)) from error
        self._rows = [self._shown(self._trial)]
        return self._advanced(self._trial)

    def advance(self, to_s: float) -> Advanced:
        """Advance to that time of the trial, or to its end if that comes first."""
        trial = self._started()
        self._rows = []
        while trial.outcome is None and trial.elapsed_s < to_s - 1e-9:
            try:
                trial.tick()
            except FoldcarError as error:
                raise TrialFailedError(str(error)) from error
            self._rows.append(self._shown(trial))
        if not self._rows:
            self._rows = [self._shown(trial)]
        return self._advanced(trial)

    def rows(self) -> list[State]:
        """The states at every tick of the last advance, its end included."""
        return [state for state, _ in self._rows]

    def end(self, row: int) -> dict[str, Any]:
        """End the trial as of that row of the last advance; its result, with outcome "terminated"."""
        return {**self._rows[row][1], "outcome": "terminated"}

    def _started(self) -> MujocoTrial:
        if self._trial is None:
            raise TrialFailedError("no trial is under way")
        return self._trial

    def _advanced(self, trial: MujocoTrial) -> Advanced:
        state, result = self._rows[-1]
        return Advanced(state, result if trial.outcome else None)

    def _shown(self, trial: MujocoTrial) -> tuple[State, dict[str, Any]]:
        s, (speed, yaw_rate) = trial.state, trial.car.motion()
        angles = (s.heading_rad, s.pitch_rad, s.roll_rad)
        place = (trial.elapsed_s, s.x_m, s.y_m, s.z_m)
        return State(*place, *angles, speed, yaw_rate, trial.consumed_energy_j), trial.result()


@lru_cache(KEPT)
def _pulses(binary: Path, settings: str) -> PulseTrain:
    return ask_pulses(Carsim(binary), [json.loads(settings)])[0]


@lru_cache(KEPT)
def _grid(binary: Path, scene: str) -> HeightGrid | None:
    return smooth_ground(json.loads(scene), Carsim(binary))
