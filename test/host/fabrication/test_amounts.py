"""Tape, tube and solder in the parts list, and the sizes of tyres, against arithmetic of their own."""

import math
import re
from functools import cache

import pytest

from foldcar.car.components.wheel_size import TYRE_PULL_N
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import OPTIONS, PartChoices, catalogue_of
from foldcar.fabrication.assembly.materials import tape_mm
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_text
from foldcar.fabrication.assembly.row import Row
from foldcar.fabrication.assembly.wheel_words import tyre_lines
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car
from part_data import part_data

FITTED = "W_B_W+button=fitted+divider=fitted+oe_wire=fitted"


@cache
def car(type_string: str, **sizes: float) -> FoldedCar:
    return folded_car(compose(type_string, sizes))


def rows(type_string: str) -> dict[str, Row]:
    return {row.name: row for row in parts_list(car(type_string))}


def test_tape_is_as_long_as_all_tabs_and_covers_all_layers() -> None:
    folded = car("W_B_W", width=95)
    height_mm = compose("W_B_W", {"width": 95}).values["height"]
    tabs_mm, layers_mm = tape_mm(folded)

    # A cap has a tab on the floor and one on each wall, about 1 mm shorter than the beam is wide and high.
    assert tabs_mm == pytest.approx(2 * ((95 - 1) + 2 * (height_mm - 1)), abs=1)
    # By the outlines on the sheets: flat layers are whole pieces, of the bridge both feet, 6 mm deep, are taped.
    areas_mm2 = {}
    for piece in cut_car(folded, options("laser")).pieces:
        areas_mm2[piece.name] = piece.outline.area * piece.count
    doublers = sum(area for name, area in areas_mm2.items() if "doubler" in name)
    bridge = next(piece for piece in folded.pieces if piece.name == "bridge")
    (foot_mm, _), *_ = [(max(x for x, _ in face.outline_mm), face) for face in bridge.faces if face.name.endswith("foot")]
    # Each wheel's hub is a disc with three straight sides: between its inscribed and its circumscribed circle.
    least, most = (4 * math.pi * radius**2 for radius in (14.0, 19.0))
    assert doublers + 2 * 6 * foot_mm + least < 6 * layers_mm < doublers + 2 * 6 * foot_mm + most
    row = rows("W_B_W")["double-sided tape"]
    assert f"{tape_mm(car('W_B_W'))[0] / 1000:.2f} m along tabs" in row.note
    assert row.quantity * 1000 >= sum(tape_mm(car("W_B_W"))) + 36
    # The text that says what to buy has the widths that the amount is computed with.
    width = part_data("assembly")["tape_width_mm"]
    expected = f"{width['value'] - width['tolerance']:g} to {width['value'] + width['tolerance']:g} mm wide"
    tapes = {part_data(f"film_{film}")["tape"] for film in OPTIONS["film"]}
    assert sum("wide" in tape for tape in tapes) >= 2
    assert all(expected in tape for tape in tapes if "wide" in tape)


def test_pieces_that_were_split_need_more_tape() -> None:
    folded = car("W_B_W", width=95)
    parted = cut_car(folded, options("scissors", sheet="a4"))
    numbers = {join.number for join in folded.joins}
    new_mm = [join.length_mm for join in parted.car.joins if join.number not in numbers]

    assert new_mm and tape_mm(folded, parted)[0] == pytest.approx(tape_mm(folded)[0] + sum(new_mm))
    assert tape_mm(folded, cut_car(folded, options("laser", sheet="1000x1000"))) == tape_mm(folded)


