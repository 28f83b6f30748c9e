"""Read the sampled values of each environment, of its scene and of its built car, as columns.

Input: an open store, which keeps every sample's scene and every draw's differences as JSON. Output: a table of
environments. A terrain object's columns are its pose and its parameters in the program: ``scene_stair.step_height_m`` is
labelled ``stair step height``. If the store lacks them, the columns are the sizes of single pieces, which are counted by
kind: ``scene_box_2_height_m`` is the height of the second box, its label ``stair, block 2: height``.
Differences of a built car are those of :mod:`foldcar.car.variation`. Those of wheels become two columns: the mean, and
left minus right. Columns that are constant, or linear in a column before them, are left out.
"""

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy
from numpy.typing import NDArray

from foldcar.car.variation import SERVO_DIFFERENCES, workshop_spreads
from foldcar.scenes.terrain_kinds import KIND_NAMES, KINDS
from foldcar.statistics.words import label_and_unit
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME, DESIGN, EXPERIMENT

# Columns with a greater correlation count as the same.
MAX_CORRELATION = 0.9995
# A column is constant if its range is at most this fraction of its largest magnitude, a rounding error.
MIN_RELATIVE_RANGE = 1e-9
# Keys that are not quantities.
LEFT_OUT = ("seed",)
# Units for readers, with the factor.
READERS_UNITS = {"m": ("mm", 1000.0), "rad": ("°", 180 / math.pi)}
# A column of a piece: the piece's kind and number, the property.
PIECE = re.compile(rf"scene_((?:{'|'.join(KINDS)})_\d+)_(.+)")

Read = TypeVar("Read")


@dataclass(frozen=True)
class EnvironmentColumn:
    """A column: its name with the SI unit; its label, unit and scale for readers, who see ``scale`` times the value."""

    name: str
    label: str
    unit: str
    scale: float


@dataclass(frozen=True)
class EnvironmentValues:
    """``values`` (environments, columns) in SI units, NaN if an environment lacks a value or is not sampled yet."""

    columns: tuple[EnvironmentColumn, ...]
    values: NDArray[Any]

    @property
    def shown(self) -> NDArray[Any]:
        """The values in the readers' units."""
        result: NDArray[Any] = self.values * numpy.array([column.scale for column in self.columns])
        return result


def environment_values(store: Store, info: ExperimentInfo) -> EnvironmentValues:
    """Return the values of an experiment's environments, read once from an open store. Raises StoreError."""
    return store.once(("environment values", info.id), lambda: _read(store, info))


def read_scenes(store: Store, info: ExperimentInfo) -> dict[int, Mapping[str, Any]]:
    """Return the stored scenes of an experiment by sample. They are read once from an open store. Raises StoreError."""
    row = store.row(EXPERIMENT, id=info.id)

    def read() -> dict[int, Mapping[str, Any]]:
        """Read the scenes from the store."""
        return _by_sample(store, row, _SCENES, read=lambda scene: scene)

    return store.once(("read scenes", info.id), read)


def objects_of_pieces(
    objects: Sequence[tuple[str, int]], scenes: Iterable[Mapping[str, Any]]
) -> list[tuple[str, list[int]]] | None:
    """Return the name and the indices of the pieces of each terrain object, the same in all ``scenes``.

    ``objects`` are ExperimentInfo's ``terrain_objects``. Where the store lacks them, each piece is an object. Returns
    None if the scenes have different pieces.
    """
    kinds_of_scenes = {tuple(piece["kind"] for piece in scene.get("terrain", ())) for scene in scenes}
    if len(kinds_of_scenes) != 1:
        return None
    # The kind of each piece, the same in all scenes.
    kinds = kinds_of_scenes.pop()
    if sum(count for _, count in objects) != len(kinds):
        return [(_piece_label(name), [index]) for index, name in enumerate(_piece_names(kinds))]
    # The pieces of an object follow each other.
    pieces_of_objects = []
    first = 0
    for name, count in objects:
        pieces_of_objects.append((name, list(range(first, first + count))))
        first += count
    return pieces_of_objects


