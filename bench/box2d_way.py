"""The speed of Box2D from Python, as its users would write it: a car from the side, stepped in a loop.

Input: a store of a sweep over boxes, the rules of a trial. Output: simulated seconds a second of processor time, and
how many runs pass.

The package is the one that Gymnasium installs. Each axle's wheels are one circle on the chassis, a polygon, driven
along the servo's torque-speed line at full drive; each box is two polygons, for wheels and chassis, as long as it lies
under them on the line of the start's heading. Runs end as trials do. Left out are roll, yaw, a car's two sides (an
obstacle under one wheel lifts both) and the firmware. Worlds are made before the time is taken.
"""

import json
import math
import sqlite3
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely
from Box2D import b2Body, b2EdgeShape, b2FixtureDef, b2MassData, b2PolygonShape, b2RevoluteJoint, b2World
from Box2D import b2CircleShape as Circle
from shapely import affinity

from foldcar.models.put_down import start_height_m
from foldcar.models.wheel_geometry import servo_limits, wheel_inertia_kg_m2
from foldcar.simulation.carsim_limits import TrialRules

# Box2D lets bodies overlap by 0.005 units, which are to be small against the car.
UNITS_PER_M = 20.0
GRAVITY_M_S2 = 9.81
FAR_M = 100.0
# As Box2D's manual suggests.
VELOCITY_ITERATIONS, POSITION_ITERATIONS = 8, 3
# Bits of what collides.
WHEEL, CHASSIS, GROUND = 1, 2, 4
# The largest difference from the speed at which the servos have no torque.
SPEED_ERROR = 0.015


@dataclass(frozen=True)
class Axle:
    """A joint with its motor: stall torque (N m) and no-load speed (rad/s) of its servos."""

    joint: b2RevoluteJoint
    stall_n_m: float
    no_load_rad_s: float

    def drive(self) -> None:
        """Sets the torque of full drive; forwards is clockwise."""
        share = min(1.0, abs(1.0 + self.joint.speed / self.no_load_rad_s))
        self.joint.maxMotorTorque = share * self.stall_n_m * UNITS_PER_M**2


