"""The cars of patterns/: their designs by name, and folded."""

from functools import cache
from pathlib import Path

from foldcar.car.design import Design
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.study.family import read_family
from foldcar.study.listing_file import read_listing

PATTERNS = Path(__file__).resolve().parents[2] / "patterns"
PUBLISHED = PATTERNS / "published_cars.json"


@cache
def designs(file: Path) -> dict[str, Design]:
    """The designs of one file."""
    return {name: read_family(file, name, vehicle).single() for name, vehicle in read_listing(file)[0].vehicles.items()}


@cache
def design(name: str) -> Design:
    """The design of that name."""
    return next(cars[name] for cars in map(designs, PATTERNS.glob("*.json")) if name in cars)


def car(name: str) -> FoldedCar:
    """The folded car of that name."""
    return folded_car(design(name))
