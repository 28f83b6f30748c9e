"""A car's design: the sequence of its modules from front to back and a value for every parameter.

Input: a type string (``W_B_W``) and parameter values in millimetres and degrees by key (``width``,
``W.length``). Output: an immutable Design; its geometry in millimetres, x forward from the middle of the
car's length, hinges flat.

A shared parameter has one value for the whole car; the other ones belong to a module and hold for every module of that
letter. In listings a parameter is found under its module (``{"W": {"length": 60}}``) or, if shared, under ``common``.
A user's own modules come from ``--components FILE``: an error in it is a message of one line that names file and line.
"""

import cmath
import itertools
import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

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
        return f"{self.key.replace('.', '_')}_{self.declared.unit}"


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


def find_parameter(group: str, name: str) -> DesignParameter | None:
    """The parameter that ``{group: {name: …}}`` of a listing sets, or None; ``group`` is ``common`` or a letter."""
    shared = parameters().get(name)
    if shared is not None and (group == "common" or group in shared.modules):
        return shared
    return parameters().get(f"{group}.{name}")


def names_in(group: str) -> list[str]:
    """The parameter names that ``group`` (``common`` or a module letter) may set."""
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


@dataclass(frozen=True, slots=True)
class Segment:
    """A rigid part of a car: the indices of its modules, x of its centre and its length (mm)."""

    modules: tuple[int, ...]
    center_mm: float
    length_mm: float


@dataclass(frozen=True, slots=True)
class Design:
    """A design that passed its checks. ``values`` holds every parameter of its modules by key, in mm and degrees."""

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
        """The car in a line: its type and what all its modules share."""
        return " ".join([self.type, *(f"{key}={value:g}" for key, value in self.values.items() if "." not in key)])

    @property
    def columns(self) -> dict[str, float]:
        """The parameters by their column names in results, which end in the unit."""
        return {parameters()[key].column: value for key, value in self.values.items()}

    @property
    def length_mm(self) -> float:
        """Length of the body (mm), hinges flat."""
        return sum(self.values[f"{letter}.length"] for letter in self.modules)

    def length_of(self, module: int) -> float:
        """Length of the module with that index (mm)."""
        return self.values[f"{self.modules[module]}.length"]

    @property
    def module_centers_mm(self) -> tuple[float, ...]:
        """x of each module's centre (mm), front to back."""
        lengths = [self.length_of(i) for i in range(len(self.modules))]
        fronts = itertools.accumulate(lengths, operator.sub, initial=self.length_mm / 2)
        return tuple(front - length / 2 for front, length in zip(fronts, lengths, strict=False))

    def centers_of(self, letter: str) -> tuple[float, ...]:
        """x of the centre of each module of a letter (mm), front to back."""
        return tuple(x for one, x in zip(self.modules, self.module_centers_mm, strict=True) if one == letter)

    @property
    def axles_mm(self) -> tuple[float, ...]:
        """x of each axle (mm), front to back."""
        return self.centers_of("W")

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


def compose(type_string: str, values: Mapping[str, float], choices: PartChoices | None = None) -> Design:
    """The design with ``values`` (mm, degrees; by key) and defaults for all others; DesignError if it cannot be built.

    Without ``choices`` the parts are those that the type string names.
    """
    letters = modules_of(type_string)
    if choices is None:
        try:
            _, choices = split_type(type_string)
        except PartError as error:
            raise DesignError(None, str(error)) from error
    complete = {
        key: float(values.get(key, parameter.declared.default_with(chosen(choices))))
        for key, parameter in parameters().items()
        if not parameter.modules.isdisjoint(letters)
    }
    for key in values:
        if key not in complete:
            raise DesignError(key, f"{type_string} has no such parameter; it has {', '.join(complete)}")
    design = Design(letters, complete, choices)
    for key, value in design.values.items():
        complaint = parameters()[key].declared.complaint(value, design.parts)
        if complaint:
            raise DesignError(key, complaint)
    tyre, key = design.parts.tyre, "W.tire_thickness"
    if tyre.width_mm is not None and design.values[key] < tyre.width_mm.value:
        raise DesignError(key, f"{design.values[key]:g} is below the {tyre.width_mm.value:g} of the {tyre.name}")
    _check_wheels(design)
    return design


def design_errors(
    type_string: str, values: Mapping[str, float], parts: Catalogue
) -> dict[str, tuple[DesignError, float]]:
    """For every value beyond its limits, by key: the error, and the limit."""
    letters, errors = modules_of(type_string), {}
    for key, value in values.items():
        declared = parameters()[key].declared
        complaint = declared.complaint(value, parts)
        if complaint and not parameters()[key].modules.isdisjoint(letters):
            limit = declared.maximum if value > declared.maximum else declared.least_with(parts)
            errors[key] = (DesignError(key, complaint), limit)
    return errors


def _check_wheels(design: Design) -> None:
    """DesignError if neighbouring wheels would touch or the belly would touch the ground."""
    radius, height, belly = design.values["radius"], design.values["height"], design.parts.assembly.belly_clearance_mm
    # Axles are at half the body's height.
    least = height / 2 + belly.value
    if radius < least - ROUNDING:
        why = f"half of height {height:g} and {belly.value:g} under the belly"
        raise DesignError("radius", f"{radius:g} is below the minimum {at_least(least)} ({why})")
    least_distance = 2 * radius + design.parts.assembly.wheel_distance_mm.value
    for front, rear in itertools.pairwise(design.axles_mm):
        distance = _folded_distance_mm(design, front, rear)
        if distance < least_distance:
            folded = "" if distance == front - rear else ", folded to the limits of H"
            lengths = " and ".join(f"{key} {value:g}" for key, value in design.values.items() if key.endswith(".length"))
            needs = f"{radius:g} needs axles at least {least_distance:g} apart, or wheels touch"
            raise DesignError("radius", f"{needs}, but {lengths} puts two of them {distance:.4g} apart{folded}")


def _folded_distance_mm(design: Design, front_mm: float, rear_mm: float) -> float:
    """The least distance of two axles (mm) with all hinges between them flat, at their lower or at their upper limit.

    Hinges are at the floor, half the body's height below the axles.
    """
    between = [x for x in design.centers_of("H") if rear_mm < x < front_mm]
    if not between:
        return front_mm - rear_mm
    drop, places = design.values["height"] / 2, [rear_mm, *reversed(between), front_mm]
    # From the rear axle forwards, along and up; each stretch is pitched once more than the one before it.
    rises = [-drop, *[0.0] * (len(between) - 1), drop]
    steps = [complex(ahead - behind, up) for behind, ahead, up in zip(places, places[1:], rises, strict=False)]
    folds = (math.radians(fold) for fold in (0.0, -design.values["H.fold_down"], design.values["H.fold_up"]))
    return min(abs(sum(step * cmath.rect(1.0, i * fold) for i, step in enumerate(steps))) for fold in folds)
