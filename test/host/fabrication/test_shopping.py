"""What to buy: every part can be found in a shop, nothing is listed twice, the switch and the cells suit the servos."""

import itertools
import re

import pytest

from foldcar.car.design import compose
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, OPTIONS, catalogue_of
from foldcar.fabrication.assembly.guide import guide_page
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_text, shopping
from foldcar.fabrication.assembly.wiring import wiring_text
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car
from published_cars import car


def test_every_part_that_costs_something_has_a_search_term() -> None:
    choices = (DEFAULT_CHOICES.changed({kind: name}) for kind, names in OPTIONS.items() for name in names)
    catalogues = [catalogue_of(choice) for choice in choices]
    bought = {
        part.name for parts in catalogues for part in parts.bought if part.cost_usd.value and part is not parts.cells
    }
    bought |= {parts.cells.cell for parts in catalogues}

    assert set(shopping()["parts"]) == bought
    assert all(len(search) > 5 for _, search in shopping()["parts"].values())


@pytest.mark.parametrize("name", ["w95", "six", "hinged"])
def test_a_parts_list_names_each_part_once_with_what_to_order_and_the_date_of_its_price(name: str) -> None:
    rows = parts_list(car(name))
    text = parts_list_text(car(name), "a car")

    assert len({row.name for row in rows}) == len(rows)
    assert all(row.search or row.note == "comes with the servos" for row in rows)
    assert (
        "| Adafruit 3405; not the ESP32 Feather V2 (5400), which has other I2C pins |" in text
        and "| Adafruit 2886 |" in text
        and "stacking headers" not in text
    )
    assert re.search(r"Prices are shops' list prices of 20\d\d", text)
    assert re.search(r"\| button to drive alone \| push button, 7 mm thread \| \w+", text)
    assert "| voltage of the servos' battery | resistors, 20 kΩ and 10 kΩ, 1 % |" in text
    (cells,) = [row for row in rows if "AA cell" in row.name]
    assert cells.quantity == 4 and cells.name.startswith("NiMH") and "not alkaline" in cells.note


def test_the_guide_s_tools_are_complete_and_none_is_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    # The pictures of the steps take long.
    monkeypatch.setattr("foldcar.fabrication.assembly.guide.build_steps", lambda *_: [])
    rows = parts_list(car("w95"))
    page = guide_page(car("w95"), cut_car(car("w95"), options("laser")), "laser", "a car")
    tools = page.partition("Tools and materials")[2].partition("</ul>")[0]
    for row, tool in itertools.product(rows, re.findall("<li>(.*?)</li>", tools)):
        assert row.name not in tool or "screwdriver" in tool or "hacksaw" in tool
    for tool in ("slotted screwdriver", "wire stripper", "hot-air gun", "soldering iron", "side cutters"):
        assert tool in tools


@pytest.mark.parametrize(("name", "mark", "stall"), [("w95", 3, 2.8), ("six", 6, 4.2)])
def test_the_switch_that_is_asked_for_bears_the_stalled_servos(name: str, mark: int, stall: float) -> None:
    (switch,) = [row for row in parts_list(car(name)) if row.name == car(name).parts.switch.name]
    text = wiring_text(car(name), "a car")

    assert switch.note.startswith(f"the servos' switch is marked {mark} A or more") and f"draw {stall} A" in switch.note
    assert f"must be marked {mark} A or more" in text
    assert "A fuse, " in text and "electrolytic capacitor" in text and "NiMH" in text


def test_alkaline_cells_carry_a_warning() -> None:
    folded = folded_car(compose("W_B_W+cells=alkaline", {}))

    for text in (wiring_text(folded, "a car"), parts_list_text(folded, "a car")):
        assert "have 6.4 V when fresh, more than the 6 V that the servos may get" in text