@pytest.mark.parametrize(
    ("type_string", "wires", "sleeves", "pins"),
    # Servo switch: two terminals, two ends of the fuse, the + lead; board switch and button two terminals each; the 20 kΩ
    # resistor's wire. Pins: two rows on both boards, eight outputs of three, two terminals, two wires at the Feather;
    # options: the button's two wires, two ends of each resistor, its wire, and two ends of the wire to #OE.
    [("W_B_W", 5 + 2, 0, 2 * 28 + 24 + 2 + 2), (FITTED, 5 + 2 + 2 + 1, 6, 2 * 28 + 24 + 2 + 2 + 2 + 6 + 1 + 2)],
)
def test_tube_and_solder_are_counted_by_joints(type_string: str, wires: int, sleeves: int, pins: int) -> None:
    own = rows(type_string)

    # 10 mm of bare wire and 5 mm of insulation at each side.
    assert own["heat-shrink tube, 3 mm"].quantity == pytest.approx(wires * 0.020)
    assert own["heat-shrink tube, 3 mm"].note.startswith(f"{wires} pieces of 20 mm")
    assert own["heat-shrink tube, 1.5 mm"].quantity == pytest.approx(0.06) if sleeves else True
    assert ("heat-shrink tube, 1.5 mm" in own) == bool(sleeves)
    # A pin 0.64 mm square in a hole of 1 mm, and a cone on each side from 1.7 mm to the pin; the most is 1.5 mm³ more.
    in_hole = (math.pi / 4 - 0.64**2) * 1.6
    cone = math.pi / 3 * (0.85**2 + 0.85 * 0.36 + 0.36**2) - 0.64**2
    joints = wires - (type_string == FITTED) + pins
    assert f"for {joints} joints" in own["solder wire"].note
    least_m, most_m = (joints * mm3 / (math.pi * 0.4**2) / 1000 for mm3 in (in_hole + 2 * cone, 2 * (in_hole + 2 * cone)))
    assert least_m <= own["solder wire"].quantity <= most_m + 0.1
    text = parts_list_text(car(type_string), "a car")
    assert f"| heat-shrink tube, 3 mm | {wires * 0.02:.2f} m |" in text


def test_a_closed_band_is_as_much_shorter_than_the_rim_as_it_is_stretched() -> None:
    (text, strip) = catalogue_of(PartChoices()).tyre.sizes(60.0, 12.0)

    inside, flat, percent = (
        float(re.findall(pattern, text)[0])
        for pattern in (r"(\d+) mm in inside diameter", r"\((\d+) mm long when", r"stretched by (\d+) %")
    )
    # The rim is 2 mm smaller than the wheel, whose radius is 60 mm with a tyre of 1 mm.
    assert inside * (1 + percent / 100) == pytest.approx(118, abs=0.6)
    assert 2 * flat == pytest.approx(math.pi * inside, abs=2.6)
    assert "12 mm wide, 1 mm thick" in text and strip == "a strip of 374 x 12 mm"
    # The same stretch pulls at the discs: 12 x 1 mm² of natural rubber of 1.5 MPa.
    assert pytest.approx(12 * 1 * 1.5 * percent / 100) == TYRE_PULL_N


@pytest.mark.parametrize(
    ("radius_mm", "words", "taped_mm"),
    # A wristband is 202 mm around its inside and 2 mm thick.
    [
        (36.0, "as it is: on the rim it is stretched by 6 %", 0.0),
        (60.0, "a strip of 371 x 12 mm, of 2 bands", 116 * math.pi),
        (30.0, "a strip of 182 x 12 mm, of one band, cut open", 56 * math.pi),
    ],
)
def test_a_wristband_is_stretched_or_cut(radius_mm: float, words: str, taped_mm: float) -> None:
    tyre = catalogue_of(PartChoices(tyre="silicone_band")).tyre

    (text,) = tyre.sizes(radius_mm, 12.0)

    assert words in text and tyre.taped_mm(radius_mm) == pytest.approx(taped_mm)


@pytest.mark.parametrize(
    ("tyre", "words"),
    [
        ("rubber_band", "If you have no such band, cut a strip of 374 x 12 mm."),
        ("grip_tape", "The ends of the strip meet and do not overlap."),
        ("shrink_tube", "Warm it with little heat"),
        ("silicone_band", "Hold a strip with double-sided tape"),
    ],
)
def test_the_guide_says_what_to_do_with_each_kind_of_tyre(tyre: str, words: str) -> None:
    assert words in " ".join(tyre_lines(car(f"W_B_W+tyre={tyre}"), "wheel"))
