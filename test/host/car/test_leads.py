"""Leads reach: their ways against a search of free ways, their lengths and extensions against the parts' data."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from foldcar.car.design import DesignError, compose
from foldcar.car.folded.model import FoldedCar, Mount
from foldcar.car.folded.placed import placed_faces
from foldcar.car.folded.pose import apply
from foldcar.car.folded.pose import compose as chain
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.verify import verify
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.wiring import wiring_drawing, wiring_text
from part_data import number, part_data
from published_cars import car

# Half the thickness of a servo's flat lead.
HALF_LEAD_MM = 0.6


def corners_mm(mount: Mount) -> Iterator[np.ndarray]:
    """The corners of the box around each of a part's solids, (8, 3) in mm in the car."""
    for solid in mount.shape:
        pose = np.array(chain(mount.pose, solid.pose))
        yield np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * solid.size_mm @ pose[:3, :3].T + pose[:3, 3]


def shortest_mm(car: FoldedCar, body: str, start: tuple[float, ...], end: tuple[float, ...]) -> float:
    """The length of the shortest way along x, y and z inside a body's walls that passes through no part's box.

    Such a way exists on the planes that touch the boxes and the ends (Dijkstra's algorithm on their grid).
    """
    faces = [face for face in placed_faces(car)[body] if face.face.role == "panel" and face.piece.name.startswith("beam")]
    walls = np.concatenate([face.corners_mm for face in faces])
    low, high = walls.min(axis=0) + 1, walls.max(axis=0) - 1
    blocks = []
    for mount in car.mounts:
        if mount.body == body and mount.part != car.parts.wiring.name:
            for corners in corners_mm(mount):
                blocks.append((corners.min(axis=0) - HALF_LEAD_MM + 0.01, corners.max(axis=0) + HALF_LEAD_MM - 0.01))
    lines = []
    for i in range(3):
        at = [edge[i] + sign * 0.02 for block in blocks for edge, sign in zip(block, (-1, 1), strict=True)]
        lines.append(np.unique([*(v for v in at if low[i] <= v <= high[i]), start[i], end[i], low[i], high[i]]))
    shape = tuple(len(line) for line in lines)
    number = np.arange(math.prod(shape)).reshape(shape)
    rows, columns, lengths = [], [], []
    for i in range(3):
        a, b = np.take(number, range(shape[i] - 1), i), np.take(number, range(1, shape[i]), i)
        free = np.ones(a.shape, dtype=bool)
        for block_low, block_high in blocks:
            # Edges whose middle lies inside a block pass it; those from the lead's own ends start on it.
            points = [lines[k] if k != i else (lines[k][1:] + lines[k][:-1]) / 2 for k in range(3)]
            inside = [(p > block_low[k]) & (p < block_high[k]) for k, p in enumerate(points)]
            free &= ~(inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :])
        step = np.diff(lines[i]).reshape([-1 if k == i else 1 for k in range(3)])
        rows.append(a[free])
        columns.append(b[free])
        lengths.append(np.broadcast_to(step, a.shape)[free])
    pairs = np.concatenate(rows), np.concatenate(columns)
    graph = coo_matrix((np.concatenate(lengths), pairs), shape=[number.size] * 2)
    ends = [number[tuple(int(np.argmin(np.abs(line - v))) for line, v in zip(lines, point, strict=True))]
            for point in (start, end)]  # fmt: skip
    return float(dijkstra(graph.tocsr(), directed=False, indices=ends[0])[ends[1]])


@pytest.mark.parametrize("name", ["w65", "six"])
def test_a_way_of_the_length_that_is_told_leads_from_every_servo_to_its_output_past_all_parts(name: str) -> None:
    folded = car(name)
    servo, wing = folded.parts.servo, folded.parts.featherwing
    board = next(m for m in folded.mounts if m.part == wing.name)
    mounts = {mount.name: mount for mount in folded.mounts}
    way_mm_of = {lead.start: lead.way_mm for lead in leads(folded)}
    for axle in folded.axles:
        # The lead leaves the end that is nearer to the shaft, 4.8 mm above the bottom, which lies inside.
        exit_mm = apply(mounts[axle.servo].pose, -servo.length_mm.value / 2 - 0.7, 0.0, servo.depth_mm.value / 2 - 4.8)
        assert abs(exit_mm[0] - axle.center_mm[0]) == pytest.approx(servo.axis_from_end_mm.value + 0.7)
        x, y = wing.outputs.at_mm[axle.channel]
        up = wing.plug_top_mm.value + wing.plug_bend_mm.value - wing.height_mm.value / 2
        plug = apply(board.pose, x, y, up + 0.7)

        free = shortest_mm(folded, "segment0", exit_mm, plug)

        # The slack, 10 % and 15 mm, takes what parts are in the way.
        assert way_mm_of[axle.servo] - 2 < free < way_mm_of[axle.servo] * 1.1 + 2, (axle.servo, free)


