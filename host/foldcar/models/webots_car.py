"""A car as a Webots PROTO (R2023b or later).

Input: a body of docs/carsim.md. Output: the text of a PROTO file. Servos are rotational motors with the stall torque
and no-load speed at the supply voltage: Webots' motors deliver their maximum torque up to their maximum speed and have
no rotor inertia. Friction is a property of pairs of materials in the world file; ``contact_materials`` names them.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from foldcar.models.exported_car import (
    axle_m,
    segment_name,
    servo_limits,
    tyre_center_m,
    wheel_inertia_kg_m2,
    wheel_name,
)

# The oldest version with these nodes; later versions read its files, older ones refuse them.
HEADER = "#VRML_SIM R2023b utf8"


@dataclass(frozen=True)
class Node:
    """A node: ``name { field value … }``."""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)


class Is(str):
    """The name of a field of the PROTO that a value refers to."""


class Vector(tuple[float, ...]):
    """Numbers that form one value: a position, a direction or a rotation."""


def vector(*values: float) -> Vector:
    """Return a Vector of these numbers."""
    return Vector(values)


def node_text(node: Node, depth: int = 0) -> str:
    """Format the node as text, indented by two spaces per level."""
    lines = [f"{name} {_value(value, depth + 1)}" for name, value in node.fields.items()]
    return _block(f"{node.name} {{", lines, "}", depth)


def _block(start: str, lines: Sequence[str], end: str, depth: int) -> str:
    return "\n".join([start, *("  " * (depth + 1) + line for line in lines), "  " * depth + end])


def _value(value: Any, depth: int) -> str:
    """Return a field's value as VRML text.

    VRML is the language of Webots. ``depth`` is the depth of indentation of a node, or of a list of nodes.
    """
    match value:
        case Node():
            return node_text(value, depth)
        case Is():
            return f"IS {value}"
        case Vector():
            # Adding 0.0 turns -0.0 into 0.0.
            return " ".join(f"{number + 0.0:.9g}" for number in value)
        case bool():
            return str(value).upper()
        case int() | float():
            return f"{value + 0.0:.9g}"
        case str():
            return json.dumps(value, ensure_ascii=False)
        case [Node(), *_]:
            return _block("[", [_value(item, depth + 1) for item in value], "]", depth)
    # What remains are lists of vectors, numbers or texts.
    if not value:
        return "[ ]"
    separator = ", " if isinstance(value[0], Vector) else " "
    return f"[ {separator.join(_value(item, depth) for item in value)} ]"


BODY_COLOUR, TYRE_COLOUR = vector(0.1, 0.45, 0.7), vector(0.15, 0.15, 0.15)


def webots_proto(body: Mapping[str, Any], name: str, comment: str) -> str:
    """Return the text of a Webots PROTO, which is a file that describes a robot.

    The file must be called ``name`` too. ``comment`` describes the robot in one line.
    """
    # The fields that a world can set: type, name, default.
    fields = (
        ("SFVec3f", "translation", f"0 0 {max(wheel['radius_m'] for wheel in body['wheels']):.9g}"),
        ("SFRotation", "rotation", "0 0 1 0"),
        ("SFString", "name", '"car"'),
        ("SFString", "controller", '"<generic>"'),
        ("MFString", "controllerArgs", "[ ]"),
    )
    interface = [f"  field {kind:<10} {field:<14} {default}" for kind, field, default in fields]
    robot = Node("Robot", {field: Is(field) for _, field, _ in fields} | _segment_fields(body, 0))
    head = [HEADER, f"# {comment}", "# Origin: middle of the car's length, at axle height; x forward, z up."]
    return "\n".join([*head, "", f"PROTO {name} [", *interface, "]", "{", "  " + node_text(robot, 1), "}", ""])


def contact_materials(body: Mapping[str, Any]) -> dict[str, float]:
    """Return the grip (friction relative to a tyre's) of the car's contact materials by their names."""
    materials = {f"{segment_name(i)} belly": s["grip"] for i, s in enumerate(body["segments"])}
    return materials | {f"{wheel_name(wheel)} tyre": wheel["grip"] for wheel in body["wheels"]}


def shape(geometry: Node, colour: tuple[float, ...]) -> Node:
    """Return a visible shape of the geometry."""
    appearance = Node("PBRAppearance", {"baseColor": colour, "roughness": 0.8, "metalness": 0})
    return Node("Shape", {"appearance": appearance, "geometry": geometry})


def placed(geometry: Node, place: tuple[float, ...], turn: tuple[float, ...]) -> Node:
    """Return a node at position ``place`` (m) with rotation ``turn`` (axis, angle in rad)."""
    return Node("Pose", {"translation": vector(*place), "rotation": vector(*turn), "children": [geometry]})


def _segment_fields(body: Mapping[str, Any], index: int) -> dict[str, Any]:
    """Return the fields of a segment's node, with its wheels and the rest of the car behind its hinge."""
    segment = body["segments"][index]
    box = Node("Box", {"size": vector(segment["length_m"], segment["width_m"], segment["height_m"])})
    middle, straight = (segment["x_m"], 0, segment["center_z_m"]), (0, 0, 1, 0)
    children = [placed(shape(box, BODY_COLOUR), middle, straight)]
    children += [_wheel(body, wheel) for wheel in body["wheels"] if wheel["segment"] == index]
    if index + 1 < len(body["segments"]):
        children.append(_hinge(body, index))
    inertias = [segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw")]
    com = (segment["com_x_m"], segment["com_y_m"], segment["com_z_m"])
    return {
        "children": children,
        "contactMaterial": f"{segment_name(index)} belly",
        "boundingObject": placed(box, middle, straight),
        "physics": _physics(segment["mass_kg"], com, inertias),
    }


def _hinge(body: Mapping[str, Any], index: int) -> Node:
    """Return a hinge between two segments, rigid parts of the car, as Webots' node of a joint.

    ``index`` counts the hinges from the front. The node contains the segment behind the hinge.
    """
    hinge = body["hinges"][index]
    parameters = {
        "axis": vector(0, 1, 0),
        "anchor": vector(hinge["x_m"], 0, hinge["z_m"]),
        "minStop": hinge["min_rad"],
        "maxStop": hinge["max_rad"],
        "springConstant": hinge["stiffness_n_m_rad"],
        "dampingConstant": hinge["damping_n_m_s_rad"],
    }
    segment_behind = index + 1
    rear = Node("Solid", {"name": segment_name(segment_behind), **_segment_fields(body, segment_behind)})
    return Node("HingeJoint", {"jointParameters": Node("HingeJointParameters", parameters), "endPoint": rear})


def _wheel(body: Mapping[str, Any], wheel: Mapping[str, Any]) -> Node:
    """Return the joint of a wheel with its sensor and, if it is driven, its servo."""
    name = wheel_name(wheel)
    axle_inertia, diameter_inertia = wheel_inertia_kg_m2(wheel)
    center = tyre_center_m(wheel)
    # About x, y (the axle) and z.
    inertias = [diameter_inertia, axle_inertia, diameter_inertia]
    # The axis of a Webots cylinder is z.
    cylinder = Node("Cylinder", {"radius": wheel["radius_m"], "height": wheel["width_m"]})
    lying = (1, 0, 0, math.pi / 2)
    axle = vector(*axle_m(body, wheel))
    disc = {
        "translation": axle,
        "name": name,
        "children": [placed(shape(cylinder, TYRE_COLOUR), center, lying)],
        "contactMaterial": f"{name} tyre",
        "boundingObject": placed(cylinder, center, lying),
        "physics": _physics(wheel["mass_kg"], center, inertias),
    }
    devices = [Node("PositionSensor", {"name": f"{name} angle"})]
    if "servo" in wheel:
        stall_torque, no_load_speed = servo_limits(body, wheel)
        # Webots downloads a sound unless one is given.
        motor = {"name": f"{name} servo", "maxVelocity": no_load_speed, "maxTorque": stall_torque, "sound": ""}
        devices.insert(0, Node("RotationalMotor", motor))
    joint = {
        "jointParameters": Node("HingeJointParameters", {"axis": vector(0, 1, 0), "anchor": axle}),
        "device": devices,
        "endPoint": Node("Solid", disc),
    }
    return Node("HingeJoint", joint)


def _physics(mass: float, com: tuple[float, ...], inertias: list[float]) -> Node:
    places = {"centerOfMass": [vector(*com)], "inertiaMatrix": [vector(*inertias), vector(0, 0, 0)]}
    return Node("Physics", {"density": -1, "mass": mass, **places})
