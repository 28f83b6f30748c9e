"""A car's design: the sequence of its modules from front to back and a value for every parameter.

Input: a type string (``W_B_W``) and parameter values in millimetres and degrees by key (``width``,
``W.length``). Output: an immutable Design; its geometry in millimetres, x forward from the middle of the
car's length, hinges flat.

A shared parameter has one value for the whole car; the other ones belong to a module and hold for every module of that
letter. A place sets the value of one module: ``W2.radius`` is that of the second W from the front. In listings a
parameter is found under its module (``{"W": {"length": 60}}``), its place (``{"W2": …}``) or, if shared, ``common``.
A user's own modules come from ``--components FILE``: an error in it is a message of one line that names file and line.
"""

import cmath
import itertools
import math
import operator
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from foldcar.car.components.component import ROUNDING, Parameter, at_least
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import BrainModule, Module, WheelModule
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, Catalogue, PartChoices, PartError, chosen, split_type
from foldcar.errors import FoldcarError

HINGE = HingeModule.letter
# Every known module by its letter or name.
MODULES: dict[str, type[Module] | type[HingeModule]] = {
    kind.letter: kind for kind in (WheelModule, BrainModule, HingeModule)
}


@dataclass(frozen=True, slots=True)
class DesignParameter:
    """A parameter of the car: its key in designs, the modules that have it, its declaration."""

    key: str
    modules: frozenset[str]
    declared: Parameter

    @property
    def column(self) -> str:
        """Its column name in results, which ends in its unit."""
        return "_".join(filter(None, (*self.key.split("."), self.declared.unit)))


@cache
def parameters() -> dict[str, DesignParameter]:
    """Every parameter by key, in the order of the results' columns: shared ones first."""
    having: dict[str, tuple[Parameter, set[str]]] = {}
    for shared in (True, False):
        for letter, kind in MODULES.items():
            for parameter in kind.parameters:
                if parameter.shared == shared:
                    key = parameter.name if shared else f"{letter}.{parameter.name}"
                    having.setdefault(key, (parameter, set()))[1].add(letter)
    return {key: DesignParameter(key, frozenset(letters), one) for key, (one, letters) in having.items()}


# A place: the letter of a module and its number among those, counted from the front.
PLACE = re.compile(r"(.*[^0-9])([1-9][0-9]*)")


def find_parameter(group: str, name: str) -> DesignParameter | None:
    """The parameter that ``{group: {name: …}}`` of a listing sets, or None; ``group`` is ``common``, a letter or a place.

    ``find_parameter("W2", "radius").key`` is ``"W2.radius"``.
    """
    shared = parameters().get(name)
    if shared is not None and (group == "common" or group in shared.modules):
        return shared
    place = PLACE.fullmatch(group)
    if place is None or group in MODULES:
        return parameters().get(f"{group}.{name}")
    every = find_parameter(place[1], name)
    if every is None or every.declared.uniform:
        return None
    return DesignParameter(f"{group}.{name}", frozenset((place[1],)), every.declared)


def parameter_of(key: str) -> DesignParameter | None:
    """The parameter of a key: ``radius``, ``W.length``, ``W2.radius``; None if there is none."""
    group, _, name = key.rpartition(".")
    return find_parameter(group or "common", name)


def key_of(column: str) -> str | None:
    """The key of a column of results: ``W2.radius`` of ``W2_radius_mm``; None if it is no column of a parameter."""
    for key, parameter in parameters().items():
        if parameter.column == column:
            return key
    group, _, rest = column.partition("_")
    names = {parameter.declared.name for parameter in parameters().values()}
    found = (find_parameter(group, name) for name in names if rest.startswith(name))
    return next((one.key for one in found if one is not None and one.column == column), None)


def places_of(letters: Sequence[str]) -> list[str]:
    """The places of a car's modules, front to back: ``places_of(("W", "B", "W"))`` is ``["W1", "B1", "W2"]``."""
    return [f"{letter}{letters[: i + 1].count(letter)}" for i, letter in enumerate(letters)]


def place_keys(key: str, letters: Sequence[str]) -> list[str]:
    """The keys of a parameter's places in a car: of ``radius`` in W_B_W ``W1.radius`` and ``W2.radius``."""
    parameter = parameters()[key]
    places = places_of([letter for letter in letters if letter in parameter.modules])
    return [] if parameter.declared.uniform else [f"{place}.{parameter.declared.name}" for place in sorted(places)]


