"""A car's design: the sequence of its modules from front to back and a value for every parameter.

Input: a type string (``W_B_W``) and parameter values in millimetres and degrees by key (``width``,
``W.length``). Output: an immutable Design; its geometry in millimetres, x forward from the middle of the
car's length, hinges flat.

A shared parameter has one value for the whole car; other parameters hold for every module of their letter. A place sets
the value of one module: ``W2.radius`` is the radius of the second W from the front. In listings a parameter stands
under its module (``{"W": {"length": 60}}``), its place (``{"W2": …}``) or, if shared, ``common``. ``--components FILE``
adds a user's own modules: an error in it is a message of one line that names file and line.
"""

import itertools
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from foldcar.car.components.composite import Composite
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import BrainModule, Module, WheelModule

# Exported from here too, because `compose` raises it.
from foldcar.car.design_checks import DesignError as DesignError
from foldcar.car.design_checks import check_design
from foldcar.car.design_parameters import (
    MODULES,
    PLACE,
    find_parameter,
    key_of,
    parameter_of,
    parameters,
    place_keys,
    places_of,
)
from foldcar.car.parts.catalogue import DEFAULT_CHOICES, Catalogue, PartChoices, PartError, catalogue_of, split_type
from foldcar.car.user_modules import component_errors

HINGE = HingeModule.letter
# Each driven wheel has a servo of its own, and the servo driver has eight outputs; the simulator takes eight wheels.
MAX_AXLES = 4
# The simulator's limit.
MAX_SEGMENTS = 8


@dataclass(frozen=True)
class ModuleValues:
    """The values of one module's parameters (mm, degrees) by name, and the key of the design that sets each.

    ``root``: a composite names the module as the one that carries the electronics.
    """

    kind: type[Module] | type[HingeModule]
    values: Mapping[str, float]
    keys: Mapping[str, str]
    root: bool = False


@dataclass(frozen=True, slots=True)
class Segment:
    """A rigid part of a car: the indices of its modules, x of its centre and its length (mm)."""

    modules: tuple[int, ...]
    center_mm: float
    length_mm: float


@dataclass(frozen=True)
class Design:
    """A design that passed its checks. ``values`` holds every parameter of its modules by key, in mm and degrees.

    The value of a place (``W2.radius``) overrides that of the letter for this module. ``letters`` are those of the type
    string, front to back; ``modules`` also resolve its composites.
    """

    letters: tuple[str, ...]
    values: Mapping[str, float]
    choices: PartChoices = DEFAULT_CHOICES

    @property
    def parts(self) -> Catalogue:
        """The data of the car's parts."""
        return catalogue_of(self.choices)

    @property
    def composition(self) -> str:
        """The modules and composites, front to back."""
        return "_".join(self.letters)

    @property
    def type(self) -> str:
        """The type string: the modules, front to back, and the parts that are not the default ones."""
        return self.composition + self.choices.suffix

    @property
    def title(self) -> str:
        """The car in a line: its type, shared values, values that a composite sets, and axles without servos."""
        texts = [f"{key}={value:g}" for key, value in self.values.items() if _is_of_car(key)]
        return " ".join([self.type, *texts])

    @property
    def columns(self) -> dict[str, float]:
        """The parameters by their column names in results, which end in the unit."""
        parameters_with_values = ((parameter_of(key), value) for key, value in self.values.items())
        return {parameter.column: value for parameter, value in parameters_with_values if parameter is not None}

    @cached_property
    def of_modules(self) -> tuple[ModuleValues, ...]:
        """The values of each module, front to back. Raises ComponentError if a composite's values are not allowed."""
        places = zip(self.letters, places_of(self.letters), strict=True)
        modules = (_module_values(letter, place, self.values, self.parts) for letter, place in places)
        return tuple(itertools.chain.from_iterable(modules))

    @cached_property
    def modules(self) -> tuple[str, ...]:
        """The letters of the modules, front to back."""
        return tuple(module.kind.letter for module in self.of_modules)

    @property
    def electronics(self) -> int:
        """The index of the module that carries boards and batteries: a composite's root, else the first B."""
        roots = (i for i, module in enumerate(self.of_modules) if module.root)
        return next(roots, self.modules.index(BrainModule.letter))

    @property
    def width_mm(self) -> float:
        """The outer width of the body (mm)."""
        return self.of(0, "width")

    @property
    def height_mm(self) -> float:
        """The outer height of the body (mm)."""
        return self.of(0, "height")

    def of(self, module: int, name: str) -> float:
        """Return the value of a parameter of the module with that index (mm, degrees): ``design.of(0, "radius")``."""
        return self.of_modules[module].values[name]

    @property
    def wheel_modules(self) -> tuple[int, ...]:
        """The indices of the modules with an axle, front to back."""
        return tuple(i for i, module in enumerate(self.of_modules) if issubclass(module.kind, WheelModule))

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
        """Return length of the module with that index (mm)."""
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
        """The rigid parts, front to back: groups of modules between hinges."""
        groups: list[list[int]] = [[]]
        for index, letter in enumerate(self.modules):
            if letter == HINGE:
                groups.append([])
            else:
                groups[-1].append(index)
        segments = []
        for group in groups:
            length_mm = sum(self.length_of(index) for index in group)
            first = group[0]
            front_x = self.module_centers_mm[first] + self.length_of(first) / 2
            segments.append(Segment(tuple(group), front_x - length_mm / 2, length_mm))
        return tuple(segments)

    def segment_at(self, module: int) -> int:
        """Return the index of the segment to which the module with index ``module`` belongs."""
        return self.modules[:module].count(HINGE)

    def segment_of(self, module: int) -> Segment:
        """Return the segment to which the module with index ``module`` belongs."""
        return self.segments[self.segment_at(module)]


