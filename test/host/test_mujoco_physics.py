"""MuJoCo's car against closed forms, and both engines against the same closed forms where both can run them."""

import itertools
import json
import math
from typing import Any

import numpy
import pytest

from foldcar.car.firmware_parameters import CHANNELS
from foldcar.crosscheck.mujoco_car import EngineOptions, MujocoCar
from foldcar.crosscheck.mujoco_run import run_mujoco
from foldcar.crosscheck.mujoco_step import SteppedMujoco
from foldcar.models.ground import height_grid
from foldcar.models.servo import drive_fraction
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.carsim_limits import CarsimLimits
from foldcar.simulation.pulses import PulseTrain, ask_pulses
from foldcar.simulation.runner import RunRequest
from study_car import car_body, empty_scene

G_M_S2 = 9.81


def steady(body: dict[str, Any], fraction: float) -> tuple[float, ...]:
    """Pulses that command that fraction of full speed at every wheel."""
    widths = [0.0] * CHANNELS
    for wheel in body["wheels"]:
        servo = wheel["servo"]
        span = servo["saturation_us"] - servo["deadband_us"]
        offset = math.copysign(servo["deadband_us"], fraction) + fraction * span
        widths[wheel["channel"]] = servo["neutral_us"] + servo["direction"] * offset
    return tuple(widths)


def rolling_mass_kg(body: dict[str, Any]) -> float:
    """The effective mass (kg) of the rolling car: its mass and the rotational inertia of wheels and rotors."""
    wheels = body["wheels"]
    mass = sum(s["mass_kg"] for s in body["segments"]) + sum(w["mass_kg"] for w in wheels)
    spins = (0.5 * w["mass_kg"] + w["servo"]["rotor_inertia_kg_m2"] / w["radius_m"] ** 2 for w in wheels)
    return float(mass + sum(spins))


def expected_way_m(body: dict[str, Any], pulses: PulseTrain, t_s: float) -> float:
    """Distance (m) of a car that rolls without slip: m dv/dt = Σ τ (u − v/(r ω0)) / r, integrated in small steps."""
    mass, scale = rolling_mass_kg(body), body["supply_v"] / body["wheels"][0]["servo"]["rated_v"]
    way = speed = 0.0
    step_s = 1e-4
    for i in range(round(t_s / step_s)):
        force = 0.0
        for wheel in body["wheels"]:
            servo, radius = wheel["servo"], wheel["radius_m"]
            fraction = drive_fraction(servo, pulses.at(i * step_s)[wheel["channel"]])
            if fraction is not None:
                stall, no_load = servo["stall_torque_n_m"] * scale, servo["no_load_speed_rad_s"] * scale
                force += max(-1.0, min(1.0, fraction - speed / radius / no_load)) * stall / radius
        speed += force / mass * step_s
        way += speed * step_s
    return way


def test_a_car_in_the_air_falls_freely() -> None:
    car = MujocoCar(car_body(), empty_scene())
    car.data.qpos[2] = 5.0
    car.advance(0.5)

    assert car.state().z_m == pytest.approx(5.0 - 0.5 * G_M_S2 * 0.5**2, abs=0.5 * 0.5 * G_M_S2 * 1e-3 * 1.01)
    assert car.state().pitch_rad == pytest.approx(0.0, abs=1e-9)


def test_a_rolling_car_reaches_the_no_load_speed() -> None:
    body = car_body()
    car = MujocoCar(body, empty_scene())
    car.drive(steady(body, 0.5))
    car.advance(2.0)
    before = car.state().x_m
    car.advance(0.5)

    wheel = body["wheels"][0]
    no_load = wheel["servo"]["no_load_speed_rad_s"] * body["supply_v"] / wheel["servo"]["rated_v"]
    assert (car.state().x_m - before) / 0.5 == pytest.approx(0.5 * no_load * wheel["radius_m"], rel=0.005)


def test_a_rolling_car_accelerates_as_the_torque_line_says(carsim_binary: Any, carsim_limits: CarsimLimits) -> None:
    body = car_body(supply_v=0.5)  # weak enough not to slip nor to lift its nose
    (pulses,) = ask_pulses(Carsim(carsim_binary), [{"speed_m_s": 0.6, "time_limit_s": 1.5}])

    result = run_mujoco(body, empty_scene(), pulses, carsim_limits.trial, options=EngineOptions(path_interval_s=0.1))

    assert result["outcome"] == "timeout"
    for t_s, x_m, *_ in result["path"][3:]:
        assert x_m == pytest.approx(expected_way_m(body, pulses, t_s), rel=0.01)


