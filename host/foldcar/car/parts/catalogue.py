"""The parts catalogue: bought parts, the film and the dimensions of assembly, from data/*.json."""

import json
from functools import cache
from importlib.resources import files
from typing import Literal

from foldcar.car.parts.choices import DEFAULT_CHOICES, OPTIONS, PartChoices, PartError
from foldcar.car.parts.electronics import Battery, Extensions, Feather, FeatherWing, LeadedBattery, Plugs, Switch, Wiring
from foldcar.car.parts.film import Assembly, Film
from foldcar.car.parts.mechanics import Caster, Horn, Screw, Servo, Spacer, Tools, Tyre
from foldcar.car.parts.quantity import Bought, BoxPart, Data, Quantity


class Catalogue(Data):
    """The parts of one car, each from the file of its name: those that all cars have and those that it chooses.

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
    data, found = files("foldcar.car.parts").joinpath("data"), {}
    for field in Catalogue.model_fields:
        name = getattr(choices, field, None)
        if field != "battery_place":
            file = f"{field}_{name}.json" if name else f"{field}.json"
            found[field] = json.loads(data.joinpath(file).read_text(encoding="utf-8"))
    return Catalogue.model_validate(found | {"battery_place": choices.battery_place})


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
