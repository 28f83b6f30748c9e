"""Films of PET, card and polypropylene: the whole chain follows the film, and what it is not fit for is refused."""

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foldcar.car.body import body_json
from foldcar.car.design import DesignError, compose
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import OPTIONS
from foldcar.car.verify import verify
from foldcar.cli import app
from foldcar.fabrication.assembly.faces import piece_area_mm2
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_csv, parts_list_text
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.cutting import how_to_cut
from foldcar.fabrication.patterns.options import MACHINES, OptionError, options
from foldcar.fabrication.patterns.sheets import cut_car, pattern
from foldcar.simulation.results import NATIVE_OUTCOMES
from part_data import part_data

HINGED = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}


@pytest.mark.parametrize("film", ["0.127", "card_160", "pp_0.8"])
def test_cars_of_every_film_pass_all_checks_and_follow_its_numbers(film: str) -> None:
    design, number = compose(f"W_B_H_W_H_W+film={film}", HINGED), part_data(f"film_{film}")
    thick, modulus = number["thickness_mm"]["value"], number["youngs_modulus_pa"]["value"]
    car, body = folded_car(design), body_json(design)

    if film != "0.127":
        assert verify(design).findings == ()
    slots = [hole for piece in car.pieces for face in piece.faces for hole in face.holes if "lock slot" in hole.name]
    for hole in slots:
        ys = [y for _, y in hole.outline_mm]
        assert max(ys) - min(ys) == pytest.approx(thick + 0.3)
    # A strip as wide as the body's walls are apart outside, bent to an arc: E w t³ / 12 l, in SI units.
    width_m, length_m = 0.095, design.values["H.length"] * 1e-3
    stiffness = modulus * width_m * (thick * 1e-3) ** 3 / 12 / length_m
    assert body["hinges"][0]["stiffness_n_m_rad"] == pytest.approx(stiffness, rel=0.01)
    volume_mm3 = sum(p.count * piece_area_mm2(p) * p.thickness_mm for p in car.pieces)
    mass_g = volume_mm3 * number["density_kg_m3"]["value"] * 1e-6
    (row,) = (row for row in parts_list(car) if row.name.startswith(number["name"]))
    assert row.mass_kg * 1e3 == pytest.approx(mass_g) and len(slots) > 0
    assert body["segments"][0]["grip"] == pytest.approx(number["friction"]["value"] / 0.6)
    # No strip is bent below the radius at which the film keeps a crease.
    least = number["least_bend_radius_mm"]["value"]
    assert design.values["H.length"] / math.radians(design.values["H.fold_down"]) >= least - 1e-9


@pytest.mark.usefixtures("carsim_binary")
def test_cars_of_other_films_drive_in_the_simulator() -> None:
    listing = Path(__file__).parents[3] / "scenarios/width_study.json"

    words = ["--experiment", "1", "--set", "width=95", "--set", "film=pp_0.8", "--json"]
    done = CliRunner().invoke(app, ["run", str(listing), *words])

    result = json.loads(done.output)
    assert result["vehicle_type"] == "W_B_W+film=pp_0.8" and result["outcome"] in NATIVE_OUTCOMES
    assert result["metrics"]["consumed_energy_j"] > 0


