"""Designs: geometry by hand calculation, limits, families."""

from pathlib import Path

import pytest

from foldcar.car.design import DesignError, compose
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.study.family import Family, read_family
from foldcar.study.listing import ListedVehicle


def family(type_string: str, *params: object) -> Family:
    vehicle = ListedVehicle.model_validate({"type": type_string, "params": list(params)})
    return read_family(Path("cars.json"), "v", vehicle)


def test_columns_carry_module_and_unit() -> None:
    design = compose("W_B_H_W", {"width": 70})

    assert design.columns == {
        "width_mm": 70,
        "height_mm": 50,
        "radius_mm": 60,
        "W_length_mm": 60,
        "W_tire_thickness_mm": 12,
        "B_length_mm": 80,
        "H_length_mm": 6,
        "H_thickness_mm": 0.25,
        "H_fold_down_deg": 60,
        "H_fold_up_deg": 0,
    }


@pytest.mark.parametrize(
    ("type_string", "values", "parameter", "message"),
    [
        (
            "W_B_W",
            {"W.length": 38},
            "W.length",
            # Axis to screw hole: 11.6 - 5.9 + 27.5 / 2 + 2.2 / 2, and 2 mm to the module's end.
            "38 is below the minimum 45.25 (the opening and screws of one servo)",
        ),
        ("W_B_W", {"radius": 26}, "radius", "26 is below the minimum 27 (half of height 50 and 2 under the belly)"),
        (
            "W_B_W",
            {"radius": 68.6},
            "radius",
            "68.6 needs axles at least 140.2 apart, or wheels touch; with W.length 60 and",
        ),
        ("W_B_W", {"L.length": 5}, "L.length", "W_B_W has no such parameter"),
        ("W_B_W_W_W_W", {"radius": 30}, None, '"W_B_W_W_W_W" has 5 axles, the servo driver serves 4'),
        ("H_W_B", {}, None, '"H_W_B" has a hinge (H) at an end or beside another: each joins two segments'),
        ("W_B_H_H_W", {}, None, '"W_B_H_H_W" has a hinge (H) at an end or beside another: each joins two segments'),
        ("W_H_W", {}, None, '"W_H_W" has no module B'),
        ("W_H" + "_B_H" * 7 + "_B", {}, None, '"W_H_B_H_B_H_B_H_B_H_B_H_B_H_B_H_B" has 9 segments, the simulator'),
        ("W_B_H_W", {"H.fold_down": 91}, "H.fold_down", "91 is above the maximum 90"),
        ("", {}, None, '"" has unknown module ""'),
    ],
)
def test_cars_that_cannot_be_built_are_refused(
    type_string: str, values: dict[str, float], parameter: str | None, message: str
) -> None:
    with pytest.raises(DesignError) as caught:
        compose(type_string, values)

    assert caught.value.parameter == parameter
    assert caught.value.message.startswith(message)


def test_wheels_must_not_meet_when_the_car_folds() -> None:
    # Axles 126 mm apart flat, each 63 mm from the hinge and 25 above it. Nose up by 5° they come nearer:
    # 2 · (63 · cos 2.5° - 25 · sin 2.5°) = 123.7.
    values = {"W.length": 120, "H.length": 6, "radius": 60.3, "H.fold_up": 5}
    assert compose("B_W_H_W", values).axles_mm[0] - compose("B_W_H_W", values).axles_mm[1] == 126

    with pytest.raises(DesignError) as caught:
        compose("B_W_H_W", values | {"radius": 60.4})

    assert caught.value.message.startswith("60.4 needs axles at least 123.8 apart, or wheels touch")
    assert caught.value.message.endswith("two axles are 123.7 apart when hinge H is at its limit")
    # With the nose down the hinge, which is under the floor, moves the axles apart.
    assert compose("B_W_H_W", values | {"H.fold_up": 0, "radius": 61.5}).values["radius"] == 61.5


def test_electronics_ride_in_the_first_body_module_and_servos_with_their_axles() -> None:
    car = folded_car(compose("W_H_B_H_B_H_W", {"W.length": 130}))

    electronics = {getattr(car.parts, name).name for name in ("feather", "featherwing", "lipo", "battery", "pad")}
    assert {mount.body for mount in car.mounts if mount.part in electronics} == {"segment1"}
    # The switches are on the nearer end of the car, where a finger reaches them.
    assert [mount.body for mount in car.mounts if mount.part == car.parts.switch.name] == ["segment0", "segment0"]
    servos = [mount for mount in car.mounts if mount.part == "FS90R servo"]
    assert [servo.body for servo in servos] == ["segment0", "segment0", "segment3", "segment3"]


def test_a_hinge_folds_up_until_the_lids_meet() -> None:
    # Two lids 49.75 mm above the strip and 6 mm apart: 2 · atan(3 / 49.75) = 6.901°.
    with pytest.raises(DesignError, match=r"^H.fold_up: 7 is above the maximum 6.901 \(where the lids meet"):
        folded_car(compose("W_B_H_W", {"W.length": 120, "H.fold_up": 7}))


def test_a_lone_wheel_module_has_room_for_servo_and_tabs() -> None:
    # From the axis to the second layer's end: 5.525 + 27.5 / 2 + 0.25 + 2.2; the tab is 8 mm deep.
    with pytest.raises(DesignError, match=r"^W.length: 59 is below the minimum 59.5 \(a segment of its own"):
        folded_car(compose("B_H_W", {"W.length": 59}))


