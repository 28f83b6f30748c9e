"""A listed vehicle as a family of designs: every combination of its parameters' values.

Input: a vehicle of a listing. Output: designs in the order of the listing; the last varied parameter changes fastest.
Members that cannot be built are skipped, and the reasons are kept. Errors name file and key.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from foldcar.car.design import Design, DesignError, compose, limit_errors, modules_of
from foldcar.car.design_parameters import (
    DesignParameter,
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

# The fractional parts of its multiples are spread evenly over 0 to 1.
GOLDEN_RATIO = (5**0.5 - 1) / 2
# Values of a parameter that a message lists one by one.
MAX_LISTED = 6


@dataclass(frozen=True)
class Family:
    """A family of designs: all combinations of the values of its parameters, or the selected ones.

    ``choices`` maps parameter keys to values (mm, degrees), ``origins`` to their places in ``file``. ``type`` names the
    modules, ``parts`` the bought parts of all members. ``members`` are the selected combinations, with values in the
    order of ``choices``; None stands for all combinations.
    """

    vehicle: str
    type: str
    choices: Mapping[str, tuple[float, ...]]
    origins: Mapping[str, str]
    file: Path
    place: str
    members: tuple[tuple[float, ...], ...] | None = None
    parts: PartChoices = DEFAULT_CHOICES
    # Results of checks by a member's values, None if it can be built. A check takes about 20 ms.
    _checked: dict[tuple[float, ...], DesignError | None] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        """The number of designs that can be built."""
        return self.combinations - len(self.skipped)

    @property
    def combinations(self) -> int:
        """The number of designs, including those that cannot be built."""
        if self.members is not None:
            return len(self.members)
        return math.prod(len(values) for values in self.choices.values())

    def spread_out(self) -> Iterator[tuple[int, tuple[float, ...]]]:
        """Yield all combinations with their positions, in an order in which the first ones already cover the family.

        From one position to the next, a fixed step is added, and the sum is taken modulo the number of positions. The
        step is about the golden ratio times this number, which spreads the positions evenly. It has no common divisor
        with the number, so each position occurs once.
        """
        count = self.combinations
        step = max(1, round(count * GOLDEN_RATIO))
        while math.gcd(step, count) > 1:
            step += 1
        for index in range(count):
            position = index * step % count
            yield position, self._values_at(position)

    def _values_at(self, position: int) -> tuple[float, ...]:
        """Return the values at a position in the order of all combinations. The last parameter changes fastest in it."""
        remainder = position
        values = []
        for choices in reversed(list(self.choices.values())):
            remainder, choice = divmod(remainder, len(choices))
            values.append(choices[choice])
        return tuple(reversed(values))

    def __iter__(self) -> Iterator[Design]:
        """Yield the designs that can be built. If no design can, raise ListingError with the errors of the first."""
        is_any_buildable = False
        for values in self.value_combinations():
            if self.error(values) is None:
                is_any_buildable = True
                yield self.design(values)
        if not is_any_buildable:
            first_combination = next(self.value_combinations())
            value_by_key = dict(zip(self.choices, first_combination, strict=True))
            errors = self._errors(value_by_key)
            raise self._listing_error([(self._origin(error.parameter), error.message) for error in errors])

    def mark_buildable(self, designs: Iterable[Mapping[str, float]]) -> None:
        """Record that these members can be built, so that they are not checked; each maps columns to values."""
        columns = self.columns()
        for design in designs:
            values = tuple(design[column] for column in columns)
            self._checked[values] = None

    @property
    def vehicle_type(self) -> str:
        """The type string of its members: their modules, and parts that are not the default."""
        return self.type + self.parts.suffix

    @property
    def skipped(self) -> list[str]:
        """The members that cannot be built, each with the reason: ``width=30 mm: width: 30 is below the minimum …``."""
        skipped = []
        for values in self.value_combinations():
            error = self.error(values)
            if error is None:
                continue
            value_texts = []
            for key, value in zip(self.choices, values, strict=True):
                if len(self.choices[key]) > 1:
                    value_texts.append(f"{key}={value:g} {declared(key).unit}".rstrip())
            parameter_text = "" if error.parameter is None else f"{error.parameter}: "
            skipped.append(f"{', '.join(value_texts)}: {parameter_text}{error.message}")
        return skipped

    def design(self, values: tuple[float, ...]) -> Design:
        """Return the design with these values, in the order of ``choices``. Raises DesignError if it cannot be built."""
        return compose(self.type, dict(zip(self.choices, values, strict=True)), self.parts)

    def has(self, values: tuple[float, ...]) -> bool:
        """Return whether the values are a combination of the family's choices, even if not among its ``members``."""
        return all(value in choices for value, choices in zip(values, self.choices.values(), strict=True))

    def columns(self) -> list[str]:
        """Return the parameters' column names in results, in the order of ``choices``."""
        return [_column(key) for key in self.choices]

    def only(self, members: Iterable[tuple[float, ...]]) -> "Family":
        """Return the family with only these combinations."""
        return replace(self, members=tuple(members))

    def value_combinations(self) -> Iterator[tuple[float, ...]]:
        """Return the values of each design, including those that cannot be built."""
        if self.members is not None:
            return iter(self.members)
        return itertools.product(*self.choices.values())

    def error(self, values: tuple[float, ...]) -> DesignError | None:
        """Return why the car with these values cannot be built; None if it can."""
        if values not in self._checked:
            self._checked[values] = self._first_error(dict(zip(self.choices, values, strict=True)))
        return self._checked[values]

    def _errors(self, values: Mapping[str, float]) -> list[DesignError]:
        """Return the errors of the design with these values by parameter key.

        There is an error for each value outside its limits. If there is no such value, there is at most one error: the
        first that is found when the car is folded.
        """
        errors_of_limits = limit_errors(self.type, values, catalogue_of(self.parts))
        if errors_of_limits:
            return errors_of_limits
        first_error = self._first_error(values)
        return [] if first_error is None else [first_error]

    def _first_error(self, values: Mapping[str, float]) -> DesignError | None:
        """Fold the car with these values by parameter key; return the error, or None if it can be built."""
        try:
            folded_car(compose(self.type, values, self.parts))
        except DesignError as error:
            return error
        return None

    def _listing_error(self, mistakes: list[tuple[str, str]]) -> ListingError:
        """Return the error for pairs of a value's origin and the mistake in it.

        The error names the option ``--set`` if the first value comes from it, else the listing's file.
        """
        origin, message = mistakes[0]
        if origin.startswith("--set"):
            return ListingError(origin, message)
        return ListingError(self.file, *(f"{origin}: {message}" for origin, message in mistakes))

    @property
    def varied(self) -> dict[str, tuple[float, ...]]:
        """The parameters with more than one value, by their column names in results (``width_mm``)."""
        return {_column(key): values for key, values in self.choices.items() if len(values) > 1}

    def outside(self, settings: Mapping[str, float | str]) -> list[str]:
        """Return a remark on each of the ``settings`` whose value no car of the family has."""
        remarks = []
        for key, value in settings.items():
            # A string is the name of a part.
            if isinstance(value, str) or key not in self.choices:
                continue
            choices = self.choices[key]
            if value not in choices:
                reason = f"is not one of the family's values, {_values_text(choices)}"
                remarks.append(f"{key}={value:.10g} {reason}: a sweep has no such car")
        return remarks

    def narrowed(self, settings: Mapping[str, float | str]) -> "Family":
        """Return the family with some parameters and parts fixed, as the option ``--set`` does.

        ``settings`` has a number for each parameter, such as ``width`` or ``W.length``, and a name for each part, such as
        ``cells``. Raises FoldcarError.
        """
        choices, origins, parts = dict(self.choices), dict(self.origins), self.parts
        for key, value in settings.items():
            if isinstance(value, str):
                try:
                    parts = parts.changed({key: value})
                except PartError as error:
                    raise ListingError(f"--set {key}={value}", error.message) from error
            else:
                self._check_parameter(key)
                choices[key] = (value,)
                origins[key] = f"--set {key}"
        for key in self._ineffective_keys(choices):
            if key not in settings:
                del choices[key]
        # The new family does not know yet which of its designs can be built.
        return replace(self, choices=choices, origins=origins, parts=parts, _checked={})

    @property
    def _letters(self) -> list[str]:
        """The letters of the car's modules, such as W, B and W."""
        return self.type.split("_")

    def _check_parameter(self, key: str) -> None:
        """Raise ListingError if ``key`` is not a parameter of the car's modules."""
        parameter = parameter_of(key)
        if parameter is not None and parameter.belongs_to(self._letters):
            return
        valid_keys = [name for name, other in parameters().items() if other.belongs_to(self._letters)]
        valid_keys += OPTIONS
        suggestion = did_you_mean(key, valid_keys)
        reason = f"{self.type} has no such parameter; it has {', '.join(valid_keys)}{suggestion}"
        raise ListingError(f"--set {key}", reason)

    def _ineffective_keys(self, choices: Mapping[str, tuple[float, ...]]) -> list[str]:
        """Return the parameters that are given for all modules, although every module has a value of its own.

        An example is ``length`` beside ``1.length``, ``2.length`` and ``3.length``.
        """
        common_keys = [key for key in choices if key in parameters()]
        ineffective_keys = []
        for key in common_keys:
            module_keys = place_keys(key, self._letters)
            if module_keys and all(module_key in choices for module_key in module_keys):
                ineffective_keys.append(key)
        return ineffective_keys

    def single(self) -> Design:
        """Return the family's only design. Raises ListingError, which names a parameter with several values."""
        for key, values in self.choices.items():
            if len(values) > 1:
                values_text = ", ".join(f"{value:g}" for value in values[:3])
                if len(values) > 3:
                    values_text += f", … {values[-1]:g}"
                message = f"has {len(values)} values ({values_text}); choose one with --set {key}=…"
                raise self._listing_error([(self.origins[key], message)])
        return next(iter(self))

    def _origin(self, key: str | None) -> str:
        """Return where a parameter's value comes from: a place of the listing, ``--set``, or its default."""
        if key is None:
            return f"{self.place}.type"
        return self.origins.get(key, f"{self.place}: {key} (its default)")