def test_both_engines_come_to_the_no_load_speed_and_end_alike(carsim_binary: Any, carsim_limits: CarsimLimits) -> None:
    body, scene = car_body(), empty_scene(goal_x_m=1.5)
    settings = {"speed_m_s": 0.691, "time_limit_s": 10.0}
    carsim = Carsim(carsim_binary)
    (pulses,) = ask_pulses(carsim, [settings])

    ours = run_mujoco(body, scene, pulses, carsim_limits.trial, options=EngineOptions(path_interval_s=0.1))
    (theirs,) = carsim.run(
        {"b": json.dumps(body)},
        {"s": json.dumps(scene)},
        [RunRequest("b", "s", json.dumps({**settings, "path_interval_s": 0.1}), "run", 0)],
    )

    wheel = body["wheels"][0]
    full_m_s = min(0.691, wheel["servo"]["no_load_speed_rad_s"] * wheel["radius_m"])
    for result in (ours, theirs):
        assert result["outcome"] == "passed"
        (t0, x0), (t1, x1) = (result["path"][i][:2] for i in (-8, -2))
        assert (x1 - x0) / (t1 - t0) == pytest.approx(full_m_s, rel=0.02)
    assert ours["elapsed_time_s"] == pytest.approx(theirs["elapsed_time_s"], rel=0.03)


def test_a_stalled_servo_gives_its_stall_torque_at_the_supply_voltage() -> None:
    body = car_body(supply_v=2.6)
    wall = {"kind": "box", "x_m": 0.2 + 0.07 + 0.06, "y_m": 0.0, "heading_rad": 0.0}
    wall |= {"length_m": 0.4, "width_m": 2.0, "height_m": 0.5}
    car = MujocoCar(body, empty_scene(terrain=[wall], friction=0.0, x_m=-0.01))
    for wheel in range(4):  # a bar through the spokes
        car.model.dof_damping[car.model.jnt_dofadr[1 + wheel]] = 1e3
    car.drive(steady(body, 1.0))
    car.advance(0.1)

    stall = body["wheels"][0]["servo"]["stall_torque_n_m"] * 2.6 / body["wheels"][0]["servo"]["rated_v"]
    assert car.data.actuator_force == pytest.approx(numpy.full(4, stall), rel=1e-3)
    servo = body["wheels"][0]["servo"]
    rise_a = servo["stall_current_a"] - servo["no_load_current_a"]
    assert car.power_w() == pytest.approx(
        4 * 2.6 * (servo["no_load_current_a"] + rise_a * 2.6 / servo["rated_v"]), rel=1e-3
    )


def test_a_car_with_blocked_wheels_slides_to_a_halt_by_friction() -> None:
    body = car_body(rotor_inertia_kg_m2=1e3)
    friction, speed = 0.4, 1.0
    car = MujocoCar(body, empty_scene(friction=friction))
    car.advance(0.3)
    start = car.state().x_m
    car.data.qvel[0] = speed
    car.advance(0.6)

    assert car.state().x_m - start == pytest.approx(speed**2 / (2 * friction * G_M_S2), rel=0.03)


@pytest.mark.parametrize(("slope", "climbs"), [(0.35, True), (0.45, False)])
def test_a_ramp_is_climbed_if_it_is_less_steep_than_the_friction(slope: float, climbs: bool) -> None:
    body = car_body(com_z_m=-0.02, stall_torque_n_m=0.5)
    ramp = {"kind": "ramp", "x_m": 1.0, "y_m": 0.0, "heading_rad": 0.0}
    ramp |= {"length_m": 2.0, "width_m": 1.0, "height_m": 2.0 * slope}
    car = MujocoCar(body, empty_scene(terrain=[ramp], friction=0.4, x_m=0.6))
    for _ in range(150):
        car.drive(steady(body, 0.2))
        car.advance(0.02)

    assert (car.state().x_m > 0.7) is climbs


