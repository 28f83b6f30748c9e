"""The parts catalogue: bought parts, the film and the dimensions of assembly, from data/*.json.

Every number has a tolerance (half-width of its expected range) and a source. Lengths are in millimetres, as on data
sheets, everything else in SI units unless its name says otherwise.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Literal

from foldcar.car.parts.choices import DEFAULT_CHOICES, OPTIONS, PartChoices, PartError
from foldcar.car.parts.electronics import (
    Battery,
    Extensions,
    Feather,
    FeatherWing,
    LeadedBattery,
    Plugs,
    Switch,
    Wiring,
)
from foldcar.car.parts.film import Assembly, Film
from foldcar.car.parts.mechanics import Caster, Horn, Screw, Servo, Spacer, Tools, Tyre
from foldcar.car.parts.quantity import Bought, BoxPart, Data, Quantity

__all__ = [
    "Assembly", "Battery", "BoxPart", "Caster", "Catalogue", "Feather", "FeatherWing", "Film", "Horn", "Plugs", "Screw",
    "Servo", "Spacer", "Switch", "Tools", "Tyre", "catalogue", "chosen", "film_of",
    "films",
]  # fmt: skip

# Catalogue's field → data file, for the parts that all cars have.
FILES = {
    "servo": "fs90r.json",
    "feather": "feather_huzzah32.json",
    "featherwing": "servo_featherwing.json",
    "headers": "headers.json",
    "lipo": "lipo_500mah.json",
    "pad": "pad.json",
    "board_pad": "board_pad.json",
    "switch": "switch.json",
    "plugs": "plugs.json",
    "wiring": "wiring.json",
    "extensions": "servo_extensions.json",
    "screw": "screw_m2.json",
    "board_screw": "screw_board.json",
    "horn_screw": "screw_horn.json",
    "centre_screw": "screw_centre.json",
    "spacer": "spacer.json",
    "tools": "tools.json",
    "caster": "caster.json",
    "assembly": "assembly.json",
}
CHOSEN = ("film", "horn", "tyre", "battery")


class Catalogue(Data):
    """The parts of one car: those that all cars have and those that it chooses.

    ``screw`` holds a servo in its wall, ``board_screw`` with a ``spacer`` the Feather's end at USB, ``board_pad`` its
    other end, ``horn_screw`` a wheel on a horn, ``centre_screw`` the horn on the servo, ``pad`` the battery in its place.
    ``headers`` have a price only: their mass is in the boards'.
    """

    servo: Servo
    feather: Feather
    featherwing: FeatherWing
    headers: Bought
    lipo: LeadedBattery
    pad: BoxPart
    board_pad: BoxPart
    switch: Switch
    plugs: Plugs
    wiring: Wiring
    extensions: Extensions
    screw: Screw
    board_screw: Screw
    horn_screw: Screw
    centre_screw: Screw
    spacer: Spacer
    tools: Tools
    caster: Caster
    assembly: Assembly
    film: Film
    horn: Horn
    tyre: Tyre
    battery: Battery
    battery_place: Literal["floor", "roof"]

    @property
    def tyre_friction(self) -> Quantity:
        """A wheel's friction coefficient: its tyre's, or the bare film's."""
        return self.tyre.friction or self.film.friction

    @property
    def bought(self) -> tuple[Bought, ...]:
        """The parts that are bought and put in."""
        parts = (getattr(self, field) for field in type(self).model_fields)
        return (*(part for part in parts if isinstance(part, Bought)), *self.extensions.sold)


def catalogue() -> Catalogue:
    """The catalogue of the default choices."""
    return chosen(DEFAULT_CHOICES)


@cache
def chosen(choices: PartChoices) -> Catalogue:
    """The catalogue with these choices; the package contains its data."""
    data = files("foldcar.car.parts").joinpath("data")
    names = FILES | {kind: choices.file(kind) for kind in CHOSEN}
    parts = {field: json.loads(data.joinpath(name).read_text(encoding="utf-8")) for field, name in names.items()}
    return Catalogue.model_validate(parts | {"battery_place": choices.battery_place})


@cache
def films(name: str) -> tuple[Film, ...]:
    """The films of the material of that name, the thinnest first."""
    found = (chosen(DEFAULT_CHOICES.changed({"film": film})).film for film in OPTIONS["film"])
    return tuple(sorted((film for film in found if film.name == name), key=lambda film: film.thickness_mm.value))


def film_of(car_film: Film, thickness_mm: float) -> Film:
    """The film of that thickness of the car's material; PartError if there is none."""
    known = {film.thickness_mm.value: film for film in films(car_film.name)}
    if thickness_mm not in known:
        sold = ", ".join(f"{one:g}" for one in known)
        raise PartError("film", f"no {car_film.name} of {thickness_mm:g} mm; known: {sold}")
    return known[thickness_mm]
