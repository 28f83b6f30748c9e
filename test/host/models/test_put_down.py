"""Exported cars stand on the ground at their start: MuJoCo sees no contact there, and one a little lower."""

import math
import random
from typing import Any

import mujoco
import pytest

from foldcar.models.ground import FALL_M, HeightGrid, smooth_ground, start_height_m
from foldcar.models.mjcf import mjcf
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ELLIPSOID
from foldcar.simulation.heights import carsim_heights
from study_car import car_body, empty_scene, hinged_body

BODIES = {"rigid": car_body(), "hinged": hinged_body()}


def random_scene(native: Carsim, seed: int) -> tuple[dict[str, Any], HeightGrid | None]:
    """A start on, beside and across blocks, half of the time on hills, at any heading."""
    draw = random.Random(seed)
    kinds = ("box", "ramp", "half_round")
    blocks = [
        {
            "kind": draw.choice(kinds),
            "x_m": draw.uniform(-0.2, 0.2),
            "y_m": draw.uniform(-0.2, 0.2),
            "heading_rad": draw.choice([0.0, math.pi / 2, draw.uniform(-math.pi, math.pi)]),
            "length_m": draw.uniform(0.02, 0.4),
            "width_m": draw.uniform(0.02, 0.6),
        }
        for _ in range(draw.randint(1, 3))
    ]
    for block in blocks:
        # A half-round is no more than half a cylinder.
        block["height_m"] = draw.uniform(0.005, min(0.08, block["length_m"] / 2))
    scene = empty_scene(blocks)
    scene["start"] = {"x_m": 0.01, "y_m": -0.02, "heading_rad": draw.uniform(-math.pi, math.pi)}
    if seed % 2:
        return scene, None
    scene["course"] = {"x_min_m": -0.5, "x_max_m": 0.5, "y_min_m": -0.5, "y_max_m": 0.5}
    rough = {"kind": "rough", "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "length_m": 1.0, "width_m": 1.0}
    rough |= {"height_sd_m": 0.005, "correlation_m": draw.uniform(0.03, 0.2), "seed": seed}
    scene["terrain"].append(rough)
    return scene, smooth_ground(scene, carsim_heights(native))


def contacts(model: Any, height_m: float) -> int:
    """How many there are at the start with the car's frame at that height."""
    data = mujoco.MjData(model)
    data.qpos[2] = height_m
    mujoco.mj_forward(model, data)
    return int(data.ncon)


@pytest.mark.parametrize("name", BODIES)
def test_no_car_starts_inside_the_ground_nor_far_above_it(native: Carsim, name: str) -> None:
    for seed in range(12):
        scene, grid = random_scene(native, seed)
        model = mujoco.MjModel.from_xml_string(mjcf(native, BODIES[name], scene))
        # The two ways to split a cell of the grid into triangles differ by a few tenths of a millimetre.
        small_m = 1e-4 if grid is None else 1e-3
        for height_m in (start_height_m(BODIES[name], scene, grid), model.qpos0[2]):
            assert contacts(model, height_m) == 0, seed
            assert contacts(model, height_m - FALL_M - small_m) > 0, seed


def test_tyres_that_are_ellipsoids_stand_no_lower(native: Carsim) -> None:
    ellipsoid = Carsim(engine=ELLIPSOID)
    for seed in range(1, 12, 2):
        scene, _ = random_scene(native, seed)
        model = mujoco.MjModel.from_xml_string(mjcf(ellipsoid, BODIES["rigid"], scene))
        assert contacts(model, start_height_m(BODIES["rigid"], scene, None)) == 0, seed


def test_heights_are_those_of_the_geometry() -> None:
    body = car_body(eccentricity_m=0.0)
    radius = body["wheels"][0]["radius_m"]
    step = {"kind": "box", "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.4, "length_m": 1.0, "width_m": 1.0}
    # Narrower than the belly, which the wheels are outside of.
    ridge = {**step, "kind": "half_round", "heading_rad": 0.0, "length_m": 0.2, "width_m": 0.05, "height_m": 0.08}
    belly = body["segments"][0]["center_z_m"] - body["segments"][0]["height_m"] / 2

    assert start_height_m(body, empty_scene(), None) == pytest.approx(radius + FALL_M, abs=1.1e-5)
    on_step = start_height_m(body, empty_scene([{**step, "height_m": 0.05}]), None)
    assert on_step == pytest.approx(radius + 0.05 + FALL_M, abs=1.1e-5)
    on_ridge = start_height_m(body, empty_scene([ridge]), None)
    assert on_ridge == pytest.approx(max(radius, 0.08 - belly) + FALL_M, abs=1.1e-5)
