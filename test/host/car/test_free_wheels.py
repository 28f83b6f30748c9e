"""Axles without servos: their wheels turn freely on a rod, in the car, its body, all engines, exports, wiring."""

import json
import math
from typing import Any
from xml.etree import ElementTree

import mujoco
import pytest

from foldcar.car.body import body_json, car_json, firmware_parameters, full_speed_m_s
from foldcar.car.design import DesignError, compose
from foldcar.car.folded.weight import body_properties
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.wiring import wiring_drawing, wiring_text
from foldcar.models.mjcf import mjcf
from foldcar.models.urdf import urdf
from foldcar.models.webots_car import webots_proto
from foldcar.models.webots_world import controller_drive
from foldcar.simulation.carsim import Carsim, PulseTrain
from foldcar.simulation.engines import MUJOCO, MULTIBODY, SIDE_VIEW
from study_car import empty_scene
from test_design import family
from test_places import drive

REAR_FREE = {"W2.driven": 0.0}


@pytest.mark.parametrize(
    ("type_string", "values"),
    [
        ("W_B_W", REAR_FREE),
        ("W_B_W", {"W1.driven": 0, "W1.radius": 45}),
        ("W_B_W+tyre=none", {**REAR_FREE, "W2.length": 46, "B.length": 70, "radius": 50}),
        ("W_B_H_W_H_W", {"radius": 30, "W.length": 80, "W2.driven": 0}),
        ("W_B_H_W", {"radius": 36, "W.length": 70, "W1.driven": 0}),
        ("B_W_W", {"radius": 30, "W.length": 80, "W1.driven": 0, "W2.radius": 31}),
    ],
)
def test_cars_with_free_wheels_go_together(type_string: str, values: dict[str, float]) -> None:
    assert verify(compose(type_string, values)).findings == ()


def test_servos_take_the_outputs_and_free_wheels_the_numbers_after() -> None:
    car = folded_car(compose("W_B_H_W_H_W", {"radius": 30, "W.length": 80, "W2.driven": 0}))

    assert [(axle.channel, axle.servo) for axle in car.axles] == [
        (0, "axle 1 left servo"), (1, "axle 1 right servo"), (4, ""), (5, ""),
        (2, "axle 3 left servo"), (3, "axle 3 right servo"),
    ]  # fmt: skip
    assert [axle.unit for axle in car.axles] == [
        *["axle 1 and 3 wheel"] * 2,
        *["axle 2 wheel"] * 2,
        *["axle 1 and 3 wheel"] * 2,
    ]


def test_a_rod_stands_for_two_servos() -> None:
    driven, free = (folded_car(compose("W_B_W", values)) for values in ({}, REAR_FREE))
    parts = free.parts

    counts = {row.name: row.quantity for row in parts_list(free)}
    assert counts[parts.servo.name] == 2 and counts[parts.horn.name] == 2
    assert counts[parts.axle_rod.name] == 1 and counts[parts.axle_tube.name] == counts[parts.axle_cap.name] == 2
    # The track is the same: the tubes are as long as what lies between wall and disc of a driven wheel.
    assert [axle.center_mm for axle in free.axles] == [axle.center_mm for axle in driven.axles]
    (rod,) = [mount for mount in free.mounts if mount.part == parts.axle_rod.name]
    long = rod.size_mm[2]
    assert long == pytest.approx(2 * (free.axles[0].center_mm[1] + 12 / 2 + parts.axle_cap.height_mm.value))
    assert rod.mass_kg == pytest.approx(math.pi / 4 * 0.003**2 * long * 1e-3 * 7850)
    # The rod passes the holes of both walls, the tubes and the wheels at the axle's height.
    assert [rod.pose[i][3] for i in range(3)] == pytest.approx([-70, 0, 0])
    assert body_properties(free, "wheel2").mass_kg < body_properties(free, "wheel0").mass_kg


def test_leads_and_wiring_know_driven_wheels_only() -> None:
    car = folded_car(compose("W_B_W", REAR_FREE))

    assert {lead.start for lead in leads(car) if lead.start.endswith(" servo")} == {
        "front left servo",
        "front right servo",
    }
    text = wiring_text(car, "car")
    assert "| 1 | CH2 | front right servo |" in text and "Outputs 2, 3, 4, 5, 6, 7 stay empty." in text
    assert wiring_drawing(car, "car").count("servo<") == 2


