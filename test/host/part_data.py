"""The data files of parts as they are."""

import json
from importlib.resources import files
from typing import Any

DATA = files("foldcar.car.parts").joinpath("data")


def part_data(name: str) -> dict[str, Any]:
    """A part's data file."""
    result: dict[str, Any] = json.loads(DATA.joinpath(f"{name}.json").read_text(encoding="utf-8"))
    return result


def number(name: str, key: str) -> float:
    """The value of a quantity of a part."""
    return float(part_data(name)[key]["value"])
