"""The command `foldcar pattern`: a folder of files, a report, one-line errors, no incomplete output."""

import io
import json
import os
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from foldcar.commands.listed_run import listed_families
from foldcar.commands.pattern import _places
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.svg import read_svg
from test_command_line import ASCII

Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def listing(write_listing: Callable[[Any], Path], listing_data: dict[str, Any]) -> Path:
    return write_listing(listing_data)


def test_all_means_every_car_of_every_vehicle_that_can_be_built(
    foldcar: Command, write_listing: Callable[[Any], Path], listing_data: dict[str, Any], tmp_path: Path
) -> None:
    listing_data["vehicles"] = {
        name: {"type": "W_B_W", "params": [{"common": {"width": width}}]}
        for name, width in (("two axles", [20, 95]), ("two_axles", 130))
    }
    listing_data["experiments"]["1"]["veh_id"] = "two axles"
    listing = write_listing(listing_data)

    done = foldcar("pattern", listing, "--all", "--machine", "laser", "-o", "cars")

    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    folders = {"two_axles/width_95": 95, "two_axles-2": 130}
    assert [line.partition(":")[0] for line in lines[:-2]] == list(folders)
    why = "width=20: width: 20 is below the minimum 53.65 (the boards across it)"
    assert lines[-2] == f"skipped, as it cannot be built: {why}"
    made = {}
    for folder, width in folders.items():
        manifest = json.loads((tmp_path / "cars" / folder / "pattern.json").read_text())
        assert manifest["parameters"]["width"] == width
        made[folder] = manifest
    sheets = sum(one["sheets"] for one in made.values())
    mass_g = 1000 * sum(one["mass_kg"] for one in made.values())
    assert lines[-1].startswith(f"2 cars of 2 vehicles in cars: {sheets} sheets, cut ")
    assert f", {mass_g:.0f} g, " in lines[-1]
    refused = foldcar("pattern", listing, "--all", "--sheet", "110x110", "-o", "cars")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "width=95" in refused.stderr and "110 x 110 mm" in refused.stderr
    assert (tmp_path / "cars" / "two_axles-2" / "sheet_1.svg").is_file()
    (only,) = _places(listed_families(listing, "two_axles", [])[1])
    assert (only.vehicle, only.folder) == ("two_axles", "car")


def test_a_folder_of_files_is_made_anew_alike_but_never_over_other_files(
    foldcar: Command, new_foldcar: Command, listing: Path, tmp_path: Path
) -> None:
    listing.rename(tmp_path / "étude.json")
    folder = tmp_path / "car"
    words = ["pattern", "étude.json", "--vehicle", "1", "--set", "width=95", "--machine", "laser", "-o", "car"]
    made, done = [], []
    # Different hash seeds give sets different orders. The second time by the command that stands on the sheets, with
    # a locale that has no letter for the listing's name.
    for environment in ({"PYTHONHASHSEED": "0"}, {"PYTHONHASHSEED": "4", **ASCII}):
        done.append(new_foldcar(*words, env={**os.environ, **environment}))
        assert (done[-1].returncode, done[-1].stderr) == (0, "")
        manifest = json.loads((folder / "pattern.json").read_text())
        assert manifest["command"] in (folder / "how_to_cut.md").read_text(encoding="utf-8")
        words = [*shlex.split(manifest["command"])[1:], "--json"]
        made.append({str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()})

    assert "étude.json" in words and made[0] == made[1]
    for word in ("sheets", "cut", "mass", "cost", "checked"):
        assert f"  {word} " in done[0].stdout
    assert f"open {Path('car', 'assembly.html')} first" in done[0].stdout
    (car,) = json.loads(done[1].stdout)["cars"]
    assert (car["vehicle"], car["parameters"]["width"], car["folder"]) == ("1", 95, "car")
    assert set(made[0]) == set(manifest["files"])
    wanted = {"how_to_cut.md", "sheet_1.svg", "sheet_1.dxf", "sheets.pdf", "coupon.svg", "car.stl", "wiring.md"}
    assert {*wanted, "parts.csv", "sheets.png"} <= set(made[0])
    assert (manifest["type"], manifest["parameters"]["width"]) == ("W_B_W", 95)
    sheet, laser = read_svg(made[0]["sheet_1.svg"].decode()), options("laser").sheet_size_mm
    assert (sheet.width_mm, sheet.height_mm) == pytest.approx(laser)
    assert ezdxf.read(io.StringIO(made[0]["sheet_1.dxf"].decode())).audit().errors == []

    (folder / "notes.txt").write_text("mine")
    again = foldcar(*words)

    assert again.returncode == 2
    assert "contains notes.txt" in again.stderr
    assert (folder / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "width=95", "--sheet", "110x110"), "it cannot be parted; --sheet 12in would do"),
        (("--set", "width=95", "--sheet", "huge"), "--sheet huge: neither one of a4, letter, 12in"),
        (("--set", "width=95", "--machine", "axe"), "--machine axe: not one of silhouette, cricut, laser, scissors"),
        (("--set", "width=95", "--kerf", "3"), "--kerf 3: not within 0 to 1 mm"),
        (("--set", "width=95", "--dash-cut", "0"), "--dash-cut 0: not within 0.3 to 50 mm"),
        (("--set", "width=95", "--fold", "bite"), "--fold bite: not one of dash, score"),
        (("--set", "width=95", "--margin", "40", "--sheet", "60x60"), "--margin 40: leaves nothing"),
        (("--set", "width=95", "--vehicle", "7"), 'vehicles: has no "7"; known: 1'),
        (("--set", "width=20"), "--set width: 20 is below the minimum"),
        ((), "has 2 values (95, 245); choose one"),
    ],
)
def test_mistakes_are_one_line_and_leave_no_folder(
    foldcar: Command, listing: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = foldcar("pattern", listing, "-o", "car", *words)

    assert done.returncode == 2
    assert said in done.stderr
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


def test_names_of_sheets_and_machines_are_of_any_case() -> None:
    assert options("Laser", sheet="A4", fold="Score") == options("laser", sheet="a4", fold="score")
