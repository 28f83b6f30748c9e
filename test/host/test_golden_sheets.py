"""The published cars' sheets are those in patterns/sheets, compared line by line in millimetres."""

import sys

import pytest

from conftest import PROJECT
from foldcar.fabrication.patterns.svg import read_svg
from foldcar.fabrication.patterns.verify import check_same

sys.path.insert(0, str(PROJECT / "tools"))
from golden_sheets import SHEETS, cars, sheets_of


@pytest.mark.parametrize("vehicle", cars())
def test_the_sheets_are_those_that_are_kept(vehicle: str) -> None:
    made = {f"{sheet.name}.svg": sheet for sheet in sheets_of(vehicle)}

    kept = {file.name: read_svg(file.read_text(encoding="utf-8")) for file in (SHEETS / vehicle).iterdir()}
    assert sorted(kept) == sorted(made)
    differences = [f"{name}: {found}" for name in kept for found in check_same(made[name], kept[name])]
    assert differences == []