@pytest.mark.parametrize(
    ("values", "parameter", "message"),
    [
        # The wall's film twice; 1.5 mm to the socket's mouth, 25.25 mm to the boards' middle, 25.4 mm from there to
        # their end, 0.5 mm to the bridge's and again to the other wall.
        ({"width": 53.6}, "width", "53.6 is below the minimum 53.65 (the boards across it)"),
        # The films of floor and lid; LiPo 4.75, screws' heads 2.4, film, spacer 5, board 1.6, headers 11.04, plugs 18.2
        # and their leads 4.
        ({"height": 47.7}, "height", "47.7 is below the minimum 47.74 (the boards and their plugs over the LiPo)"),
        # B lies between axles 120 mm apart, with 27.5 - 21.73 mm of floor behind it, where the holder begins: 31.5 mm,
        # 1 mm and 12.24 mm farther is the boards' middle, 6.5 mm before the axles'. The plug, 13.59 mm in diameter and
        # 9.45 mm below the axles and 1 mm from a tyre, is at least sqrt((56 + 6.79 + 1)² - 9.45²) = 63.09 mm from the
        # front one, 3.09 mm behind the middle.
        (
            {"B.length": 65, "W.length": 55, "radius": 56},
            "B.length",
            "65 is below the minimum 74.6 (the boards and the square 4xAA holder, with a USB plug clear of the tyres)",
        ),
        # A holder 58 mm wide, or 59.5 mm, does not stand across a body 58.4 mm wide.
        (
            {"width": 58.4, "B.length": 60, "radius": 30},
            "B.length",
            "60 is below the minimum 73.7 (the boards and the square 4xAA holder lengthwise at width 58.4)",
        ),
    ],
)
def test_parts_that_find_no_room_are_named(values: dict[str, float], parameter: str, message: str) -> None:
    with pytest.raises(DesignError) as caught:
        folded_car(compose("W_B_W", values))

    assert (caught.value.parameter, caught.value.message) == (parameter, message)


# The sums of these minima are off by rounding, beyond the digits that are told.
@pytest.mark.parametrize(
    ("type_string", "values", "parameter", "least"),
    [
        ("W_B", {"radius": 27, "W.tire_thickness": 11, "B.length": 62.4}, "B.length", 63.4),
        ("W_B_W+film=pp_0.8+horn=disc+battery=4xaa_flat", {"B.length": 110, "width": 56}, "width", 61.3),
    ],
)
def test_the_least_value_that_a_refusal_tells_is_taken(
    type_string: str, values: dict[str, float], parameter: str, least: float
) -> None:
    with pytest.raises(DesignError, match=rf"is below the minimum {least} ") as caught:
        folded_car(compose(type_string, values))
    assert caught.value.parameter == parameter

    folded_car(compose(type_string, {**values, parameter: least}))

    with pytest.raises(DesignError, match="below the minimum"):
        folded_car(compose(type_string, {**values, parameter: least - 0.1}))


def test_a_family_has_every_combination_the_last_varied_fastest() -> None:
    cars = family("W_B_W", {"common": {"width": [70, 80], "radius": [60, 50]}}, {"B": {"length": 90}})

    pairs = [(design.values["width"], design.values["radius"]) for design in cars]

    assert pairs == [(70, 60), (70, 50), (80, 60), (80, 50)]
    assert len(cars) == 4
    assert cars.varied == {"width_mm": (70, 80), "radius_mm": (60, 50)}


def test_a_shared_parameter_may_be_repeated_but_not_contradicted() -> None:
    agreeing = family("W_B_W", {"common": {"radius": 60}}, {"W": {"radius": 60}})
    assert agreeing.single().values["radius"] == 60

    with pytest.raises(FoldcarError) as caught:
        family("W_B_W", {"common": {"radius": 60}}, {"W": {"radius": 50}})
    assert str(caught.value) == (
        "cars.json: vehicles.v.params.1.W.radius: differs from vehicles.v.params.0.common.radius, "
        "but this parameter has one value for the whole car"
    )


def test_a_family_is_narrowed_to_one_car() -> None:
    cars = family("W_B_W", {"common": {"width": {"from": 65, "to": 245, "step": 5}}})

    with pytest.raises(FoldcarError) as caught:
        cars.single()
    assert str(caught.value) == (
        "cars.json: vehicles.v.params.0.common.width: has 37 values (65, 70, 75, … 245); choose one with --set width=…"
    )
    assert cars.narrowed({"width": 95}).single().values["width"] == 95
    with pytest.raises(FoldcarError, match=r"^--set width: 20 is below the minimum 53.65"):
        cars.narrowed({"width": 20}).single()
    with pytest.raises(FoldcarError, match=r"^--set colour: W_B_W has no such parameter; it has width, height"):
        cars.narrowed({"colour": 1})


def test_a_default_that_does_not_fit_is_named_as_such() -> None:
    with pytest.raises(FoldcarError, match=r"^cars.json: vehicles.v: radius \(its default\): 60 needs axles"):
        family("W_B_W", {"B": {"length": 60}}).single()
