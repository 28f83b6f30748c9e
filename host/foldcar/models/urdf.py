"""A car as URDF, the robot description of ROS.

Input: a body of docs/carsim.md. Output: the text of a URDF file. URDF has limits of effort and speed but no motors: a
servo is represented by its stall torque and no-load speed at the supply voltage, and by a transmission. The stiffness
of flexures and the ground cannot be represented. The root link is the front segment, in the car's frame (origin in the
middle of the car's length at axle height): PyBullet and DART give a link without inertia 1 kg.

URDF itself has no friction of contacts: ``contact`` is Bullet's element, ``gazebo`` Gazebo's, ``drake:`` Drake's, which
also takes the inertia of the rotors. Other programs ignore them. All coefficients are those on ground of friction 1.
"""

import math
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element, indent, tostring
from xml.etree.ElementTree import SubElement as add  # noqa: N813

from foldcar.models.exported_car import (
    axle_m,
    segment_name,
    servo_limits,
    tyre_center_m,
    wheel_inertia_kg_m2,
    wheel_name,
)

ROOT = "base_link"
# URDF requires a speed limit, and some programs stop a joint at it, so it is above the speed of every flexure.
FREE_RAD_S = 1000.0


def numbers(*values: float) -> str:
    """Format numbers as the text of an attribute, separated by spaces."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def urdf(body: Mapping[str, Any], name: str) -> str:
    """Return the robot description of the car, named ``name``."""
    robot = Element("robot", {"name": name, "xmlns:drake": "http://drake.mit.edu"})
    # For MuJoCo only, which would otherwise fuse the root to the world.
    add(add(robot, "mujoco"), "compiler", fusestatic="false")
    for index in range(len(body["segments"])):
        _add_segment(robot, body, index)
        if index > 0:
            _add_hinge(robot, body, index - 1)
    for wheel in body["wheels"]:
        _add_wheel(robot, body, wheel)
    indent(robot)
    return f'<?xml version="1.0"?>\n{tostring(robot, encoding="unicode")}\n'


def _add_segment(robot: Element, body: Mapping[str, Any], index: int) -> None:
    """Add the link of a segment: its mass, its box and its friction.

    All places are in the link's frame. Its origin is the hinge in front of the segment; that of the first segment is the
    car's origin.
    """
    segment = body["segments"][index]
    link = add(robot, "link", name=_link(index))
    frame = _hinge_place(body, index)
    com = (segment["com_x_m"], segment["com_y_m"], segment["com_z_m"])
    inertias = [segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw")]
    _add_inertial(link, _minus(com, frame), segment["mass_kg"], inertias)
    middle = _minus((segment["x_m"], 0.0, segment["center_z_m"]), frame)
    box = numbers(segment["length_m"], segment["width_m"], segment["height_m"])
    _add_shape(link, middle, 0.0, segment["grip"], "box", size=box)
    _add_friction(robot, link, segment["grip"])


def _add_hinge(robot: Element, body: Mapping[str, Any], index: int) -> None:
    """Add the joint of a hinge, between the segment with the same index and the next one behind it."""
    hinge = body["hinges"][index]
    place = _minus(_hinge_place(body, index + 1), _hinge_place(body, index))
    joint = _add_joint(robot, f"hinge{index}", "revolute", _link(index), _link(index + 1), place)
    # A hinge has no motor, so its effort, which is the largest torque of a motor, is 0.
    bounds = {"lower": numbers(hinge["min_rad"]), "upper": numbers(hinge["max_rad"])}
    add(joint, "limit", {**bounds, "effort": "0", "velocity": numbers(FREE_RAD_S)})
    add(joint, "dynamics", damping=numbers(hinge["damping_n_m_s_rad"]))


def _add_wheel(robot: Element, body: Mapping[str, Any], wheel: Mapping[str, Any]) -> None:
    """Add a wheel's link, its axle, and the transmission of its servo if it has one."""
    name = wheel_name(wheel)
    link = add(robot, "link", name=name)
    axle_inertia, diameter_inertia = wheel_inertia_kg_m2(wheel)
    center = tyre_center_m(wheel)
    # About x, y (the axle) and z.
    _add_inertial(link, center, wheel["mass_kg"], [diameter_inertia, axle_inertia, diameter_inertia])
    size = {"radius": numbers(wheel["radius_m"]), "length": numbers(wheel["width_m"])}
    _add_shape(link, center, math.pi / 2, wheel["grip"], "cylinder", **size)
    _add_friction(robot, link, wheel["grip"])
    place = _minus(axle_m(body, wheel), _hinge_place(body, wheel["segment"]))
    joint = _add_joint(robot, f"{name}_axle", "continuous", _link(wheel["segment"]), name, place)
    if "servo" in wheel:
        stall_torque, no_load_speed = servo_limits(body, wheel)
        add(joint, "limit", effort=numbers(stall_torque), velocity=numbers(no_load_speed))
        _add_transmission(robot, name, wheel["servo"]["rotor_inertia_kg_m2"])