def names_in(group: str) -> list[str]:
    """The parameter names that ``group`` (``common``, a module letter or a place) may set."""
    names = {parameter.declared.name for parameter in parameters().values()}
    return sorted(name for name in names if find_parameter(group, name) is not None)


# Each wheel has a servo of its own, and the servo driver has eight outputs.
MAX_AXLES = 4
# The simulator's limit.
MAX_SEGMENTS = 8


class DesignError(FoldcarError):
    """A design that cannot be built. ``parameter`` is the key of the value at fault, or None for the type string."""

    def __init__(self, parameter: str | None, message: str) -> None:
        super().__init__(f"{parameter}: {message}" if parameter else message)
        self.parameter, self.message = parameter, message


@dataclass(frozen=True)
class ModuleValues:
    """The values of one module's parameters (mm, degrees) by name, and the key of the design that sets each."""

    values: Mapping[str, float]
    keys: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Segment:
    """A rigid part of a car: the indices of its modules, x of its centre and its length (mm)."""

    modules: tuple[int, ...]
    center_mm: float
    length_mm: float


@dataclass(frozen=True)
class Design:
    """A design that passed its checks. ``values`` holds every parameter of its modules by key, in mm and degrees.

    The value of a place (``W2.radius``) stands before that of the letter, for this module.
    """

    modules: tuple[str, ...]
    values: Mapping[str, float]
    choices: PartChoices = DEFAULT_CHOICES

    @property
    def parts(self) -> Catalogue:
        """The data of the car's parts."""
        return chosen(self.choices)

    @property
    def composition(self) -> str:
        """The modules, front to back."""
        return "_".join(self.modules)

    @property
    def type(self) -> str:
        """The type string: the modules, front to back, and the parts that are not the default ones."""
        return self.composition + self.choices.suffix

    @property
    def title(self) -> str:
        """The car in a line: its type, what all its modules share, and its axles without servos."""
        told = ((key, value, declared(key)) for key, value in self.values.items())
        return " ".join([self.type, *(f"{key}={value:g}" for key, value, one in told if one.shared or one.is_switch)])

    @property
    def columns(self) -> dict[str, float]:
        """The parameters by their column names in results, which end in the unit."""
        found = ((parameter_of(key), value) for key, value in self.values.items())
        return {parameter.column: value for parameter, value in found if parameter is not None}

    @cached_property
    def of_modules(self) -> tuple[ModuleValues, ...]:
        """The values of each module, front to back."""
        return tuple(
            _module_values(letter, self.modules[: i + 1].count(letter), self.values, self.parts)
            for i, letter in enumerate(self.modules)
        )

    def of(self, module: int, name: str) -> float:
        """The value of a parameter of the module with that index (mm, degrees): ``design.of(0, "radius")``."""
        return self.of_modules[module].values[name]

    @property
    def wheel_modules(self) -> tuple[int, ...]:
        """The indices of the modules with an axle, front to back."""
        return tuple(i for i, letter in enumerate(self.modules) if letter == WheelModule.letter)

    @property
    def driven_modules(self) -> tuple[int, ...]:
        """The indices of the modules whose axle has servos, front to back."""
        return tuple(i for i in self.wheel_modules if self.of(i, "driven"))

    @property
    def radii_mm(self) -> tuple[float, ...]:
        """The wheels' radius of each axle (mm), front to back."""
        return tuple(self.of(i, "radius") for i in self.wheel_modules)

    @property
    def length_mm(self) -> float:
        """Length of the body (mm), hinges flat."""
        return sum(self.length_of(i) for i in range(len(self.modules)))

    def length_of(self, module: int) -> float:
        """Length of the module with that index (mm)."""
        return self.of(module, "length")

    @property
    def module_centers_mm(self) -> tuple[float, ...]:
        """x of each module's centre (mm), front to back."""
        lengths = [self.length_of(i) for i in range(len(self.modules))]
        fronts = itertools.accumulate(lengths, operator.sub, initial=self.length_mm / 2)
        return tuple(front - length / 2 for front, length in zip(fronts, lengths, strict=False))

    @property
    def axles_mm(self) -> tuple[float, ...]:
        """x of each axle (mm), front to back."""
        return tuple(self.module_centers_mm[i] for i in self.wheel_modules)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The rigid parts, front to back."""
        found = []
        for hinge, group in itertools.groupby(range(len(self.modules)), lambda i: self.modules[i] == "H"):
            if not hinge:
                indices = tuple(group)
                lengths = [self.length_of(i) for i in indices]
                front = self.module_centers_mm[indices[0]] + lengths[0] / 2
                found.append(Segment(indices, front - sum(lengths) / 2, sum(lengths)))
        return tuple(found)

    def segment_at(self, module: int) -> int:
        """The index of the segment to which the module with index ``module`` belongs."""
        return self.modules[:module].count("H")

    def segment_of(self, module: int) -> Segment:
        """The segment to which the module with index ``module`` belongs."""
        return self.segments[self.segment_at(module)]


def modules_of(type_string: str) -> tuple[str, ...]:
    """The module letters of a type string; DesignError for unknown, missing or wrongly placed modules."""
    letters = tuple(type_string.partition("+")[0].split("_"))
    for letter in letters:
        if letter not in MODULES:
            known = ", ".join(f"{known} ({kind.title})" for known, kind in MODULES.items())
            raise DesignError(None, f'"{type_string}" has unknown module "{letter}"; known: {known}')
    for letter in (WheelModule.letter, BrainModule.letter):
        if letter not in letters:
            raise DesignError(None, f'"{type_string}" has no module {letter} ({MODULES[letter].title})')
    if letters.count("W") > MAX_AXLES:
        raise DesignError(None, f'"{type_string}" has {letters.count("W")} axles, the servo driver serves {MAX_AXLES}')
    if letters[0] == "H" or letters[-1] == "H" or ("H", "H") in itertools.pairwise(letters):
        raise DesignError(None, f'"{type_string}" has a hinge (H) beside no segment: each must join two')
    segments = letters.count("H") + 1
    if segments > MAX_SEGMENTS:
        raise DesignError(None, f'"{type_string}" has {segments} segments, the simulator takes {MAX_SEGMENTS}')
    return letters


def _module_values(letter: str, number: int, values: Mapping[str, float], parts: Catalogue) -> ModuleValues:
    """The values of the ``number``-th module of a letter: those of its place, else of its letter, else shared ones."""
    keys, every = {}, MODULES[letter].parameters
    for parameter in every:
        known = (f"{letter}{number}.{parameter.name}", f"{letter}.{parameter.name}", parameter.name)
        key = next((key for key in known if key in values), None)
        if key is not None:
            keys[parameter.name] = key
    defaults = {one.name: one.default_with(parts) for one in every if one.optional}
    return ModuleValues(defaults | {name: values[key] for name, key in keys.items()}, keys)


def compose(type_string: str, values: Mapping[str, float], choices: PartChoices | None = None) -> Design:
    """The design with ``values`` (mm, degrees; by key) and defaults for all others; DesignError if it cannot be built.

    Without ``choices`` the parts are those that the type string names. A key may be a place:
    ``compose("W_B_W", {"W2.radius": 50})``.
    """
    letters = modules_of(type_string)
    if choices is None:
        try:
            _, choices = split_type(type_string)
        except PartError as error:
            raise DesignError(None, str(error)) from error
    design = Design(letters, _complete(type_string, letters, values, chosen(choices)), choices)
    for key, value in design.values.items():
        complaint = declared(key).complaint(value, design.parts)
        if complaint:
            raise DesignError(key, complaint)
    tyre = design.parts.tyre
    for module in design.wheel_modules:
        width_mm, key = design.of(module, "tire_thickness"), design.of_modules[module].keys["tire_thickness"]
        if tyre.width_mm is not None and width_mm < tyre.width_mm.value:
            raise DesignError(key, f"{width_mm:g} is below the {tyre.width_mm.value:g} of the {tyre.name}")
    if not design.driven_modules:
        raise DesignError(None, f'"{type_string}" has no driven axle: at least one W needs "driven": true')
    _check_wheels(design)
    return design


def compose_columns(type_string: str, columns: Mapping[str, float | str]) -> Design:
    """The design of a row of results: ``compose_columns("W_B_W", {"width_mm": 95})``; DesignError for another column."""
    values = {}
    for column, value in columns.items():
        key = key_of(column)
        if key is None:
            raise DesignError(None, f"no module has the parameter {column}")
        values[key] = float(value)
    return compose(type_string, values)


def declared(key: str) -> Parameter:
    """The declaration of the parameter of a key, which must be one."""
    found = parameter_of(key)
    assert found is not None, key
    return found.declared


def _complete(
    type_string: str, letters: tuple[str, ...], values: Mapping[str, float], parts: Catalogue
) -> dict[str, float]:
    """The values by key, with defaults for all that no value or place sets; DesignError for a key that sets nothing."""
    complete: dict[str, float] = {}
    for key, parameter in parameters().items():
        if parameter.modules.isdisjoint(letters):
            continue
        keys = place_keys(key, letters)
        set_by_place = {place: float(values[place]) for place in keys if place in values}
        all_set = bool(keys) and len(set_by_place) == len(keys)
        if key in values and all_set:
            raise DesignError(key, f"sets nothing: every module has a value of its own, {', '.join(set_by_place)}")
        if key in values or not (all_set or parameter.declared.optional):
            complete[key] = float(values.get(key, parameter.declared.default_with(parts)))
        complete |= set_by_place
    for key in values:
        if key not in complete:
            raise DesignError(key, _unknown(type_string, letters, key, complete))
    return complete


def _unknown(type_string: str, letters: Sequence[str], key: str, known: Iterable[str]) -> str:
    """Why a key sets nothing in a car."""
    group, _, name = key.partition(".")
    place = PLACE.fullmatch(group)
    if place is not None and place[1] in letters:
        every = find_parameter(place[1], name)
        if int(place[2]) > letters.count(place[1]):
            return f"{type_string} has {letters.count(place[1])} modules {place[1]}"
        if every is not None and every.declared.uniform:
            return f"the whole car has one value of it: set {every.key}"
    return f"{type_string} has no such parameter; it has {', '.join(known)}"


def design_errors(
    type_string: str, values: Mapping[str, float], parts: Catalogue
) -> dict[str, tuple[DesignError, float]]:
    """For every value beyond its limits, by key: the error, and the limit."""
    letters, errors = modules_of(type_string), {}
    for key, value in values.items():
        parameter = parameter_of(key)
        if parameter is None or parameter.modules.isdisjoint(letters):
            continue
        one = parameter.declared
        complaint = one.complaint(value, parts)
        if complaint:
            limit = one.maximum if value > one.maximum else one.least_with(parts)
            errors[key] = (DesignError(key, complaint), limit)
    return errors


def _check_wheels(design: Design) -> None:
    """DesignError if neighbouring wheels would touch or the belly would touch the ground."""
    height, belly = design.values["height"], design.parts.assembly.belly_clearance_mm
    # Axles are at half the body's height.
    least = height / 2 + belly.value
    wheels = [(design.of(i, "radius"), design.of_modules[i].keys["radius"], i) for i in design.wheel_modules]
    for radius, key, _ in wheels:
        if radius < least - ROUNDING:
            why = f"half of height {height:g} and {belly.value:g} under the belly"
            raise DesignError(key, f"{radius:g} is below the minimum {at_least(least)} ({why})")
    for front, rear in itertools.pairwise(wheels):
        least_distance = front[0] + rear[0] + design.parts.assembly.wheel_distance_mm.value
        distance, flat = _folded_distance_mm(design, front[2], rear[2])
        if distance < least_distance:
            folded = "" if distance == flat else ", folded to the limits of H"
            lengths = " and ".join(f"{key} {value:g}" for key, value in design.values.items() if key.endswith(".length"))
            radius, key, _ = max(front, rear, key=lambda one: one[0])
            beside = "" if front[0] == rear[0] else f" beside {min(front, rear)[0]:g}"
            needs = f"{radius:g}{beside} needs axles at least {least_distance:g} apart, or wheels touch"
            raise DesignError(key, f"{needs}, but {lengths} puts two of them {distance:.4g} apart{folded}")


def _folded_distance_mm(design: Design, front: int, rear: int) -> tuple[float, float]:
    """The least distance of the axles of two modules (mm) with the hinges between at one of their limits, and flat.

    Hinges are at the floor, half the body's height below the axles.
    """
    centers, hinges = design.module_centers_mm, [i for i in range(front, rear) if design.modules[i] == HINGE]
    flat = centers[front] - centers[rear]
    if not hinges:
        return flat, flat
    hinges.reverse()
    drop, places = design.values["height"] / 2, [centers[i] for i in (rear, *hinges, front)]
    # From the rear axle forwards, along and up; each stretch is pitched once more than the one before it.
    rises = [-drop, *[0.0] * (len(hinges) - 1), drop]
    steps = [complex(ahead - behind, up) for behind, ahead, up in zip(places, places[1:], rises, strict=False)]
    distances = []
    for sign, name in ((0, "fold_down"), (-1, "fold_down"), (1, "fold_up")):
        folds = itertools.accumulate((sign * math.radians(design.of(i, name)) for i in hinges), initial=0.0)
        distances.append(abs(sum(step * cmath.rect(1.0, fold) for step, fold in zip(steps, folds, strict=True))))
    return min(distances), distances[0]
