"""Masses and tracks of cars, recomputed from the parts' data files and the outlines of their film."""

import csv
import io
import math
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import foldcar
from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.placed import placed_faces
from foldcar.car.folded_car import folded_car
from foldcar.car.leads import leads, stock_wire_mm
from foldcar.car.parts.catalogue import OPTIONS, WITHOUT_DATA, Catalogue
from foldcar.car.variation import workshop_spreads
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_csv, parts_list_text, total_mass_kg
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.piece_shapes import piece_shapes
from foldcar.fabrication.patterns.sheets import cut_car
from part_data import DATA, number, part_data

CARS = ["W_B_W", "W_B_H_W", "W_B_W+film=0.19+tyre=silicone_band", "W_B+film=0.127+tyre=none+horn=disc"]


def film_mm2(car: FoldedCar) -> float:
    area = 0.0
    for piece in car.pieces:
        for face in piece.faces:
            area += piece.count * shapely.Polygon(face.outline_mm, [hole.outline_mm for hole in face.holes]).area
    return area


def leads_g(car: FoldedCar) -> float:
    """Servo extensions, and wire beyond that which the wiring's mass includes."""
    sold = {entry["name"]: entry["mass_kg"]["value"] for entry in part_data("extensions")["sold"]}
    more_mm = max(0.0, stock_wire_mm(leads(car)) - number("wiring", "wire_mm"))
    extensions = sum(sold[lead.extension] for lead in leads(car) if lead.extension)
    return 1e3 * extensions + more_mm * number("wiring", "wire_kg_m")


@pytest.mark.parametrize("type_string", CARS)
def test_cars_weigh_their_film_and_the_parts_of_the_data_files(type_string: str) -> None:
    design = compose(type_string, {"W.length": 100.0} if "H" in type_string else {})
    car, body = folded_car(design), body_json(design)
    chosen = design.choices
    wheels, boards = 2 * type_string.count("W"), 2
    film = f"film_{chosen.film}"
    tyre, radius, width = f"tyre_{chosen.tyre}", design.values["radius"], design.values["W.tire_thickness"]
    inner = radius - number(tyre, "thickness_mm")

    grams = {
        "film": film_mm2(car) * float(chosen.film) * number(film, "density_kg_m3") * 1e-6,
        "tyres": wheels * math.pi * (radius**2 - inner**2) * width * number(tyre, "density_kg_m3") * 1e-6,
        "servos": wheels * 9.0,
        "screws": 1e3 * 2 * wheels * number("screw", "mass_kg"),
        "horns": 1e3 * wheels * number(f"horn_{chosen.horn}", "mass_kg"),
        "wheel screws": 1e3 * 2 * wheels * number("horn_screw", "mass_kg"),
        "centre screws": 1e3 * wheels * number("centre_screw", "mass_kg"),
        "board screws": 1e3 * boards * number("board_screw", "mass_kg"),
        "spacers": 1e3 * boards * number("spacer", "mass_kg"),
        "battery": 1e3 * number(f"battery_{chosen.battery}", "mass_kg"),
        "electronics": 1e3 * sum(
            number(f"{key}", "mass_kg")
            for key in ("feather", "featherwing", "lipo", "pad", "board_pad", "switch", "switch", "wiring")
        ),
        "longer leads": leads_g(car),
    }  # fmt: skip
    simulated = sum(part["mass_kg"] for part in (*body["segments"], *body["wheels"]))

    assert simulated * 1e3 == pytest.approx(sum(grams.values()), rel=1e-6)
    assert total_mass_kg(parts_list(car)) == pytest.approx(simulated, rel=1e-6)