def _piece_names(kinds: Iterable[str]) -> Iterator[str]:
    """Yield ``box_1``, ``ramp_1``, ``box_2``: each piece's kind and its number among those of its kind."""
    seen = Counter[str]()
    for kind in kinds:
        seen[kind] += 1
        yield f"{kind}_{seen[kind]}"


def _piece_label(name: str) -> str:
    """Return ``block 2`` of box_2."""
    kind, _, number = name.rpartition("_")
    return f"{KIND_NAMES.get(kind, kind)} {number}"


def _object_parameters(store: Store, experiment: Any, samples: Iterable[int]) -> dict[int, list[Any]]:
    """Return names and parameters of the terrain objects by sample; {} if the store lacks those of one of ``samples``.

    ``experiment`` is the experiment's row in the store.
    """
    where = "WHERE environment_id = ?1 AND sample < ?2"
    rows = store.rows(BY_NAME["sample"], where, experiment["environment_id"], experiment["environments"])
    objects_by_sample = {row["sample"]: json.loads(row["objects"]) for row in rows if row["objects"] is not None}
    is_complete = all(sample in objects_by_sample for sample in samples)
    return objects_by_sample if is_complete else {}


def _object_columns(names: Sequence[str]) -> list[str]:
    """Return for each object how the names of its columns begin, such as ``scene_kerb_2`` for the object ``kerb 2``.

    No two objects get the same name.
    """
    counts = Counter[str]()
    columns = []
    for name in names:
        column = name.replace(" ", "_")
        counts[column] += 1
        while counts[column] > 1:
            column = f"{column}_{counts[column]}"
            counts[column] += 1
        columns.append(f"scene_{column}")
    return columns


def _read(store: Store, info: ExperimentInfo) -> EnvironmentValues:
    """Return a table with the random values of an experiment's environments and of the cars that drive in them.

    The table has a row for each sample, and a column for each value that differs between the samples.
    """
    experiment = store.row(EXPERIMENT, id=info.id)
    scenes = read_scenes(store, info)
    objects_by_sample = _object_parameters(store, experiment, scenes)
    first_design = store.row(DESIGN, experiment=info.id, position=0)
    body = store.row(BY_NAME["body"], id=first_design["body_id"])
    wheels = json.loads(body["json"]).get("wheels", ())
    # The values by name of each scene and of each car, by sample.
    scene_values = {sample: _scene(scene, objects_by_sample.get(sample)) for sample, scene in scenes.items()}
    car_values = _by_sample(store, experiment, _VARIATIONS, read=lambda drawn: _car(drawn, wheels))
    samples_with_values = [*scene_values.items(), *car_values.items()]
    # The columns are in the order in which their names occur first.
    index_by_name: dict[str, int] = {}
    for _, values_by_name in samples_with_values:
        for name in values_by_name:
            index_by_name.setdefault(name, len(index_by_name))
    values = numpy.full((info.environments, len(index_by_name)), numpy.nan)
    for sample, values_by_name in samples_with_values:
        for name, value in values_by_name.items():
            values[sample, index_by_name[name]] = value
    names = list(index_by_name)
    labels = _labels_of_objects(objects_by_sample)
    prefixes = _prefixes_of_pieces(info, scenes)
    informative = _informative(values)
    columns = tuple(_column(names[index], labels, prefixes) for index in informative)
    return EnvironmentValues(columns, values[:, informative])


def _labels_of_objects(objects_by_sample: Mapping[int, Sequence[Any]]) -> dict[str, str]:
    """Return the label of each column of an object's parameter, by the column's name."""
    labels = {}
    for objects in objects_by_sample.values():
        columns = _object_columns([name for name, _ in objects])
        for column, (name, parameters) in zip(columns, objects, strict=True):
            for parameter in parameters:
                label, _ = label_and_unit(parameter)
                labels[f"{column}.{parameter}"] = f"{name} {label}"
    return labels