def test_a_patch_sets_the_friction_of_what_stands_on_it() -> None:
    body = car_body(rotor_inertia_kg_m2=1e3)
    patch = {"kind": "patch", "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.3, "length_m": 3.0, "width_m": 2.0}
    car = MujocoCar(body, empty_scene(terrain=[{**patch, "friction": 0.1}], friction=0.8))
    car.advance(0.3)
    car.data.qvel[0] = 0.5
    car.drive((0.0,) * 8)
    car.advance(1.0)

    assert car.state().x_m == pytest.approx(0.5**2 / (2 * 0.1 * G_M_S2), rel=0.05)


def test_the_ground_has_the_heights_of_its_pieces() -> None:
    pose = {"y_m": 0.1, "heading_rad": 0.5}
    ramp = {"kind": "ramp", "x_m": 0.0, **pose, "length_m": 0.4, "width_m": 0.3, "height_m": 0.05}
    arc = {"kind": "half_round", "x_m": 1.0, **pose, "length_m": 0.2, "width_m": 0.3, "height_m": 0.04}
    car = MujocoCar(car_body(), empty_scene(terrain=[ramp, arc], x_m=-3.0))
    radius = (0.1**2 + 0.04**2) / (2 * 0.04)

    for along in (-0.15, 0.0, 0.1, 0.19):
        assert ray_height_m(car, ramp, along, 0.1) == pytest.approx(0.05 * (along + 0.2) / 0.4, abs=1e-6)
    for along in (-0.09, 0.0, 0.05):
        expected = math.sqrt(radius**2 - along**2) + 0.04 - radius
        assert ray_height_m(car, arc, along, -0.14) == pytest.approx(expected, abs=1e-6)
    assert ray_height_m(car, arc, 0.0, 0.16) == pytest.approx(0.0, abs=1e-9)


def test_smooth_ground_stands_where_its_heights_say_and_carries_wheels() -> None:
    def heights(x: Any, y: Any) -> Any:
        # A hill and a hollow at different positions, so that mirrored heights would fail.
        return 0.03 * numpy.exp(-((x - 0.4) ** 2 + (y - 0.1) ** 2) / 0.02) - 0.02 * numpy.exp(
            -((x + 0.3) ** 2 + (y + 0.2) ** 2) / 0.01
        )

    scene = empty_scene()
    pieces = [{"kind": "rough", "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "length_m": 2.4, "width_m": 1.6}]
    grid = height_grid(pieces, scene["course"], heights)
    car = MujocoCar(car_body(), scene, grid)

    for x, y in ((0.4, 0.1), (-0.3, -0.2), (0.4, -0.1), (0.33, 0.17), (-0.25, -0.12), (1.1, 0.7), (1.5, 0.0)):
        expected = float(heights(numpy.array([x]), numpy.array([y]))[0])
        assert ray_height_m(car, {"x_m": x, "y_m": y, "heading_rad": 0.0}, 0, 0) == pytest.approx(
            expected, abs=2e-4
        )
    car.data.qpos[:3] = [1.5, 0.0, 0.061]
    car.advance(0.3)
    assert car.state().z_m == pytest.approx(0.06, abs=2e-4)
    car.data.qpos[:3] = [-0.9, -0.6, 0.061]
    car.advance(0.3)
    assert car.state().z_m == pytest.approx(0.06, abs=3e-4)


def ray_height_m(car: MujocoCar, piece: dict[str, Any], along: float, across: float) -> float:
    """The ground's height under a point of the piece's own axes, by a ray from above."""
    import mujoco

    cos, sin = math.cos(piece["heading_rad"]), math.sin(piece["heading_rad"])
    x, y = piece["x_m"] + along * cos - across * sin, piece["y_m"] + along * sin + across * cos
    geom = numpy.zeros(1, dtype=numpy.int32)
    origin, down = numpy.array([x, y, 2.0]), numpy.array([0.0, 0.0, -1.0])
    return 2.0 - float(mujoco.mj_ray(car.model, car.data, origin, down, None, True, -1, geom))


def test_a_trial_advanced_in_steps_is_the_trial_run_at_once(carsim_binary: Any, carsim_limits: CarsimLimits) -> None:
    body, scene = car_body(), empty_scene(goal_x_m=0.6)
    settings = {"speed_m_s": 0.6, "time_limit_s": 10.0}
    (pulses,) = ask_pulses(Carsim(carsim_binary), [settings])
    whole = run_mujoco(body, scene, pulses, carsim_limits.trial)

    stepped = SteppedMujoco(carsim_binary, EngineOptions())
    advanced = stepped.start(json.dumps(body), json.dumps(scene), json.dumps(settings))
    rows = [advanced.state]
    while advanced.result is None:
        advanced = stepped.advance(rows[-1].t_s + 0.11)
        rows += stepped.rows()

    assert advanced.result == whole
    assert whole["consumed_energy_j"] > 0
    for before, after in itertools.pairwise(rows[10:]):
        # The mean speed between two ticks.
        mean = (before.speed_m_s + after.speed_m_s) / 2
        assert after.x_m - before.x_m == pytest.approx(mean * (after.t_s - before.t_s), abs=5e-4)
    assert stepped.end(0)["outcome"] == "terminated"
