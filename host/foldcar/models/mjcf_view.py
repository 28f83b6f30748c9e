"""What people see and read of a car in MuJoCo: cameras, the size of the scene, sensors, the start as a keyframe.

Nothing here changes the physics. Input: body and scene of docs/carsim.md, the car's start. Output: elements.
"""

import math
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

import numpy

from foldcar.models.wheel_geometry import wheel_name
from foldcar.models.xml_elements import add, numbers

# The ground around the car that is shown at least.
REACH_M = 0.5
# From the middle of what is shown to the camera, in radii of what is shown; seen from behind, right and above.
EYE = (-1.4, -1.9, 1.5)
# From there to the lamp, likewise.
LAMP = (-0.6, -0.9, 3.0)


def add_size(root: Element, scene: Mapping[str, Any] | None) -> None:
    """The middle and the radius of start, goal and terrain, which the viewer's camera begins with."""
    middle, radius_m = _shown(scene)
    add(root, "statistic", center=numbers(*middle), extent=numbers(radius_m))
    # The headlight is low, so that shapes have a light and a dark side.
    visual = add(root, "visual")
    add(visual, "headlight", ambient="0.35 0.35 0.35", diffuse="0.2 0.2 0.2", specular="0 0 0")
    add(visual, "quality", shadowsize="4096")
    add(visual, "global", offwidth="1280", offheight="960")


def add_light_and_overview(world: Element, scene: Mapping[str, Any] | None) -> None:
    """A lamp, and the camera ``overview`` of the whole scene."""
    middle, radius_m = _shown(scene)
    lamp = numpy.array(middle) + radius_m * numpy.array(LAMP)
    direction = numbers(*(-value for value in LAMP))
    add(world, "light", pos=numbers(*lamp), dir=direction, cutoff="60", diffuse="0.5 0.5 0.5", specular="0 0 0")
    eye = numpy.array(middle) + 0.8 * radius_m * numpy.array(EYE)
    add(world, "camera", name="overview", pos=numbers(*eye), xyaxes=_looking(EYE))


def add_follower(car: Element, length_m: float) -> None:
    """The camera ``follow``, which keeps its distance from the car and its direction in the world."""
    distance = numpy.array(EYE) * 1.6 * length_m
    add(car, "camera", name="follow", mode="trackcom", pos=numbers(*distance), xyaxes=_looking(EYE))


def add_sensors(root: Element, body: Mapping[str, Any]) -> None:
    """The IMU of the car, at the site ``imu``, and speed and torque of each wheel, which servos do not report."""
    sensor = add(root, "sensor")
    add(sensor, "accelerometer", name="imu_acceleration", site="imu")
    add(sensor, "gyro", name="imu_turn_rate", site="imu")
    for wheel in body["wheels"]:
        name = wheel_name(wheel)
        add(sensor, "jointvel", name=f"{name}_speed", joint=f"{name}_axle")
        add(sensor, "actuatorfrc", name=f"{name}_torque", actuator=f"{name}_servo")


def add_start(root: Element, body: Mapping[str, Any], start: Mapping[str, float], height_m: float) -> None:
    """The keyframe ``start``: the car at rest at its start, hinges flat."""
    half = start["heading_rad"] / 2
    joints = [0.0] * (len(body["hinges"]) + len(body["wheels"]))
    turn = (math.cos(half), 0.0, 0.0, math.sin(half))
    place = f"{numbers(start['x_m'], start['y_m'])} {height_m!r} {numbers(*turn, *joints)}"
    add(add(root, "keyframe"), "key", name="start", qpos=place)


def _shown(scene: Mapping[str, Any] | None) -> tuple[tuple[float, float, float], float]:
    if scene is None:
        return (0.0, 0.0, 0.0), REACH_M
    course, start = scene["course"], scene["start"]
    places = [start, *([scene["goal"]] if scene["goal"] else []), *scene["terrain"]]
    x = numpy.clip([place["x_m"] for place in places], course["x_min_m"], course["x_max_m"])
    y = numpy.clip([place["y_m"] for place in places], course["y_min_m"], course["y_max_m"])
    middle = (float(x.min() + x.max()) / 2, float(y.min() + y.max()) / 2, 0.0)
    return middle, float(numpy.hypot(numpy.ptp(x), numpy.ptp(y))) / 2 + REACH_M


def _looking(eye: tuple[float, float, float]) -> str:
    """The axes to the right and up of a camera that looks back along ``eye``."""
    forward = -numpy.array(eye) / numpy.linalg.norm(eye)
    right = numpy.cross(forward, (0, 0, 1))
    right /= numpy.linalg.norm(right)
    return numbers(*right, *numpy.cross(right, forward))
