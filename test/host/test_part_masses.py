"""Masses and tracks of cars, recomputed from the parts' data files and the outlines of their film."""

import json
import math
from collections import Counter
from importlib.resources import files
from typing import Any

import pytest
import shapely

from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import FILES
from foldcar.car.parts.choices import OPTIONS
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_text, total_mass_kg

DATA = files("foldcar.car.parts").joinpath("data")
CARS = ["W_B_W", "W_B_H_W", "W_B_W+film=0.19+tyre=silicone_band", "W_B+film=0.127+tyre=none+horn=disc"]


def data(name: str) -> dict[str, Any]:
    return json.loads(DATA.joinpath(name).read_text())


def number(name: str, key: str) -> float:
    return data(name)[key]["value"]


def film_mm2(car: FoldedCar) -> float:
    area = 0.0
    for piece in car.pieces:
        for face in piece.faces:
            area += piece.count * shapely.Polygon(face.outline_mm, [hole.outline_mm for hole in face.holes]).area
    return area


@pytest.mark.parametrize("type_string", CARS)
def test_cars_weigh_their_film_and_the_parts_of_the_data_files(type_string: str) -> None:
    design = compose(type_string, {"W.length": 100.0} if "H" in type_string else {})
    car, body = folded_car(design), body_json(design)
    chosen = design.choices
    wheels, boards = 2 * type_string.count("W"), 2
    film = OPTIONS["film"][chosen.film]
    tyre, radius, width = OPTIONS["tyre"][chosen.tyre], design.values["radius"], design.values["W.tire_thickness"]
    inner = radius - number(tyre, "thickness_mm")

    grams = {
        "film": film_mm2(car) * float(chosen.film) * number(film, "density_kg_m3") * 1e-6,
        "tyres": wheels * math.pi * (radius**2 - inner**2) * width * number(tyre, "density_kg_m3") * 1e-6,
        "servos": wheels * 9.0,
        "screws": 1e3 * 2 * wheels * number("screw_m2.json", "mass_kg"),
        "horns": 1e3 * wheels * number(OPTIONS["horn"][chosen.horn], "mass_kg"),
        "wheel screws": 1e3 * 2 * wheels * number("screw_horn.json", "mass_kg"),
        "centre screws": 1e3 * wheels * number("screw_centre.json", "mass_kg"),
        "board screws": 1e3 * boards * number("screw_board.json", "mass_kg"),
        "spacers": 1e3 * boards * number("spacer.json", "mass_kg"),
        "battery": 1e3 * number(OPTIONS["battery"][chosen.battery], "mass_kg"),
        "electronics": 1e3 * sum(
            number(FILES[key], "mass_kg")
            for key in ("feather", "featherwing", "lipo", "pad", "board_pad", "switch", "wiring")
        ),
    }  # fmt: skip
    simulated = sum(part["mass_kg"] for part in (*body["segments"], *body["wheels"]))

    assert simulated * 1e3 == pytest.approx(sum(grams.values()), rel=1e-6)
    assert total_mass_kg(parts_list(car)) == pytest.approx(simulated, rel=1e-6)


def test_the_parts_list_counts_what_is_put_in() -> None:
    car = folded_car(compose("W_B_W", {}))
    rows = {row.name: row.quantity for row in parts_list(car)}

    counted = Counter({data(name)["name"]: count for name, count in (
        ("fs90r.json", 4), ("screw_m2.json", 8), ("screw_horn.json", 8), ("screw_centre.json", 4),
        ("screw_board.json", 2), ("spacer.json", 2), ("switch.json", 1), ("tyre_rubber_band.json", 4),
        ("board_pad.json", 1), ("horn_two_sided.json", 4),
    )})  # fmt: skip
    assert {name: rows.get(name) for name in counted} == counted
    assert data("tyre_none.json")["name"] not in {
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


@pytest.mark.parametrize("width", [65.0, 95.0, 115.0, 180.0])
def test_tracks_are_those_of_the_servos_drawing(width: float) -> None:
    # The ears' undersides lie on the walls; the spline reaches into the horn, whose outer face carries the wheel.
    horn = "horn_two_sided.json"
    outer_face = number("fs90r.json", "spline_top_mm") - number(horn, "spline_depth_mm") + number(horn, "height_mm")
    out = outer_face - number("fs90r.json", "ear_underside_mm")

    body = body_json(compose("W_B_W", {"width": width}))

    assert outer_face == pytest.approx(32.0)
    assert body["track_m"] * 1e3 == pytest.approx(width + 2 * out + 12.0, abs=0.3)


def test_every_data_file_is_used_and_every_number_has_a_source() -> None:
    used = set(FILES.values()) | {name for names in OPTIONS.values() for name in names.values()} - {""}
    kept = {entry.name for entry in DATA.iterdir() if entry.name.endswith(".json")}

    def check(value: Any, place: str) -> None:
        if isinstance(value, dict):
            if "tolerance" in value:
                assert value["tolerance"] >= 0 and len(value["source"]) > 5, place
            for key, inner in value.items():
                check(inner, f"{place}.{key}")
        elif isinstance(value, list):
            for inner in value:
                check(inner, place)

    for name in kept:
        check(data(name), name)
    assert kept == used
