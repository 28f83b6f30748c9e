"""Names the terrain objects of a sampled scene as its Scenic program does, and reads their parameters.

Input: a compiled scenario and one of its scenes. Output: names, counts of pieces, and parameters, in the order of the
scene's terrain.
"""

import re
from collections import Counter
from numbers import Real
from typing import Any

from foldcar.scenes import scenic_private
from foldcar.scenes.program import named_instances
from foldcar.scenes.reading import is_a, pose, rounded
from foldcar.scenes.scene_json import terrain_pieces

# The name of the vocabulary's module. All parameters of its terrain are lengths, except these.
VOCABULARY = "model"
UNITLESS = ("steps", "friction", "seed")

# Greater numbers, which no store takes, are no quantities of a car's environment.
MAX_NUMBER = 1e15

# An object's name, and its parameters by name, with units in the names.
Parameters = tuple[str, dict[str, float]]


def terrain_objects(scenario: Any, scene: Any) -> list[tuple[str, int]]:
    """Return the name of each terrain object and its number of pieces. Raises UnusableError.

    An object is called by its variable, such as ``kerb2``, or ``kerbs[1]`` in a list. Without one, it is called by its
    class and its number among the objects of that class, such as ``kerb 2``; the only object of its class has no number.
    """
    names = terrain_names(scenario, scene)
    return [(name, len(terrain_pieces(thing))) for name, thing in zip(names, _terrain(scene), strict=True)]


def terrain_names(scenario: Any, scene: Any) -> list[str]:
    """Return the names of a program's terrain objects, in their order. They are the same in all scenes.

    An object is named by the variable of the program that has it, or else by its class and, if there are several of the
    class, by a number.
    """
    variable_by_id = _variables(scenario)
    total_counts = Counter(type(thing).__name__ for thing in _terrain(scene))
    counts_so_far: Counter[str] = Counter()
    names = []
    # The program's objects and their samples are in the same order.
    for original, sampled in zip(scenario.objects, scene.objects, strict=True):
        if not is_a(sampled, "Terrain"):
            continue
        class_name = type(sampled).__name__
        counts_so_far[class_name] += 1
        if id(original) in variable_by_id:
            names.append(variable_by_id[id(original)])
        elif total_counts[class_name] > 1:
            names.append(f"{_in_words(class_name)} {counts_so_far[class_name]}")
        else:
            names.append(_in_words(class_name))
    return names


def object_parameters(names: list[str], scene: Any) -> list[Parameters]:
    """Return the parameters of a scene's terrain objects, which have these ``names``.

    The parameters of an object are its pose, and its properties that are numbers: those that its class, or a base class
    below Terrain, declares, and those that the program gives by ``with``. The name of a parameter ends with its unit; the
    unit of a property that a user's class declares is unknown.

    Example: ``[("stair", {"x_m": 0.8, "y_m": 0.0, "heading_rad": 0.0, "steps": 3.0, "step_height_m": 0.02, …})]``
    """
    parameters = []
    for name, thing in zip(names, _terrain(scene), strict=True):
        parameters.append((name, {**pose(thing), **_own_numbers(thing)}))
    return parameters


def _terrain(scene: Any) -> list[Any]:
    """Return the Terrain objects of a scene, in its order."""
    return [thing for thing in scene.objects if is_a(thing, "Terrain")]


def _own_numbers(thing: Any) -> dict[str, float]:
    """Return the properties of a terrain object that are numbers, by their name with its unit.

    Properties that every Terrain has are left out. The properties of derived classes come before those of their bases.
    """
    # The object's class and its bases, from the most derived one to Terrain.
    classes = list(type(thing).__mro__)
    while classes[-1].__name__ != "Terrain":
        classes.pop()
    terrain = classes.pop()
    # The names with units, by the names in the program, in the order of the result.
    name_with_unit: dict[str, str] = {}
    for cls in classes:
        for name in scenic_private.own_properties(cls):
            # All numbers that foldcar's own classes declare are lengths, except a few.
            is_length = cls.__module__ == VOCABULARY and name not in UNITLESS
            if is_length:
                name_with_unit[name] = f"{name}_m"
            else:
                name_with_unit.setdefault(name, name)
    # The program may give further properties by `with`.
    for name in thing.properties:
        if name not in scenic_private.defaults(terrain):
            name_with_unit.setdefault(name, name)
    numbers = {}
    for name, with_unit in name_with_unit.items():
        value = getattr(thing, name)
        if _is_quantity(value):
            numbers[with_unit] = rounded(float(value))
    return numbers


def _is_quantity(value: Any) -> bool:
    """Return whether a property's value is a number that a store takes."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return is_number and bool(-MAX_NUMBER <= value <= MAX_NUMBER)


def _variables(scenario: Any) -> dict[int, str]:
    """Return the name of the program's variable that holds an object, by the object's id.

    An object in a list is called ``name[index]``. An object that no variable holds is left out.
    """
    variable_by_id: dict[int, str] = {}
    for name, instances in named_instances(scenario).items():
        for index, instance in enumerate(instances):
            variable = name if len(instances) == 1 else f"{name}[{index}]"
            variable_by_id.setdefault(id(instance), variable)
    # A line in a loop makes several objects, and the loop's variable holds only the last one. This one is not called by
    # the variable, so that all of them are named in the same way.
    lines_with_unnamed = {_line(instance) for instance in scenario.objects if id(instance) not in variable_by_id}
    for instance in scenario.objects:
        if _line(instance) in lines_with_unnamed:
            variable_by_id.pop(id(instance), None)
    return variable_by_id


def _line(instance: Any) -> Any:
    """Return the file and the line that made the object; the object itself if Scenic has not recorded them."""
    return getattr(instance, "creationLine", instance)


def _in_words(kind: str) -> str:
    """Return a class's name in words: ``round bump`` for RoundBump."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind).lower()
