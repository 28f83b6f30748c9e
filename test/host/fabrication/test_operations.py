"""What a person does to build a car is counted once, step by step, and its time follows from the times of its kinds."""

import math
from collections import Counter
from dataclasses import replace

import pytest
import shapely

import published_cars
from foldcar.car.folded.model import FoldedCar
from foldcar.car.leads import leads
from foldcar.car.proof.prove import assembly_steps
from foldcar.fabrication.assembly.operations import (
    Operations,
    is_screw,
    kinds,
    operations,
    operations_of_sheets,
)
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.flat_piece import FlatPiece
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheet_files import svg
from foldcar.fabrication.patterns.sheets import cut_car, pattern_of


@pytest.fixture(scope="module", params=["four wheels", "three segments"])
def car(request: pytest.FixtureRequest) -> FoldedCar:
    return published_cars.car("w95" if request.param == "four wheels" else "hinged")


def test_steps_put_every_copy_and_part_in_once_and_make_every_join(car: FoldedCar) -> None:
    steps = assembly_steps(car)

    added = Counter((add.kind, add.name, add.copy) for step in steps for add in step.adds if add.kind != "unit")
    joined = Counter(number for step in steps for number in step.joins)
    closed: dict[str, dict[str, float]] = {}
    for step in steps:
        for name, folds in step.folds.items():
            closed.setdefault(name, {}).update(folds)
    units = Counter((step.unit, add.body) for step in steps if step.unit for add in step.adds)
    placed = {(add.name, add.body) for step in steps for add in step.adds if add.kind == "unit"}

    assert added == Counter(
        [("piece", placed.piece, placed.copy) for placed in car.placed]
        + [("mount", mount.name, 0) for mount in car.mounts]
    )
    assert joined == dict.fromkeys({join.number for join in car.joins}, 1)
    for piece in car.pieces:
        for crease in piece.creases:
            assert closed.get(piece.name, {}).get(crease.name) == 1.0 or crease.flexure or not crease.angle_rad
    assert set(units) == placed


def test_operations_are_those_of_pieces_joins_parts_and_wires(car: FoldedCar) -> None:
    parts = cut_car(car, options("laser"))
    cut, wheels = parts.car, len(car.axles)

    work = operations(car, parts)

    of_wheels = {placed.piece for placed in car.placed if placed.body.startswith("wheel")}
    joins: Counter[str] = Counter()
    for join in cut.joins:
        joins[join.kind] += wheels if join.piece_a in of_wheels else 1
    screws = sum(is_screw(car.parts, mount) for mount in car.mounts)
    assert work.piece == sum(piece.count for piece in cut.pieces)
    # The LiPo lies on a strip of tape.
    assert work.tape == sum(joins[kind] for kind in ("lap", "tab", "laminate")) + 1
    assert work.tongue == joins["tab_slot"] + joins["lock"] + joins["rim"]
    assert work.screw == screws
    # Two at each servo and at the boards; those of horns have none.
    assert work.nut == 2 * wheels + 2
    # The battery's lead is soldered to the switch, and all wires of board switch and options.
    assert work.plug == sum(wire.carries in ("signal", "supply", "stack") for wire in car.wires) - 1
    # Both boards have rows of 16 and 12 pins, the wing eight outputs of three pins and two terminals; two wires are
    # soldered to the Feather, and to each switch; the fuse has two ends; a short lead is longer by one joint.
    longer = sum(lead.kind == "solder" and lead.missing_mm > 0 for lead in leads(car))
    assert work.joint == 2 * (16 + 12) + 8 * 3 + 2 + 2 + 2 * 2 + 2 + longer
    # A wheel is put on as one, and so is every other unit but a cap, which counts by its tape.
    units = {(step.unit, add.body) for step in assembly_steps(car) if step.unit for add in step.adds}
    wiring = sum(mount.part == car.parts.wiring.name for mount in car.mounts)
    caps = sum(" cap" in unit for unit, _ in units)
    assert caps == 1 and work.part == len(car.mounts) - screws - wiring + len(units) - caps


@pytest.mark.parametrize("car", ["four wheels"], indirect=True)
def test_openings_weeded_are_the_closed_inner_contours_of_the_sheets(
    car: FoldedCar, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The first layout does: where pieces lie changes no opening.
    monkeypatch.setattr(nesting, "MAX_TRIES", 0)
    chosen = options("scissors")
    cut = cut_car(car, chosen)
    sheets = pattern_of(cut, chosen, "a car").sheets

    inside = 0
    for text in (svg(sheet).split("<g id=") for sheet in sheets):
        inner = next((group for group in text if group.startswith('"CUT_INNER"')), "")
        inside += inner.count("<circle") + inner.count("z")

    assert inside > 40
    assert operations_of_sheets(cut).weed == operations(car, cut).weed == inside


def protrusions(flat: FlatPiece) -> int:
    """What stands out of a piece that is nowhere else narrower than 10.4 mm: its hooks and tongues."""
    whole = shapely.Polygon(flat.outline.exterior)
    outside = whole.difference(whole.buffer(-5.2, join_style="mitre").buffer(5.2 + 1e-6, join_style="mitre"))
    return sum(part.area > 3 for part in shapely.get_parts(outside))


def test_every_hook_and_tongue_on_the_sheets_is_counted() -> None:
    """By the pieces' outlines, which know nothing of joins."""
    car = published_cars.car("w95")
    cut = cut_car(car, options("silhouette"))

    of_wheels = {piece.name: protrusions(piece) for piece in cut.pieces if piece.name.startswith("wheel")}
    beam = next(piece for piece in cut.pieces if piece.name == "beam")
    # The lid's locks and the bridge's tongue go through slots so narrow that nothing but film passes.
    narrow = sum(shapely.Polygon(ring).buffer(-0.3).is_empty for ring in beam.outline.interiors)

    # Three hooks on a hub; four hooks and a tongue on a rim's half.
    assert {name: count for name, count in of_wheels.items() if count} == {
        "wheel hub": 3, "wheel rim 1": 5, "wheel rim 2": 5,
    }  # fmt: skip
    on_wheels = sum(piece.count * of_wheels.get(piece.name, 0) for piece in cut.pieces)
    assert operations(car, cut).tongue == on_wheels + narrow == 52 + 3


def test_minutes_are_seconds_of_each_kind_at_the_pace_of_a_first_build() -> None:
    times = kinds()
    done = Operations(fold=10, screw=4)

    low, high = done.minutes_between

    seconds = 10 * times["fold"].value + 4 * times["screw"].value
    of_kinds = math.hypot(10 * times["fold"].tolerance, 4 * times["screw"].tolerance) / seconds
    share = math.hypot(times["pace"].tolerance / times["pace"].value, of_kinds)
    assert done.minutes == pytest.approx(seconds * times["pace"].value / 60)
    assert (low, high) == pytest.approx((done.minutes * (1 - share), done.minutes * (1 + share)))
    assert Operations().minutes == 0


def test_the_published_car_of_95_mm_is_built_in_an_hour_and_soldered_in_twenty_minutes() -> None:
    folded = published_cars.car("w95")

    work = operations(folded, cut_car(folded, options("silhouette")))

    assert work.total - work.joint <= 222
    assert replace(work, joint=0).minutes <= 61 and work.minutes <= 80
    # Weeding is told apart, its minutes are not.
    seconds = work.weed * kinds()["weed"].value * kinds()["pace"].value
    assert work.total == sum(work.counts.values()) - work.weed
    assert replace(work, weed=0).minutes == pytest.approx(work.minutes - seconds / 60)
