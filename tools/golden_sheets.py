"""Regenerates the sheets of the published cars: patterns/sheets/CAR/sheet_N.svg for every car of cars.json.

Run it after an intended change of the sheets, review `git diff --stat`, and commit them with the change: the tests
compare generated sheets with these files.
"""

import json
import shutil
from pathlib import Path

from foldcar.car.folded_car import folded_car
from foldcar.commands.listed_run import listed_family
from foldcar.commands.pattern import car_command
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheet_files import svg
from foldcar.fabrication.patterns.sheets import pattern

PATTERNS = Path(__file__).resolve().parents[1] / "patterns"
SHEETS = PATTERNS / "sheets"


def cars() -> dict[str, dict[str, str]]:
    """Listing and machine of each published car, by its vehicle's id."""
    listed: dict[str, dict[str, str]] = json.loads((SHEETS / "cars.json").read_text(encoding="utf-8"))
    return listed


def sheets_of(vehicle: str) -> tuple[Sheet, ...]:
    """The sheets of a published car as the current code generates them."""
    car = cars()[vehicle]
    design = listed_family(PATTERNS / car["listing"], vehicle, [])[1].single()
    chosen = options(car["machine"])
    command = car_command(Path("patterns", car["listing"]), vehicle, [], chosen, [])
    return pattern(folded_car(design), chosen, design.title, command).sheets


def main() -> None:
    """Replace the sheets of all published cars."""
    for vehicle in cars():
        folder = SHEETS / vehicle
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for sheet in sheets_of(vehicle):
            (folder / f"{sheet.name}.svg").write_text(svg(sheet), encoding="utf-8")
        print(f"{folder.relative_to(PATTERNS.parent)}: {len(list(folder.iterdir()))} sheets")


if __name__ == "__main__":
    main()
