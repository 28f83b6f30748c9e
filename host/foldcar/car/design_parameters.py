"""The parameters of a car's modules by their keys: ``width``, ``W.length``, ``W2.radius``, and their columns in results.

Input: the known modules. Output: declarations. A key names a shared parameter, one of a letter, or one of a place: the
letter of a module and its number among those, counted from the front.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from foldcar.car.components.component import Parameter
from foldcar.car.components.composite import Composite
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import BrainModule, Module, WheelModule

Kind = type[Module] | type[HingeModule] | type[Composite]
# Every known module by its letter or name.
MODULES: dict[str, Kind] = {kind.letter: kind for kind in (WheelModule, BrainModule, HingeModule)}
# The files of users' modules.
USER_FILES: dict[Path, list[str]] = {}


@dataclass(frozen=True, slots=True)
class DesignParameter:
    """A parameter of the car: its key in designs, the modules that have it, its declaration."""

    key: str
    modules: frozenset[str]
    declared: Parameter

    def belongs_to(self, letters: Iterable[str]) -> bool:
        """Return whether one of the modules with these letters has the parameter."""
        return not self.modules.isdisjoint(letters)

    @property
    def column(self) -> str:
        """Its column name in results, which ends in its unit."""
        return "_".join(filter(None, (*self.key.split("."), self.declared.unit)))


@cache
def parameters() -> dict[str, DesignParameter]:
    """Return every parameter by key, in the order of the results' columns: shared ones first."""
    declared_by_key: dict[str, Parameter] = {}
    letters_by_key: dict[str, set[str]] = {}
    for shared in (True, False):
        for letter, kind in MODULES.items():
            for parameter in kind.parameters:
                if parameter.shared == shared:
                    key = parameter.name if shared else f"{letter}.{parameter.name}"
                    declared_by_key.setdefault(key, parameter)
                    letters_by_key.setdefault(key, set()).add(letter)
    return {key: DesignParameter(key, frozenset(letters_by_key[key]), declared_by_key[key]) for key in declared_by_key}


# A place: the letter of a module and its number among those, counted from the front.
PLACE = re.compile(r"(.*[^0-9])([1-9][0-9]*)")


def find_parameter(group: str, name: str) -> DesignParameter | None:
    """Return the parameter ``name`` of a group of modules, or None if there is no such parameter.

    ``group`` is ``common`` for all modules, or the letter of a kind of module, such as ``W``, or a *place*, which is one
    module of a car, such as ``W2``, the second W. ``find_parameter("W2", "radius").key`` is ``"W2.radius"``.
    """
    shared = parameters().get(name)
    if shared is not None and (group == "common" or group in shared.modules):
        return shared
    place = PLACE.fullmatch(group)
    if place is None or group in MODULES:
        return parameters().get(f"{group}.{name}")
    # A place has the parameters of its letter, except uniform ones, which have the same value at all places.
    letter = place[1]
    parameter = find_parameter(letter, name)
    if parameter is None or parameter.declared.uniform:
        return None
    return DesignParameter(f"{group}.{name}", frozenset((letter,)), parameter.declared)


def parameter_of(key: str) -> DesignParameter | None:
    """Return the parameter of a key such as ``radius``, ``W.length`` or ``W2.radius``, or None for other keys."""
    group, _, name = key.rpartition(".")
    return find_parameter(group or "common", name)


def key_of(column: str) -> str | None:
    """Return the key of the parameter whose values are in a column of results, or None if the column has other values.

    For example, ``key_of("W2_radius_mm")`` is ``"W2.radius"``.
    """
    for key, parameter in parameters().items():
        if parameter.column == column:
            return key
    # The column may belong to a single module, such as W2. Then it is the module's place, the parameter's name and the
    # unit, joined by underscores. As names may contain underscores, every known name is tried.
    place, _, name_and_unit = column.partition("_")
    names = {parameter.declared.name for parameter in parameters().values()}
    for name in names:
        parameter_of_place = find_parameter(place, name) if name_and_unit.startswith(name) else None
        if parameter_of_place is not None and parameter_of_place.column == column:
            return parameter_of_place.key
    return None


def places_of(letters: Sequence[str]) -> list[str]:
    """Return the places of a car's modules, front to back: ``places_of(("W", "B", "W"))`` is ``["W1", "B1", "W2"]``."""
    return [f"{letter}{letters[: i + 1].count(letter)}" for i, letter in enumerate(letters)]


def place_keys(key: str, letters: Sequence[str]) -> list[str]:
    """Return the keys of a parameter's places in a car: of ``radius`` in W_B_W ``W1.radius`` and ``W2.radius``."""
    parameter = parameters()[key]
    places = places_of([letter for letter in letters if letter in parameter.modules])
    return [] if parameter.declared.uniform else [f"{place}.{parameter.declared.name}" for place in sorted(places)]


def names_in(group: str) -> list[str]:
    """Return the parameter names that ``group`` (``common``, a module letter or a place) may set."""
    names = {parameter.declared.name for parameter in parameters().values()}
    return sorted(name for name in names if find_parameter(group, name) is not None)


def declared(key: str) -> Parameter:
    """Return the declaration of the parameter with this key, which must exist."""
    parameter = parameter_of(key)
    assert parameter is not None, key
    return parameter.declared
