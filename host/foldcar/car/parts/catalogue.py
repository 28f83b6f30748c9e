"""The parts catalogue from data/*.json, and the parts that a vehicle chooses: one of each kind, by name.

A choice is checked where it is read, so that everything downstream has valid names. A type string names the choices
that differ from the defaults, so that it describes the whole car: ``W_B_W+tyre=none``.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from foldcar.car.parts.bought import (
    Cells,
    Extensions,
    Feather,
    FeatherWing,
    Film,
    Headers,
    Plugs,
    Screw,
    Spacer,
    Tools,
    Tyre,
    Wiring,
)
from foldcar.car.parts.quantity import Bought, BoxPart, Data, PartData, Quantity
from foldcar.car.parts.servo import Horn, Servo
from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean

# Kind of part → its names; the data of a part are in KIND_NAME.json.
OPTIONS: dict[str, tuple[str, ...]] = {
    "film": ("0.127", "0.19", "0.25", "card_160", "card_300", "pp_0.5", "pp_0.8"),
    "horn": ("one_sided", "two_sided", "cross", "disc"),
    "tyre": ("none", "rubber_band", "silicone_band", "grip_tape", "shrink_tube"),
    "battery": ("4xaa_flat", "4xaa_square"),
    "battery_place": ("floor", "roof"),
    "cells": ("unnamed", "nimh", "alkaline"),
    "button": ("none", "fitted"),
    "divider": ("none", "fitted"),
    "oe_wire": ("none", "fitted"),
}
# Kinds that choose a place, or whether the car has an option: they have no data of their own.
WITHOUT_DATA = ("battery_place", "button", "divider", "oe_wire")


class PartError(FoldcarError):
    """An unknown kind of part, or an unknown name of a part of ``kind``, which is None for an unknown kind."""

    def __init__(self, kind: str | None, message: str) -> None:
        super().__init__(f"{kind}: {message}" if kind else message)
        self.kind, self.message = kind, message


@dataclass(frozen=True, slots=True)
class PartChoices:
    """The names of the parts that a vehicle chooses, one of each kind (``OPTIONS`` lists them)."""

    film: str = "0.25"
    horn: str = "two_sided"
    tyre: str = "rubber_band"
    battery: str = "4xaa_square"
    battery_place: str = "floor"
    cells: str = "unnamed"
    button: str = "none"
    divider: str = "none"
    oe_wire: str = "none"

    def changed(self, names: Mapping[str, str]) -> "PartChoices":
        """Return these choices with other names by kind. Raises PartError, which lists the known names or kinds."""
        for kind, name in names.items():
            if kind not in OPTIONS:
                suggestion = did_you_mean(kind, list(OPTIONS))
                raise PartError(None, f'unknown kind of part "{kind}"; known: {", ".join(OPTIONS)}{suggestion}')
            if name not in OPTIONS[kind]:
                suggestion = did_you_mean(name, list(OPTIONS[kind]))
                raise PartError(kind, f'unknown name "{name}"; known: {", ".join(OPTIONS[kind])}{suggestion}')
        return replace(self, **names)

    @property
    def suffix(self) -> str:
        """The end of a type string, after the modules: every name that is not the default, as ``+tyre=none``."""
        usual = asdict(DEFAULT_CHOICES)
        return "".join(f"+{kind}={name}" for kind, name in asdict(self).items() if name != usual[kind])


DEFAULT_CHOICES = PartChoices()


def split_type(type_string: str) -> tuple[str, PartChoices]:
    """Split a vehicle's type, such as ``W_B_W+tyre=none``, into the letters of its modules and its choice of parts.

    In the example these are ``W_B_W`` and no tyre. For kinds of parts that the type does not name, the choice has the
    default part. Raises PartError if a part or a kind is unknown, or if a kind is named twice.
    """
    modules, *part_texts = type_string.split("+")
    names: dict[str, str] = {}
    for part_text in part_texts:
        kind, equals, name = part_text.partition("=")
        if not equals or kind in names:
            raise PartError(None, f'"{type_string}": "+{part_text}" must be +KIND=NAME of a part, as in W_B_W+tyre=none')
        names[kind] = name
    try:
        return modules, DEFAULT_CHOICES.changed(names)
    except PartError as error:
        raise PartError(None, f'"{type_string}": {error}') from error


class Catalogue(Data):
    """The parts of one car, each from the file of its name: those that all cars have and those that it chooses.

    ``screw`` holds a servo in its wall, ``board_screw`` with a ``spacer`` holds the Feather's end at USB, ``board_pad``
    its other end. ``horn_screw`` holds a wheel on a horn, ``centre_screw`` the horn on the servo, ``pad`` the battery.
    ``axle_rod`` carries wheels without servos; an ``axle_tube`` keeps each off its wall, an ``axle_cap`` on the rod.
    The mass of ``headers`` is in the boards', that of ``fuse`` in the wires'. Mass and cost of ``wiring`` include
    ``wire_mm`` of wire; ``wiring`` also has the slack that leads need. Leads leave the middle of an end of a battery's
    length. ``push_button`` and ``resistor`` are in a car that has these options. ``assembly`` has the clearances,
    laminations and contact properties of a folded car.
    """

    servo: Servo
    feather: Feather
    featherwing: FeatherWing
    headers: Headers
    fuse: Bought
    lipo: BoxPart
    pad: BoxPart
    board_pad: BoxPart
    switch: BoxPart
    plugs: Plugs
    wiring: Wiring
    extensions: Extensions
    screw: Screw
    board_screw: Screw
    horn_screw: Screw
    centre_screw: Screw
    spacer: Spacer
    axle_rod: Bought
    axle_tube: Bought
    axle_cap: Bought
    tools: Tools
    caster: BoxPart
    assembly: PartData
    film: Film
    horn: Horn
    tyre: Tyre
    battery: BoxPart
    cells: Cells
    push_button: BoxPart
    resistor: BoxPart
    battery_place: Literal["floor", "roof"]
    button: Literal["none", "fitted"]
    divider: Literal["none", "fitted"]
    oe_wire: Literal["none", "fitted"]

    @property
    def film_mm(self) -> float:
        """Thickness of the film."""
        return self.film.thickness_mm.value

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
    """Return the catalogue of the default choices."""
    return catalogue_of(DEFAULT_CHOICES)


@cache
def catalogue_of(choices: PartChoices) -> Catalogue:
    """Return the catalogue with these choices, read from the package's data."""
    folder = files("foldcar.car.parts").joinpath("data")
    contents: dict[str, Any] = {}
    for field in Catalogue.model_fields:
        # The part that was chosen, by name, or None for a part that is the same in all cars.
        chosen_name = getattr(choices, field, None)
        if field in WITHOUT_DATA:
            # The choice itself is the content, such as the battery's place "roof".
            contents[field] = chosen_name
            continue
        file_name = f"{field}_{chosen_name}.json" if chosen_name else f"{field}.json"
        contents[field] = json.loads(folder.joinpath(file_name).read_text(encoding="utf-8"))
    return Catalogue.model_validate(contents)


@cache
def films(name: str) -> tuple[Film, ...]:
    """Return the films of the material of that name, the thinnest first."""
    candidates = (catalogue_of(DEFAULT_CHOICES.changed({"film": film})).film for film in OPTIONS["film"])
    return tuple(sorted((film for film in candidates if film.name == name), key=lambda film: film.thickness_mm.value))


def film_of(car_film: Film, thickness_mm: float) -> Film:
    """Return the film of the car's material with that thickness. Raises PartError if it is not sold."""
    by_thickness = {film.thickness_mm.value: film for film in films(car_film.name)}
    if thickness_mm not in by_thickness:
        sold = ", ".join(f"{thickness:g}" for thickness in by_thickness)
        raise PartError("film", f"no {car_film.name} of {thickness_mm:g} mm; known: {sold}")
    return by_thickness[thickness_mm]