def _prefixes_of_pieces(info: ExperimentInfo, scenes: Mapping[int, Mapping[str, Any]]) -> dict[str, str]:
    """Return how the labels of a piece's columns begin, by the piece's name.

    The piece ``box_2`` of the object ``kerb`` has the prefix "kerb ". If the object has several pieces, the prefix names
    the piece, too, such as "stair, block 2: ".
    """
    objects = objects_of_pieces(info.terrain_objects, scenes.values())
    if objects is None:
        return {}
    first_scene = next(iter(scenes.values()))
    kinds = [piece["kind"] for piece in first_scene.get("terrain", ())]
    piece_names = list(_piece_names(kinds))
    prefixes = {}
    for object_name, indices in objects:
        if len(indices) == 1:
            prefixes[piece_names[indices[0]]] = f"{object_name} "
            continue
        # Within an object, pieces are counted from 1.
        names_in_object = _piece_names(kinds[index] for index in indices)
        for index, name_in_object in zip(indices, names_in_object, strict=True):
            prefixes[piece_names[index]] = f"{object_name}, {_piece_label(name_in_object)}: "
    return prefixes


@dataclass(frozen=True)
class _Drawn:
    """How the store keeps what is drawn for each sample.

    Each row of ``table`` names a row of ``content_table`` for a sample. The rows of an experiment have the experiment's
    value in the column ``key``.
    """

    table: str
    key: str
    content_table: str


_SCENES = _Drawn(table="sample", key="environment_id", content_table="scene")
_VARIATIONS = _Drawn(table="draw", key="spread_id", content_table="variation")


def _by_sample(store: Store, experiment: Any, drawn: _Drawn, read: Callable[[Any], Read]) -> dict[int, Read]:
    """Return what ``read`` makes of the scene or the variation of each sample, by sample.

    ``experiment`` is the experiment's row. Samples may share a scene or a variation, which is then read once.
    """
    content_id = f"{drawn.content_table}_id"
    of_experiment = f"WHERE {drawn.key} = ?1 AND sample < ?2"
    limits = experiment[drawn.key], experiment["environments"]
    samples = store.rows(BY_NAME[drawn.table], of_experiment, *limits)
    id_by_sample = {row["sample"]: row[content_id] for row in samples}
    where = f"WHERE id IN (SELECT {content_id} FROM {drawn.table} {of_experiment})"
    contents = store.rows(BY_NAME[drawn.content_table], where, *limits)
    value_by_id = {row["id"]: read(json.loads(row["json"])) for row in contents}
    return {sample: value_by_id[row_id] for sample, row_id in id_by_sample.items() if row_id in value_by_id}


def _scene(scene: Mapping[str, Any], objects: Sequence[Any] | None) -> dict[str, float]:
    """Return the numbers of a scene by the name of their column.

    They are its friction, its start, its goal, its number of pieces, the height of its highest piece (m), and the numbers
    of its terrain. The latter are the parameters of the ``objects``. If these are unknown, they are the numbers of each
    piece.
    """
    values = _numbers("scene", {"friction": scene.get("friction")})
    for position in ("start", "goal"):
        values |= _numbers(f"scene_{position}", scene.get(position) or {})
    terrain = scene.get("terrain", ())
    if objects is not None:
        columns = _object_columns([name for name, _ in objects])
        for column, (_, parameters) in zip(columns, objects, strict=True):
            for key, value in parameters.items():
                if key not in LEFT_OUT:
                    values[f"{column}.{key}"] = float(value)
    else:
        piece_names = _piece_names(piece["kind"] for piece in terrain)
        for piece_name, piece in zip(piece_names, terrain, strict=True):
            values |= _numbers(f"scene_{piece_name}", piece)
    heights_m = [piece.get("height_m", 0.0) for piece in terrain]
    values["scene_pieces"] = len(heights_m)
    values["scene_highest_m"] = max(heights_m, default=0.0)
    return values


