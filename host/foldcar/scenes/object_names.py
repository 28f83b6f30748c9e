"""Names the terrain objects of a sampled scene as its Scenic program does.

Input: a compiled scenario and one of its scenes. Output: names and counts of pieces in the order of the scene's terrain.
"""

import re
from collections import Counter
from typing import Any

from foldcar.scenes.program import named_instances
from foldcar.scenes.reading import is_a
from foldcar.scenes.scene_json import terrain_pieces


def terrain_objects(scenario: Any, scene: Any) -> list[tuple[str, int]]:
    """Return the name of each terrain object and its number of pieces. Raises UnusableError.

    An object is called by its variable, such as ``kerb2``, or ``kerbs[1]`` in a list. Without one, it is called by its
    class and its number among the objects of that class, such as ``kerb 2``; the only object of its class has no number.
    """
    variables = _variables(scenario)
    pairs = [pair for pair in zip(scenario.objects, scene.objects, strict=True) if is_a(pair[1], "Terrain")]
    totals = Counter(type(sampled).__name__ for _, sampled in pairs)
    count_so_far = Counter[str]()
    objects = []
    for original, sampled in pairs:
        class_name = type(sampled).__name__
        count_so_far[class_name] += 1
        number_text = f" {count_so_far[class_name]}" if totals[class_name] > 1 else ""
        name = variables.get(id(original)) or _in_words(class_name) + number_text
        objects.append((name, len(terrain_pieces(sampled))))
    return objects


def _variables(scenario: Any) -> dict[int, str]:
    """Return the variable of each object by the object's id."""
    variables: dict[int, str] = {}
    for name, things in named_instances(scenario).items():
        for index, thing in enumerate(things):
            variables.setdefault(id(thing), name if len(things) == 1 else f"{name}[{index}]")
    # The variable of a loop names only the object of the loop's last pass.
    unnamed_lines = {_line(thing) for thing in scenario.objects if id(thing) not in variables}
    unnamed_objects = {id(thing) for thing in scenario.objects if _line(thing) in unnamed_lines}
    return {thing: name for thing, name in variables.items() if thing not in unnamed_objects}


def _line(thing: Any) -> Any:
    """Return the file and the line that made the object."""
    return getattr(thing, "creationLine", thing)


def _in_words(kind: str) -> str:
    """Return ``round bump`` of RoundBump."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind).lower()
