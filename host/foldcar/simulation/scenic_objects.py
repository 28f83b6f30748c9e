"""Updates the ego of a running Scenic simulation faster than Scenic does; tests compare both.

carsim's states are written into the ego some hundred times a run. Scenic's updateObjects would check types, compute
orientations through Euler angles and clear every cache. The ego's z is the scene's z plus the car's rise since the start.
"""

import math
from typing import Any

from scenic.core.vectors import Orientation, Vector, alwaysGlobalOrientation
from scipy.spatial.transform import Rotation

from foldcar.scenes import scenic_private
from foldcar.simulation.carsim_step import State

# Properties that Scenic derives from yaw, pitch and roll.
DERIVED = {"orientation", "heading"}


class ShownEgo:
    """The ego of a running simulation; create it after Scenic has created the ego's dynamic copy."""

    def __init__(self, ego: Any, start: State) -> None:
        """Make a copy of the ego, which :meth:`show` moves with the car. ``start`` is the car's state at the start."""
        self._copy = scenic_private.shown_copy(ego)
        self._attributes = self._copy.__dict__
        # The names of the attributes in which Scenic keeps what it has derived from other properties.
        self._cache_names = scenic_private.caches(type(ego))
        # Scenic's position of the ego may be higher than that of the car's state; the difference stays as at the start.
        self._z_offset_m = float(ego.position.z) - start.z_m
        # If the program gives the ego a parent orientation, its yaw, pitch and roll count from there. None if they count
        # from the axes of the scene.
        parent = ego.parentOrientation
        self._parent = None if alwaysGlobalOrientation(parent) else parent
        # A class of the program may have more properties that depend on the ego's state. They must be computed anew at
        # each state.
        derived = scenic_private.derived_while_driving(type(ego))
        self._has_more_derived_properties = not derived.issubset(DERIVED)

    def show(self, state: State) -> None:
        """Give the ego the properties of a state of the car, such as its position and its speed."""
        # Headings count from the y axis in Scenic, and from the x axis in carsim.
        yaw = math.remainder(state.heading_rad - math.pi / 2, 2 * math.pi)
        orientation = _orientation(yaw, state.pitch_rad, state.roll_rad)
        local_yaw, local_pitch, local_roll = yaw, state.pitch_rad, state.roll_rad
        if self._parent is not None:
            local_yaw, local_pitch, local_roll = map(float, self._parent.localAnglesFor(orientation))
        velocity_x_m_s = state.speed_m_s * math.cos(state.heading_rad)
        velocity_y_m_s = state.speed_m_s * math.sin(state.heading_rad)
        attributes = self._attributes
        attributes.update(
            position=Vector(state.x_m, state.y_m, state.z_m + self._z_offset_m),
            yaw=local_yaw,
            pitch=local_pitch,
            roll=local_roll,
            heading=yaw,
            orientation=orientation,
            speed=state.speed_m_s,
            velocity=Vector(velocity_x_m_s, velocity_y_m_s, 0.0),
            angularVelocity=Vector(0.0, 0.0, state.yaw_rate_rad_s),
            angularSpeed=abs(state.yaw_rate_rad_s),
            consumedEnergy=state.consumed_energy_j,
        )
        if self._has_more_derived_properties:
            scenic_private.derive_again(self._copy)
        # What Scenic has derived from the old properties is deleted, so that Scenic computes it again.
        for name in self._cache_names.intersection(attributes):
            del attributes[name]


def _orientation(yaw: float, pitch: float, roll: float) -> Any:
    """Return Scenic's orientation for these angles (rad).

    It is a rotation by yaw about the z axis, then by pitch about the new x axis, then by roll about the new y axis.
    """
    # The quaternion is the product of three quaternions, one for each rotation.
    cz, sz = math.cos(yaw / 2), math.sin(yaw / 2)
    cx, sx = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(roll / 2), math.sin(roll / 2)
    # Its components are in the order x, y, z, w.
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
