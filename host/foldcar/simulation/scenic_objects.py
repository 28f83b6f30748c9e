"""The ego of a running Scenic simulation, kept up to date in less time than Scenic takes; tests compare with it.

States of carsim are written into the ego some hundred times per run. Scenic's updateObjects would check types, compute
orientations through Euler angles and clear every cache. The orientation, which takes as long to compute as everything
else and which few programs read, is computed when it is read. The ego's z is that of the scene plus the car's rise since
the start.
"""

import functools
import math
from typing import Any

from scenic.core.vectors import Orientation, Vector, alwaysGlobalOrientation
from scipy.spatial.transform import Rotation

from foldcar.simulation.carsim_step import State

# Properties that Scenic derives from yaw, pitch and roll.
DERIVED = {"orientation", "heading"}
CACHE_PREFIX = "_cached_"
# The attribute that stores the angles of the orientation.
ANGLES = "_shown_angles_rad"


class ShownEgo:
    """The ego of a running simulation; constructed after Scenic has created the ego's dynamic copy."""

    def __init__(self, ego: Any, start: State) -> None:
        # The copy represents the ego during a simulation; writing its dictionary bypasses Scenic's proxy.
        self._copy = object.__getattribute__(ego, "_dynamicProxy")
        own: Any = type(ego)
        object.__setattr__(self._copy, "__class__", shown_class(own))
        self._attributes = self._copy.__dict__
        self._caches = {CACHE_PREFIX + name for name in own._cache_clearers}
        self._z_offset_m = float(ego.position.z) - start.z_m
        parent = ego.parentOrientation
        self._parent = None if alwaysGlobalOrientation(parent) else parent
        self._derives_more = not set(own._dynamicFinalProperties) <= DERIVED

    def show(self, state: State) -> None:
        """Set the ego's properties to those of ``state``."""
        yaw = math.remainder(state.heading_rad - math.pi / 2, 2 * math.pi)
        angles = yaw, state.pitch_rad, state.roll_rad
        local: tuple[float, ...] = angles
        if self._parent is not None:
            local = tuple(map(float, self._parent.localAnglesFor(_orientation(*angles))))
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        attributes = self._attributes
        attributes.update(
            position=Vector(state.x_m, state.y_m, state.z_m + self._z_offset_m),
            yaw=local[0],
            pitch=local[1],
            roll=local[2],
            heading=yaw,
            speed=state.speed_m_s,
            velocity=Vector(state.speed_m_s * cos, state.speed_m_s * sin, 0.0),
            angularVelocity=Vector(0.0, 0.0, state.yaw_rate_rad_s),
            angularSpeed=abs(state.yaw_rate_rad_s),
            consumedEnergy=state.consumed_energy_j,
        )
        attributes[ANGLES] = angles
        attributes.pop("orientation", None)
        if self._derives_more:
            self._copy._recomputeDynamicFinals()
        for name in self._caches.intersection(attributes):
            del attributes[name]


class _OrientationWhenRead:
    """A descriptor that computes the ego's orientation when it is first read and stores it in the ego's dictionary."""

    def __get__(self, ego: Any, owner: type) -> Any:
        if ego is None:
            # Scenic refuses properties that its classes have already.
            raise AttributeError("orientation")
        attributes = ego.__dict__
        orientation = attributes["orientation"] = _orientation(*attributes[ANGLES])
        return orientation


@functools.lru_cache(maxsize=8)
def shown_class(own: Any) -> Any:
    """A subclass of the ego's class with orientations computed when read; it inherits the defaults of its properties."""
    return type(own.__name__, (own,), {"_defaults": own._defaults, "orientation": _OrientationWhenRead()})


def _orientation(yaw: float, pitch: float, roll: float) -> Any:
    """Scenic's orientation: intrinsic rotations by yaw about z, then pitch about x, then roll about y (rad)."""
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