def _numbers(start: str, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers among ``values``, named with the prefix ``start``."""
    return {
        f"{start}_{key}": float(value)
        for key, value in values.items()
        if isinstance(value, int | float) and key not in LEFT_OUT
    }


def _car(drawn: Mapping[str, Any], wheels: Any) -> dict[str, float]:
    """Return the differences of a built car from its design, with the mean and the difference of sides for wheels.

    ``drawn`` is a sample's stored variation, ``wheels`` are those of the body of the family's first design.
    """
    values = {}
    for name, value in drawn.items():
        if name not in workshop_spreads():
            continue
        if not isinstance(value, list):
            values[f"car_{name}"] = float(value)
        elif wheels:
            values |= _wheel_values(name, value, wheels)
    return values


def _wheel_values(name: str, value_by_channel: Sequence[float], wheels: Any) -> dict[str, float]:
    """Return the mean of a quantity over a car's wheels, and if there are wheels on both sides, left minus right.

    ``value_by_channel`` has the value of each servo channel.
    """
    all_values: list[float] = []
    values_by_side: dict[str, list[float]] = {"left": [], "right": []}
    for wheel in wheels:
        # A wheel without servo has no differences of a servo.
        if name in SERVO_DIFFERENCES and "servo" not in wheel:
            continue
        # A servo that is mounted the other way round turns the other way with the same pulse.
        sign = wheel["servo"]["direction"] if name == "neutral_us" else 1
        value = sign * value_by_channel[wheel["channel"]]
        all_values.append(value)
        values_by_side[wheel["side"]].append(value)
    values = {f"car_mean_{name}": sum(all_values) / len(all_values)}
    left_values, right_values = values_by_side["left"], values_by_side["right"]
    if left_values and right_values:
        left_mean = sum(left_values) / len(left_values)
        right_mean = sum(right_values) / len(right_values)
        values[f"car_left_less_right_{name}"] = left_mean - right_mean
    return values


def _informative(values: NDArray[Any]) -> list[int]:
    """Return the indices of the columns that vary and tell something that no column before them tells.

    A column tells nothing new if it is a linear function of an earlier one.
    """
    informative: list[int] = []
    for index, column in enumerate(values.T):
        is_known = ~numpy.isnan(column)
        known_values = column[is_known]
        if len(known_values) < 2 or numpy.ptp(known_values) <= MIN_RELATIVE_RANGE * abs(known_values).max():
            continue
        is_repeated = False
        for earlier in informative:
            # Only columns that are known in the same samples can be compared.
            if (~numpy.isnan(values[:, earlier]) == is_known).all():
                correlation = numpy.corrcoef(values[is_known, earlier], known_values)[0, 1]
                # If the correlation is NaN, this comparison is False, so the column counts as a repetition.
                is_repeated = is_repeated or not abs(correlation) <= MAX_CORRELATION
        if not is_repeated:
            informative.append(index)
    return informative


def _column(name: str, labels: Mapping[str, str], prefixes: Mapping[str, str]) -> EnvironmentColumn:
    """Return the column ``name`` with its label, its unit, and the factor from SI units to this unit.

    ``labels`` has the labels of the columns that belong to objects, by the column's name. ``prefixes`` has the beginning
    of the labels of the columns that belong to a piece, by the piece's name.
    """
    _, si_unit = label_and_unit(name)
    unit, scale = READERS_UNITS.get(si_unit, (si_unit, 1.0))
    label = labels.get(name) or _label(name, prefixes)
    return EnvironmentColumn(name, label, unit, scale)


def _label(name: str, prefixes: Mapping[str, str]) -> str:
    """Return the label of a column of a piece, of another part of the scene, or of the car.

    That of ``scene_box_2_height_m`` is ``stair, block 2: height``, that of ``car_mean_neutral_us`` ``car, mean neutral``.
    """
    match = PIECE.fullmatch(name)
    if match is not None:
        piece_name, quantity = match[1], match[2]
        prefix = prefixes.get(piece_name, f"{_piece_label(piece_name)} ")
        quantity_label, _ = label_and_unit(quantity)
        return f"{prefix}{quantity_label}"
    label, _ = label_and_unit(name.removeprefix("scene_"))
    if label == "highest":
        return "highest obstacle"
    if label == "pieces":
        return "pieces of terrain"
    return label.replace("car mean", "car, mean").replace("car left less right", "car, left less right")
