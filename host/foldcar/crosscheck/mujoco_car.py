"""A car of docs/carsim.md in MuJoCo: standing on a scene's ground, given pulses, advanced, looked at.

Input: body and scene, the grid of the scene's smooth ground, the engine's options. Output: states.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.crosscheck.ending import State
from foldcar.errors import FoldcarError
from foldcar.models.ground import HeightGrid
from foldcar.models.mjcf import MjcfOptions, mjcf
from foldcar.models.servo import drive_fraction
from foldcar.models.wheel_geometry import main_segment, segment_name, wheel_name
from foldcar.scenes.terrain_kinds import kind_of


@dataclass(frozen=True)
class EngineOptions:
    """Time step, shape of the tyres (cylinder or ellipsoid), and the path's interval (0: no path)."""

    timestep_s: float = 1e-3
    tyre: str = "cylinder"
    path_interval_s: float = 0.0


DEFAULTS = EngineOptions()


def import_mujoco() -> Any:
    """The package, or a FoldcarError that says how to install it."""
    try:
        import mujoco
    except ImportError as error:
        message = f"the second engine cannot be loaded ({error}): pip install 'foldcar[crosscheck]'"
        raise FoldcarError(message) from error
    return mujoco


class MujocoCar:
    """A car in a scene, where the exported model puts it down. It stands still until it is advanced."""

    def __init__(
        self,
        body: Mapping[str, Any],
        scene: Mapping[str, Any],
        grid: HeightGrid | None = None,
        options: EngineOptions = DEFAULTS,
    ) -> None:
        self._mujoco = import_mujoco()
        text = mjcf(body, scene, grid, MjcfOptions(options.timestep_s, options.tyre))
        try:
            self.model = self._mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise FoldcarError(f"MuJoCo refuses the model: {error}") from error
        self.data = self._mujoco.MjData(self.model)
        self._servos = [wheel["servo"] for wheel in body["wheels"]]
        self._supply_v = body["supply_v"]
        self._channels = [wheel["channel"] for wheel in body["wheels"]]
        gains, biases = self.model.actuator_gainprm[:, 0].tolist(), self.model.actuator_biasprm[:, 2].tolist()
        self._torque_lines = list(zip(gains, biases, strict=True))
        self._origin = self.model.body(segment_name(main_segment(body))).id
        self._scene = scene
        self._patches = [piece for piece in scene["terrain"] if kind_of(piece).form == "patch"]
        self._grips = [(self.model.geom(f"{wheel_name(wheel)}_tyre").id, wheel["grip"]) for wheel in body["wheels"]] + [
            (self.model.geom(f"{segment_name(i)}_belly").id, segment["grip"])
            for i, segment in enumerate(body["segments"])
        ]
        self.drive((0.0,) * 8)
        self._mujoco.mj_forward(self.model, self.data)

    def drive(self, widths_us: tuple[float, ...]) -> None:
        """Give the servos their pulses; patches set the friction of what stands over them."""
        for i, servo in enumerate(self._servos):
            fraction = drive_fraction(servo, widths_us[self._channels[i]])
            gain, bias = self._torque_lines[i] if fraction is not None else (0.0, 0.0)
            self.model.actuator_gainprm[i, 0], self.model.actuator_biasprm[i, 2] = gain, bias
            self.data.ctrl[i] = fraction or 0.0
        if self._patches:
            for geom, grip in self._grips:
                x, y, _ = self.data.geom_xpos[geom]
                self.model.geom_friction[geom, 0] = grip * self._friction(x, y)

    def advance(self, seconds: float) -> None:
        """Let the engine run."""
        self._mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))
        if self.data.warning[self._mujoco.mjtWarning.mjWARN_BADQACC].number or not math.isfinite(self.data.qpos[0]):
            raise FoldcarError("MuJoCo: the simulation left the finite numbers")

    def power_w(self) -> float:
        """What the servos draw: current runs from no load to stall in proportion to the torque."""
        total = 0.0
        torques = self.data.actuator_force.tolist()
        for i, (servo, torque) in enumerate(zip(self._servos, torques, strict=True)):
            if self.model.actuator_gainprm[i, 0]:
                a_per_n_m = (servo["stall_current_a"] - servo["no_load_current_a"]) / servo["stall_torque_n_m"]
                total += servo["no_load_current_a"] * abs(float(self.data.ctrl[i])) + a_per_n_m * abs(torque)
        return float(self._supply_v * total)

    def motion(self) -> tuple[float, float]:
        """Speed along the heading (m/s) and yaw rate (rad/s) of the car's origin."""
        velocity = numpy.zeros(6)
        kind = self._mujoco.mjtObj.mjOBJ_XBODY
        self._mujoco.mj_objectVelocity(self.model, self.data, kind, self._origin, velocity, 0)
        heading = self.state().heading_rad
        return float(velocity[3] * math.cos(heading) + velocity[4] * math.sin(heading)), float(velocity[2])

    def state(self) -> State:
        """Where the car's origin is."""
        x, y, z = self.data.xpos[self._origin].tolist()
        r = self.data.xmat[self._origin].tolist()
        pitch = math.asin(max(-1.0, min(1.0, r[6])))
        return State(x, y, z, math.atan2(r[3], r[0]), pitch, math.atan2(r[7], r[8]), r[8])

    def _friction(self, x: float, y: float) -> float:
        """The ground's friction at a point: the last patch over it counts."""
        for patch in reversed(self._patches):
            dx, dy = x - patch["x_m"], y - patch["y_m"]
            cos, sin = math.cos(patch["heading_rad"]), math.sin(patch["heading_rad"])
            along, across = dx * cos + dy * sin, dy * cos - dx * sin
            if abs(along) <= patch["length_m"] / 2 and abs(across) <= patch["width_m"] / 2:
                return float(patch["friction"])
        return float(self._scene["friction"])