@pytest.mark.parametrize(
    ("film", "values", "message"),
    [
        ("card_300", {"H.length": 6.0}, r"H.length: 6 is below the minimum 9.949 \(card 0.38 mm bent by 60° on 9.5 mm\)"),
        ("0.25", {"H.thickness": 0.3}, r"0.3 is not sold; the nearest size is 0.25 \(sizes: 0.127, 0.19, 0.25\)"),
        ("pp_0.5", {"H.thickness": 0.25}, "H.thickness: 0.25 is below the minimum 0.5"),
    ],
)
def test_what_a_film_is_not_fit_for_is_refused(film: str, values: dict[str, float], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        folded_car(compose(f"W_B_H_W_H_W+film={film}", HINGED | values))


def test_a_machine_that_does_not_cut_the_film_is_refused(tmp_path: Path) -> None:
    folded = folded_car(compose("W_B_W+film=pp_0.8", {}))
    for machine in ("silhouette", "cricut"):
        with pytest.raises(OptionError, match=f"{machine}: does not cut polypropylene sheet 0.8 mm; only laser or"):
            cut_car(folded, options(machine))
    assert cut_car(folded, options("laser")).pieces
    # How every other pair is done is said.
    for film in OPTIONS["film"]:
        assert set(part_data(f"film_{film}")["cutting"]) == set(MACHINES)

    done = CliRunner().invoke(app, ["pattern", "patterns/published_cars.json", "--vehicle", "w95", "--set", "film=pp_0.8",
                                    "-o", str(tmp_path / "car")])  # fmt: skip
    assert isinstance(done.exception, OptionError) and not (tmp_path / "car").exists()


def test_a_hinge_of_another_film_has_its_own_sheet_and_is_bought(monkeypatch: pytest.MonkeyPatch) -> None:
    # The first layout is as good as the best here.
    monkeypatch.setattr(nesting, "MAX_TRIES", 0)
    folded = folded_car(compose("W_B_H_W", {"W.length": 100, "H.thickness": 0.127}))
    made = pattern(folded, options("laser"), "a car")
    *others, last = made.sheets
    strips = sum(piece.count for piece in folded.pieces if piece.thickness_mm == 0.127)

    assert {sheet.film for sheet in others} == {"PET film 0.25 mm"} and last.film == "PET film 0.127 mm"
    assert sum(shape.layer == "CUT_OUTER" for shape in last.shapes) == strips == 1
    rows = {row["part"]: row for row in csv.DictReader(io.StringIO(parts_list_csv(folded, made.sheets)))}
    # Whole sheets, at 15 and 8 USD/m².
    sheet_m2 = 0.6 * 0.4
    assert float(rows["PET film 0.25 mm"]["cost_usd"]) == pytest.approx(len(others) * sheet_m2 * 15, abs=0.01)
    assert float(rows["PET film 0.127 mm"]["cost_usd"]) == pytest.approx(sheet_m2 * 8, abs=0.01)
    assert "Film: PET film 0.25 mm, PET film 0.127 mm" in how_to_cut(made, "")
    by_hand = replace(made, options=options("scissors"))
    assert "|LightBurn|" in how_to_cut(made, "") and "LightBurn" not in how_to_cut(by_hand, "")
    page = how_to_cut(replace(made, title="a [b](c)"), "foldcar pattern 'x\n# y'")
    assert "# How to cut a \\[b\\](c)\n" in page and "\n    foldcar pattern 'x # y'\n" in page


def test_the_parts_list_says_what_is_curled_and_how_long_tyres_are() -> None:
    folded = folded_car(compose("W_B_H_W", {"W.length": 100, "radius": 50}))
    text = parts_list_text(folded, "a car")
    cells = [line.split("|") for line in text.splitlines()]
    bent = {row[1].strip(): row[-2].strip() for row in cells if len(row) == 7}

    assert bent["wheel rim 1"] == "curl, do not crease" and bent["wheel hub"] == "3"
    assert bent["beam 1"] == "7" and bent["hinge strip"] == "0 and a hinge: do not crease that"
    # A strip of that size has the tyre's volume.
    tyre = folded.parts.tyre
    (note,) = (row.note for row in parts_list(folded) if row.name == tyre.name)
    length, width = (float(word) for word in note.rpartition("a strip of ")[2].split(" mm")[0].split(" x "))
    volume_m3 = length * width * tyre.thickness_mm.value * 1e-9
    assert volume_m3 * tyre.density_kg_m3.value == pytest.approx(tyre.mass_kg(50, 12), rel=0.003)