def test_a_lead_over_a_hinge_is_long_enough_at_the_hinge_s_limits() -> None:
    folded = car("hinged")
    lead = {lead_.start: lead_ for lead_ in leads(folded)}["axle 2 left servo"]
    # Slits are at the caps' middles, 24.875 mm above the floor, where the hinge is; caps stand 6 mm apart.
    hinge, height = folded.hinges[0], 24.875 + 0.25
    assert hinge.min_rad == pytest.approx(-math.radians(60))
    angle = 2 * math.atan2(3, height) + math.radians(60)
    gap = 2 * math.hypot(3, height) * math.sin(angle / 2)
    mounts = {mount.name: mount for mount in folded.mounts}
    servo, board = folded.parts.servo, next(m for m in folded.mounts if m.part == folded.parts.featherwing.name)
    start = np.array(apply(mounts["axle 2 left servo"].pose, -servo.length_mm.value / 2, 0.0, 22 / 2 - 4.8))
    end = np.array(apply(board.pose, *folded.parts.featherwing.outputs.at_mm[2], 18.2 + 4 - 10.1 / 2))
    slits = np.array([[hinge.center_mm[0] + dx, 0.0, 0.0] for dx in (-3, 3)])
    along = np.abs(start - slits[0]).sum() + gap + np.abs(end - slits[1]).sum()

    assert lead.way_mm == pytest.approx(along, abs=0.5)
    assert lead.needed_mm == pytest.approx(lead.way_mm * 1.1 + 15 + 15 + 14)


def test_an_extension_is_the_shortest_that_reaches_with_the_least_lengths_of_both() -> None:
    sold = part_data("extensions")["sold"]
    lengths = [
        (entry["name"], 250 - 10 + entry["length_mm"]["value"] - entry["length_mm"]["tolerance"] - 6) for entry in sold
    ]
    for length in (80.0, 200.0, 320.0, 400.0):
        for lead in leads(folded_car(compose("W_B_W", {"width": 200, "B.length": length, "W.length": 100}))):
            if lead.start.endswith("servo"):
                expected = next(name for name, reach in [("", 240), *lengths] if reach >= lead.needed_mm)
                assert lead.extension == expected


def test_extensions_are_bought_plugged_in_drawn_and_find_room() -> None:
    design = compose("W_B_W", {"width": 95, "W.length": 60, "B.length": 400})
    folded = folded_car(design)
    added = [m for m in folded.mounts if m.name.startswith("extension of ")]
    rows = {row.name: row for row in parts_list(folded)}
    text = wiring_text(folded, "a car")

    assert verify(design).findings == ()
    assert sorted(m.part for m in added) == ["servo extension, 150 mm"] * 2 + ["servo extension, 300 mm"] * 2
    assert rows["servo extension, 300 mm"].quantity == 2
    assert rows["servo extension, 300 mm"].mass_kg == pytest.approx(2 * 0.0042)
    assert rows["servo extension, 300 mm"].cost_usd == pytest.approx(2 * 2.0)
    assert f"| {folded.parts.featherwing.name} 1 | 336 | 399 | 524 | with servo extension, 300 mm |" in text
    assert wiring_drawing(folded, "a car").count(">300 mm<") == 2
    step = next(step for step in assembly_steps(folded) if step.title == "Plug all wires in")
    assert {add.name for add in step.adds if add.way_mm} == {m.name for m in added}


def test_wire_is_lengthened_by_solder_and_weighs_and_costs_what_it_is_long() -> None:
    folded = folded_car(compose("W_B_W", {"width": 95, "W.length": 60, "B.length": 400}))
    lead_of = {lead.start: lead for lead in leads(folded)}
    battery = folded.parts.battery.name
    cut_mm = max(0, lead_of[f"{battery} +"].needed_mm - 130) + max(0, lead_of[f"{battery} -"].needed_mm - 130)
    cut_mm += sum(lead_of[name].needed_mm for name in ("servo switch 2", "board switch 1", "board switch 2"))
    more_m = (cut_mm - number("wiring", "wire_mm")) / 1000
    row = next(row for row in parts_list(folded) if row.name == folded.parts.wiring.name)

    assert more_m > 0.2
    assert row.mass_kg == pytest.approx(number("wiring", "mass_kg") + more_m * number("wiring", "wire_kg_m"))
    assert row.cost_usd == pytest.approx(number("wiring", "cost_usd") + more_m * number("wiring", "wire_usd_m"))
    missing = math.ceil((lead_of[f"{battery} +"].needed_mm - 130) / 5) * 5
    assert f"solder {missing} mm of wire to it" in wiring_text(folded, "a car")


def test_a_battery_s_leads_reach_while_it_is_out_of_the_car() -> None:
    folded = folded_car(compose("W_B_W", {"width": 95}))
    battery = next(m for m in folded.mounts if m.part == folded.parts.battery.name)
    minus = next(lead for lead in leads(folded) if lead.start == f"{battery.name} -")
    board = next(m for m in folded.mounts if m.part == folded.parts.featherwing.name)
    (x, y, z), size = folded.parts.featherwing.terminal_block.at_mm, folded.parts.featherwing.terminal_block.size_mm
    block = np.array(apply(board.pose, x, y + size[1] / 2, z - board.size_mm[2] / 2))
    # Its left end, with its bottom as high as the walls, 24.875 mm above the axles.
    middle = np.array([row[3] for row in battery.pose[:3]])
    end = middle + np.array((0, 58 / 2, 24.875 - (middle[2] - battery.size_mm[2] / 2)))

    assert minus.leaves == "left"
    assert minus.way_mm == pytest.approx(np.abs(end - block).sum(), abs=0.3)


def test_a_car_for_which_no_extension_is_long_enough_is_refused() -> None:
    with pytest.raises(DesignError, match=r"rear left servo must be 1\d\d\d mm long, but is 1214 mm with the longest"):
        folded_car(compose("W_B_B_B_W", {"B.length": 400.0, "W.length": 400.0}))
