"""A car as URDF, the robot description of ROS.

Input: a body of docs/carsim.md. Output: the text of a URDF file. URDF has limits of effort and speed but no motors: a
servo is represented by its stall torque and no-load speed at the supply voltage. Rotor inertias, the stiffness of
flexures, friction and the ground cannot be represented. The massless root link is the car's frame: its origin is in
the middle of the car's length at axle height.
"""

import math
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

from foldcar.models.wheel_geometry import (
    axle_m,
    segment_name,
    servo_limits,
    tyre_center_m,
    wheel_inertia_kg_m2,
    wheel_name,
)
from foldcar.models.xml_elements import add, document, numbers


def urdf(body: Mapping[str, Any], name: str) -> str:
    """The robot description of the car, named ``name``."""
    robot = Element("robot", name=name)
    # For MuJoCo only, which would otherwise fuse links without joints to the world.
    add(add(robot, "mujoco"), "compiler", fusestatic="false")
    add(robot, "link", name="base_link")
    for index, segment in enumerate(body["segments"]):
        link = add(robot, "link", name=segment_name(index))
        com = (segment["com_x_m"], segment["com_y_m"], segment["com_z_m"])
        inertias = [segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw")]
        # A segment's frame is at the hinge in front of it; the first segment's is the car's.
        frame = _hinge_place(body, index)
        _add_inertial(link, _minus(com, frame), segment["mass_kg"], inertias)
        middle = _minus((segment["x_m"], 0.0, segment["center_z_m"]), frame)
        box = numbers(segment["length_m"], segment["width_m"], segment["height_m"])
        _add_shape(link, middle, 0.0, "box", size=box)
        if index == 0:
            _add_joint(robot, "base", "fixed", "base_link", segment_name(0), (0.0, 0.0, 0.0))
        else:
            place = _minus(frame, _hinge_place(body, index - 1))
            hinge = body["hinges"][index - 1]
            parents = (segment_name(index - 1), segment_name(index))
            joint = _add_joint(robot, f"hinge{index - 1}", "revolute", *parents, place)
            # Flexures have no motor, but URDF requires limits of effort and speed.
            bounds = {"lower": numbers(hinge["min_rad"]), "upper": numbers(hinge["max_rad"])}
            add(joint, "limit", **bounds, effort="0", velocity="0")
            add(joint, "dynamics", damping=numbers(hinge["damping_n_m_s_rad"]))
    for wheel in body["wheels"]:
        _add_wheel(robot, body, wheel)
    return '<?xml version="1.0"?>\n' + document(robot)


def _add_wheel(robot: Element, body: Mapping[str, Any], wheel: Mapping[str, Any]) -> None:
    name = wheel_name(wheel)
    link = add(robot, "link", name=name)
    spin, across = wheel_inertia_kg_m2(wheel)
    center = tyre_center_m(wheel)
    _add_inertial(link, center, wheel["mass_kg"], [across, spin, across])
    size = {"radius": numbers(wheel["radius_m"]), "length": numbers(wheel["width_m"])}
    _add_shape(link, center, math.pi / 2, "cylinder", **size)
    place = _minus(axle_m(body, wheel), _hinge_place(body, wheel["segment"]))
    joint = _add_joint(robot, f"{name}_axle", "continuous", segment_name(wheel["segment"]), name, place)
    stall, no_load = servo_limits(body, wheel)
    add(joint, "limit", effort=numbers(stall), velocity=numbers(no_load))


def _add_inertial(link: Element, com: tuple[float, ...], mass: float, inertias: list[float]) -> None:
    inertial = add(link, "inertial")
    add(inertial, "origin", xyz=numbers(*com))
    add(inertial, "mass", value=numbers(mass))
    ixx, iyy, izz = (numbers(value) for value in inertias)
    add(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _add_shape(link: Element, middle: tuple[float, ...], turn_rad: float, shape: str, **size: str) -> None:
    for purpose in ("visual", "collision"):
        holder = add(link, purpose)
        add(holder, "origin", xyz=numbers(*middle), rpy=numbers(turn_rad, 0, 0))
        add(add(holder, "geometry"), shape, **size)


def _add_joint(
    robot: Element, name: str, kind: str, parent: str, child: str, place: tuple[float, ...]
) -> Element:
    joint = add(robot, "joint", name=name, type=kind)
    add(joint, "parent", link=parent)
    add(joint, "child", link=child)
    add(joint, "origin", xyz=numbers(*place))
    if kind != "fixed":
        add(joint, "axis", xyz="0 1 0")
    return joint


def _hinge_place(body: Mapping[str, Any], segment: int) -> tuple[float, float, float]:
    """Position (m) of the hinge in front of a segment; for the first one the car's origin."""
    if segment == 0:
        return 0.0, 0.0, 0.0
    hinge = body["hinges"][segment - 1]
    return hinge["x_m"], 0.0, hinge["z_m"]


def _minus(one: tuple[float, ...], other: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(a - b for a, b in zip(one, other, strict=True))