def _is_of_car(key: str) -> bool:
    """Return whether the parameter is shown in the car's title: it is shared, a switch, or of a composite."""
    parameter = parameter_of(key)
    if parameter is None:
        return False
    of_composite = any(issubclass(MODULES[letter], Composite) for letter in parameter.modules)
    return of_composite or parameter.declared.shared or parameter.declared.is_switch


def modules_of(type_string: str) -> tuple[str, ...]:
    """Return the letters (or names) of a car's modules from its type string, front to back.

    ``modules_of("W_B_W")`` returns ("W", "B", "W"). A *composite* is a name that stands for several modules. Raises
    DesignError for unknown, missing or misplaced modules.
    """
    letters = tuple(type_string.partition("+")[0].split("_"))
    for letter in letters:
        if letter not in MODULES:
            known_modules = ", ".join(f"{name} ({kind.title})" for name, kind in MODULES.items())
            raise DesignError(None, f'"{type_string}" has unknown module "{letter}"; known: {known_modules}')
    # The modules of a composite, such as "W_B", are the same for all values of its parameters, so no values are needed.
    with component_errors(DesignError):
        parts = catalogue_of(DEFAULT_CHOICES)
        modules: list[ModuleValues] = []
        for letter in letters:
            modules += _module_values(letter, place=letter, values={}, parts=parts)
    resolved = [module.kind.letter for module in modules]
    axle_count = sum(issubclass(module.kind, WheelModule) for module in modules)
    for kind, count in ((WheelModule, axle_count), (BrainModule, resolved.count(BrainModule.letter))):
        if not count:
            raise DesignError(None, f'"{type_string}" has no module {kind.letter} ({kind.title})')
    if axle_count > MAX_AXLES:
        raise DesignError(None, f'"{type_string}" has {axle_count} axles, the servo driver serves {MAX_AXLES}')
    has_hinge_at_end = HINGE in (resolved[0], resolved[-1])
    if has_hinge_at_end or (HINGE, HINGE) in itertools.pairwise(resolved):
        raise DesignError(None, f'"{type_string}" has a hinge (H) at an end or beside another: each joins two segments')
    segments = resolved.count(HINGE) + 1
    if segments > MAX_SEGMENTS:
        raise DesignError(None, f'"{type_string}" has {segments} segments, the simulator takes {MAX_SEGMENTS}')
    return letters


def _module_values(letter: str, place: str, values: Mapping[str, float], parts: Catalogue) -> list[ModuleValues]:
    """Return the values of the parameters of one of a car's modules.

    The result has one entry. If the module is a composite, which consists of several modules, it has an entry for each of
    these. ``letter`` is the kind of the module, such as W, and ``place`` the name of this module, such as W2. ``values``
    are the values of the design, by key. If several keys set a parameter, the most special one is used: ``W2.radius``
    for this module before ``W.radius`` for all modules of the kind, and this before ``radius`` for all modules.
    """
    kind = MODULES[letter]
    # For each parameter that the design sets: its value, and the key that sets it.
    own_values: dict[str, float] = {}
    own_keys: dict[str, str] = {}
    for parameter in kind.parameters:
        keys_by_priority = (f"{place}.{parameter.name}", f"{letter}.{parameter.name}", parameter.name)
        for key in keys_by_priority:
            if key in values:
                own_values[parameter.name] = values[key]
                own_keys[parameter.name] = key
                break
    if not issubclass(kind, Composite):
        defaults = {option.name: option.default_with(parts) for option in kind.parameters if option.optional}
        return [ModuleValues(kind, defaults | own_values, own_keys)]
    # A composite computes the values of its modules, and knows which of the design's keys set them.
    composite = kind(own_values, place, parts=parts, keys=own_keys)
    module_values = []
    for part in composite.modules():
        module = part.module
        values_of_module = {parameter.name: module[parameter.name] for parameter in module.parameters}
        module_values.append(ModuleValues(type(module), values_of_module, module.keys, part.root))
    return module_values