def _add_transmission(robot: Element, name: str, rotor_inertia_kg_m2: float) -> None:
    """Add the transmission from a servo to the axle of the wheel ``name``. URDF says with it that a motor drives a joint.

    The rotor's inertia is given at the wheel, so the ratio of the transmission is 1.
    """
    transmission = add(robot, "transmission", name=f"{name}_transmission")
    add(transmission, "type").text = "transmission_interface/SimpleTransmission"
    effort = "hardware_interface/EffortJointInterface"
    add(add(transmission, "joint", name=f"{name}_axle"), "hardwareInterface").text = effort
    actuator = add(transmission, "actuator", name=f"{name}_servo")
    add(actuator, "hardwareInterface").text = effort
    add(actuator, "mechanicalReduction").text = "1"
    add(actuator, "drake:rotor_inertia", value=numbers(rotor_inertia_kg_m2))
    add(actuator, "drake:gear_ratio", value="1")


def _link(segment: int) -> str:
    return segment_name(segment) if segment else ROOT


def _add_inertial(link: Element, com: tuple[float, ...], mass: float, inertias: list[float]) -> None:
    """Add mass (kg), centre of mass (m) and moments of inertia (kg m², about x, y, z through it) to a link."""
    inertial = add(link, "inertial")
    add(inertial, "origin", xyz=numbers(*com))
    add(inertial, "mass", value=numbers(mass))
    ixx, iyy, izz = (numbers(value) for value in inertias)
    add(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _add_shape(link: Element, middle: tuple[float, ...], turn_rad: float, grip: float, shape: str, **size: str) -> None:
    """Add a shape to a link, for drawing and for contacts, turned about x; ``grip`` is its friction coefficient."""
    for purpose in ("visual", "collision"):
        holder = add(link, purpose)
        add(holder, "origin", xyz=numbers(*middle), rpy=numbers(turn_rad, 0, 0))
        geometry = add(holder, "geometry")
        # Element takes attributes as a dictionary.
        add(geometry, shape, size)
        if purpose == "collision":
            contact = add(holder, "drake:proximity_properties")
            for kind in ("dynamic", "static"):
                add(contact, f"drake:mu_{kind}", value=numbers(grip))


def _add_friction(robot: Element, link: Element, grip: float) -> None:
    add(add(link, "contact"), "lateral_friction", value=numbers(grip))
    gazebo = add(robot, "gazebo", reference=link.get("name", ""))
    for name in ("mu1", "mu2"):
        add(gazebo, name).text = numbers(grip)


def _add_joint(robot: Element, name: str, kind: str, parent: str, child: str, place: tuple[float, ...]) -> Element:
    """Add a joint about y at ``place`` (m) in the frame of the link ``parent``."""
    joint = add(robot, "joint", name=name, type=kind)
    add(joint, "parent", link=parent)
    add(joint, "child", link=child)
    add(joint, "origin", xyz=numbers(*place))
    add(joint, "axis", xyz="0 1 0")
    return joint


def _hinge_place(body: Mapping[str, Any], segment: int) -> tuple[float, float, float]:
    """Return the position (m) of the hinge in front of a segment; for the first segment the car's origin."""
    if segment == 0:
        return 0.0, 0.0, 0.0
    hinge = body["hinges"][segment - 1]
    return hinge["x_m"], 0.0, hinge["z_m"]


def _minus(first: tuple[float, ...], second: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(a - b for a, b in zip(first, second, strict=True))
