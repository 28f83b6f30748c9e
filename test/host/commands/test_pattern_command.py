"""The command `foldcar pattern`: a folder of files, a report, one-line errors, no incomplete output."""

import io
import json
import os
import re
import shlex
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from foldcar.car.design import compose
from foldcar.car.folded_car import folded_car
from foldcar.commands.pattern import car_command
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.guide_service import ListedCar, driving_steps
from foldcar.fabrication.patterns import options as pattern_options
from foldcar.fabrication.patterns.options import PRESETS, OptionError, options, read_material
from sheet_reader import read_svg
from test_shown_text import ASCII

Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def listing(write_listing: Callable[[Any], Path], listing_data: dict[str, Any]) -> Path:
    return write_listing(listing_data)


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_a_car_is_made_with_what_its_manifest_names_but_never_over_other_files(
    foldcar: Command, write_listing: Callable[[Any], Path], listing_data: dict[str, Any], tmp_path: Path
) -> None:
    words = ["pattern", write_listing(listing_data).name, "--set", "width=95", "--material", "laser", "-o", "car"]

    done = foldcar(*words)

    assert (done.returncode, done.stderr) == (0, "")
    files = files_of(tmp_path / "car")
    manifest = json.loads(files["pattern.json"])
    # Sheets are handed on: they name no folder.
    assert "/" not in car_command(
        tmp_path / "listing.json", "one", ["width=95"], options("laser"), [tmp_path / "tail.py"]
    )
    assert set(files) == set(manifest["files"]) and manifest["parameters"]["width"] == 95
    assert {"sheet_1.svg", "sheet_1.dxf", "sheet_1.lbrn2", "sheets.pdf", "assembly.html", "parts.csv"} <= set(files)
    # The guide names the listing and an experiment of this car: its command is accepted as it is printed.
    (printed,) = re.findall("<code>(foldcar flash .*?)</code>", files["assembly.html"].decode())
    assert "LISTING" not in files["assembly.html"].decode()
    loaded = foldcar(*shlex.split(printed)[1:], "--file", "flashed.json")
    assert (loaded.returncode, loaded.stderr) == (0, "")
    assert (tmp_path / "flashed.json").read_bytes() == files["car.json"]
    (tmp_path / "car" / "notes.txt").write_text("mine")
    again = foldcar(*words)
    assert again.returncode == 2 and "contains notes.txt" in again.stderr
    assert (tmp_path / "car" / "notes.txt").read_text() == "mine"


def test_the_guide_says_once_what_a_name_in_a_command_stands_for() -> None:
    car = folded_car(compose("W_B_W", {}))
    for listed, command, words in (
        (ListedCar(), "foldcar flash LISTING --experiment ID", "LISTING is the file in which this car is listed, ID one"),
        (ListedCar("my cars.json"), "foldcar flash 'my cars.json' --experiment ID", "my cars.json has none yet"),
    ):
        lines = [line for _, step_lines in driving_steps(car, listed) for line in step_lines]
        (line,) = [line for line in lines if command in line]
        assert words in line and sum("ID" in text.split() for text in lines) == 1


