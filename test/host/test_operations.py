"""What a person does to build a car is counted once, step by step, and its time follows from the times of its kinds."""

import math
from collections import Counter
from pathlib import Path

import pytest

from foldcar.car.assembly.order import assembly_steps
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.commands.listed_design import listed_family
from foldcar.fabrication.assembly.operations import Operations, assembly_times, is_screw, operations
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car


@pytest.fixture(scope="module", params=["four wheels", "three segments"])
def car(request: pytest.FixtureRequest) -> FoldedCar:
    hinged = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}
    return folded_car(compose("W_B_W", {}) if request.param == "four wheels" else compose("W_B_H_W_H_W", hinged))


def test_steps_put_every_copy_and_part_in_once_and_make_every_join(car: FoldedCar) -> None:
    steps = assembly_steps(car)

    added = Counter((one.kind, one.name, one.copy) for step in steps for one in step.adds if one.kind != "unit")
    joined = Counter(number for step in steps for number in step.joins)
    closed: dict[str, dict[str, float]] = {}
    for step in steps:
        for name, folds in step.folds.items():
            closed.setdefault(name, {}).update(folds)
    units = Counter((step.unit, one.body) for step in steps if step.unit for one in step.adds)
    placed = {(one.name, one.body) for step in steps for one in step.adds if one.kind == "unit"}

    assert added == Counter(
        [("piece", one.piece, one.copy) for one in car.placed] + [("mount", mount.name, 0) for mount in car.mounts]
    )
    assert joined == dict.fromkeys({join.number for join in car.joins}, 1)
    for piece in car.pieces:
        for crease in piece.creases:
            assert closed.get(piece.name, {}).get(crease.name) == 1.0 or crease.flexure or not crease.angle_rad
    assert set(units) == placed


def test_operations_are_those_of_pieces_joins_parts_and_wires(car: FoldedCar) -> None:
    parts = cut_car(car, options("laser"))
    cut, wheels = parts.car, len(car.axles)

    found = operations(car, parts)

    of_wheels = {one.piece for one in car.placed if one.body.startswith("wheel")}
    joins: Counter[str] = Counter()
    for join in cut.joins:
        joins[join.kind] += wheels if join.piece_a in of_wheels else 1
    screws = sum(is_screw(car.parts, mount) for mount in car.mounts)
    assert found.piece == sum(piece.count for piece in cut.pieces)
    assert found.tape == sum(joins[kind] for kind in ("lap", "tab", "laminate"))
    assert found.tongue == joins["tab_slot"] + joins["lock"] + joins["rim"]
    assert found.screw == screws
    assert found.plug == sum(wire.carries != "usb" for wire in car.wires)
    # A wheel is put on as one, and so is every other unit.
    units = {(step.unit, one.body) for step in assembly_steps(car) if step.unit for one in step.adds}
    wiring = sum(mount.part == car.parts.wiring.name for mount in car.mounts)
    assert found.part == len(car.mounts) - screws - wiring + len(units)


def test_minutes_are_seconds_of_each_kind_at_the_pace_of_a_first_build() -> None:
    times = assembly_times()
    done = Operations(fold=10, screw=4)

    low, high = done.minutes_between

    seconds = 10 * times.fold_s.value + 4 * times.screw_s.value
    of_kinds = math.hypot(10 * times.fold_s.tolerance, 4 * times.screw_s.tolerance) / seconds
    share = math.hypot(times.pace.tolerance / times.pace.value, of_kinds)
    assert done.minutes == pytest.approx(seconds * times.pace.value / 60)
    assert (low, high) == pytest.approx((done.minutes * (1 - share), done.minutes * (1 + share)))
    assert Operations().minutes == 0


def test_the_published_car_of_95_mm_is_built_in_an_hour() -> None:
    published = Path(__file__).resolve().parents[2] / "patterns" / "published_cars.json"
    folded = folded_car(listed_family(published, "w95", [])[1].single())

    found = operations(folded, cut_car(folded, options("silhouette")))

    assert found.total <= 250
    assert found.minutes <= 60
