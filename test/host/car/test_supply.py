"""The servos' supply: currents by the data sheet's points, and the switch, fuse and wire that bear them."""

import pytest

from foldcar.car.design import compose
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, catalogue_of
from foldcar.car.supply import check_supply, fresh_cells_warning, supply
from published_cars import car


@pytest.mark.parametrize(("name", "stall_a", "switch_a", "fuse_a"), [("w95", 2.77, 3.0, 3.0), ("six", 4.16, 6.0, 5.0)])
def test_switch_fuse_and_wire_bear_all_servos_stalled(name: str, stall_a: float, switch_a: float, fuse_a: float) -> None:
    needs = supply(car(name))

    # 0.64 A at 4.8 V and 0.8 A at 6 V: 0.693 A at 5.2 V.
    assert needs.stall_a == pytest.approx(stall_a, abs=0.005)
    assert (needs.switch_a, needs.fuse_a) == (switch_a, fuse_a)
    assert needs.stall_a <= needs.fuse_a <= needs.gauge.current_a
    assert list(check_supply(car(name))) == []


def test_eight_servos_need_thicker_wire_and_on_fresh_alkaline_cells_another_switch_than_there_is() -> None:
    values = {"radius": 40, "W.length": 90}
    eight = folded_car(compose("W_W_B_W_W", values))

    assert supply(eight).stall_a == pytest.approx(5.55, abs=0.01)
    assert (supply(eight).switch_a, supply(eight).gauge.awg) == (6.0, 20)
    assert list(check_supply(eight)) == []
    (finding,) = map(str, check_supply(folded_car(compose("W_W_B_W_W+cells=alkaline", values))))
    assert finding.startswith("supply: rocker switch, 10 x 15 mm: 8 stalled servos draw 6.2 A, more than its 6 A")


def test_only_alkaline_cells_are_warned_of() -> None:
    warnings = {name: fresh_cells_warning(catalogue_of(DEFAULT_CHOICES.changed({"cells": name})))
                for name in ("unnamed", "nimh", "alkaline")}  # fmt: skip

    assert warnings["unnamed"] == warnings["nimh"] == ""
    assert "6.4 V when fresh, more than the 6 V" in warnings["alkaline"]
