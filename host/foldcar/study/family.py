"""A listed vehicle as a family of designs: every combination of its parameters' values.

Input: a vehicle of a listing. Output: designs, composed one by one in the order of the listing, the last varied
parameter changing fastest. Errors name file and key.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from foldcar.car.design import Design, DesignError, compose, modules_of
from foldcar.car.folded_car import folded_car
from foldcar.car.modules import find_parameter, names_in, parameters
from foldcar.study.listing import ListedVehicle, ListingError


@dataclass(frozen=True)
class Family:
    """``choices`` maps parameter keys to their values (mm, degrees), ``origins`` to the places in the listing."""

    vehicle: str
    type: str
    choices: Mapping[str, tuple[float, ...]]
    origins: Mapping[str, str]
    place: str

    def __len__(self) -> int:
        return math.prod(len(values) for values in self.choices.values())

    def __iter__(self) -> Iterator[Design]:
        """Every design, checked for valid parameters and space for its parts; ListingError."""
        for values in itertools.product(*self.choices.values()):
            try:
                design = compose(self.type, dict(zip(self.choices, values, strict=True)))
                folded_car(design)
            except DesignError as error:
                raise ListingError(f"{self._origin(error.parameter)}: {error.message}") from error
            yield design

    @property
    def varied(self) -> dict[str, tuple[float, ...]]:
        """The parameters with more than one value, by their column names in results (``width_mm``)."""
        return {parameters()[key].column: values for key, values in self.choices.items() if len(values) > 1}

    def narrowed(self, settings: Mapping[str, float]) -> "Family":
        """The family with these parameters fixed (keys as ``width`` or ``W.length``); FoldcarError for unknown ones."""
        choices, origins = dict(self.choices), dict(self.origins)
        for key, value in settings.items():
            if key not in parameters() or not parameters()[key].modules & set(self.type.split("_")):
                known = [
                    name for name, p in parameters().items() if p.modules & set(self.type.split("_"))
                ]
                raise ListingError(
                    f"--set {key}: {self.type} has no such parameter; it has {', '.join(known)}"
                )
            choices[key] = (value,)
            origins[key] = f"--set {key}"
        return replace(self, choices=choices, origins=origins)

    def single(self) -> Design:
        """The only design; ListingError naming a parameter that has several values."""
        for key, values in self.choices.items():
            if len(values) > 1:
                shown = ", ".join(f"{value:g}" for value in values[:3])
                more = f", … {values[-1]:g}" if len(values) > 3 else ""
                has = f"has {len(values)} values ({shown}{more})"
                raise ListingError(f"{self.origins[key]}: {has}; choose one with --set {key}=…")
        return next(iter(self))

    def _origin(self, key: str | None) -> str:
        if key is None:
            return f"{self.place}.type"
        return self.origins.get(key, f"{self.place}: {key} (its default)")


def read_family(file: Path, name: str, vehicle: ListedVehicle) -> Family:
    """The family of the vehicle ``name`` of the listing ``file``; ListingError if it is invalid."""
    place = f"{file}: vehicles.{name}"
    try:
        letters = modules_of(vehicle.type)
    except DesignError as error:
        raise ListingError(f"{place}.type: {error.message}") from error
    choices: dict[str, tuple[float, ...]] = {}
    origins: dict[str, str] = {}
    for index, groups in enumerate(vehicle.params):
        for group, settings in groups.items():
            here = f"{place}.params.{index}.{group}"
            if group != "common" and group not in letters:
                known = ", ".join(sorted(set(letters)))
                raise ListingError(f"{here}: {vehicle.type} has no module {group}; known: common, {known}")
            for parameter_name, values in settings.items():
                parameter = find_parameter(group, parameter_name)
                if parameter is None:
                    raise ListingError(
                        f'{here}: unknown parameter "{parameter_name}"; known: {", ".join(names_in(group))}'
                    )
                origin = f"{here}.{parameter_name}"
                if choices.get(parameter.key, values) != values:
                    raise ListingError(
                        f"{origin}: differs from {origins[parameter.key].removeprefix(f'{file}: ')}, "
                        "but the whole car has one value of it"
                    )
                if parameter.key not in choices:
                    choices[parameter.key], origins[parameter.key] = values, origin
    return Family(name, vehicle.type, choices, origins, place)
