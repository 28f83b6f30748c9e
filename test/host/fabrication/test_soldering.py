"""The step that solders the boards: pins are shown from both sides, #OE where the board's data say that it is."""

import re
import xml.etree.ElementTree as ET
from functools import cache

import pytest

from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads
from foldcar.fabrication.assembly.soldering import PINS_OF_RESISTORS, soldering_step

OPTIONS = "W_B_W+button=fitted+divider=fitted+oe_wire=fitted"
# The pitch of pins (mm), the scale of the boards' drawings, and the middles of the Feather's two drawings (mm).
PITCH_MM, SCALE, MIDDLES_MM = 2.54, 1.5, {"above": (46, 32), "below": (138, 32)}
# Each pin's row ("short": 12 pins, "long": 16) and number from USB, from Adafruit's pinouts page of the HUZZAH32.
PLACES = {
    "EN": ("short", 2), "GND": ("long", 4), "32": ("short", 9), "34": ("long", 7), "27": ("short", 6), "3V": ("long", 2),
}  # fmt: skip


@cache
def car(type_string: str) -> FoldedCar:
    return folded_car(compose(type_string, {}))


def group(type_string: str, name: str) -> ET.Element:
    """Return a part of the drawing by its id."""
    (picture,) = soldering_step(car(type_string)).pictures
    drawn = ET.fromstring(str(picture.svg))
    return next(found for found in drawn.iter("{http://www.w3.org/2000/svg}g") if found.attrib["id"] == name)


def circles(drawn: ET.Element, without: str = "#ffffff") -> list[tuple[float, float]]:
    """Return the middles of the circles that do not have a colour."""
    found = [circle.attrib for circle in drawn.iterfind("{*}circle")]
    return [(float(c["cx"]), float(c["cy"])) for c in found if c["fill"] != without]


@pytest.mark.parametrize(("type_string", "pins"), [("W_B_W", ("EN", "GND")), (OPTIONS, tuple(PLACES))])
@pytest.mark.parametrize("view", ["above", "below"])
def test_pins_with_wires_are_shown_in_both_views_and_mirrored_from_below(
    type_string: str, pins: tuple[str, ...], view: str
) -> None:
    x0, y0 = MIDDLES_MM[view]
    expected = []
    for row, number in (PLACES[pin] for pin in pins):
        # A Feather's rows lie 20.32 mm apart; the long one's middle is the board's, the short one ends where that ends.
        start = -16 / 2 * PITCH_MM if row == "long" else 16 / 2 * PITCH_MM - 12 * PITCH_MM
        across = 10.16 * (1 if row == "long" else -1) * (1 if view == "above" else -1)
        expected.append((x0 + SCALE * (start + (number - 0.5) * PITCH_MM), y0 + SCALE * across))

    drawn = group(type_string, f"feather-{view}")

    assert [pytest.approx(point, abs=0.011) for point in sorted(expected)] == sorted(circles(drawn))
    texts = [text.text for text in drawn.iterfind("{*}text")]
    assert all(texts[texts.index(pin) + 1] == str(PLACES[pin][1]) for pin in pins)


def test_every_pin_is_named_with_its_place_by_one_rule() -> None:
    text = " ".join(soldering_step(car(OPTIONS)).lines)

    for pin, (row, number) in PLACES.items():
        assert f"{pin} (number {number} of the {12 if row == 'short' else 16})" in text
    # The pin at the LiPo's voltage is EN's neighbour at the end of the row.
    assert "BAT (number 1 of the 12)" in text


def test_resistors_are_drawn_between_the_legs_that_the_text_names() -> None:
    text, drawn = " ".join(soldering_step(car(OPTIONS)).lines), group(OPTIONS, "feather-below")
    x0, y0 = MIDDLES_MM["below"]

    at_mm = {}
    for pin in PLACES:
        x, y = car(OPTIONS).parts.feather.pin_mm(pin)
        at_mm[pin] = f"{x0 + SCALE * x:.2f},{y0 + SCALE * y:.2f}"
    ends = [line.attrib["points"].split()[-1] for line in drawn.iterfind("{*}polyline")]
    for name, pins in PINS_OF_RESISTORS.items():
        assert name in text
        assert all(at_mm[pin] in ends for pin in pins if pin)


def test_oe_is_the_pad_of_the_boards_data_and_the_check_names_both_ends() -> None:
    parts = car(OPTIONS).parts
    # Eagle's data of the board: R7 at (33.909, 16.891) mm from a corner, its pad 1 at -0.95 mm; U1, turned by -90°, with
    # pin 23 at (-0.975, 2.918) of its package; the board is 50.8 x 22.86 mm.
    pad = 33.909 - 0.95 - 50.8 / 2, 16.891 - 22.86 / 2
    pin_23 = 34.163 + 2.918 - 50.8 / 2, 10.922 + 0.975 - 22.86 / 2
    for at, expected in zip(parts.featherwing.output_enable.at_mm, (pad, pin_23), strict=True):
        assert at == pytest.approx(expected, abs=0.002)

    (marked,) = [c.attrib for c in group(OPTIONS, "wing-above").iterfind("{*}circle") if c.attrib["fill"] == "#c2272d"]
    assert (float(marked["cx"]), float(marked["cy"])) == pytest.approx((46 + 1.5 * pad[0], 96 - 1.5 * pad[1]), abs=0.01)
    enlarged = " ".join(text.text or "" for text in group(OPTIONS, "enable").iterfind("{*}text"))
    assert "solder the wire to this end of the 10 kΩ resistor" in enlarged and "Pin 23" in enlarged
    red = [box for box in group(OPTIONS, "enable").iterfind("{*}rect") if box.attrib["fill"] == "#c2272d"]
    assert len(red) == 2
    text = " ".join(soldering_step(car(OPTIONS)).lines)
    assert "connected with pin 23 of the chip, and the other end with GND" in text and "without power" in text
    assert "#OE" not in " ".join(soldering_step(car("W_B_W")).lines)
    with pytest.raises(StopIteration):
        group("W_B_W", "enable")


def test_the_wire_to_oe_reaches_the_pad() -> None:
    lead = next(lead for lead in leads(car(OPTIONS)) if lead.end.endswith("#OE"))
    text = " ".join(soldering_step(car(OPTIONS)).lines)

    # Along the boards' sides, from the leg of 27 to the pad: both boards, what is between them, and a joint at each end.
    x, y = 5.08 - 6 * PITCH_MM + 5.5 * PITCH_MM, 10.16
    way_mm = abs(x - 7.559) + abs(y - 5.461) + 1.6 + 11.04 + 1.6
    assert lead.way_mm == pytest.approx(way_mm, abs=0.01)
    length_mm = int(re.findall(r"(\d+) mm of wire, 30 AWG", text)[0])
    # The wing, 22.86 mm wide, lies beside the Feather while nuts are put on.
    assert way_mm + 2 * 10 + 22.86 <= length_mm <= 1.1 * way_mm + 2 * 10 + 22.86 + 5
