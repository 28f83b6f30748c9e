"""Bodies: mass, inertia and servo values against independent computations."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from foldcar.car.body import TableRow, body_json, check_parameters, firmware_parameters, full_speed_m_s
from foldcar.car.design import Design, compose
from foldcar.car.folded.model import FoldedCar, Solid
from foldcar.car.folded.placed import placed_faces
from foldcar.car.folded.weight import body_properties
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads, stock_wire_mm
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from study_car import empty_scene


def study_car(width: float = 95) -> Design:
    return compose("W_B_W", {"width": width})


def solids(design: Design, body: str) -> list[trimesh.Trimesh]:
    """Every face of the body extruded to its thickness, and every part's shape, in metres, with their densities."""
    car = folded_car(design)
    meshes = []
    for face in placed_faces(car, (body,))[body]:
        mesh = trimesh.creation.extrude_polygon(face.polygon, face.piece.thickness_mm)
        mesh.apply_translation((0, 0, -face.piece.thickness_mm / 2))
        mesh.apply_transform(face.matrix)
        mesh.apply_scale(1e-3)
        mesh.density = 1390
        meshes.append(mesh)
    for mount in car.mounts:
        if mount.body == body:
            shapes = [solid_mesh(solid, np.array(mount.pose)) for solid in mount.solids if not solid.weightless]
            shapes = shapes or [trimesh.creation.box(mount.size_mm, np.array(mount.pose))]
            density = mount.mass_kg / sum(mesh.volume for mesh in shapes) * 1e9
            for mesh in shapes:
                mesh.apply_scale(1e-3)
                mesh.density = density
            meshes += shapes
    return meshes


def solid_mesh(solid: Solid, pose: np.ndarray) -> trimesh.Trimesh:
    place = pose @ np.array(solid.pose)
    if solid.kind == "box":
        return trimesh.creation.box(solid.size_mm, place)
    # A prism of the cylinder's volume.
    corners = 96
    radius = solid.size_mm[0] / 2 * math.sqrt(2 * math.pi / corners / math.sin(2 * math.pi / corners))
    return trimesh.creation.cylinder(radius, solid.size_mm[2], corners, transform=place)


@pytest.mark.parametrize(
    ("type_string", "body"),
    [("W_B_W", "segment0"), ("W_B_W_W", "segment0"), ("W_B_H_W", "segment1"), ("W_B_W", "wheel1")],
)
def test_mass_center_and_inertia_agree_with_the_integrals_over_meshes(type_string: str, body: str) -> None:
    design = compose(type_string, {"W.length": 130})
    meshes = solids(design, body)
    mass = sum(mesh.mass for mesh in meshes)
    center = sum(mesh.mass * mesh.center_mass for mesh in meshes) / mass
    inertia = np.zeros((3, 3))
    for mesh in meshes:
        offset = mesh.center_mass - center
        inertia += mesh.moment_inertia + mesh.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))

    properties = body_properties(folded_car(design), body)

    assert properties.mass_kg == pytest.approx(mass, rel=1e-9)
    assert properties.center_m == pytest.approx(center, abs=1e-9)
    assert properties.inertia_kg_m2 == pytest.approx(inertia, rel=1e-6, abs=1e-11)


# Beside its tongue and slot a latch has a lever, 11 mm wide and 9 at its tip, cut from a notch of the lid with 1.5 mm
# around it, which the flap keeps off its end too. The notch of one is longer by a pull tab, as large.
LATCH_MM2 = 10 * 10 - 14 * 11.5 - 1.5 * 10
PULL_TAB_MM2 = 10 * 10 - 14 * 10


