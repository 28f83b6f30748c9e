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

WORKSHOP = spread_named("workshop", "here")
FLAT = (
    '{"friction":0.6,"terrain":[],"start":{"x_m":0,"y_m":0,"heading_rad":0},'
    '"goal":{"kind":"line","x_m":1,"y_m":0,"heading_rad":0},'
    '"course":{"x_min_m":-1,"x_max_m":2,"y_min_m":-2,"y_max_m":2}}'
)


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
    variation: dict[str, Any] = {
        "servo_speed": [0.1] * 8,
        "servo_torque": [-0.1] * 8,
        "neutral_us": [12.0, -12.0] * 4,
        "deadband_us": [5.0] * 8,
        "eccentricity_m": [0.001] * 8,
        "eccentricity_phase_rad": [2.0] * 8,
        "tyre_grip": [0.2] * 8,
        "wheel_radius": [0.05] * 8,
        "supply_v": -0.2,
        "mass": 0.1,
        "com_x_m": 0.003,
        "com_y_m": -0.002,
        "com_z_m": 0.001,
        "belly_grip": -0.5,
    }
    nominal = body["segments"][0]

    before = canonical_json(body)

    varied = vary_body(body, variation, carsim_limits.numbers)

    assert canonical_json(body) == before
    (segment,) = varied["segments"]
    assert segment["mass_kg"] == pytest.approx(1.1 * nominal["mass_kg"])
    # The same shape of 1.1 times the density.
    for axis in ("roll", "pitch", "yaw"):
        inertia = f"{axis}_inertia_kg_m2"
        assert segment[inertia] == pytest.approx(1.1 * nominal[inertia]), axis
    assert segment["com_x_m"] == pytest.approx(nominal["com_x_m"] + 0.003)
    assert segment["com_y_m"] == pytest.approx(nominal["com_y_m"] - 0.002)
    assert segment["com_z_m"] == pytest.approx(nominal["com_z_m"] + 0.001)
    assert segment["grip"] == pytest.approx(0.5 * 0.35 / 0.6)
    second = varied["wheels"][1]
    assert second["radius_m"] == pytest.approx(0.063)
    assert second["grip"] == pytest.approx(1.2)
    assert (second["eccentricity_m"], second["eccentricity_phase_rad"]) == (0.001, 2.0)
    assert second["servo"]["no_load_speed_rad_s"] == pytest.approx(
        1.1 * body["wheels"][1]["servo"]["no_load_speed_rad_s"]
    )
    assert second["servo"]["stall_torque_n_m"] == pytest.approx(0.9 * body["wheels"][1]["servo"]["stall_torque_n_m"])
    assert (second["servo"]["neutral_us"], second["servo"]["deadband_us"]) == (1488, 50)
    assert varied["supply_v"] == pytest.approx(5.0)
    # What does not vary stays.
    assert segment["length_m"] == nominal["length_m"]
    assert second["servo"]["rated_v"] == 5.2


def test_without_spread_nothing_changes(body: dict[str, Any], carsim_limits: CarsimLimits) -> None:
    still = draw({name: 0.0 for name in workshop()}, 42, 0)

    assert vary_body(body, still, carsim_limits.numbers) == body
    assert vary_body(body, {}, carsim_limits.numbers) == body


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("garage", "here: unknown variation 'garage'; known: \"workshop\""),
        (3, "here: unknown variation 3; known"),
        ({}, 'here: "from" is missing; known: "workshop"'),
        ({"from": "workshop", "luck": 1}, 'here: unknown spread "luck"; known: servo_speed, servo_torque'),
        ({"from": "workshop", "supply_v": -1}, "here.supply_v: -1 is outside 0 to 2 (V, one sd)"),
        ({"from": "workshop", "supply_v": float("nan")}, "here.supply_v: nan is outside 0 to 2"),
        ({"from": "workshop", "mass": 0.6}, "here.mass: 0.6 is outside 0 to 0.5 (relative, one sd)"),
        ({"from": "workshop", "mass": True}, "here.mass: True is not a number"),
        ({"from": "workshop", "mass": "1"}, "here.mass: '1' is not a number"),
    ],
)
def test_unknown_spreads_are_refused(asked: Any, message: str) -> None:
    with pytest.raises(FoldcarError) as caught:
        spread_named(asked, "here")

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

    results = Carsim(carsim_binary).run(
        bodies, {"flat": FLAT}, [RunRequest(name, "flat", settings, name, 0) for name in bodies]
    )

    assert len({result["distance_to_target_m"] for result in results}) == 40