def test_the_firmware_drives_no_free_wheel() -> None:
    design = compose("W_B_W", {**REAR_FREE, "W2.radius": 50})
    car, values = car_json(design), firmware_parameters(design)

    assert [(wheel["channel"], wheel["side"]) for wheel in car["wheels"]] == [(1, "left"), (2, "right")]
    assert [values[f"CH{n}_SIDE"] for n in range(1, 9)] == [1, 2, 0, 0, 0, 0, 0, 0]
    # Free wheels do not limit the speed.
    assert car["wheel_radius_m"] == 0.06
    assert full_speed_m_s(design) == full_speed_m_s(compose("W_B_W", {}))
    assert car["mass_kg"] == pytest.approx(sum(row.mass_kg for row in parts_list(folded_car(design))), abs=1e-4)


@pytest.mark.parametrize("engine", [MULTIBODY, SIDE_VIEW, MUJOCO])
def test_one_axle_drives_the_car_in_every_engine(engine: str) -> None:
    path = drive(engine, REAR_FREE)

    speed = (path[-1][1] - path[-11][1]) / (path[-1][0] - path[-11][0])
    assert speed == pytest.approx(0.3, rel=0.05)


def test_engines_agree_on_how_a_car_with_one_driven_axle_gets_away() -> None:
    """Friction at the driven axle limits the acceleration; multibody and MuJoCo agree on the way after 0.6 s."""
    values = {"W1.driven": 0.0, "W1.radius": 45.0}
    ways = [drive(engine, values, speed_m_s=0.6, time_limit_s=0.6)[-1][1] for engine in (MULTIBODY, MUJOCO)]

    assert ways[0] == pytest.approx(ways[1], rel=0.03)
    assert ways[0] > 0.1


def test_exports_have_motors_for_driven_wheels_only(native: Carsim) -> None:
    body = body_json(compose("W_B_W", {**REAR_FREE, "W2.radius": 50}))

    model = mujoco.MjModel.from_xml_string(mjcf(native, body, empty_scene()))
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) for i in range(model.nu)]
    assert names == ["wheel0_servo", "wheel1_servo"]
    free = model.joint("wheel2_axle")
    assert model.dof_armature[free.dofadr[0]] == 0 and model.dof_armature[model.joint("wheel0_axle").dofadr[0]] > 0
    robot = ElementTree.fromstring(urdf(body, "Car"))
    assert [transmission.get("name") for transmission in robot.findall("transmission")] == [
        "wheel0_transmission",
        "wheel1_transmission",
    ]
    assert robot.find("joint[@name='wheel2_axle']/limit") is None
    proto = webots_proto(body, "Car", "car")
    assert proto.count("RotationalMotor") == 2 and proto.count("PositionSensor") == 4
    drive_text = controller_drive(body, PulseTrain((0.0,), ((1700.0, 1300.0, 0, 0, 0, 0, 0, 0),)), 0.5)
    assert json.loads(drive_text)["motors"] == ["wheel0 servo", "wheel1 servo"]


def test_a_car_without_a_driven_axle_is_refused() -> None:
    with pytest.raises(DesignError, match=r'^"W_B_W" has no driven axle: at least one W needs "driven": true$'):
        compose("W_B_W", {"W.driven": 0})


def test_a_listing_says_true_or_false() -> None:
    cars = family("W_B_W", {"W2": {"driven": [True, False]}})

    assert [design.columns["W2_driven"] for design in cars] == [1, 0]
    assert cars.narrowed({"W2.driven": 0.0}).single().title == "W_B_W width=95 height=50 radius=60 W2.driven=0"
    with pytest.raises(FoldcarError, match=r"W2.driven: 2 is neither true nor false$"):
        family("W_B_W", {"W2": {"driven": 2}}).single()
    with pytest.raises(
        FoldcarError, match=r"W2.radius: True is not a number; write a number, a list of numbers or a range$"
    ):
        family("W_B_W", {"W2": {"radius": True}})


def test_the_command_line_says_true_or_false(foldcar: Any, tmp_path: Any) -> None:
    (tmp_path / "cars.json").write_text('{"vehicles": {"1": {"type": "W_B_W"}}}')

    done = foldcar("model", "cars.json", "--vehicle", "1", "--to", "urdf", "--set", "W2.driven=false", "-o", "out")

    assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "out").iterdir()
    assert file.read_text().count("<transmission") == 2