def test_the_chassis_weighs_its_film_and_parts() -> None:
    round_one, slot = math.pi * 1.1**2, 10.6 * 0.55
    # A servo's opening, and notches 2.2 mm wide for screws up to 14 mm from its middle.
    opening = 23.4 * 12.7 + 2 * (2.2 * (14.0 - 11.7) + round_one / 2)
    # A strip 200 long: walls of 49.75, a floor of 94.75, a lid less a film and a gap of 0.2, a flap between caps'
    # tabs with two latches. Openings for servos, locks, the bridge, and around a USB plug of at most 10.6 x 8.5 mm with
    # 0.3 of play for it and 0.3 for its socket.
    beam = 200 * (2 * 49.75 + 94.75 + 94.3) + 10 * (200 - 2 * 8.6) + 2 * 9 * 2.575 + 2 * LATCH_MM2 + PULL_TAB_MM2
    beam -= 4 * opening + math.pi / 4 * (math.hypot(10.6, 8.5) + 1.2) ** 2 + 3 * slot
    # A window for the light, and two slots for the tie of the cable.
    beam -= math.pi * 3**2 + 2 * 2 * 4
    # Caps inside the walls, a mitred flange or tab of 8 mm at each of their edges.
    caps = 2 * (94.05 * 49.05 + 2 * (94.05 - 8) * 8 + 2 * (49.05 - 8) * 8) - 2 * 13.9 * 8.8
    doublers = 4 * (32.4 * 24.3 - opening) + 3 * ((2 * 13.9 + 18) * (8.8 + 12) - 2 * 13.9 * 8.8)
    # Below the battery, 31.5 mm wide, with 0.55 mm at both ends, and 2 mm from both walls.
    doublers += 32.6 * (94.75 - 4)
    # The bridge: a shelf with two legs over a LiPo of 4.75 mm and screws' heads, feet, and a flange with a tongue.
    leg = 4.75 + 2.4
    bridge = 23.98 * (52.15 + 2 * leg + 2 * 6) + (52.15 - 6.5) * (leg + 0.025) + 10 * 0.85 - 2 * round_one
    film_kg = (beam + caps + doublers + bridge) * 1e-6 * 0.25e-3 * 1390
    # Servos with two screws each; boards on two screws with spacers, a pad of foam; LiPo, battery, pad, switches, wires.
    servos_kg, boards_kg = 4 * (0.009 + 2 * 0.0004), 0.0085 + 0.009 + 2 * (0.0005 + 0.00005) + 0.0002
    parts_kg = servos_kg + boards_kg + 0.0105 + 0.124 + 0.0015 + 2 * 0.003 + 0.002
    # The wires' 2 g are those of 250 mm; test_leads.py measures the ways.
    folded = folded_car(study_car())
    parts_kg += (stock_wire_mm(leads(folded)) - 250) * 1e-3 * 0.0055

    (chassis,) = body_json(study_car())["segments"]

    assert chassis["mass_kg"] == pytest.approx(film_kg + parts_kg, abs=2e-6)


