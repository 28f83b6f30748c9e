"""Values of single modules by their place, and wheels of different radii: the tilted body, its limits, all engines."""

import json
import math
from typing import Any

import numpy as np
import pytest

from foldcar.car.body import body_json, car_json, design_name, firmware_parameters, full_speed_m_s
from foldcar.car.design import DesignError, compose, compose_columns
from foldcar.car.design_parameters import key_of
from foldcar.car.folded.stance import stance, standing
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO, MULTIBODY, SIDE_VIEW
from study_car import empty_scene
from test_design import family

TWO_RADII = {"W1.radius": 60.0, "W2.radius": 50.0}


def drive(engine: str, values: dict[str, float], type_string: str = "W_B_W", **run: Any) -> list[list[float]]:
    """The path of a car on level ground: rows of time, x, y, z, heading, pitch, roll, hinges."""
    design = compose(type_string, values)
    body = body_json(design)
    scene = {
        **empty_scene(),
        "goal": None,
        "course": {"x_min_m": -9, "x_max_m": 9, "y_min_m": -9, "y_max_m": 9},
    }
    settings = {"speed_m_s": 0.3, "time_limit_s": 3.0, "path_interval_s": 0.05, "parameters": firmware_parameters(design)}
    lines = [{"body": {"id": "b", **body}}, {"scene": {"id": "s", **scene}}]
    lines.append({"run": {"id": "r", "body": "b", "scene": "s", **settings, **run}})
    *_, result = Carsim(engine=engine).answers([json.dumps(line) for line in lines])
    path: list[list[float]] = result["path"]
    return path


def test_a_place_sets_the_value_of_one_module() -> None:
    design = compose("W_B_H_W_H_W", {"radius": 30, "W.length": 70, "W3.length": 90, "H2.length": 20, "H2.fold_up": 5})

    assert [design.of(i, "length") for i in range(6)] == [70, 80, 6, 70, 20, 90]
    assert design.length_mm == 70 + 80 + 6 + 70 + 20 + 90
    assert [hinge.max_rad for hinge in folded_car(design).hinges] == pytest.approx([0, math.radians(5)])
    # Lengths from front to back: the middle of the last module is half of it before the rear.
    assert design.axles_mm[-1] == -design.length_mm / 2 + 45
    assert design.columns["W3_length_mm"] == 90 and design.columns["H2_fold_up_deg"] == 5
    assert key_of("H2_fold_up_deg") == "H2.fold_up" and key_of("W2_width_mm") is None
    assert compose_columns(design.type, design.columns) == design


def test_what_every_place_sets_has_no_value_for_the_letter() -> None:
    design = compose("W_B_W", TWO_RADII)

    assert "radius" not in design.values
    assert design.radii_mm == (60, 50)
    assert design_name(design) == "W_B_W 95x200 r60,50"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"W3.radius": 50}, "W3.radius: W_B_W has 2 modules W"),
        ({"H1.length": 50}, "H1.length: W_B_W has no such parameter; it has width, height, radius, W.length"),
        ({"W1.width": 90}, "W1.width: the whole car has one value of it: set width"),
        ({"W1.tire_thickness": 14}, "W1.tire_thickness: the whole car has one value of it: set W.tire_thickness"),
        ({**TWO_RADII, "radius": 50}, "radius: sets nothing, as W1.radius, W2.radius set it for every module: leave"),
        ({"W2.length": 38}, "W2.length: 38 is below the minimum 45.25 (the opening and screws of one servo)"),
        ({"W2.radius": 26}, "W2.radius: 26 is below the minimum 27 (half of height 50 and 2 under the belly)"),
        ({"W1.radius": 90}, "W1.radius: 90 beside 60 needs axles at least 153 apart, or wheels touch; with W.length 60"),
        (
            {"W1.radius": 70, "W2.radius": 33, "W2.length": 110, "B.length": 90},
            "W2.radius: 33 is below the minimum 36.941",
        ),
    ],
)
def test_a_place_that_cannot_be_is_one_line(values: dict[str, float], message: str) -> None:
    with pytest.raises(DesignError) as caught:
        folded_car(compose("W_B_W", values))

    assert str(caught.value).startswith(message)


def test_the_least_radius_beside_larger_ones_is_taken() -> None:
    values = {"W1.radius": 70.0, "W2.length": 110.0, "B.length": 90.0}
    with pytest.raises(DesignError, match="beside 70: the tilted body is less than 2 above the ground") as caught:
        folded_car(compose("W_B_W", {**values, "W2.radius": 33}))

    least = float(caught.value.message.split("minimum ")[1].split(" ")[0])

    car = folded_car(compose("W_B_W", {**values, "W2.radius": least}))
    # Independently: the lowest corner of the body, turned by asin((r1 - r2) / wheelbase), from wheels on z = 0.
    pitch = math.asin((70 - least) / (30 + 90 + 55))
    rear = -(60 + 90 + 110) / 2
    front_axle = (30 + 90 + 110) - (60 + 90 + 110) / 2
    height = 70 + (rear - front_axle) * math.sin(pitch) - 25 * math.cos(pitch)
    assert height == pytest.approx(2, abs=2e-3)
    assert stance(car).height_mm(rear, -25) == pytest.approx(height, abs=1e-9)


def test_the_body_tilts_by_the_radii_over_the_wheelbase() -> None:
    assert stance(folded_car(compose("W_B_W", TWO_RADII))).pitch_rad == pytest.approx(math.asin(10 / 140), abs=1e-12)
    assert stance(folded_car(compose("W_B_W", {}))).pitch_rad == 0