class Car:
    """A rigid car in a world of its own, which starts at x = 0 on the scene's ground."""

    def __init__(self, body: Mapping[str, Any], scene: Mapping[str, Any]) -> None:
        assert len(body["segments"]) == 1, "a rigid car"
        self.world = b2World(gravity=(0, -GRAVITY_M_S2 * UNITS_PER_M), doSleep=False)
        self._add_ground(body, scene)
        height_m = start_height_m(body, scene, None)
        segment = body["segments"][0]
        self.chassis: b2Body = self.world.CreateDynamicBody(position=(0, height_m * UNITS_PER_M))
        outline = _rectangle(
            segment["x_m"] - segment["length_m"] / 2,
            segment["x_m"] + segment["length_m"] / 2,
            segment["center_z_m"] - segment["height_m"] / 2,
            segment["center_z_m"] + segment["height_m"] / 2,
        )
        self.chassis.CreateFixture(_part(outline, CHASSIS, scene["friction"], segment["grip"]))
        x_m, z_m, mass_kg = segment["com_x_m"], segment["com_z_m"], segment["mass_kg"]
        inertia_kg_m2 = segment["pitch_inertia_kg_m2"] + mass_kg * (x_m**2 + z_m**2)
        self.chassis.massData = b2MassData(
            mass=mass_kg, center=(x_m * UNITS_PER_M, z_m * UNITS_PER_M), I=inertia_kg_m2 * UNITS_PER_M**2
        )
        places_m = sorted({wheel["x_m"] for wheel in body["wheels"]})
        self._axles = [self._add_axle(body, scene, x_m, height_m) for x_m in places_m]

    def step(self, step_s: float) -> None:
        """Advances by one step at full drive."""
        for axle in self._axles:
            axle.drive()
        self.world.Step(step_s, VELOCITY_ITERATIONS, POSITION_ITERATIONS)

    def _add_ground(self, body: Mapping[str, Any], scene: Mapping[str, Any]) -> None:
        ground = self.world.CreateStaticBody()
        floor = b2EdgeShape(vertices=[(-FAR_M * UNITS_PER_M, 0), (FAR_M * UNITS_PER_M, 0)])
        ground.CreateFixture(_block(floor, WHEEL | CHASSIS, scene["friction"]))
        half_track_m, half_tyre_m = body["track_m"] / 2, body["wheels"][0]["width_m"] / 2
        half_width_m = body["segments"][0]["width_m"] / 2
        sides = [(side * half_track_m - half_tyre_m, side * half_track_m + half_tyre_m) for side in (-1, 1)]
        for box in scene["terrain"]:
            assert box["kind"] == "box", "a scene of boxes"
            area = _seen_from_start(box, scene["start"])
            for strips, bit in ((sides, WHEEL), ([(-half_width_m, half_width_m)], CHASSIS)):
                met = area.intersection(shapely.union_all([shapely.box(-FAR_M, a, FAR_M, b) for a, b in strips]))
                if not met.is_empty:
                    low_m, _, high_m, _ = met.bounds
                    shape = _rectangle(low_m, high_m, 0, box["height_m"])
                    ground.CreateFixture(_block(shape, bit, scene["friction"]))

    def _add_axle(self, body: Mapping[str, Any], scene: Mapping[str, Any], x_m: float, height_m: float) -> Axle:
        wheels = [wheel for wheel in body["wheels"] if wheel["x_m"] == x_m]
        at = (x_m * UNITS_PER_M, height_m * UNITS_PER_M)
        disc = self.world.CreateDynamicBody(position=at)
        circle = Circle(radius=wheels[0]["radius_m"] * UNITS_PER_M)
        disc.CreateFixture(_part(circle, WHEEL, scene["friction"], wheels[0]["grip"]))
        inertia_kg_m2 = sum(wheel_inertia_kg_m2(one)[0] + one["servo"]["rotor_inertia_kg_m2"] for one in wheels)
        disc.massData = b2MassData(mass=sum(one["mass_kg"] for one in wheels), I=inertia_kg_m2 * UNITS_PER_M**2)
        stall_n_m, no_load_rad_s = servo_limits(body, wheels[0])
        joint = self.world.CreateRevoluteJoint(
            bodyA=self.chassis, bodyB=disc, anchor=at, enableMotor=True, motorSpeed=-no_load_rad_s
        )
        return Axle(joint, len(wheels) * stall_n_m, no_load_rad_s)


def python_factor(store: Path, rules: TrialRules) -> tuple[float, int]:
    """The speed over all runs of the store, and how many passed.

    The program exits unless every car also passes its scene without boxes, at the speed where the servos' torque ends.
    """
    connection = sqlite3.connect(f"{store.as_uri()}?mode=ro", uri=True)
    runs = connection.execute(
        "SELECT b.json, s.json, t.json FROM run r JOIN body b ON b.id = r.body_id "
        "JOIN scene s ON s.id = r.scene_id JOIN settings t ON t.id = r.settings_id"
    ).fetchall()
    connection.close()
    simulated_s = processor_s = 0.0
    passed = 0
    for texts in runs:
        body, scene, settings = map(json.loads, texts)
        _check_level(body, {**scene, "terrain": []}, settings["time_limit_s"], rules)
        car = Car(body, scene)
        start_s = time.process_time()
        outcome, elapsed_s = trial(car, scene, settings["time_limit_s"], rules)
        processor_s += time.process_time() - start_s
        simulated_s += elapsed_s + rules.settling_s
        passed += outcome == "passed"
    return simulated_s / processor_s, passed


