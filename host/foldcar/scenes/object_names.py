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
    all_pairs = zip(scenario.objects, scene.objects, strict=True)
    pairs = [(original, sampled) for original, sampled in all_pairs if is_a(sampled, "Terrain")]
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
