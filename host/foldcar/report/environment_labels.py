"""Names of the columns of sampled values, and their labels for readers.

A scene's pieces of terrain are named by kind and number: ``box_2`` is the second box, which readers know as block 2. The
terrain's objects consist of pieces: a kerb is one box, a stair several.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from foldcar.scenes.terrain_kinds import KIND_NAMES, KINDS
from foldcar.statistics.words import label_and_unit
from foldcar.store.info import ExperimentInfo

# A column of a piece: the piece's kind and number, the property.
PIECE = re.compile(rf"scene_((?:{'|'.join(KINDS)})_\d+)_(.+)")


class TerrainObject(NamedTuple):
    """An object of the terrain: its name, and the indices of its pieces in the terrain of each scene."""

    name: str
    pieces: list[int]


def objects_of_pieces(
    objects: Sequence[tuple[str, int]], scenes: Iterable[Mapping[str, Any]]
) -> list[TerrainObject] | None:
    """Return the terrain's objects with their pieces, which must be the same in all ``scenes``.

    ``objects`` are the name and the number of pieces of each object. If the store lacks them, each piece is returned as
    an object. Returns None if the scenes have different pieces.
    """
    kinds_of_scenes = {tuple(piece["kind"] for piece in scene.get("terrain", ())) for scene in scenes}
    if len(kinds_of_scenes) != 1:
        return None
    # The kind of each piece, the same in all scenes.
    kinds = kinds_of_scenes.pop()
    if sum(count for _, count in objects) != len(kinds):
        return [TerrainObject(piece_label(name), [index]) for index, name in enumerate(piece_names(kinds))]
    # The pieces of an object follow each other.
    terrain_objects = []
    first = 0
    for name, count in objects:
        terrain_objects.append(TerrainObject(name, list(range(first, first + count))))
        first += count
    return terrain_objects


def piece_names(kinds: Iterable[str]) -> Iterator[str]:
    """Yield ``box_1``, ``ramp_1``, ``box_2``: each piece's kind and its number among those of its kind."""
    seen = Counter[str]()
    for kind in kinds:
        seen[kind] += 1
        yield f"{kind}_{seen[kind]}"


def piece_label(name: str) -> str:
    """Return ``block 2`` of box_2."""
    kind, _, number = name.rpartition("_")
    return f"{KIND_NAMES.get(kind, kind)} {number}"


def object_columns(names: Sequence[str]) -> list[str]:
    """Return for each object how the names of its columns begin, such as ``scene_kerb_2`` for the object ``kerb 2``.

    No two objects get the same name: of two objects ``kerb``, the second one gets ``scene_kerb_2``, too.
    """
    # How often each name was wanted so far.
    counts = Counter[str]()
    columns = []
    for name in names:
        column = name.replace(" ", "_")
        counts[column] += 1
        # A name that is taken gets a number. The name with this number may be taken as well.
        while counts[column] > 1:
            column = f"{column}_{counts[column]}"
            counts[column] += 1
        columns.append(f"scene_{column}")
    return columns


def labels_of_objects(objects_by_sample: Mapping[int, Sequence[Any]]) -> dict[str, str]:
    """Return the label of each column of an object's parameter, by the column's name."""
    labels = {}
    for objects in objects_by_sample.values():
        columns = object_columns([name for name, _ in objects])
        for column, (name, parameters) in zip(columns, objects, strict=True):
            for parameter in parameters:
                label, _ = label_and_unit(parameter)
                labels[f"{column}.{parameter}"] = f"{name} {label}"
    return labels


def prefixes_of_pieces(info: ExperimentInfo, scenes: Mapping[int, Mapping[str, Any]]) -> dict[str, str]:
    """Return the prefix of each terrain piece, with which the labels of its columns in a table begin.

    A key is the piece's name in the scene, such as ``box_2``. If an object ``kerb`` of the program is a single piece,
    the prefix is "kerb ". If an object ``stair`` has several pieces, the prefix names the piece, too: "stair, block 1: "
    for the object's first block. The result is empty if the scenes have different pieces.
    """
    objects = objects_of_pieces(info.terrain_objects, scenes.values())
    if objects is None:
        return {}
    first_scene = next(iter(scenes.values()))
    kinds = [piece["kind"] for piece in first_scene.get("terrain", ())]
    names_in_scene = list(piece_names(kinds))
    prefixes = {}
    for terrain_object in objects:
        if len(terrain_object.pieces) == 1:
            (piece,) = terrain_object.pieces
            prefixes[names_in_scene[piece]] = f"{terrain_object.name} "
            continue
        # Within an object, pieces are counted from 1 again.
        names_in_object = piece_names(kinds[piece] for piece in terrain_object.pieces)
        for piece, name_in_object in zip(terrain_object.pieces, names_in_object, strict=True):
            prefixes[names_in_scene[piece]] = f"{terrain_object.name}, {piece_label(name_in_object)}: "
    return prefixes


def column_label(name: str, prefixes: Mapping[str, str]) -> str:
    """Return the label of the column ``name`` for readers.

    The label of ``scene_box_2_height_m`` is ``stair, block 2: height``, and that of ``car_mean_neutral_us`` is
    ``car, mean neutral``. ``prefixes`` has the beginnings of the labels of pieces, such as "stair, block 2: " of box_2.
    """
    match = PIECE.fullmatch(name)
    if match is not None:
        piece_name, quantity = match[1], match[2]
        prefix = prefixes.get(piece_name, f"{piece_label(piece_name)} ")
        quantity_label, _ = label_and_unit(quantity)
        return f"{prefix}{quantity_label}"
    label, _ = label_and_unit(name.removeprefix("scene_"))
    if label == "highest":
        return "highest obstacle"
    if label == "pieces":
        return "pieces of terrain"
    for quantity in ("mean", "left less right"):
        label = label.replace(f"car {quantity}", f"car, {quantity}")
    return label