# Three cars, in processes of their own.
@pytest.mark.slow
def test_every_car_is_made_and_its_own_command_makes_it_anew_alike_but_never_over_other_files(
    foldcar: Command, new_foldcar: Command, write_listing: Callable[[Any], Path], listing_data: dict[str, Any],
    tmp_path: Path,
) -> None:  # fmt: skip
    listing_data["vehicles"] = {
        name: {"type": "W_B", "params": [{"common": {"width": width}}, {"B": {"length": 120}}]}
        for name, width in (("one axle", [20, 95]), ("one_axle", 130))
    }
    listing_data["experiments"]["1"]["veh_id"] = "one axle"
    write_listing(listing_data).rename(tmp_path / "étude.json")
    # A sheet as large as two cars takes the search for their places less time.
    laser = ["--material", "laser", "--sheet", "1000x1000"]

    done = new_foldcar("pattern", "étude.json", "--all", *laser, "-o", "cars", env={**os.environ, "PYTHONHASHSEED": "0"})

    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    folders = {"one_axle/width_95": 95, "one_axle-2": 130}
    assert [line.partition(":")[0] for line in lines[:-2]] == list(folders)
    why = "width=20 mm: width: 20 is below the minimum 53.65 (the boards across it)"
    assert lines[-2] == f"skipped, as it cannot be built: {why}"
    made = {name: files_of(tmp_path / "cars" / name) for name in folders}
    manifests = [json.loads(files["pattern.json"]) for files in made.values()]
    assert [manifest["parameters"]["width"] for manifest in manifests] == list(folders.values())
    sheets, mass_g = (
        sum(manifest["sheets"] for manifest in manifests),
        1000 * sum(manifest["mass_kg"] for manifest in manifests),
    )
    assert lines[-1].startswith(f"2 cars of 2 vehicles in cars: {sheets} sheets, cut ")
    assert f", {mass_g:.0f} g, " in lines[-1]

    # Different hash seeds give sets different orders. The second time by the command that stands on the sheets, with a
    # locale that has no letter for the listing's name.
    files, manifest = made["one_axle/width_95"], manifests[0]
    words = shlex.split(manifest["command"])[1:]
    anew = new_foldcar(*words, env={**os.environ, "PYTHONHASHSEED": "4", **ASCII})

    assert (anew.returncode, anew.stderr) == (0, "")
    assert "étude.json" in words and files == files_of(tmp_path / "car")
    for word in ("sheets", "cut", "mass", "cost", "checked"):
        assert f"  {word} " in anew.stdout
    assert f"open {Path('car', 'assembly.html')} first" in anew.stdout
    assert set(files) == set(manifest["files"]) and manifest["command"] in files["how_to_cut.md"].decode()
    wanted = {"how_to_cut.md", "sheet_1.svg", "sheet_1.dxf", "sheets.pdf", "coupon.svg", "car.stl", "wiring.md"}
    assert {*wanted, "parts.csv", "sheets.png"} <= set(files)
    assert manifest["type"] == "W_B" and manifest["warnings"] == []
    sheet = read_svg(files["sheet_1.svg"].decode())
    assert (sheet.width_mm, sheet.height_mm) == (1000, 1000)
    assert ezdxf.read(io.StringIO(files["sheet_1.dxf"].decode())).audit().errors == []

    (tmp_path / "car" / "notes.txt").write_text("mine")
    again = foldcar(*words)
    refused = foldcar("pattern", "étude.json", "--all", "--sheet", "110x110", "-o", "cars")

    assert again.returncode == 2 and "contains notes.txt" in again.stderr
    assert (tmp_path / "car" / "notes.txt").read_text() == "mine"
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "width=95" in refused.stderr and "110 x 110 mm" in refused.stderr
    assert (tmp_path / "cars" / "one_axle-2" / "sheet_1.svg").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "width=95", "--sheet", "110x110"), "it cannot be split; --sheet 12in would do"),
        (("--set", "width=95", "--material", "axe"), "--material axe: is neither a file nor one of silhouette,"),
        ((), "has 2 values (95, 245); choose one"),
    ],
)
def test_mistakes_are_one_line_and_leave_no_folder(
    foldcar: Command, listing: Path, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    done = foldcar("pattern", listing, "-o", "car", *words)

    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert {file.name for file in tmp_path.iterdir()} == {"listing.json"}


def test_a_file_in_the_folders_place_is_refused(foldcar: Command, listing: Path, tmp_path: Path) -> None:
    (tmp_path / "car").write_text("a file")

    done = foldcar("pattern", listing, "--set", "width=95", "-o", "car")
    below = foldcar("pattern", listing, "--set", "width=95", "-o", "car/below")

    assert (done.returncode, below.returncode) == (2, 2)
    assert "not a folder" in done.stderr
    assert "cannot be written" in below.stderr
    assert (tmp_path / "car").read_text() == "a file"


def test_options_are_of_any_case_and_within_their_limits() -> None:
    assert options("Laser", sheet="A4", fold="Score") == options("laser", sheet="a4", fold="score")
    for changes, message in (
        ({"sheet": "huge"}, "sheet huge: is neither one of a4, letter, 12in"),
        ({"kerf_mm": 3}, "kerf_mm 3: is not within 0 to 1"),
        ({"fold": "bite"}, "fold bite: is not one of dash, score"),
        ({"margin_mm": 40, "sheet": "60x60"}, "margin_mm 40: leaves nothing"),
    ):
        with pytest.raises(OptionError, match=re.escape(message)):
            options("silhouette", **changes)


def test_a_material_file_changes_a_preset_and_is_named_on_the_sheets(
    foldcar: Command, write_listing: Callable[[Any], Path], listing_data: dict[str, Any], tmp_path: Path
) -> None:
    write_listing(listing_data)
    file = tmp_path / "mine.json"
    file.write_text('{"machine": "laser", "kerf_mm": 0.4, "tab_clearance_mm": 0.5} // of my shop')

    done = foldcar("pattern", "listing.json", "--set", "width=95", "--material", "mine.json", "-o", "car")

    assert (done.returncode, done.stderr) == (0, "")
    assert "for laser, kerf 0.4 mm" in done.stdout
    command = json.loads((tmp_path / "car" / "pattern.json").read_text())["command"]
    assert "--material mine.json --sheet 600x400" in command
    chosen = read_material(str(file))
    assert replace(chosen, kerf_mm=0.15, tab_clearance_mm=0.2, file=None) == options("laser")
    # Each preset is a file of the same kind.
    presets = sorted((Path(pattern_options.__file__).parent / "materials").glob("*.json"))
    assert {preset.stem for preset in presets} == set(PRESETS)
    for preset in presets:
        assert replace(read_material(str(preset)), file=None) == PRESETS[preset.stem]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"kerf_mm": 0.1}', "is not a JSON object with a machine: silhouette, cricut, laser, scissors"),
        ('{"machine": "axe"}', "machine axe: is not one of silhouette, cricut, laser, scissors"),
        ('{"machine": "laser", "kerf": 0.1}', "kerf: unknown key; known: bend_radius_mm, "),
        ('{"machine": "laser", "kerf_mm": "0.1"}', "kerf_mm: '0.1' is not a number"),
        ('{"machine": "laser", "kerf_mm": 3}', "kerf_mm 3: is not within 0 to 1 (the cut of a blade or beam)"),
        ('{"machine": "laser", "sheet": 4}', "sheet: 4 is not a text"),
        ('{"machine": "laser", "kerf_mm": 0.5, "dash_cut_mm": 0.3}', "kerf_mm 0.5: is above half of dash_cut_mm 0.3"),
        ('{"machine": "laser", ', "is not JSON"),
    ],
)
def test_mistakes_in_a_material_file_name_file_key_value_and_limit(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "mine.json"
    file.write_text(text)

    with pytest.raises(FoldcarError, match=re.escape(f"{file}: {message}")):
        read_material(str(file))


def test_folds_that_are_too_wide_for_a_car_are_refused(foldcar: Command, listing: Path, tmp_path: Path) -> None:
    (tmp_path / "wide.json").write_text('{"machine": "laser", "bend_radius_mm": 4}')

    done = foldcar("pattern", listing, "--set", "width=95", "--material", "wide.json", "-o", "car")

    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "bend_radius_mm 4: the folds of " in done.stderr and not (tmp_path / "car").exists()
