"""A trial in MuJoCo: the car of docs/carsim.md in a scene, driven by the firmware's pulses.

Input: body and scene, the pulses, the rules of carsim's trials, the grid of the scene's smooth ground, the engine's
options. Output: the result as `carsim batch` gives it, and where the car ends. Servos take their pulses as often as
the firmware writes them; that is also when states are looked at: between, the engine runs alone.
"""

from collections.abc import Mapping
from typing import Any

from foldcar.crosscheck.ending import Ending, distance_to_target_m
from foldcar.crosscheck.mujoco_car import DEFAULTS, EngineOptions, MujocoCar
from foldcar.models.ground import HeightGrid
from foldcar.simulation.carsim_limits import TrialRules
from foldcar.simulation.pulses import PulseTrain


def run_mujoco(
    body: Mapping[str, Any],
    scene: Mapping[str, Any],
    pulses: PulseTrain,
    rules: TrialRules,
    grid: HeightGrid | None = None,
    options: EngineOptions = DEFAULTS,
) -> dict[str, Any]:
    """The result of one run. FoldcarError if the simulation leaves the finite numbers."""
    trial = MujocoTrial(body, scene, pulses, rules, grid, options)
    path = []
    next_path_s = 0.0
    while True:
        if options.path_interval_s > 0 and (trial.outcome or trial.elapsed_s >= next_path_s - 1e-9):
            path.append(trial.path_row())
            next_path_s += options.path_interval_s
        if trial.outcome:
            break
        trial.tick()
    return {**trial.result(), "path": path} if options.path_interval_s > 0 else trial.result()


class MujocoTrial:
    """One trial, a tick at a time. It begins when the car has stood for ``rules.settling_s``.

    ``outcome`` is None until the trial is over; ``state`` is that at ``elapsed_s``.
    """

    def __init__(
        self,
        body: Mapping[str, Any],
        scene: Mapping[str, Any],
        pulses: PulseTrain,
        rules: TrialRules,
        grid: HeightGrid | None = None,
        options: EngineOptions = DEFAULTS,
    ) -> None:
        self.car = MujocoCar(body, scene, grid, options)
        self.elapsed_s = 0.0
        self.consumed_energy_j = 0.0
        self._scene = scene
        self._pulses = pulses
        self._rules = rules
        self._tick_s = 0.5 * rules.firmware_tick_s
        self._max_roll = self._max_pitch = 0.0
        self.car.advance(0.5 * rules.firmware_tick_s)
        for _ in range(round(rules.settling_s / rules.firmware_tick_s - 0.5)):
            self.car.advance(rules.firmware_tick_s)
        self.state = self.car.state()
        self._ending = Ending(scene, self.state, rules)
        self.outcome: str | None = None
        self._look()

    def tick(self) -> None:
        """Give the servos their pulses and go on to when they get the next ones."""
        # The firmware ticks with the first step after its period is over: a change stands up to one step late.
        self.car.drive(self._pulses.at(self.elapsed_s + self._rules.step_s))
        self.car.advance(self._tick_s)
        self.consumed_energy_j += self.car.power_w() * self._tick_s
        self.elapsed_s, self._tick_s = round(self.elapsed_s + self._tick_s, 9), self._rules.firmware_tick_s
        self.state = self.car.state()
        self._look()

    def path_row(self) -> list[float]:
        """A row of docs/carsim.md's ``path``."""
        s = self.state
        return [self.elapsed_s, s.x_m, s.y_m, s.z_m, s.heading_rad, s.pitch_rad, s.roll_rad]

    def result(self) -> dict[str, Any]:
        """As of now."""
        return {
            "outcome": self.outcome,
            "elapsed_time_s": self.elapsed_s,
            "distance_to_target_m": distance_to_target_m(self._scene, self.state),
            "consumed_energy_j": self.consumed_energy_j,
            "max_roll_rad": self._max_roll,
            "max_pitch_rad": self._max_pitch,
            "end": [self.state.x_m, self.state.y_m],
        }

    def _look(self) -> None:
        self._max_roll = max(self._max_roll, abs(self.state.roll_rad))
        self._max_pitch = max(self._max_pitch, abs(self.state.pitch_rad))
        self.outcome = self._ending.check(self.state, self.elapsed_s)
        if self.outcome is None and self.elapsed_s >= self._pulses.end_s:
            self.outcome = "timeout"
