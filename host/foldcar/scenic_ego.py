"""Shows the simulated car to a Scenic program: writes a state of carsim into the program's ego.

Input: a state. Output: the ego's position (the middle of the car; its z is that of the scene plus what the car has
risen since the start), orientation, speed, velocities and `consumedEnergy` (J).

This happens some hundred times a run. Scenic's own updateObjects would check types, compute orientations through
Euler angles and call every cache's clearer, which takes several times as long; tests compare with it.
"""

import math
from typing import Any

from scenic.core.vectors import Orientation, Vector, alwaysGlobalOrientation
from scipy.spatial.transform import Rotation

from foldcar.carsim_step import State

# What Scenic derives from yaw, pitch and roll.
DERIVED = {"orientation", "heading"}
CACHE_PREFIX = "_cached_"


class ShownEgo:
    """The ego of a running simulation. Made after Scenic has created its dynamic copy."""

    def __init__(self, ego: Any, start: State) -> None:
        # The copy stands in for the ego while a simulation runs; its dictionary is written past Scenic's proxy.
        self._copy = object.__getattribute__(ego, "_dynamicProxy")
        self._attributes = self._copy.__dict__
        self._z_offset_m = float(ego.position.z) - start.z_m
        parent = ego.parentOrientation
        self._parent = None if alwaysGlobalOrientation(parent) else parent
        self._derives_more = not set(type(ego)._dynamicFinalProperties) <= DERIVED

    @property
    def position(self) -> Any:
        """Where the ego is shown, as a Scenic vector."""
        return self._attributes["position"]

    def show(self, state: State) -> None:
        """Make ``state`` what the program sees."""
        yaw = math.remainder(state.heading_rad - math.pi / 2, 2 * math.pi)
        orientation = _orientation(yaw, state.pitch_rad, state.roll_rad)
        local: tuple[float, ...] = (yaw, state.pitch_rad, state.roll_rad)
        if self._parent is not None:
            local = tuple(map(float, self._parent.localAnglesFor(orientation)))
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        attributes = self._attributes
        attributes.update(
            position=Vector(state.x_m, state.y_m, state.z_m + self._z_offset_m),
            yaw=local[0],
            pitch=local[1],
            roll=local[2],
            orientation=orientation,
            heading=yaw,
            speed=state.speed_m_s,
            velocity=Vector(state.speed_m_s * cos, state.speed_m_s * sin, 0.0),
            angularVelocity=Vector(0.0, 0.0, state.yaw_rate_rad_s),
            angularSpeed=abs(state.yaw_rate_rad_s),
            consumedEnergy=state.consumed_energy_j,
        )
        if self._derives_more:
            self._copy._recomputeDynamicFinals()
        for name in [name for name in attributes if name.startswith(CACHE_PREFIX)]:
            del attributes[name]


def _orientation(yaw: float, pitch: float, roll: float) -> Any:
    """Scenic's orientation: turned by yaw about z, then by pitch about its own x, then by roll about its own y."""
    cz, sz = math.cos(yaw / 2), math.sin(yaw / 2)
    cx, sx = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(roll / 2), math.sin(roll / 2)
    return Orientation(
        Rotation.from_quat(
            [
                cz * sx * cy - sz * cx * sy,
                cz * cx * sy + sz * sx * cy,
                cz * sx * sy + sz * cx * cy,
                cz * cx * cy - sz * sx * sy,
            ]
        )
    )