def _column(key: str) -> str:
    """Return the column's name in results of the parameter ``key``."""
    parameter = parameter_of(key)
    assert parameter is not None, key
    return parameter.column


def read_family(file: Path, vehicle_id: str, vehicle: ListedVehicle) -> Family:
    """Return the family of a vehicle in a listing: all designs with the listed values of its parameters.

    ``vehicle.type`` names the modules and parts of the car, such as ``W_B_W+cells=nimh``. Raises ListingError with all
    mistakes, each with its place in ``file``.
    """
    place = f"vehicles.{vehicle_id}"
    try:
        letters = modules_of(vehicle.type)
    except DesignError as error:
        raise ListingError(file, f"{place}.type: {error.message}") from error
    composition, parts, mistakes = _listed_parts(vehicle, place)
    reader = _ParameterReader(vehicle.type, letters)
    for index, groups in enumerate(vehicle.params):
        for group, settings in groups.items():
            reader.read(group, settings, f"{place}.params.{index}.{group}")
    mistakes += reader.mistakes
    if mistakes:
        raise ListingError(file, *mistakes)
    return Family(vehicle_id, composition, reader.choices, reader.origins, file, place, parts=parts)


def _listed_parts(vehicle: ListedVehicle, place: str) -> tuple[str, PartChoices, list[str]]:
    """Return a vehicle's type without parts, its parts, and the mistakes in them.

    Parts are listed in the type, as in ``W_B_W+cells=nimh``, or under ``parts``.
    """
    composition, parts = vehicle.type, DEFAULT_CHOICES
    mistakes = []
    try:
        composition, parts = split_type(vehicle.type)
    except PartError as error:
        mistakes.append(f"{place}.type: {error}")
    for kind, name in vehicle.parts.items():
        try:
            parts = parts.changed({kind: name})
        except PartError as error:
            kind_text = "" if error.kind is None else f".{error.kind}"
            mistakes.append(f"{place}.parts{kind_text}: {error.message}")
    return composition, parts, mistakes


