"""Variation: draws with the declared spreads, the same for every design, bodies as computed by hand."""

import json
import math
import statistics
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json, firmware_parameters, full_speed_m_s
from foldcar.car.design import compose
from foldcar.car.variation import draw, spread_named, workshop_spreads
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from study_car import empty_scene

WORKSHOP = spread_named("workshop", "here")


@pytest.fixture
def body() -> dict[str, Any]:
    return body_json(compose("W_B_W", {}))


def test_draws_are_spread_as_declared() -> None:
    samples = [draw(WORKSHOP, 42, k) for k in range(1500)]

    for name, spread in workshop_spreads().items():
        values = [v for s in samples for v in (s[name] if isinstance(s[name], list) else [s[name]])]
        assert max(abs(value) for value in values) <= 3 * spread.sd
        # Clamping at three standard deviations reduces the spread by 0.7 %; tolerance: five standard errors of a spread.
        tolerance = 0.007 + 5 / math.sqrt(2 * len(values))
        if spread.distribution == "normal":
            assert abs(statistics.fmean(values)) < 5 * spread.sd / math.sqrt(len(values)), name
            assert statistics.pstdev(values) == pytest.approx(spread.sd, rel=tolerance), name
        else:
            assert min(values) >= 0
            assert statistics.fmean(v * v for v in values) ** 0.5 == pytest.approx(spread.sd, rel=tolerance)
    phases = [phase for s in samples for phase in s["eccentricity_phase_rad"]]
    assert statistics.fmean(phases) == pytest.approx(math.pi, abs=0.1)
    assert statistics.pstdev(phases) == pytest.approx(2 * math.pi / math.sqrt(12), rel=0.05)


def test_wheels_and_quantities_vary_independently() -> None:
    samples = [draw(WORKSHOP, 1, k) for k in range(2000)]

    def column(name: str, wheel: int) -> list[float]:
        return [s[name][wheel] for s in samples]

    speed = column("servo_speed", 0)
    for other in (column("servo_speed", 1), column("servo_torque", 0), [s["mass"] for s in samples]):
        assert abs(statistics.correlation(speed, other)) < 0.1
    assert abs(statistics.correlation(speed[1:], speed[:-1])) < 0.1


def test_a_draw_depends_on_seed_and_sample_alone() -> None:
    assert draw(WORKSHOP, 42, 7) == draw(dict(reversed(WORKSHOP.items())), 42, 7)
    assert draw(WORKSHOP, 42, 7) != draw(WORKSHOP, 42, 8)
    assert draw(WORKSHOP, 42, 7) != draw(WORKSHOP, 43, 7)
    # Another spread of one quantity scales it and leaves the others alone.
    wider = draw(spread_named({"from": "workshop", "servo_speed": 0.1}, ""), 42, 7)
    nominal = draw(WORKSHOP, 42, 7)
    assert wider["servo_speed"] == pytest.approx([2 * value for value in nominal["servo_speed"]])
    assert {k: v for k, v in wider.items() if k != "servo_speed"} == {
        k: v for k, v in nominal.items() if k != "servo_speed"
    }