def test_the_parts_list_and_its_csv_count_what_is_put_in() -> None:
    car = folded_car(compose("W_B_W", {}))
    rows = {row.name: row.quantity for row in parts_list(car)}
    written = {row["part"]: row for row in csv.DictReader(io.StringIO(parts_list_csv(car)))}

    counted = Counter({part_data(name)["name"]: count for name, count in (
        ("servo", 4), ("screw", 8), ("horn_screw", 8), ("centre_screw", 4),
        ("board_screw", 2), ("spacer", 2), ("switch", 2), ("tyre_rubber_band", 4),
        ("board_pad", 1), ("horn_two_sided", 4),
    )})  # fmt: skip
    assert {name: rows.get(name) for name in counted} == counted
    assert {name: float(row["quantity"]) for name, row in written.items()} == pytest.approx(rows, rel=1e-5)
    assert float(written["FS90R servo"]["mass_g"]) == pytest.approx(36)
    assert part_data("tyre_none")["name"] not in {
        row.name for row in parts_list(folded_car(compose("W_B_W+tyre=none", {})))
    }


def test_the_parts_list_says_where_the_centre_of_mass_is() -> None:
    design = compose("W_B", {})
    body = body_json(design)
    (chassis,), wheels = body["segments"], body["wheels"]
    whole = chassis["mass_kg"] + sum(wheel["mass_kg"] for wheel in wheels)
    x = (chassis["mass_kg"] * chassis["com_x_m"] + sum(wheel["mass_kg"] * wheel["x_m"] for wheel in wheels)) / whole
    # Wheels' centres are at axle height, from which the chassis's is measured.
    z = chassis["mass_kg"] * chassis["com_z_m"] / whole + wheels[0]["radius_m"]
    side = "in front of" if x > 0 else "behind"

    text = parts_list_text(folded_car(design), "a car")

    assert f"is {abs(x) * 1e3:.0f} mm {side} the middle of the car's length, {z * 1e3:.0f} mm above the ground" in text


def test_every_data_file_is_used_and_every_number_has_a_source() -> None:
    used = {f"{kind}_{name}" for kind, names in OPTIONS.items() for name in names if kind not in WITHOUT_DATA}
    used |= set(Catalogue.model_fields) - set(OPTIONS)
    kept = {entry.name.removesuffix(".json") for entry in DATA.iterdir() if entry.name.endswith(".json")}

    named: set[str] = set()

    def check(value: Any, place: str) -> None:
        if isinstance(value, dict):
            if "tolerance" in value:
                assert value["tolerance"] >= 0 and len(value["source"]) > 5, place
            for key, inner in value.items():
                named.update([key] if isinstance(inner, dict) else [])
                check(inner, f"{place}.{key}")
        elif isinstance(value, list):
            for inner in value:
                check(inner, place)

    for name in kept:
        check(part_data(name), name)
    assert kept == used
    # What no class declares is named where it is used; these tell only where the servo, the switch are from.
    code = "".join(file.read_text() for file in (Path(foldcar.__file__).parent).rglob("*.py"))
    words = set(re.findall(r"\w+", code))
    assert named - words == {"body_depth_mm", "spline_teeth", "terminal_depth_mm"}


@pytest.mark.parametrize("width", [65.0, 180.0])
def test_parts_laid_into_their_outlines_move_the_centre_as_said_and_as_cars_vary(width: float) -> None:
    car, body = folded_car(compose("W_B_W", {"width": width})), body_json(compose("W_B_W", {"width": width}))
    whole = sum(part["mass_kg"] for part in (*body["segments"], *body["wheels"]))
    laid = sum(number(name, "mass_kg") for name in ("battery_4xaa_square", "pad", "lipo"))
    placing = number("assembly", "placement_mm") * laid / whole
    # The battery's mass and the switch's, at their distances from the middle of all, are most of the others.
    middle = sum(m.mass_kg * np.array(m.pose)[:3, 3] for m in car.mounts) / sum(m.mass_kg for m in car.mounts)
    weighed = np.zeros(3)
    for file in ("battery_4xaa_square", "switch", "feather", "featherwing"):
        part = part_data(file)
        at = sum(np.array(m.pose)[:3, 3] - middle for m in car.mounts if m.part == part["name"])
        weighed += (at * part["mass_kg"]["tolerance"] / whole) ** 2
    heights = part_data("pad")["height_mm"]["tolerance"], part_data("battery_4xaa_square")["height_mm"]["tolerance"] / 2
    high = math.hypot(*heights) * number("battery_4xaa_square", "mass_kg") / whole

    assert f"It moves by at most {placing:.1f} mm along and across the car" in parts_list_text(car, "a car")
    # Tolerances are two standard deviations; leads, which lie anywhere, add to them.
    for axis, other in (("x", placing), ("y", placing), ("z", high)):
        computed_m = math.hypot(other, math.sqrt(weighed["xyz".index(axis)])) / 2 * 1e-3
        assert 0.8 < workshop_spreads()[f"com_{axis}_m"].sd / computed_m < 2, axis