def test_a_car_stands_where_its_centre_of_mass_is_lowest() -> None:
    """Independently: of all lines that no wheel is below, a rigid car takes that with the lowest centre of mass."""
    draw = np.random.default_rng(4)
    for _ in range(200):
        wheels = [(x + draw.uniform(-20, 20), draw.uniform(30, 60)) for x in (-100.0, -30.0, 30.0, 100.0)]
        x, z = draw.uniform(-60, 60), draw.uniform(-10, 10)

        def height(pitch: float, x: float = x, z: float = z, wheels: Any = wheels) -> float:
            lift = max(r - at * math.sin(pitch) for at, r in wheels)
            return float(x * math.sin(pitch) + z * math.cos(pitch) + lift)

        pitches = np.linspace(-0.6, 0.6, 4001)
        best = min(pitches, key=height)
        stands = standing(wheels, (x, z))
        if abs(stands.pitch_rad) < 0.55:
            assert height(stands.pitch_rad) <= height(best) + 1e-9, (wheels, x, z)


@pytest.mark.parametrize("engine", [MULTIBODY, SIDE_VIEW, MUJOCO])
@pytest.mark.parametrize("radii", [(60.0, 50.0), (45.0, 60.0)])
def test_every_engine_tilts_the_car_alike(engine: str, radii: tuple[float, float]) -> None:
    path = drive(engine, {"W1.radius": radii[0], "W2.radius": radii[1]})

    tilt = math.asin((radii[0] - radii[1]) / 140)
    # It stands when the trial starts, and drives so.
    for row in (path[0], path[-1]):
        assert row[5] == pytest.approx(tilt, abs=2e-3)
        # The car's middle is halfway between the axles.
        assert row[3] == pytest.approx(sum(radii) / 2e3, abs=1e-3)


def test_wheels_of_two_radii_roll_at_one_speed() -> None:
    design = compose("W_B_W", TWO_RADII)
    values, car = firmware_parameters(design), car_json(design)

    assert car["wheel_radius_m"] == values["WHEEL_RADIUS_M"] == 0.05
    assert values["CH1_GAIN_US"] * 60 == pytest.approx(values["CH3_GAIN_US"] * 50, rel=1e-8)
    # The small wheels reach their no-load speed; the larger ones roll as fast.
    assert full_speed_m_s(design) == pytest.approx(values["WHEEL_MAX_RAD_S"] * 0.05, rel=1e-8)
    rows = drive(MULTIBODY, TWO_RADII)
    speed = (rows[-1][1] - rows[-11][1]) / (rows[-1][0] - rows[-11][0])
    assert speed == pytest.approx(0.3, rel=0.05)


def test_wheels_of_two_radii_are_cut_and_put_together_apart() -> None:
    car = folded_car(compose("W_B_W", TWO_RADII))

    counts = {piece.name: piece.count for piece in car.pieces}
    for end, radius in (("front", 60), ("rear", 50)):
        assert counts[f"{end} wheel inner disc"] == counts[f"{end} wheel hub"] == 2
        disc = next(piece for piece in car.pieces if piece.name == f"{end} wheel outer disc")
        reach = max(math.hypot(*point) for point in disc.faces[0].outline_mm)
        assert reach == pytest.approx(radius - car.parts.tyre.thickness_mm.value, abs=0.01)
    assert [axle.radius_mm for axle in car.axles] == [60, 60, 50, 50]
    assert verify(compose("W_B_W", TWO_RADII)).findings == ()
    masses = [wheel["mass_kg"] for wheel in body_json(compose("W_B_W", TWO_RADII))["wheels"]]
    alike = [body_json(compose("W_B_W", {"radius": radius}))["wheels"][0]["mass_kg"] for radius in (60, 50)]
    assert masses == [alike[0], alike[0], alike[1], alike[1]]


def test_alike_wheels_are_alike_however_they_are_written() -> None:
    plain, placed = (
        folded_car(compose("W_B_W", values)) for values in ({"radius": 50}, {"W1.radius": 50, "W2.radius": 50})
    )

    assert plain == placed


def test_a_listing_names_places_also_in_ranges() -> None:
    cars = family("W_B_W", {"common": {"radius": 60}, "W2": {"radius": {"from": 45, "to": 60, "step": 5}, "length": 70}})

    assert [design.radii_mm for design in cars] == [(60, radius) for radius in (45, 50, 55, 60)]
    assert cars.varied == {"W2_radius_mm": (45, 50, 55, 60)}
    assert cars.narrowed({"W2.radius": 50}).single().columns["W2_length_mm"] == 70
    with pytest.raises(
        FoldcarError, match=r"^cars.json: vehicles.v.params.0.W3: W_B_W has no module W3; known: common, B, W"
    ):
        family("W_B_W", {"W3": {"radius": 60}})
    with pytest.raises(FoldcarError, match=r'params.0.W2: unknown parameter "width"; known: driven, length, radius$'):
        family("W_B_W", {"W2": {"width": 60}})


def test_the_axles_of_a_hinged_car_are_told_apart() -> None:
    car = folded_car(compose("W_B_H_W_H_W", {"radius": 30, "W.length": 80, "W2.radius": 34}))

    assert {axle.unit for axle in car.axles} == {"axle 1 and 3 wheel", "axle 2 wheel"}
    assert verify(compose("W_B_H_W_H_W", {"radius": 30, "W.length": 80, "W2.radius": 34})).findings == ()
    assert [axle.radius_mm for axle in car.axles[::2]] == [30, 34, 30]
