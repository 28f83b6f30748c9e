"""A car and its scene as MJCF, MuJoCo's XML.

Input: body and scene of docs/carsim.md, the grid of the scene's smooth ground, the shape of the tyres. Output: the
text of a model. All parts of the car are given in the car's frame: origin in the middle of its length at axle height,
x forward, y left, z up.

Choices that MuJoCo leaves to the model:
- Contacts have sliding friction only (condim 3: the line of contact of a cylindrical tyre resists yaw by itself),
  elliptic cones, because friction is isotropic, and a priority above the ground's, so that the car's part determines
  the coefficient. impratio 10 prevents tyres from creeping on slopes.
- The time constant of contacts is 5 ms, several steps: penetrations stay under 0.1 mm.
- multiccd is off, because it gives cylinders wrong normals at the edges of boxes. The Jacobian is dense, because a car
  has few degrees of freedom.
- The servo is MuJoCo's general actuator: torque τ·u − (τ/ω0)·ω, limited to ±τ; the rotor is the joint's
  armature.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

from foldcar.models.ground import HeightGrid
from foldcar.models.mjcf_terrain import add_terrain
from foldcar.models.mjcf_view import add_follower, add_light_and_overview, add_sensors, add_size, add_start
from foldcar.models.put_down import start_height_m
from foldcar.models.wheel_geometry import (
    axle_m,
    main_segment,
    segment_name,
    servo_limits,
    tyre_center_m,
    wheel_inertia_kg_m2,
    wheel_name,
)
from foldcar.models.xml_elements import add, document, numbers

GRAVITY_M_S2 = 9.81
CAR_CONTACT = {"contype": "2", "conaffinity": "1", "priority": "1", "condim": "3"}
SOLREF = "0.005 1"
IMPRATIO = 10
CAR_RGBA = "0.1 0.45 0.7 0.6"
TYRE_RGBA = "0.2 0.2 0.2 1"


@dataclass(frozen=True)
class MjcfOptions:
    """``tyre`` is "cylinder" (as wide as the tyre) or "ellipsoid" (a contact point in the tyre's middle plane)."""

    timestep_s: float = 1e-3
    tyre: str = "cylinder"


DEFAULTS = MjcfOptions()


def mjcf(
    body: Mapping[str, Any],
    scene: Mapping[str, Any] | None = None,
    grid: HeightGrid | None = None,
    options: MjcfOptions = DEFAULTS,
    name: str = "foldcar",
) -> str:
    """The model, of that name, of the car on the scene's ground, or without a scene on a level floor with friction 1.

    The car stands at the scene's start, put down on the ground (foldcar.models.put_down).
    """
    root = Element("mujoco", model=name)
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = add(
        root,
        "option",
        timestep=f"{options.timestep_s:.9g}",
        gravity=f"0 0 {-GRAVITY_M_S2}",
        integrator="implicitfast",
        cone="elliptic",
        impratio=f"{IMPRATIO}",
        jacobian="dense",
    )
    add(option, "flag", multiccd="disable")
    add_size(root, scene)
    default = add(root, "default")
    add(default, "geom", solref=SOLREF)
    asset = add(root, "asset")
    world = add(root, "worldbody")
    add_light_and_overview(world, scene)
    add_terrain(world, asset, scene["terrain"] if scene else (), grid)
    start = scene["start"] if scene else {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
    height_m = start_height_m(body, scene, grid)
    _add_car(world, body, start, height_m, scene["friction"] if scene else 1.0, options.tyre)
    _add_servos(add(root, "actuator"), body)
    add_sensors(root, body)
    add_start(root, body, start, height_m)
    return document(root)


def _add_car(
    world: Element,
    body: Mapping[str, Any],
    start: Mapping[str, float],
    height_m: float,
    friction: float,
    tyre: str,
) -> None:
    parent = world
    for index, segment in enumerate(body["segments"]):
        name = segment_name(index)
        if index == 0:
            # All digits of the height: the crosscheck starts from here.
            place = f"{numbers(start['x_m'], start['y_m'])} {height_m!r}"
            part = add(parent, "body", name=name, pos=place, euler=numbers(0, 0, start["heading_rad"]))
            add(part, "freejoint", name="car")
            add_follower(part, max(s["x_m"] + s["length_m"] / 2 for s in body["segments"]) * 2)
        else:
            part = add(parent, "body", name=name)
            _add_hinge(part, index - 1, body["hinges"][index - 1])
        inertias = (segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw"))
        add(
            part,
            "inertial",
            pos=numbers(segment["com_x_m"], segment["com_y_m"], segment["com_z_m"]),
            mass=numbers(segment["mass_kg"]),
            diaginertia=numbers(*inertias),
        )
        add(
            part,
            "geom",
            name=f"{name}_belly",
            type="box",
            size=numbers(segment["length_m"] / 2, segment["width_m"] / 2, segment["height_m"] / 2),
            pos=numbers(segment["x_m"], 0, segment["center_z_m"]),
            friction=numbers(friction * segment["grip"]),
            rgba=CAR_RGBA,
            **CAR_CONTACT,
        )
        if index == main_segment(body):
            add(part, "site", name="imu", pos="0 0 0", size="0.004")
        for wheel in body["wheels"]:
            if wheel["segment"] == index:
                _add_wheel(part, body, wheel, friction, tyre)
        parent = part


def _add_hinge(part: Element, index: int, hinge: Mapping[str, float]) -> None:
    # The angle is that of the rear segment relative to the front one about +y: positive with the front one's nose up.
    add(
        part,
        "joint",
        name=f"hinge{index}",
        type="hinge",
        axis="0 1 0",
        pos=numbers(hinge["x_m"], 0, hinge["z_m"]),
        range=numbers(hinge["min_rad"], hinge["max_rad"]),
        stiffness=numbers(hinge["stiffness_n_m_rad"]),
        damping=numbers(hinge["damping_n_m_s_rad"]),
    )


def _add_wheel(
    part: Element, body: Mapping[str, Any], wheel: Mapping[str, Any], friction: float, tyre: str
) -> None:
    name = wheel_name(wheel)
    disc = add(part, "body", name=name, pos=numbers(*axle_m(body, wheel)))
    add(
        disc,
        "joint",
        name=f"{name}_axle",
        type="hinge",
        axis="0 1 0",
        armature=numbers(wheel["servo"]["rotor_inertia_kg_m2"]),
    )
    spin, across = wheel_inertia_kg_m2(wheel)
    center = numbers(*tyre_center_m(wheel))
    inertia = numbers(across, spin, across)
    add(disc, "inertial", pos=center, mass=numbers(wheel["mass_kg"]), diaginertia=inertia)
    radius, half_width = wheel["radius_m"], wheel["width_m"] / 2
    shape = (
        {"type": "cylinder", "size": numbers(radius, half_width), "zaxis": "0 1 0"}
        if tyre == "cylinder"
        else {"type": "ellipsoid", "size": numbers(radius, half_width, radius)}
    )
    add(
        disc,
        "geom",
        name=f"{name}_tyre",
        **shape,
        pos=center,
        friction=numbers(friction * wheel["grip"]),
        rgba=TYRE_RGBA,
        **CAR_CONTACT,
    )


def _add_servos(actuator: Element, body: Mapping[str, Any]) -> None:
    for wheel in body["wheels"]:
        name = wheel_name(wheel)
        stall, no_load = servo_limits(body, wheel)
        add(
            actuator,
            "general",
            name=f"{name}_servo",
            joint=f"{name}_axle",
            ctrlrange="-1 1",
            forcerange=numbers(-stall, stall),
            gaintype="fixed",
            gainprm=numbers(stall),
            biastype="affine",
            biasprm=numbers(0, 0, -stall / no_load),
        )