def compose(type_string: str, values: Mapping[str, float], choices: PartChoices | None = None) -> Design:
    """Return the design with ``values`` (mm, degrees; by key) and defaults for all others.

    A type string names the modules of a car from front to back, such as "W_B_W", and may name parts after a "+". If
    ``choices`` is None, the parts are those that it names. A key may belong to a single module: the value
    of "W2.radius" is the radius of the second module W. Raises DesignError if the design cannot be built.
    """
    letters = modules_of(type_string)
    if choices is None:
        try:
            _, choices = split_type(type_string)
        except PartError as error:
            raise DesignError(None, str(error)) from error
    design = Design(letters, _complete_values(type_string, letters, values, catalogue_of(choices)), choices)
    with component_errors(DesignError):
        check_design(type_string, design)
    return design


def compose_columns(type_string: str, columns: Mapping[str, float | str]) -> Design:
    """Return the design whose parameters are given by the columns of results, such as ``{"width_mm": 95}``.

    Raises DesignError for a column that is no parameter.
    """
    values = {}
    for column, value in columns.items():
        key = key_of(column)
        if key is None:
            raise DesignError(None, f"no module has the parameter {column}")
        values[key] = float(value)
    return compose(type_string, values)


def _complete_values(
    type_string: str, letters: tuple[str, ...], values: Mapping[str, float], parts: Catalogue
) -> dict[str, float]:
    """Return the values of a design by key: those that are set, and the defaults of parameters that are not set.

    A parameter may be set by its key, such as ``W.length``, and for single modules by the keys of their places, such as
    ``W2.length``, which is that of the second module W. If the keys of places set it for every module, the result has
    no value for ``W.length``, as that value would have no effect. An optional parameter that is not set has no value
    either. Raises DesignError for a key that has no effect.
    """
    complete: dict[str, float] = {}
    for key, parameter in parameters().items():
        if parameter.modules.isdisjoint(letters):
            continue
        keys_of_places = place_keys(key, letters)
        values_by_place = {place: float(values[place]) for place in keys_of_places if place in values}
        all_places_set = bool(keys_of_places) and len(values_by_place) == len(keys_of_places)
        if key in values:
            if all_places_set:
                setting = ", ".join(values_by_place)
                raise DesignError(key, f"sets nothing, as {setting} set it for every module: leave it out")
            complete[key] = float(values[key])
        elif not all_places_set and not parameter.declared.optional:
            complete[key] = float(parameter.declared.default_with(parts))
        complete |= values_by_place
    for key in values:
        if key not in complete:
            raise DesignError(key, _unknown_key_message(type_string, letters, key, complete))
    return complete


def _unknown_key_message(type_string: str, letters: Sequence[str], key: str, parameter_keys: Iterable[str]) -> str:
    """Return the message for a key that sets no parameter of the car, such as ``W3.radius`` of a car with two W."""
    module_name, _, parameter_name = key.partition(".")
    # A single module is named by its letter and its number among the modules with this letter, as in W3.
    place = PLACE.fullmatch(module_name)
    if place is not None and place[1] in letters:
        letter, number = place[1], int(place[2])
        if number > letters.count(letter):
            return f"{type_string} has {letters.count(letter)} modules {letter}"
        parameter = find_parameter(letter, parameter_name)
        if parameter is not None and parameter.declared.uniform:
            return f"the whole car has one value of it: set {parameter.key}"
    return f"{type_string} has no such parameter; it has {', '.join(parameter_keys)}"


def limit_errors(type_string: str, values: Mapping[str, float], parts: Catalogue) -> list[DesignError]:
    """Return an error for every value that is outside the limits of its parameter. ``values`` are given by key.

    Keys of unknown parameters, or of modules that the type does not have, are skipped: other checks report them.
    """
    letters = modules_of(type_string)
    errors = []
    for key, value in values.items():
        parameter = parameter_of(key)
        if parameter is None or parameter.modules.isdisjoint(letters):
            continue
        message = parameter.declared.limit_error(value, parts)
        if message:
            errors.append(DesignError(key, message))
    return errors