@pytest.mark.parametrize("type_string", ["W_B_W", "W_B_W+battery_place=roof", "W_B_W+battery=4xaa_flat", "W_B_H_W"])
def test_outlines_on_the_film_are_where_the_parts_lie(type_string: str) -> None:
    car = folded_car(compose(type_string, {"W.length": 130, "B.length": 120, "width": 110}))
    mounts = {mount.name: mount for mount in car.mounts}
    lying = {}
    for faces in placed_faces(car).values():
        for face in faces:
            lying |= {mark.name: face.in_car(mark.outline_mm) for mark in face.face.marks if mark.name in mounts}
            # Holes at the corners show what stands on the side without print.
            holes = {hole.name.rpartition(".")[2]: hole.center_mm for hole in face.face.holes if hole.kind == "mark"}
            for name in {name.partition(" corner ")[0] for name in holes}:
                lying[name] = face.in_car([at for hole, at in holes.items() if hole.startswith(f"{name} corner")])

    assert lying.keys() == {car.parts.lipo.name, car.parts.pad.name, car.parts.battery.name}
    for name, corners in lying.items():
        mount = mounts[name]
        center, half = np.array(mount.pose)[:3, 3], np.abs(np.array(mount.pose)[:3, :3]) @ np.array(mount.size_mm) / 2
        assert np.ptp(corners[:, 2]) < 1e-9
        assert corners[:, :2].min(axis=0) == pytest.approx((center - half)[:2])
        assert corners[:, :2].max(axis=0) == pytest.approx((center + half)[:2])


def test_sheets_have_the_corners_and_the_names_of_what_is_laid_on_the_film() -> None:
    car, chosen = folded_car(compose("W_B_W", {})), options("silhouette")
    # The arrow to the front, on the beam, has a tip and two corners behind it in two lines.
    for piece, names, other_lines in (("beam", ("lipo",), 2), ("floor doubler", ("pad", "battery_4xaa_square"), 0)):
        (flat,) = (flat for flat in cut_car(car, chosen).pieces if flat.name == piece)
        shapes, missing = piece_shapes(flat, chosen, join_marks(flat, car, car))
        lines = [shapely.LineString(shape.points_mm) for shape in shapes if shape.layer == "SCORE"]
        corners = [part for part in shapely.get_parts(shapely.line_merge(shapely.union_all(lines))) if part.length > 0]
        sizes = {(part_data(name)["length_mm"]["value"], part_data(name)["width_mm"]["value"]) for name in names}

        # Four corners of each outline; the beam has that of the doubler, too.
        assert missing == [] and len(corners) == 4 * (len(sizes) + (piece == "beam")) + other_lines
        middles = np.array([part.coords[1] for part in corners])
        apart = {tuple(sorted(np.round(np.abs(a - b), 2), reverse=True)) for a in middles for b in middles}
        assert {tuple(float(c) for c in size) for size in sizes} <= apart
        assert all(film_holds(flat.outline, line) for line in lines)


def film_holds(outline: shapely.Polygon, line: shapely.LineString) -> bool:
    """Whether a line is drawn on film, clear of cuts."""
    return bool(outline.buffer(-0.5).contains(line))
