"""Variation: draws with the declared spreads, the same for every design, bodies as computed by hand."""

import math
import statistics
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json, firmware_parameters, full_speed_m_s
from foldcar.car.design import compose
from foldcar.car.variation import draw, spread_named, vary_body, workshop
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim, CarsimLimits
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from study_car import empty_scene

WORKSHOP = spread_named("workshop", "here")


@pytest.fixture
def body() -> dict[str, Any]:
    return body_json(compose("W_B_W", {}))


def test_draws_are_spread_as_declared() -> None:
    samples = [draw(WORKSHOP, 42, k) for k in range(1500)]

    for name, spread in workshop().items():
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


def test_a_body_is_changed_as_computed_by_hand(body: dict[str, Any], carsim_limits: CarsimLimits) -> None:
    of_wheels = {"servo_speed": 0.1, "servo_torque": -0.1, "deadband_us": 5.0, "eccentricity_m": 0.001,
                 "eccentricity_phase_rad": 2.0, "tyre_grip": 0.2, "wheel_radius": 0.05}  # fmt: skip
    variation: dict[str, Any] = {name: [value] * 8 for name, value in of_wheels.items()}
    variation |= {"neutral_us": [12.0, -12.0] * 4, "supply_v": -0.2, "mass": 0.1, "belly_grip": -0.5}
    variation |= {"com_x_m": 0.003, "com_y_m": -0.002, "com_z_m": 0.001}
    nominal, wheel = body["segments"][0], body["wheels"][1]
    before = canonical_json(body)

    varied = vary_body(body, variation, carsim_limits.numbers)

    assert canonical_json(body) == before
    # The same shape of 1.1 times the density, its centre moved; what does not vary stays.
    same_shape = ("mass_kg", "roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2")
    expected = {**nominal, **{key: 1.1 * nominal[key] for key in same_shape}, "grip": 0.5 * 0.35 / 0.6}
    expected |= {key: nominal[key] + variation[key] for key in ("com_x_m", "com_y_m", "com_z_m")}
    assert varied["segments"] == [pytest.approx(expected)]
    changed = {"radius_m": 0.063, "grip": 1.2, "eccentricity_m": 0.001, "eccentricity_phase_rad": 2.0}
    servo = {"neutral_us": 1488, "deadband_us": 50, "rated_v": 5.2}
    servo |= {key: by * wheel["servo"][key] for key, by in (("no_load_speed_rad_s", 1.1), ("stall_torque_n_m", 0.9))}
    second, own = varied["wheels"][1], wheel.pop("servo")
    assert second.pop("servo") == pytest.approx({**own, **servo})
    assert second == pytest.approx({**wheel, **changed})
    assert varied["supply_v"] == pytest.approx(5.0)


def test_without_spread_nothing_changes(body: dict[str, Any], carsim_limits: CarsimLimits) -> None:
    still = draw({name: 0.0 for name in workshop()}, 42, 0)

    assert vary_body(body, still, carsim_limits.numbers) == body
    assert vary_body(body, {}, carsim_limits.numbers) == body


@pytest.mark.parametrize(
    ("spread", "message"),
    [
        ("garage", "here: unknown variation 'garage'; known: \"workshop\""),
        ({}, 'here: unknown variation None; known: "workshop"'),
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
def test_the_simulator_takes_every_nearby_car(carsim_binary: Path, carsim_limits: CarsimLimits, type_string: str) -> None:
    # The largest spreads that a listing may ask for.
    spread = spread_named({"from": "workshop"} | {n: s.largest_sd for n, s in workshop().items()}, "here")
    design = compose(type_string, {"W.length": 140})
    nominal = body_json(design)
    settings = canonical_json(
        {
            "speed_m_s": full_speed_m_s(design),
            "time_limit_s": 0.5,
            "parameters": firmware_parameters(design, nominal),
        }
    )
    bodies = {str(k): canonical_json(vary_body(nominal, draw(spread, 5, k), carsim_limits.numbers)) for k in range(40)}

    flat = canonical_json(empty_scene(goal_x_m=1.0))
    requests = [RunRequest(name, "flat", settings, name, 0) for name in bodies]
    results = Carsim(carsim_binary).run(bodies, {"flat": flat}, requests)

    assert len({result["distance_to_target_m"] for result in results}) == 40
