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

# The parameters of an object by name, units in the names; beside the object's own name.
Parameters = tuple[str, dict[str, float]]


def terrain_objects(scenario: Any, scene: Any) -> list[tuple[str, int]]:
    """Return the name of each terrain object and its number of pieces. Raises UnusableError.

    An object is called by its variable, such as ``kerb2``, or ``kerbs[1]`` in a list. Without one, it is called by its
    class and its number among the objects of that class, such as ``kerb 2``; the only object of its class has no number.
    """
    names = terrain_names(scenario, scene)
    return [(name, len(terrain_pieces(thing))) for name, thing in zip(names, _terrain(scene), strict=True)]


def terrain_names(scenario: Any, scene: Any) -> list[str]:
    """Return the names of the terrain objects, as :func:`terrain_objects`; they are the same in all scenes."""
    variables = _variables(scenario)
    all_pairs = zip(scenario.objects, scene.objects, strict=True)
    pairs = [(original, sampled) for original, sampled in all_pairs if is_a(sampled, "Terrain")]
    totals = Counter(type(sampled).__name__ for _, sampled in pairs)
    count_so_far = Counter[str]()
    names = []
    for original, sampled in pairs:
        class_name = type(sampled).__name__
        count_so_far[class_name] += 1
        number_text = f" {count_so_far[class_name]}" if totals[class_name] > 1 else ""
        names.append(variables.get(id(original)) or _in_words(class_name) + number_text)
    return names


def object_parameters(names: list[str], scene: Any) -> list[Parameters]:
    """Return the parameters of the terrain objects with these ``names``.

    They are an object's pose, and the numbers among the properties that its class or a base below Terrain declares, or
    that the program gives by ``with``. Names end with the unit if it is known: that of a user's property is not.

    Example: ``[("stair", {"x_m": 0.8, "y_m": 0.0, "heading_rad": 0.0, "steps": 3.0, "step_height_m": 0.02, …})]``
    """
    return [(name, {**pose(thing), **_own_numbers(thing)}) for name, thing in zip(names, _terrain(scene), strict=True)]


def _terrain(scene: Any) -> list[Any]:
    return [thing for thing in scene.objects if is_a(thing, "Terrain")]


def _own_numbers(thing: Any) -> dict[str, float]:
    """Return the numbers among an object's own properties by name, those of derived classes first."""
    ancestors = type(thing).__mro__
    position = next(place for place, ancestor in enumerate(ancestors) if ancestor.__name__ == "Terrain")
    common = scenic_private.defaults(ancestors[position])
    lengths: set[str] = set()
    names: dict[str, None] = {}
    for ancestor in ancestors[:position]:
        own = scenic_private.own_properties(ancestor)
        names |= dict.fromkeys(own)
        if ancestor.__module__ == VOCABULARY:
            lengths.update(name for name in own if name not in UNITLESS)
    names |= dict.fromkeys(name for name in thing.properties if name not in common)
    numbers = {name: getattr(thing, name) for name in names}
    return {
        f"{name}_m" if name in lengths else name: rounded(float(value))
        for name, value in numbers.items()
        if _is_quantity(value)
    }


def _is_quantity(value: Any) -> bool:
    """Return whether a property's value is a number that a store takes."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return is_number and bool(-MAX_NUMBER <= value <= MAX_NUMBER)


def _variables(scenario: Any) -> dict[int, str]:
    """Return the name of the variable that holds each object, by the object's id; ``name[index]`` in a list."""
    variables: dict[int, str] = {}
    for name, instances in named_instances(scenario).items():
        for index, instance in enumerate(instances):
            variables.setdefault(id(instance), name if len(instances) == 1 else f"{name}[{index}]")
    # After a loop, its variable holds only the last object. Objects of one line are therefore named all or not at all.
    unnamed_lines = {_line(instance) for instance in scenario.objects if id(instance) not in variables}
    unnamed_ids = {id(instance) for instance in scenario.objects if _line(instance) in unnamed_lines}
    return {instance_id: name for instance_id, name in variables.items() if instance_id not in unnamed_ids}


def _line(instance: Any) -> Any:
    """Return the file and the line that made the object; the object itself if Scenic has not recorded them."""
    return getattr(instance, "creationLine", instance)


def _in_words(kind: str) -> str:
    """Return ``round bump`` of RoundBump."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind).lower()
