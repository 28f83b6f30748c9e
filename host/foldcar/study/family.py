"""A listed vehicle as a family of designs: every combination of its parameters' values.

Input: a vehicle of a listing. Output: designs, composed one by one in the order of the listing, the last varied
parameter changing fastest. Members that cannot be built are skipped, with the reason. Errors name file and key.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from foldcar.car.design import Design, DesignError, compose, design_errors, modules_of
from foldcar.car.design_parameters import (
    declared,
    find_parameter,
    names_in,
    parameter_of,
    parameters,
    place_keys,
    places_of,
)
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, OPTIONS, PartChoices, PartError, catalogue_of, split_type
from foldcar.study.listing import ListedVehicle, ListingError
from foldcar.typed import did_you_mean

# Multiples of it, without their whole parts, are spread over 0 to 1.
GOLDEN_RATIO = (5**0.5 - 1) / 2


@dataclass(frozen=True)
class Family:
    """``choices`` maps parameter keys to their values (mm, degrees), ``origins`` to their places in the ``file``.

    ``type`` is the modules, ``parts`` are the parts of all members.
    ``members`` are the combinations that are wanted, in the order of ``choices``; None: every one.
    """

    vehicle: str
    type: str
    choices: Mapping[str, tuple[float, ...]]
    origins: Mapping[str, str]
    file: Path
    place: str
    members: tuple[tuple[float, ...], ...] | None = None
    parts: PartChoices = DEFAULT_CHOICES
    # Why a member cannot be built, or None, by its values: checking one takes some 20 ms.
    _checked: dict[tuple[float, ...], DesignError | None] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        """The number of designs that can be built."""
        return self.combinations - len(self.skipped)

    @property
    def combinations(self) -> int:
        """The number of designs, those that cannot be built included."""
        return math.prod(len(values) for values in self.choices.values()) if self.members is None else len(self.members)

    def spread_out(self) -> Iterator[tuple[int, tuple[float, ...]]]:
        """Every combination with its place in the order; the first ones of any number are spread over the family."""
        count = self.combinations
        step = round(count * GOLDEN_RATIO) or 1
        while math.gcd(step, count) > 1:
            step += 1
        for turn in range(count):
            place = rest = turn * step % count
            values = []
            for choices in reversed(list(self.choices.values())):
                rest, at = divmod(rest, len(choices))
                values.append(choices[at])
            yield place, tuple(reversed(values))

    def __iter__(self) -> Iterator[Design]:
        """Every design that can be built; ListingError, naming all that is wrong with the first, if none can."""
        built = False
        for values in self._combinations():
            if self.error(values) is None:
                built = True
                yield self.design(values)
        if not built:
            first = dict(zip(self.choices, next(self._combinations()), strict=True))
            raise self._listing_error([(self._origin(e.parameter), e.message) for e in self._errors(first)])

    def take_as_sound(self, built: Iterable[Mapping[str, float]]) -> None:
        """Members, by their columns, are known to be such that can be built."""
        columns = self.columns()
        self._checked.update((tuple(one[column] for column in columns), None) for one in built)

    @property
    def vehicle_type(self) -> str:
        """The type string of its members: their modules and the parts that are not the default ones."""
        return self.type + self.parts.suffix

    @property
    def skipped(self) -> list[str]:
        """The members that cannot be built, each with the reason: ``width=30 mm: width: 30 is below the minimum …``."""
        result = []
        for values in self._combinations():
            error = self.error(values)
            if error is not None:
                members = zip(self.choices.items(), values, strict=True)
                varied = [
                    f"{key}={value:g} {declared(key).unit}".rstrip()
                    for (key, choices), value in members
                    if len(choices) > 1
                ]
                at_fault = "" if error.parameter is None else f"{error.parameter}: "
                result.append(f"{', '.join(varied)}: {at_fault}{error.message}")
        return result

    def design(self, values: tuple[float, ...]) -> Design:
        """The design with these values, in the order of ``choices``; DesignError if it cannot be built."""
        return compose(self.type, dict(zip(self.choices, values, strict=True)), self.parts)

    def has(self, values: tuple[float, ...]) -> bool:
        """Whether they are one of the family's combinations, whatever its ``members``."""
        return all(value in choices for value, choices in zip(values, self.choices.values(), strict=True))

    def columns(self) -> list[str]:
        """The column names in results of the parameters, in the order of ``choices``."""
        return [_column(key) for key in self.choices]

    def only(self, members: Iterable[tuple[float, ...]]) -> "Family":
        """The family of these combinations alone."""
        return replace(self, members=tuple(members))

    def _combinations(self) -> Iterator[tuple[float, ...]]:
        return itertools.product(*self.choices.values()) if self.members is None else iter(self.members)

    def error(self, values: tuple[float, ...]) -> DesignError | None:
        """Why the car with these values cannot be built; None if it can."""
        if values not in self._checked:
            self._checked[values] = self._first_error(dict(zip(self.choices, values, strict=True)))
        return self._checked[values]

    def _errors(self, values: Mapping[str, float]) -> list[DesignError]:
        """What is wrong with a design: all values beyond their limits or, with none, what else is wrong first."""
        beyond = design_errors(self.type, values, catalogue_of(self.parts))
        first = self._first_error(values)
        return [error for error, _ in beyond.values()] or ([] if first is None else [first])

    def _first_error(self, values: Mapping[str, float]) -> DesignError | None:
        try:
            folded_car(compose(self.type, values, self.parts))
        except DesignError as error:
            return error
        return None

    def _listing_error(self, mistakes: list[tuple[str, str]]) -> ListingError:
        origin, message = mistakes[0]
        if origin.startswith("--set"):
            return ListingError(origin, message)
        return ListingError(self.file, *(f"{origin}: {message}" for origin, message in mistakes))

    @property
    def varied(self) -> dict[str, tuple[float, ...]]:
        """The parameters with more than one value, by their column names in results (``width_mm``)."""
        return {_column(key): values for key, values in self.choices.items() if len(values) > 1}

    def narrowed(self, settings: Mapping[str, float | str]) -> "Family":
        """The family with these parameters fixed (``width``, ``W.length``) and parts of these names; FoldcarError."""
        choices, origins, parts, letters = dict(self.choices), dict(self.origins), self.parts, self.type.split("_")
        for key, value in settings.items():
            if isinstance(value, str):
                try:
                    parts = parts.changed({key: value})
                except PartError as error:
                    raise ListingError(f"--set {key}={value}", error.message) from error
                continue
            parameter = parameter_of(key)
            if parameter is None or parameter.modules.isdisjoint(letters):
                known = [name for name, p in parameters().items() if not p.modules.isdisjoint(letters)]
                known += OPTIONS
                close = did_you_mean(key, known)
                raise ListingError(f"--set {key}", f"{self.type} has no such parameter; it has {', '.join(known)}{close}")
            choices[key] = (value,)
            origins[key] = f"--set {key}"
        # Where each module has a value of its own, that of all sets nothing.
        for key in [key for key in choices if key in parameters() and key not in settings]:
            keys = place_keys(key, letters)
            if keys and choices.keys() >= set(keys):
                del choices[key]
        return replace(self, choices=choices, origins=origins, parts=parts, _checked={})

    def single(self) -> Design:
        """The only design; ListingError naming a parameter that has several values."""
        for key, values in self.choices.items():
            if len(values) > 1:
                shown = ", ".join(f"{value:g}" for value in values[:3])
                more = f", … {values[-1]:g}" if len(values) > 3 else ""
                has = f"has {len(values)} values ({shown}{more})"
                raise self._listing_error([(self.origins[key], f"{has}; choose one with --set {key}=…")])
        return next(iter(self))

    def _origin(self, key: str | None) -> str:
        if key is None:
            return f"{self.place}.type"
        return self.origins.get(key, f"{self.place}: {key} (its default)")


