"""Choices of parts: in a type string, in a listing, with --set; what follows from them; mistakes."""

import json
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foldcar.car.body import body_json
from foldcar.car.design import DesignError, compose
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, OPTIONS, catalogue_of, split_type
from foldcar.cli import app
from foldcar.study.family import read_family
from foldcar.study.listing import ListingError
from foldcar.study.listing_file import read_listing
from part_data import number


def listing(folder: Path, vehicle: dict[str, object]) -> Path:
    file = folder / "cars.json"
    file.write_text(json.dumps({"vehicles": {"1": {"type": "W_B_W", **vehicle}}}))
    return file


def test_every_choice_has_data_and_its_type_string_names_it_again() -> None:
    for choices in (DEFAULT_CHOICES.changed({kind: name}) for kind, names in OPTIONS.items() for name in names):
        assert catalogue_of(choices).film.thickness_mm.value == number(f"film_{choices.film}", "thickness_mm")
        assert split_type(f"W_B_W{choices.suffix}") == ("W_B_W", choices)
    assert DEFAULT_CHOICES.suffix == ""


def test_a_tyre_grips_in_proportion_to_the_default_one_and_the_belly_as_ever() -> None:
    bodies = {tyre: body_json(compose(f"W_B_W+tyre={tyre}", {})) for tyre in OPTIONS["tyre"]}

    # Published: PET on PET 0.35; a scene's friction is that of the default tyre, 0.6.
    assert bodies["rubber_band"]["wheels"][0]["grip"] == 1.0
    assert bodies["none"]["wheels"][0]["grip"] == pytest.approx(0.35 / 0.6)
    assert bodies["silicone_band"]["wheels"][0]["grip"] == pytest.approx(0.8 / 0.6)
    assert [body["segments"][0]["grip"] for body in bodies.values()] == pytest.approx([0.35 / 0.6] * len(bodies))
    # Without a tyre it is the film that grips.
    for film in ("card_160", "pp_0.5"):
        (grip,) = {wheel["grip"] for wheel in body_json(compose(f"W_B_W+film={film}+tyre=none", {}))["wheels"]}
        assert grip == pytest.approx(number(f"film_{film}", "friction") / 0.6)


def test_named_cells_sag_and_cars_without_a_name_for_theirs_stay_as_they_were(carsim_binary: Path) -> None:
    bodies = {cells: body_json(compose(f"W_B_W+cells={cells}", {})) for cells in OPTIONS["cells"]}
    six_wheels = body_json(compose("W_B_W_B_W+cells=alkaline", {}))

    assert bodies["unnamed"] == body_json(compose("W_B_W", {})) and "supply_resistance_ohm" not in bodies["unnamed"]
    assert [body["supply_v"] for body in bodies.values()] == [5.2, 4.9, 5.8]
    assert [bodies[cells]["supply_resistance_ohm"] for cells in ("nimh", "alkaline")] == [0.25, 0.9]
    # The simulator's limit: cells of 5.8 V whose voltage six stalled servos halve.
    stall_a = sum(wheel["servo"]["stall_current_a"] for wheel in six_wheels["wheels"])
    assert six_wheels["supply_resistance_ohm"] == pytest.approx(2.9 / stall_a, rel=0.01)
    lines = [json.dumps({"body": {"id": name, **body}}) for name, body in (*bodies.items(), ("six", six_wheels))]
    answer = subprocess.run([carsim_binary, "batch"], input="\n".join(lines), capture_output=True, text=True, check=True)
    assert answer.stdout == ""


def test_a_listing_and_the_command_line_choose_the_same_parts(tmp_path: Path) -> None:
    file = listing(tmp_path, {"parts": {"tyre": "none", "film": 0.19}, "params": [{"common": {"width": 95}}]})

    family = read_family(file, "1", read_listing(file)[0].vehicles["1"])

    assert family.vehicle_type == family.single().type == "W_B_W+film=0.19+tyre=none"
    assert compose(family.vehicle_type, {"width": 95.0}) == family.single()
    usual = family.narrowed({"tyre": "rubber_band", "film": "0.25"})
    assert usual.vehicle_type == "W_B_W" and usual.single() == compose("W_B_W", {"width": 95.0})
    done = CliRunner().invoke(
        app, ["model", str(file), "--vehicle", "1", "--set", "tyre=grip_tape", "--to", "urdf", "-o", str(tmp_path)]
    )
    assert done.exit_code == 0 and (tmp_path / "Foldcar1_tyre_grip_tape.urdf").exists()


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"tyre": "nune"}, 'vehicles.1.parts.tyre: unknown name "nune"; known: none, rubber_band'),
        ({"tire": "none"}, 'vehicles.1.parts: unknown kind of part "tire"; known: film, horn, tyre'),
        ({"tyre": ["none"]}, "vehicles.1.parts.tyre: ['none'] is not a text"),
    ],
)
def test_mistakes_in_a_listing_name_key_and_known_names(tmp_path: Path, parts: object, message: str) -> None:
    file = listing(tmp_path, {"parts": parts})

    with pytest.raises(ListingError) as refused:
        read_family(file, "1", read_listing(file)[0].vehicles["1"])

    assert str(refused.value).startswith(f"{file}: {message}")


@pytest.mark.parametrize(
    ("type_string", "message"),
    [
        ("W_B_W+tyre=slik", '"W_B_W+tyre=slik": tyre: unknown name "slik"; known: none'),
        ("W_B_W+tyre=none+tyre=none", "must be +KIND=NAME of a part"),
    ],
)
def test_mistakes_in_a_type_string_are_named(type_string: str, message: str) -> None:
    with pytest.raises(DesignError) as refused:
        compose(type_string, {})

    assert message in str(refused.value)


def test_a_tyre_wider_than_its_rim_is_refused() -> None:
    with pytest.raises(DesignError, match=r"W\.tire_thickness: 10 is below the 12 of the silicone band tyre"):
        compose("W_B_W+tyre=silicone_band", {"W.tire_thickness": 10.0})