class _ParameterReader:
    """Reads the parameters of a listed vehicle, group by group.

    ``choices`` are the values of each parameter by its key, ``origins`` the places where they are listed. ``mistakes``
    are lines about parameters that are not valid.
    """

    def __init__(self, vehicle_type: str, letters: Sequence[str]) -> None:
        self.choices: dict[str, tuple[float, ...]] = {}
        self.origins: dict[str, str] = {}
        self.mistakes: list[str] = []
        self._type = vehicle_type
        self._modules = [*sorted(set(letters)), *places_of(letters)]

    def read(self, group: str, settings: Mapping[str, tuple[float, ...]], place: str) -> None:
        """Read the values of a group of modules, such as ``common``, ``W`` or ``W2``, which is listed at ``place``."""
        if group != "common" and group not in self._modules:
            known = ", ".join(self._modules)
            self.mistakes.append(f"{place}: {self._type} has no module {group}; known: common, {known}")
            return
        for name, values in settings.items():
            parameter = find_parameter(group, name)
            if parameter is None:
                names = names_in(group)
                suggestion = did_you_mean(name, names)
                self.mistakes.append(f'{place}: unknown parameter "{name}"; known: {", ".join(names)}{suggestion}')
            else:
                self._read_values(parameter, values, f"{place}.{name}")

    def _read_values(self, parameter: DesignParameter, values: tuple[float, ...], origin: str) -> None:
        """Keep the values of a parameter, which are listed at ``origin``."""
        has_boolean = any(isinstance(value, bool) for value in values)
        if has_boolean and not parameter.declared.is_switch:
            text = f"{values[0]} is not a number; write a number, a list of numbers or a range"
            self.mistakes.append(f"{origin}: {text}")
            return
        # The parameter may have been listed before, in another group of the listing. Then the values must be the same.
        earlier_values = self.choices.setdefault(parameter.key, values)
        if earlier_values != values:
            first = self.origins[parameter.key]
            reason = f"differs from {first}, but this parameter has one value for the whole car"
            self.mistakes.append(f"{origin}: {reason}")
            return
        self.origins.setdefault(parameter.key, origin)


def _values_text(values: Sequence[float]) -> str:
    """Return few values one by one, of many the range: ``95 and 115``, ``37 values from 65 to 245``."""
    if len(values) > MAX_LISTED:
        return f"{len(values)} values from {min(values):.10g} to {max(values):.10g}"
    *first_texts, last_text = [f"{value:.10g}" for value in values]
    return f"{', '.join(first_texts)} and {last_text}" if first_texts else last_text