def _column(key: str) -> str:
    parameter = parameter_of(key)
    assert parameter is not None, key
    return parameter.column


def read_family(file: Path, vehicle_id: str, vehicle: ListedVehicle) -> Family:
    """The family of the vehicle ``vehicle_id`` of the listing ``file``; ListingError of all mistakes if it is invalid."""
    place = f"vehicles.{vehicle_id}"
    try:
        letters = modules_of(vehicle.type)
    except DesignError as error:
        raise ListingError(file, f"{place}.type: {error.message}") from error
    choices: dict[str, tuple[float, ...]] = {}
    origins: dict[str, str] = {}
    mistakes = []
    composition, parts = vehicle.type, DEFAULT_CHOICES
    try:
        composition, parts = split_type(vehicle.type)
    except PartError as error:
        mistakes.append(f"{place}.type: {error}")
    for kind, name in vehicle.parts.items():
        try:
            parts = parts.changed({kind: name})
        except PartError as error:
            at = "" if error.kind is None else f".{error.kind}"
            mistakes.append(f"{place}.parts{at}: {error.message}")
    for index, groups in enumerate(vehicle.params):
        for group, settings in groups.items():
            here = f"{place}.params.{index}.{group}"
            if group not in ("common", *letters, *places_of(letters)):
                known = ", ".join([*sorted(set(letters)), *places_of(letters)])
                mistakes.append(f"{here}: {vehicle.type} has no module {group}; known: common, {known}")
                continue
            for parameter_name, values in settings.items():
                parameter = find_parameter(group, parameter_name)
                origin = f"{here}.{parameter_name}"
                if parameter is None:
                    names = names_in(group)
                    close = did_you_mean(parameter_name, names)
                    mistakes.append(f'{here}: unknown parameter "{parameter_name}"; known: {", ".join(names)}{close}')
                elif not parameter.declared.is_switch and any(isinstance(value, bool) for value in values):
                    text = f"{values[0]} is not a number; write a number, a list of numbers or a range"
                    mistakes.append(f"{origin}: {text}")
                elif choices.setdefault(parameter.key, values) != values:
                    first = origins[parameter.key]
                    mistakes.append(f"{origin}: differs from {first}, but the whole car has one value of it")
                else:
                    origins.setdefault(parameter.key, origin)
    if mistakes:
        raise ListingError(file, *mistakes)
    return Family(vehicle_id, composition, choices, origins, file, place, parts=parts)