def test_inertias_obey_the_triangle_inequality_and_grow_with_width() -> None:
    bodies = [body_json(study_car(width))["segments"][0] for width in range(65, 250, 30)]

    for chassis in bodies:
        roll, pitch, yaw = (chassis[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw"))
        assert roll < pitch + yaw and pitch < roll + yaw and yaw < roll + pitch
    for key in ("mass_kg", "roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2"):
        assert all(narrow[key] < wide[key] for narrow, wide in itertools.pairwise(bodies))


def test_the_servo_line_lies_between_the_published_points() -> None:
    servo = body_json(study_car())["wheels"][0]["servo"]

    rpm = np.interp(5.2, [4.8, 6.0], [100, 130])
    kgf_cm = np.interp(5.2, [4.8, 6.0], [1.3, 1.5])
    assert servo["no_load_speed_rad_s"] == pytest.approx(rpm / 60 * 2 * math.pi)
    assert servo["stall_torque_n_m"] == pytest.approx(kgf_cm * 9.80665 * 0.01)
    assert servo["stall_current_a"] == pytest.approx(0.8 * 5.2 / 6)
    assert full_speed_m_s(study_car()) == pytest.approx(rpm / 60 * 2 * math.pi * 0.06)


def test_wheels_stand_front_to_back_left_then_right_and_mirrored() -> None:
    body = body_json(study_car())

    places = [(wheel["channel"], wheel["side"], wheel["x_m"], wheel["servo"]["direction"]) for wheel in body["wheels"]]
    assert places == [
        (0, "left", 0.07, 1),
        (1, "right", 0.07, -1),
        (2, "left", -0.07, 1),
        (3, "right", -0.07, -1),
    ]
    assert body["track_m"] == pytest.approx(0.1392)


def test_the_controller_is_set_for_the_same_car() -> None:
    values = firmware_parameters(study_car())

    assert values["TRACK_M"] == pytest.approx(0.1392)
    assert values["WHEEL_RADIUS_M"] == 0.06
    assert [values[f"CH{n}_SIDE"] for n in range(1, 9)] == [1, 2, 1, 2, 0, 0, 0, 0]
    assert [values[f"CH{n}_DIRECTION"] for n in range(1, 5)] == [1, -1, 1, -1]
    # The pulse for the no-load speed is at the end of the servo's range.
    full_us = values["CH1_DEADBAND_US"] + values["CH1_GAIN_US"] * values["WHEEL_MAX_RAD_S"]
    assert full_us == pytest.approx(body_json(study_car())["wheels"][0]["servo"]["saturation_us"])


def test_values_the_firmware_does_not_take_are_refused() -> None:
    table = {"TRACK_M": TableRow("TRACK_M", "m", 0.01, 2.0, 0.111)}

    with pytest.raises(FoldcarError, match=r"TRACK_M: 3 is outside the firmware's limits 0.01 to 2 m"):
        check_parameters({"TRACK_M": 3.0}, table)
    with pytest.raises(FoldcarError, match=r"TRACKM: the firmware of this carsim has no such parameter"):
        check_parameters({"TRACKM": 1.0}, table)


def longer_leads_kg(car: FoldedCar, body: str = "") -> float:
    """Servo extensions, and wire beyond that which the wiring includes, in one body or in all."""
    sold = {extension.name for extension in car.parts.extensions.sold}
    mounts = [mount for mount in car.mounts if body in ("", mount.body)]
    wires = sum(m.mass_kg - car.parts.wiring.mass_kg.value for m in mounts if m.part == car.parts.wiring.name)
    return wires + sum(mount.mass_kg for mount in mounts if mount.part in sold)


def test_segments_and_hinges_stand_where_the_modules_do() -> None:
    design = compose("W_B_H_W_H_W", {"W.length": 140, "B.length": 80, "H.length": 6})
    body = body_json(design)

    # 140 + 80, 6, 140, 6, 140: 512 in all.
    places = [(segment["x_m"], segment["length_m"]) for segment in body["segments"]]
    assert places == [(0.146, 0.22), (-0.04, 0.14), (-0.186, 0.14)]
    assert [hinge["x_m"] for hinge in body["hinges"]] == [0.033, -0.113]
    assert [(wheel["segment"], wheel["x_m"]) for wheel in body["wheels"][::2]] == [
        (0, 0.186),
        (1, -0.04),
        (2, -0.186),
    ]
    first, second, third = body["segments"]
    assert first["mass_kg"] > 0.15 > 0.05 > second["mass_kg"]
    # The centre of mass of a single-axle segment is at its axle, except for the servos' offset.
    assert second["com_x_m"] == pytest.approx(-0.04, abs=0.006)
    extensions = [longer_leads_kg(folded_car(design), f"segment{i}") for i in (1, 2)]
    assert extensions[1] > extensions[0]
    assert third["mass_kg"] - extensions[1] == pytest.approx(second["mass_kg"] - extensions[0], abs=0.001)


def test_a_hinge_is_as_stiff_as_a_clamped_strip_and_folds_as_far_as_designed() -> None:
    values = {"H.length": 10, "H.thickness": 0.25, "width": 100, "W.length": 80, "H.fold_down": 45, "H.fold_up": 6}
    design = compose("W_B_H_W", values)

    (hinge,) = body_json(design)["hinges"]

    # 4.5 GPa · 100 mm · (0.25 mm)³ / 12 / 10 mm.
    assert hinge["stiffness_n_m_rad"] == pytest.approx(4.5e9 * 0.1 * 0.25e-3**3 / 12 / 0.01)
    # Glued under the floors, its middle half a film and half a strip below that of the floor.
    assert hinge["z_m"] == pytest.approx(-0.025 - 0.000125)
    assert (hinge["min_rad"], hinge["max_rad"]) == pytest.approx((-math.pi / 4, math.radians(6)))
    # The loss factor's damping at its frequency: three hundredths of the stiffness over the angular rate.
    assert hinge["damping_n_m_s_rad"] == pytest.approx(0.03 * 0.0586 / (2 * math.pi * 5), rel=1e-3)


@pytest.mark.parametrize("type_string", ["B_W_W_W_W", "W_B", "W_B_H_W_H_W_H_W"])
def test_the_simulator_takes_the_body_and_drives_it(carsim_binary: Path, type_string: str) -> None:
    carsim = Carsim(carsim_binary)
    design = compose(type_string, {"W.length": 140})
    values = firmware_parameters(design)
    check_parameters(values, carsim.parameter_table())
    settings = {"speed_m_s": full_speed_m_s(design), "time_limit_s": 20.0, "parameters": values}

    (result,) = carsim.run(
        {"car": canonical_json(body_json(design))},
        {"flat": canonical_json(empty_scene(goal_x_m=1.0))},
        [RunRequest("car", "flat", canonical_json(settings), "the run", 0)],
    )

    assert result["outcome"] == "passed"
    # On the flat the car cannot be faster than its wheels turn unloaded.
    assert result["elapsed_time_s"] > 1 / full_speed_m_s(design)
