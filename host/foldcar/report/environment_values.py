"""Read the sampled values of each environment, of its scene and of its built car, as columns.

Input: an open store, which keeps every sample's scene and every draw's differences as JSON. Output: a table of
environments. A terrain object's columns are its pose and its parameters in the program: ``scene_stair.step_height_m`` is
labelled ``stair step height``. If the store lacks them, the columns are the sizes of single pieces, which are counted by
kind: ``scene_box_2_height_m`` is the height of the second box, its label ``stair, block 2: height``.
Differences of a built car are those of :mod:`foldcar.car.variation`. Those of wheels become two columns: the mean, and
left minus right. Columns that are constant, or linear in a column before them, are left out.
"""

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy
from numpy.typing import NDArray

from foldcar.car.variation import SERVO_DIFFERENCES, workshop
from foldcar.scenes.terrain_kinds import KIND_NAMES, KINDS
from foldcar.statistics.words import label_and_unit
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME, DESIGN, EXPERIMENT

# Columns with a greater correlation count as the same.
MAX_CORRELATION = 0.9995
# Keys that are not quantities.
LEFT_OUT = ("seed",)
SIDES = ("left", "right")
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
    """Return the stored scenes of an experiment by sample, read once from an open store. Raises StoreError."""
    row = store.row(EXPERIMENT, id=info.id)
    return store.once(
        ("read scenes", info.id), lambda: _by_sample(store, row, "sample", "environment_id", "scene", lambda scene: scene)
    )


def objects_of_pieces(
    objects: Sequence[tuple[str, int]], scenes: Iterable[Mapping[str, Any]]
) -> list[tuple[str, list[int]]] | None:
    """Return the name and the indices of the pieces of each terrain object, the same in all ``scenes``.

    ``objects`` are ExperimentInfo's ``terrain_objects``. Where the store lacks them, each piece is an object. Returns
    None if the scenes have different pieces.
    """
    kinds = {tuple(piece["kind"] for piece in scene.get("terrain", ())) for scene in scenes}
    if len(kinds) != 1:
        return None
    (pieces,) = kinds
    if sum(count for _, count in objects) != len(pieces):
        return [(_piece_label(name), [index]) for index, name in enumerate(_piece_names(pieces))]
    indices = iter(range(len(pieces)))
    return [(name, list(itertools.islice(indices, count))) for name, count in objects]


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
    """Return names and parameters of the terrain objects by sample; {} if the store lacks those of one of ``samples``."""
    where = "WHERE environment_id = ?1 AND sample < ?2"
    rows = store.rows(BY_NAME["sample"], where, experiment["environment_id"], experiment["environments"])
    objects = {row["sample"]: json.loads(row["objects"]) for row in rows if row["objects"] is not None}
    return objects if all(sample in objects for sample in samples) else {}


def _object_columns(names: Sequence[str]) -> list[str]:
    """Return the beginning of the names of each object's columns, ``scene_kerb_2`` of ``kerb 2``; all differ."""
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
    """Read the scenes and built cars of an experiment into a table."""
    row = store.row(EXPERIMENT, id=info.id)
    stored = read_scenes(store, info)
    objects = _object_parameters(store, row, stored)
    labels = {
        f"{column}.{parameter}": f"{name} {label_and_unit(parameter)[0]}"
        for sampled in objects.values()
        for column, (name, parameters) in zip(_object_columns([name for name, _ in sampled]), sampled, strict=True)
        for parameter in parameters
    }
    scenes = {sample: _scene(scene, objects.get(sample)) for sample, scene in stored.items()}
    first = store.row(DESIGN, experiment=info.id, position=0)
    body = store.row(BY_NAME["body"], id=first["body_id"])
    wheels = json.loads(body["json"]).get("wheels", ())
    cars = _by_sample(
        store, row, table="draw", key="spread_id", content_table="variation", read=lambda drawn: _car(drawn, wheels)
    )
    tables = [scenes, cars]
    names = list(dict.fromkeys(name for table in tables for sampled in table.values() for name in sampled))
    column_of_name = {name: place for place, name in enumerate(names)}
    values = numpy.full((info.environments, len(names)), numpy.nan)
    for table in tables:
        for sample, row_values in table.items():
            values[sample, [column_of_name[name] for name in row_values]] = list(row_values.values())
    informative = _informative(values)
    prefixes = _prefixes_of_pieces(info, stored)
    columns = tuple(_column(names[index], labels, prefixes) for index in informative)
    return EnvironmentValues(columns, values[:, informative])


def _prefixes_of_pieces(info: ExperimentInfo, scenes: Mapping[int, Mapping[str, Any]]) -> dict[str, str]:
    """Return the beginning of the labels of each piece, such as box_2: ``kerb ``, or ``stair, block 2: `` of several."""
    objects = objects_of_pieces(info.terrain_objects, scenes.values())
    if objects is None:
        return {}
    terrain = next(iter(scenes.values())).get("terrain", ())
    pieces = list(_piece_names(piece["kind"] for piece in terrain))
    prefixes = {}
    for name, indices in objects:
        own = _piece_names(terrain[index]["kind"] for index in indices)
        for index, piece in zip(indices, own, strict=True):
            prefixes[pieces[index]] = f"{name} " if len(indices) == 1 else f"{name}, {_piece_label(piece)}: "
    return prefixes