def test_carsim_changes_a_car_and_its_ground_as_computed_by_hand(carsim_binary: Path) -> None:
    """The run with a reality has the numbers of a run whose body and scene were changed by hand."""
    design = compose("W_B_W", {"width": 95.0})
    body, carsim = body_json(design), Carsim(carsim_binary)
    settings = canonical_json(
        {"speed_m_s": full_speed_m_s(design), "time_limit_s": 3, "parameters": firmware_parameters(design, body)}
    )
    scene = empty_scene(goal_x_m=1.0)
    half_round = {"kind": "half_round", "x_m": 0.5, "y_m": 0.0, "heading_rad": 0.0, "length_m": 0.02, "width_m": 1.0}
    scene["terrain"] = [
        {**half_round, "height_m": 0.008},
        {**half_round, "kind": "box", "x_m": 0.8, "height_m": 0.01},
        {**half_round, "kind": "patch", "x_m": 0.2, "friction": 0.3},
    ]
    wheels: dict[str, float] = {"servo_speed": 0.1, "servo_torque": -0.1, "deadband_us": 5.0, "eccentricity_m": 0.001,
                                "eccentricity_phase_rad": 2.0, "tyre_grip": 0.2, "wheel_radius": 0.05}  # fmt: skip
    reality: dict[str, Any] = {name: [value] * 8 for name, value in wheels.items()}
    reality |= {"neutral_us": [12.0, -12.0] * 4, "supply_v": -0.2, "mass": 0.1, "belly_grip": -0.5, "track_m": 0.004}
    reality |= {"com_x_m": 0.003, "com_y_m": -0.002, "com_z_m": 0.001, "supply_resistance_ohm": 0.2}
    reality |= {"friction": 0.9, "obstacle_height": 1.4, "start_x_m": -0.02, "start_y_m": 0.01, "start_heading_rad": 0.05}
    by_hand = json.loads(canonical_json(body))
    for segment in by_hand["segments"]:
        for key in ("mass_kg", "roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2"):
            segment[key] *= 1 + 0.1
        segment["grip"] *= 1 - 0.5
        for key in ("com_x_m", "com_y_m", "com_z_m"):
            segment[key] += reality[key]
    for wheel in by_hand["wheels"]:
        wheel["radius_m"] *= 1 + 0.05
        wheel["grip"] *= 1 + 0.2
        wheel |= {"eccentricity_m": 0.001, "eccentricity_phase_rad": 2.0}
        servo = wheel["servo"]
        servo["no_load_speed_rad_s"] *= 1 + 0.1
        servo["stall_torque_n_m"] *= 1 - 0.1
        servo["deadband_us"] += 5
        servo["neutral_us"] += reality["neutral_us"][wheel["channel"]]
    by_hand["track_m"] += 0.004
    by_hand["supply_v"] -= 0.2
    by_hand["supply_resistance_ohm"] = 0.2
    ground = json.loads(canonical_json(scene))
    ground["friction"] *= 0.9
    # An arc is at most half as high as long.
    ground["terrain"][0]["height_m"] = 0.01
    ground["terrain"][1]["height_m"] *= 1.4
    ground["terrain"][2]["friction"] *= 0.9
    for key, shift in (("x_m", -0.02), ("y_m", 0.01), ("heading_rad", 0.05)):
        ground["start"][key] += shift
    bodies = {"design": canonical_json(body), "by hand": canonical_json(by_hand)}
    scenes = {"nominal": canonical_json(scene), "by hand": canonical_json(ground)}

    nominal, real, changed = carsim.run(
        bodies,
        scenes,
        [
            RunRequest("design", "nominal", settings, "nominal", 0),
            RunRequest("design", "nominal", settings, "reality", 0, canonical_json(reality)),
            RunRequest("by hand", "by hand", settings, "by hand", 0),
        ],
    )

    assert real == changed != nominal


def test_without_spread_nothing_changes(carsim_binary: Path) -> None:
    design = compose("W_B_W", {"width": 95.0})
    body, still = body_json(design), draw({name: 0.0 for name in workshop_spreads()}, 42, 0)
    settings = canonical_json({"speed_m_s": 0.5, "time_limit_s": 0.5, "parameters": firmware_parameters(design, body)})
    requests = [RunRequest("car", "flat", settings, "run", 0, canonical_json(reality)) for reality in ({}, still)]

    scenes = {"flat": canonical_json(empty_scene(goal_x_m=1.0))}
    nominal, unchanged = Carsim(carsim_binary).run({"car": canonical_json(body)}, scenes, requests)

    assert nominal == unchanged


@pytest.mark.parametrize(
    ("spread", "message"),
    [
        ("garage", "here: unknown variation 'garage'; known: \"workshop\""),
        ({}, 'here: lacks "from"; write {"from": "workshop", …}'),
        ({"from": "workshop", "luck": 1}, 'here: unknown spread "luck"; known: servo_speed, servo_torque'),
        ({"from": "workshop", "supply_v": float("nan")}, "here.supply_v: nan is outside 0 to 2"),
        ({"from": "workshop", "mass": 0.6}, "here.mass: 0.6 is outside 0 to 0.5 (relative, one sd)"),
        ({"from": "workshop", "mass": "1"}, "here.mass: '1' is not a number"),
    ],
)
def test_unknown_spreads_are_refused(spread: Any, message: str) -> None:
    with pytest.raises(FoldcarError) as caught:
        spread_named(spread, "here")

    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("type_string", ["W_B_W", "W_B_H_W_H_W"])
def test_the_simulator_takes_every_nearby_car(carsim_binary: Path, type_string: str) -> None:
    # The largest spreads that a listing may ask for.
    spread = spread_named({"from": "workshop"} | {n: s.largest_sd for n, s in workshop_spreads().items()}, "here")
    design = compose(type_string, {"W.length": 140})
    nominal = body_json(design)
    settings = canonical_json(
        {
            "speed_m_s": full_speed_m_s(design),
            "time_limit_s": 0.5,
            "parameters": firmware_parameters(design, nominal),
        }
    )
    flat = canonical_json(empty_scene(goal_x_m=1.0))
    requests = [RunRequest("car", "flat", settings, f"car {k}", 0, canonical_json(draw(spread, 5, k))) for k in range(40)]
    results = Carsim(carsim_binary).run({"car": canonical_json(nominal)}, {"flat": flat}, requests)

    assert len({result["distance_to_target_m"] for result in results}) == 40
