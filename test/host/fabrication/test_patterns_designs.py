"""The designs in patterns/ are cars that can be built, on the sheets in patterns/sheets."""

import math
import sys
from pathlib import Path

import pytest

from conftest import PROJECT
from foldcar.car.design import compose
from foldcar.car.folded_car import folded_car
from foldcar.car.verify import verify
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.piece_shapes import narrowest_film, piece_shapes
from foldcar.fabrication.patterns.sheets import cut_car, enlarge_sheet
from published_cars import PATTERNS, PUBLISHED, car, design, designs
from sheet_reader import check_same, check_sheet, read_svg

sys.path.insert(0, str(PROJECT / "tools"))
from golden_sheets import SHEETS, cars, sheets_of

FILES = sorted(PATTERNS.glob("*.json"))


# One of each film and machine; the others differ in width.
QUICK = ("w95", "six", "hinged")


@pytest.mark.parametrize(
    "vehicle", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in cars()]
)
def test_the_sheets_are_those_that_are_kept(vehicle: str) -> None:
    made = {f"{sheet.name}.svg": sheet for sheet in sheets_of(vehicle)}

    kept = {file.name: read_svg(file.read_text(encoding="utf-8")) for file in (SHEETS / vehicle).iterdir()}
    assert sorted(kept) == sorted(made)
    margin_mm = options(cars()[vehicle]["machine"]).margin_mm
    findings = {name: check_same(made[name], kept[name]) + check_sheet(kept[name], margin_mm) for name in kept}
    assert not any(findings.values()), findings
    shapes = [sheet.shapes for sheet in made.values()]
    assert all(any(math.isclose(s.length_mm, 100) for s in shape if s.layer == "LABEL") for shape in shapes)
    assert any(s.layer == "QR_CODE" for shape in shapes for s in shape)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_design_passes_the_verification(file: Path) -> None:
    assert {name: verify(design).findings for name, design in designs(file).items()} == dict.fromkeys(designs(file), ())


@pytest.mark.parametrize(("name", "sheet"), [("w95", "12in"), ("six", "12x24in")])
def test_a_car_takes_the_smallest_of_a_machines_sheets_that_holds_its_pieces(name: str, sheet: str) -> None:
    assert enlarge_sheet(folded_car(design(name)), options("cricut")).sheet == sheet


def test_the_published_cars_are_there() -> None:
    published = designs(PUBLISHED).values()

    assert [car.values["width"] for car in published] == [65, 95, 115, 180]
    assert {(car.length_mm, car.values["radius"]) for car in published} == {(200, 60)}


@pytest.mark.parametrize(("name", "film"), [("w95", ""), ("six", ""), ("hinged", ""), ("w65", "+film=pp_0.5")])
def test_pieces_have_room_for_their_labels_and_no_film_that_may_tear(name: str, film: str) -> None:
    listed, chosen = design(name), options("silhouette")
    cut = cut_car(folded_car(compose(listed.type + film, listed.values)), chosen)

    for flat in cut.pieces:
        for turn in range(4):
            assert piece_shapes(flat, chosen, join_marks(flat, cut.car, cut.unsplit_car), turn)[1] == []
    films = [film for flat in cut.pieces if (film := narrowest_film(flat, chosen)) is not None]
    assert not any(film.narrow for film in films)
    # The film around a servo's notches: 1 mm, as between a fold's cuts, is enough.
    assert 1.09 < min(film.width_mm for film in films) < 1.11


def test_numbers_of_layers_stand_where_the_layers_lie() -> None:
    folded = car("hinged")
    cut = cut_car(folded, options("silhouette"))
    numbers = {join.piece_a: str(join.number) for join in folded.joins if join.kind == "laminate"}

    doublers, strips = 0, {}
    for flat in (flat for flat in cut.pieces if flat.name.startswith("beam")):
        openings = [ring for face in flat.faces for name, ring in face.holes.items() if name.endswith("wall opening")]
        (floor,) = (face for face in flat.faces if face.name.endswith("floor"))
        for mark in join_marks(flat, cut.car, cut.unsplit_car):
            if mark.text == numbers["servo doubler"]:
                assert any(set(mark.edges) <= set(ring) for ring in openings)
                doublers += 1
            elif mark.text == numbers["hinge strip"]:
                low, _, high, _ = floor.outline.bounds
                ends = [x for edge in mark.edges for x, _ in edge]
                # Glued 10 mm wide along the segment's end.
                assert max(ends) < low + 10.5 or min(ends) > high - 10.5
                strips[flat.label] = strips.get(flat.label, 0) + 1

    assert doublers == len(folded.axles)
    assert strips == {"beam 1": 1, "beam 2": 2, "beam 3": 1}