def _by_sample(
    store: Store, experiment: Any, table: str, key: str, content_table: str, read: Callable[[Any], Read]
) -> dict[int, Read]:
    """Return what ``read`` makes of each sample's scene or variation; equal ones are read once.

    The rows of ``table`` (sample or draw) with the experiment's value of ``key`` (its environment or spread) name a row
    of ``content_table`` (scene or variation) for each sample.
    """
    rows = store.rows(BY_NAME[table], f"WHERE {key} = ?1 AND sample < ?2", experiment[key], experiment["environments"])
    ids = {row["sample"]: row[f"{content_table}_id"] for row in rows}
    where = f"WHERE id IN (SELECT {content_table}_id FROM {table} WHERE {key} = ?1 AND sample < ?2)"
    texts = store.rows(BY_NAME[content_table], where, experiment[key], experiment["environments"])
    values = {row["id"]: read(json.loads(row["json"])) for row in texts}
    return {sample: values[row_id] for sample, row_id in ids.items() if row_id in values}


def _scene(scene: Mapping[str, Any], objects: Sequence[Any] | None) -> dict[str, float]:
    """Return the numbers of a scene: friction, start, goal, terrain, the number of pieces, the highest.

    Those of the terrain are the parameters of its ``objects``, or of each piece if these are unknown.
    """
    values = _numbers("scene", {"friction": scene.get("friction")})
    for position in ("start", "goal"):
        values |= _numbers(f"scene_{position}", scene.get(position) or {})
    terrain = scene.get("terrain", ())
    if objects is not None:
        for column, (_, parameters) in zip(_object_columns([name for name, _ in objects]), objects, strict=True):
            values |= {f"{column}.{key}": float(value) for key, value in parameters.items() if key not in LEFT_OUT}
    else:
        for name, piece in zip(_piece_names(piece["kind"] for piece in terrain), terrain, strict=True):
            values |= _numbers(f"scene_{name}", piece)
    heights = [piece.get("height_m", 0.0) for piece in terrain]
    return values | {"scene_pieces": len(heights), "scene_highest_m": max(heights, default=0.0)}


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
    result = {}
    for name, value in drawn.items():
        if name not in workshop():
            continue
        if not isinstance(value, list):
            result[f"car_{name}"] = float(value)
        elif wheels:
            own_wheels = [wheel for wheel in wheels if "servo" in wheel or name not in SERVO_DIFFERENCES]
            # A servo that is mounted the other way round turns the other way with the same pulse.
            signs = [wheel["servo"]["direction"] if name == "neutral_us" else 1 for wheel in own_wheels]
            by_wheel = [sign * value[wheel["channel"]] for sign, wheel in zip(signs, own_wheels, strict=True)]
            result[f"car_mean_{name}"] = sum(by_wheel) / len(by_wheel)
            pairs = list(zip(own_wheels, by_wheel, strict=True))
            sides = [[number for wheel, number in pairs if wheel["side"] == side] for side in SIDES]
            if all(sides):
                left, right = (sum(side) / len(side) for side in sides)
                result[f"car_left_less_right_{name}"] = left - right
    return result


def _informative(values: NDArray[Any]) -> list[int]:
    """Return the indices of columns that vary and are not linear in a column before them."""
    informative: list[int] = []
    for index, column in enumerate(values.T):
        present = ~numpy.isnan(column)
        if present.sum() < 2 or numpy.ptp(column[present]) <= 1e-9 * abs(column[present]).max():
            continue
        # Columns that are known in the same samples.
        comparable = [other for other in informative if (numpy.isnan(values[:, other]) != present).all()]
        correlations = [numpy.corrcoef(values[present, other], column[present])[0, 1] for other in comparable]
        if all(abs(correlation) <= MAX_CORRELATION for correlation in correlations):
            informative.append(index)
    return informative


def _column(name: str, labels: Mapping[str, str], prefixes: Mapping[str, str]) -> EnvironmentColumn:
    """Return the column of this name.

    ``labels`` are those of objects' columns. ``prefixes`` begin the labels of pieces' columns, by piece.
    """
    unit = label_and_unit(name)[1]
    return EnvironmentColumn(name, labels.get(name) or _label(name, prefixes), *READERS_UNITS.get(unit, (unit, 1.0)))


def _label(name: str, prefixes: Mapping[str, str]) -> str:
    """Return the label of a column of a piece, of another part of the scene, or of the car.

    That of ``scene_box_2_height_m`` is ``stair, block 2: height``, that of ``car_mean_neutral_us`` ``car, mean neutral``.
    """
    match = PIECE.fullmatch(name)
    if match:
        piece_name, quantity = match[1], match[2]
        return f"{prefixes.get(piece_name, f'{_piece_label(piece_name)} ')}{label_and_unit(quantity)[0]}"
    label = label_and_unit(name.removeprefix("scene_"))[0]
    label = {"highest": "highest obstacle", "pieces": "pieces of terrain"}.get(label, label)
    return label.replace("car mean", "car, mean").replace("car left less right", "car, left less right")
