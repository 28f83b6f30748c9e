"""The options of a car - button, measured servo battery, wire to the driver's output enable - and what every car has."""

import math
from typing import Any

import pytest

from foldcar.car.body import body_json, car_json, firmware_parameters
from foldcar.car.components.bridge import option_resistors
from foldcar.car.design import DesignError, compose
from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads
from foldcar.car.verify import verify
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.soldering import soldering_step
from foldcar.fabrication.assembly.wiring import optional_parts, wiring_text

ALL = "+button=fitted+divider=fitted+oe_wire=fitted"


def mount_of(car: FoldedCar, name: str) -> Mount:
    return next(mount for mount in car.mounts if mount.name == name)


@pytest.mark.parametrize(
    ("modules", "values"),
    [
        ("W_B_W", {"width": 65}),
        ("W_B_W", {"width": 180}),
        ("W_B_H_W", {}),
        ("B_W", {"B.length": 110}),
        ("W_B", {"B.length": 110}),
    ],
)
def test_a_car_with_all_options_passes_the_proof_and_its_leads_reach(modules: str, values: dict[str, float]) -> None:
    design = compose(modules + ALL, values)
    car = folded_car(design)

    assert verify(design).findings == ()
    # The button is at the end of the car without switches.
    ends = [mount_of(car, name).pose[0][3] for name in ("button", "servo switch", "board switch")]
    assert ends[0] * ends[1] < 0 < ends[1] * ends[2]
    controls = {lead.start: lead for lead in leads(car) if lead.kind == "wire"}
    assert controls.keys() == {
        "servo switch 2", "board switch 1", "board switch 2", "button 1", "button 2", "20 kΩ resistor",
        "HUZZAH32 Feather 27",
    }  # fmt: skip
    for name in ("board switch 1", "button 1"):
        # At least from the cap to the board, lifted out of the car.
        straight = abs(mount_of(car, name[:-2]).pose[0][3] - mount_of(car, "HUZZAH32 Feather").pose[0][3])
        assert controls[name].needed_mm > straight + 30


def test_what_is_fitted_is_told_to_the_firmware_and_is_in_parts_and_guide() -> None:
    plain, fitted = compose("W_B_W", {}), compose("W_B_W" + ALL, {})
    told = {"BUTTON_WIRED": 1.0, "SERVO_DIVIDER": 3.0, "OE_WIRED": 1.0}

    assert not told.keys() & firmware_parameters(plain).keys()
    assert told.items() <= firmware_parameters(fitted).items() and told.items() <= car_json(fitted)["parameters"].items()
    cars = [folded_car(design) for design in (plain, fitted)]
    rows = [{row.name: row.quantity for row in parts_list(car)} for car in cars]
    assert {name: count for name, count in rows[1].items() if name not in rows[0]} == {
        "push button, 7 mm thread": 1, "resistor, 1/4 W": 3, "heat-shrink tube, 1.5 mm": 2 * 3 * 0.010,
    }  # fmt: skip
    assert [len(optional_parts(car)) for car in cars] == [4, 1]
    plain_text, fitted_text = (" ".join(soldering_step(car).lines) for car in cars)
    for words in (
        "the legs of 32 (number 9 of the 12) and GND",
        "10 kΩ resistor between the legs of 34 (number 7 of the 16)",
        "pin 23 of the chip",
    ):
        assert words in fitted_text and words not in plain_text
    assert wiring_text(cars[1], "a car").count("|yes|") == 3 and wiring_text(cars[0], "a car").count("|no|") == 3


def test_a_divider_of_these_resistors_gives_the_parameters_value() -> None:
    values = [float(name.split()[0]) for name in option_resistors(folded_car(compose("W_B_W+divider=fitted", {})).parts)]

    lower, upper = sorted(values)
    assert (upper + lower) / lower == firmware_parameters(compose("W_B_W+divider=fitted", {}))["SERVO_DIVIDER"]


def test_both_switches_need_room_beside_or_between_servos() -> None:
    with pytest.raises(DesignError, match=r"W\.length: 50 is below the minimum 5\d\.\d \(the servos beside the switches"):
        folded_car(compose("W_B_W", {"width": 70, "W.length": 50, "B.length": 100}))
    assert verify(compose("W_B_W", {"width": 95, "W.length": 50, "B.length": 100})).findings == ()


def test_the_light_is_seen_aslant_and_the_tie_has_film_between_its_slots() -> None:
    car = folded_car(compose("W_B_W", {}))
    holes: dict[str, Any] = {
        hole.name.rpartition(".")[2]: hole for piece in car.pieces for face in piece.faces for hole in face.holes
    }
    # The light: 5.91 mm beside the socket's middle, 2.86 mm from the board's end, which is 0.15 mm behind the socket's
    # mouth; the mouth is 1.5 mm behind the wall.
    beside = [x - holes["USB"].center_mm[0] for x in (holes["light"].center_mm[0] - 3, holes["light"].center_mm[0] + 3)]
    depth = 1.5 - 0.15 + 2.86 + car.parts.film_mm / 2
    aslant = [math.degrees(math.atan2(x - 5.91, depth)) for x in beside]
    assert 30 < aslant[0] < aslant[1] < 66
    # A plug, 10.6 mm wide at most, is not in the way.
    assert beside[0] > 10.6 / 2
    slots = [holes[name] for name in ("tie 1", "tie 2")]
    assert abs(slots[1].center_mm[0] - slots[0].center_mm[0]) - 2 == pytest.approx(8)
    assert all(slot.center_mm[1] > holes["USB"].center_mm[1] + 7.4 + 4 for slot in slots)


def test_the_floor_below_the_battery_has_two_layers() -> None:
    car = folded_car(compose("W_B_W", {}))
    battery = mount_of(car, car.parts.battery.name)

    (join,) = [join for join in car.joins if "floor doubler" in (join.piece_a, join.piece_b)]
    body = body_json(compose("W_B_W", {}))

    assert join.kind == "laminate"
    # On two layers of 0.25 mm and the pad.
    floor_z = -(50 - 0.25) / 2
    pad_mm = car.parts.pad.height_mm.value
    assert battery.pose[2][3] - battery.size_mm[2] / 2 == pytest.approx(floor_z + 0.125 + 0.25 + pad_mm)
    assert body["segments"][0]["mass_kg"] > 0.2