def trial(car: Car, scene: Mapping[str, Any], limit_s: float, rules: TrialRules) -> tuple[str, float]:
    """How a trial ends, and when (s): the rules of sim2d/lib/trial/ending.cpp, for a car that keeps its heading."""
    start, course, goal = scene["start"], scene["course"], scene["goal"]
    assert goal["kind"] == "line"
    ahead_x, ahead_y = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    goal_x, goal_y = math.cos(goal["heading_rad"]), math.sin(goal["heading_rad"])
    for _ in range(round(rules.settling_s / rules.step_s)):
        car.world.Step(rules.step_s, VELOCITY_ITERATIONS, POSITION_ITERATIONS)
    moved_m = left_m = car.chassis.position.x / UNITS_PER_M
    moved_at_s = left_at_s = 0.0
    steps = 0
    while True:
        car.step(rules.step_s)
        steps += 1
        time_s = steps * rules.step_s
        way_m = car.chassis.position.x / UNITS_PER_M
        x_m, y_m = start["x_m"] + way_m * ahead_x, start["y_m"] + way_m * ahead_y
        if math.cos(car.chassis.angle) < rules.tipped_up:
            return "tipped", time_s
        if (goal["x_m"] - x_m) * goal_x + (goal["y_m"] - y_m) * goal_y <= 0:
            return "passed", time_s
        if not (course["x_min_m"] <= x_m <= course["x_max_m"] and course["y_min_m"] <= y_m <= course["y_max_m"]):
            return "off_course", time_s
        if abs(way_m - left_m) > rules.held_distance_m:
            left_m, left_at_s = way_m, time_s
        if abs(way_m - moved_m) > rules.stuck_distance_m:
            moved_m, moved_at_s = way_m, time_s
        if time_s - left_at_s >= rules.held_time_s or time_s - moved_at_s >= rules.stuck_time_s:
            return "stuck", time_s
        if time_s >= limit_s:
            return "timeout", time_s


def _check_level(body: Mapping[str, Any], scene: Mapping[str, Any], limit_s: float, rules: TrialRules) -> None:
    car = Car(body, scene)
    outcome, _ = trial(car, scene, limit_s, rules)
    speed_m_s = car.chassis.linearVelocity.x / UNITS_PER_M
    wheel = body["wheels"][0]
    expected_m_s = servo_limits(body, wheel)[1] * wheel["radius_m"]
    if outcome != "passed" or abs(speed_m_s / expected_m_s - 1) > SPEED_ERROR:
        sys.exit(f"Box2D from Python: {outcome} on level ground at {speed_m_s:.3f} m/s, not {expected_m_s:.3f} m/s")


def _seen_from_start(box: Mapping[str, Any], start: Mapping[str, Any]) -> shapely.Polygon:
    """The box from above (m), x along the start's heading from the car's origin."""
    half_length_m, half_width_m = box["length_m"] / 2, box["width_m"] / 2
    area = shapely.box(-half_length_m, -half_width_m, half_length_m, half_width_m)
    area = affinity.rotate(area, box["heading_rad"], origin=(0, 0), use_radians=True)
    area = affinity.translate(area, box["x_m"] - start["x_m"], box["y_m"] - start["y_m"])
    return affinity.rotate(area, -start["heading_rad"], origin=(0, 0), use_radians=True)


def _rectangle(low_x_m: float, high_x_m: float, low_z_m: float, high_z_m: float) -> b2PolygonShape:
    corners = [(low_x_m, low_z_m), (high_x_m, low_z_m), (high_x_m, high_z_m), (low_x_m, high_z_m)]
    return b2PolygonShape(vertices=[(x_m * UNITS_PER_M, z_m * UNITS_PER_M) for x_m, z_m in corners])


def _part(shape: Any, bit: int, friction: float, grip: float) -> b2FixtureDef:
    # Box2D takes the geometric mean with the ground's.
    return b2FixtureDef(shape=shape, friction=friction * grip**2, categoryBits=bit, maskBits=GROUND)


def _block(shape: Any, bits: int, friction: float) -> b2FixtureDef:
    return b2FixtureDef(shape=shape, friction=friction, categoryBits=GROUND, maskBits=bits)
