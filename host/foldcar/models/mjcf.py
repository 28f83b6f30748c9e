"""A car, and the scene it stands in, as MJCF: MuJoCo's XML.

Input: body and scene of docs/carsim.md, the grid of the scene's smooth ground, the shape of the tyres. Output:
the text of a model. All frames of the car's parts are the car's own: the origin in the middle of its length at
axle height, x forward, y left, z up.

What the format leaves open is decided here:
- contacts: sliding friction only (condim 3; a tyre's contact line resists turning by itself), elliptic cones, as
  friction acts alike in all directions, and a priority above the ground's so that a contact has the coefficient of
  the part of the car; impratio 10 keeps tyres from creeping on slopes.
- a reference time of 5 ms: penetrations under 0.1 mm, and several steps long.
- multiccd off: on edges of boxes it gives cylinders wrong normals. A dense Jacobian: a car has few degrees of
  freedom.
- the servo is MuJoCo's general actuator: torque τ·u − (τ/ω0)·ω, limited to ±τ; the rotor is the joint's armature.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from foldcar.models.ground import HeightGrid
from foldcar.models.mjcf_terrain import add_terrain
from foldcar.models.wheel_geometry import segment_name, tyre_center_m, wheel_inertia_kg_m2, wheel_name

TYRES = ("cylinder", "ellipsoid")
GRAVITY_M_S2 = 9.81
CAR_CONTACT = {"contype": "2", "conaffinity": "1", "priority": "1", "condim": "3"}
SOLREF = "0.005 1"
IMPRATIO = 10
CAR_RGBA = "0.1 0.45 0.7 0.6"
TYRE_RGBA = "0.2 0.2 0.2 1"


@dataclass(frozen=True)
class MjcfOptions:
    """``tyre`` is cylinder (as wide as the tyre) or ellipsoid (one point of contact in its middle)."""

    timestep_s: float = 1e-3
    tyre: str = "cylinder"


DEFAULTS = MjcfOptions()


def mjcf(
    body: Mapping[str, Any],
    scene: Mapping[str, Any] | None = None,
    grid: HeightGrid | None = None,
    options: MjcfOptions = DEFAULTS,
) -> str:
    """The model of the car on the scene's ground; on a level floor of friction 1 if there is no scene.

    It stands with its axles one largest wheel radius over z = 0, at the scene's start.
    """
    root = Element("mujoco", model="foldcar")
    SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = SubElement(
        root,
        "option",
        timestep=f"{options.timestep_s:.9g}",
        gravity=f"0 0 {-GRAVITY_M_S2}",
        integrator="implicitfast",
        cone="elliptic",
        impratio=f"{IMPRATIO}",
        jacobian="dense",
    )
    SubElement(option, "flag", multiccd="disable")
    default = SubElement(root, "default")
    SubElement(default, "geom", solref=SOLREF)
    asset = SubElement(root, "asset")
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 0 3", dir="0 0 -1")
    add_terrain(world, asset, scene["terrain"] if scene else (), grid)
    start = scene["start"] if scene else {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
    _add_car(world, body, start, scene["friction"] if scene else 1.0, options.tyre)
    _add_servos(SubElement(root, "actuator"), body)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _add_car(
    world: Element, body: Mapping[str, Any], start: Mapping[str, float], friction: float, tyre: str
) -> None:
    height_m = max(wheel["radius_m"] for wheel in body["wheels"])
    parent = world
    for index, segment in enumerate(body["segments"]):
        name = segment_name(index)
        if index == 0:
            place = {"pos": _text(start["x_m"], start["y_m"], height_m), "euler": _text(0, 0, start["heading_rad"])}
            part = SubElement(parent, "body", name=name, **place)
            SubElement(part, "freejoint", name="car")
        else:
            part = SubElement(parent, "body", name=name)
            _add_hinge(part, index - 1, body["hinges"][index - 1])
        inertias = (segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw"))
        SubElement(
            part,
            "inertial",
            pos=_text(segment["com_x_m"], segment["com_y_m"], segment["com_z_m"]),
            mass=_text(segment["mass_kg"]),
            diaginertia=_text(*inertias),
        )
        SubElement(
            part,
            "geom",
            name=f"{name}_belly",
            type="box",
            size=_text(segment["length_m"] / 2, segment["width_m"] / 2, segment["height_m"] / 2),
            pos=_text(segment["x_m"], 0, segment["center_z_m"]),
            friction=_text(friction * segment["grip"]),
            rgba=CAR_RGBA,
            **CAR_CONTACT,
        )
        for wheel in body["wheels"]:
            if wheel["segment"] == index:
                _add_wheel(part, body, wheel, friction, tyre)
        parent = part


def _add_hinge(part: Element, index: int, hinge: Mapping[str, float]) -> None:
    # About +y of the rear segment against the front one: positive with the front one's nose up.
    SubElement(
        part,
        "joint",
        name=f"hinge{index}",
        type="hinge",
        axis="0 1 0",
        pos=_text(hinge["x_m"], 0, hinge["z_m"]),
        range=_text(hinge["min_rad"], hinge["max_rad"]),
        stiffness=_text(hinge["stiffness_n_m_rad"]),
        damping=_text(hinge["damping_n_m_s_rad"]),
    )


def _add_wheel(
    part: Element, body: Mapping[str, Any], wheel: Mapping[str, Any], friction: float, tyre: str
) -> None:
    name = wheel_name(wheel)
    side = 1 if wheel["side"] == "left" else -1
    place = _text(wheel["x_m"], side * body["track_m"] / 2, 0)
    disc = SubElement(part, "body", name=name, pos=place)
    SubElement(
        disc,
        "joint",
        name=f"{name}_axle",
        type="hinge",
        axis="0 1 0",
        armature=_text(wheel["servo"]["rotor_inertia_kg_m2"]),
    )
    spin, across = wheel_inertia_kg_m2(wheel)
    center = _text(*tyre_center_m(wheel))
    inertia = _text(across, spin, across)
    SubElement(disc, "inertial", pos=center, mass=_text(wheel["mass_kg"]), diaginertia=inertia)
    radius, half_width = wheel["radius_m"], wheel["width_m"] / 2
    shape = (
        {"type": "cylinder", "size": _text(radius, half_width), "zaxis": "0 1 0"}
        if tyre == "cylinder"
        else {"type": "ellipsoid", "size": _text(radius, half_width, radius)}
    )
    SubElement(
        disc,
        "geom",
        name=f"{name}_tyre",
        **shape,
        pos=center,
        friction=_text(friction * wheel["grip"]),
        rgba=TYRE_RGBA,
        **CAR_CONTACT,
    )


def _add_servos(actuator: Element, body: Mapping[str, Any]) -> None:
    for wheel in body["wheels"]:
        servo, name = wheel["servo"], wheel_name(wheel)
        scale = body["supply_v"] / servo["rated_v"]
        stall, no_load = servo["stall_torque_n_m"] * scale, servo["no_load_speed_rad_s"] * scale
        SubElement(
            actuator,
            "general",
            name=f"{name}_servo",
            joint=f"{name}_axle",
            ctrlrange="-1 1",
            forcerange=_text(-stall, stall),
            gaintype="fixed",
            gainprm=_text(stall),
            biastype="affine",
            biasprm=_text(0, 0, -stall / no_load),
        )


def _text(*numbers: float) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)
