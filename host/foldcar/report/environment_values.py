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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy
from numpy.typing import NDArray

from foldcar.car.variation import SERVO_DIFFERENCES, workshop_spreads
from foldcar.report.environment_labels import (
    column_label,
    labels_of_objects,
    object_columns,
    piece_names,
    prefixes_of_pieces,
)
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


def _object_parameters(store: Store, experiment: Any, samples: Iterable[int]) -> dict[int, list[Any]]:
    """Return names and parameters of the terrain objects by sample; {} if the store lacks those of one of ``samples``.

    ``experiment`` is the experiment's row in the store.
    """
    where = "WHERE environment_id = ?1 AND sample < ?2"
    rows = store.rows(BY_NAME["sample"], where, experiment["environment_id"], experiment["environments"])
    objects_by_sample = {row["sample"]: json.loads(row["objects"]) for row in rows if row["objects"] is not None}
    is_complete = all(sample in objects_by_sample for sample in samples)
    return objects_by_sample if is_complete else {}


def _read(store: Store, info: ExperimentInfo) -> EnvironmentValues:
    """Return a table with the random values of an experiment's environments and of the cars that drive in them.

    The table has a row for each sample, and a column for each value that differs between the samples.
    """
    experiment = store.row(EXPERIMENT, id=info.id)
    scenes = read_scenes(store, info)
    objects_by_sample = _object_parameters(store, experiment, scenes)
    scene_values = {sample: _scene(scene, objects_by_sample.get(sample)) for sample, scene in scenes.items()}
    wheels = _wheels_of_first_design(store, info)
    car_values = _by_sample(store, experiment, _VARIATIONS, read=lambda variation: _car(variation, wheels))
    names, values = _table([*scene_values.items(), *car_values.items()], info.environments)
    labels = labels_of_objects(objects_by_sample)
    prefixes = prefixes_of_pieces(info, scenes)
    informative = _informative(values)
    columns = tuple(_column(names[index], labels, prefixes) for index in informative)
    return EnvironmentValues(columns, values[:, informative])


def _wheels_of_first_design(store: Store, info: ExperimentInfo) -> Sequence[Mapping[str, Any]]:
    """Return the wheels of the body of the experiment's first design; none if the car has no wheels."""
    first_design = store.row(DESIGN, experiment=info.id, position=0)
    body = store.row(BY_NAME["body"], id=first_design["body_id"])
    wheels: Sequence[Mapping[str, Any]] = json.loads(body["json"]).get("wheels", ())
    return wheels


def _table(
    samples_with_values: Sequence[tuple[int, Mapping[str, float]]], samples: int
) -> tuple[list[str], NDArray[Any]]:
    """Return the names of all values, and a table (``samples``, names) of the values, NaN where a sample lacks one.

    ``samples_with_values`` are pairs of a sample and some of its values by name. The names are in the order in which they
    occur first.
    """
    index_by_name: dict[str, int] = {}
    for _, value_by_name in samples_with_values:
        for name in value_by_name:
            index_by_name.setdefault(name, len(index_by_name))
    table = numpy.full((samples, len(index_by_name)), numpy.nan)
    for sample, value_by_name in samples_with_values:
        for name, value in value_by_name.items():
            table[sample, index_by_name[name]] = value
    return list(index_by_name), table


@dataclass(frozen=True)
class _DrawnTables:
    """Where the store keeps what is drawn at random for each sample: its scene, or the variation of its built car.

    Each row of ``table`` refers to a row of ``content_table``, which has the content as JSON. The rows of an experiment
    have the experiment's value in the column ``key``.
    """

    table: str
    key: str
    content_table: str


_SCENES = _DrawnTables(table="sample", key="environment_id", content_table="scene")
_VARIATIONS = _DrawnTables(table="draw", key="spread_id", content_table="variation")


def _by_sample(store: Store, experiment: Any, tables: _DrawnTables, read: Callable[[Any], Read]) -> dict[int, Read]:
    """Return the result of ``read`` for the content of each sample, by sample.

    The contents are the scenes or the variations that are stored in ``tables``. ``experiment`` is the experiment's row.
    Samples may share a content, which is then read once.
    """
    content_id = f"{tables.content_table}_id"
    of_experiment = f"WHERE {tables.key} = ?1 AND sample < ?2"
    parameters = experiment[tables.key], experiment["environments"]
    samples = store.rows(BY_NAME[tables.table], of_experiment, *parameters)
    id_by_sample = {row["sample"]: row[content_id] for row in samples}
    of_samples = f"WHERE id IN (SELECT {content_id} FROM {tables.table} {of_experiment})"
    contents = store.rows(BY_NAME[tables.content_table], of_samples, *parameters)
    result_by_id = {row["id"]: read(json.loads(row["json"])) for row in contents}
    return {sample: result_by_id[row_id] for sample, row_id in id_by_sample.items() if row_id in result_by_id}


def _scene(scene: Mapping[str, Any], objects: Sequence[Any] | None) -> dict[str, float]:
    """Return the numbers of a scene by the name of their column.

    They are its friction, its start, its goal, its number of pieces, the height of its highest piece (m), and the numbers
    of its terrain. The latter are the parameters of the terrain's ``objects``, or if these are unknown (None), the sizes
    and places of its pieces.
    """
    values = _numbers("scene", {"friction": scene.get("friction")})
    for position in ("start", "goal"):
        values |= _numbers(f"scene_{position}", scene.get(position) or {})
    terrain = scene.get("terrain", ())
    values |= _numbers_of_pieces(terrain) if objects is None else _numbers_of_objects(objects)
    heights_m = [piece.get("height_m", 0.0) for piece in terrain]
    values["scene_pieces"] = len(heights_m)
    values["scene_highest_m"] = max(heights_m, default=0.0)
    return values


def _numbers_of_objects(objects: Sequence[Any]) -> dict[str, float]:
    """Return the parameters of terrain objects by the name of their column. An object is [name, parameters]."""
    values = {}
    columns = object_columns([name for name, _ in objects])
    for column, (_, parameters) in zip(columns, objects, strict=True):
        for key, value in parameters.items():
            if key not in LEFT_OUT:
                values[f"{column}.{key}"] = float(value)
    return values


def _numbers_of_pieces(terrain: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the numbers of each piece of a terrain by the name of their column, such as ``scene_box_2_height_m``."""
    values: dict[str, float] = {}
    names_in_scene = piece_names(piece["kind"] for piece in terrain)
    for piece_name, piece in zip(names_in_scene, terrain, strict=True):
        values |= _numbers(f"scene_{piece_name}", piece)
    return values


def _numbers(start: str, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers among ``values``, named with the prefix ``start``."""
    return {
        f"{start}_{key}": float(value)
        for key, value in values.items()
        if isinstance(value, int | float) and key not in LEFT_OUT
    }


def _car(variation: Mapping[str, Any], wheels: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return how a built car differs from its design, by the name of the column, such as ``car_supply_v``.

    ``variation`` is a sample's stored variation: the difference of each quantity, or if each wheel has its own, a list
    of differences. ``wheels`` are the wheels of the family's first design.
    """
    values = {}
    for name, difference in variation.items():
        if name not in workshop_spreads():
            continue
        if not isinstance(difference, list):
            values[f"car_{name}"] = float(difference)
        elif wheels:
            values |= _wheel_values(name, difference, wheels)
    return values


def _wheel_values(name: str, value_by_channel: Sequence[float], wheels: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the mean of a quantity over a car's wheels, and the mean of its left wheels minus that of its right wheels.

    The second value is left out if all wheels are on one side. ``value_by_channel`` has the quantity for each channel
    of the servos, which says how this built car differs from its design.
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
    """Return the indices of the columns of ``values`` (samples, columns) that vary and are not repetitions.

    A column is a repetition if it is a linear function of an informative column before it.
    """
    informative: list[int] = []
    for index, column in enumerate(values.T):
        if _is_constant(column):
            continue
        if not any(_is_repetition(column, values[:, earlier]) for earlier in informative):
            informative.append(index)
    return informative


def _is_constant(column: NDArray[Any]) -> bool:
    """Return whether all known values of a column are equal, apart from rounding. Unknown values are NaN."""
    known_values = column[~numpy.isnan(column)]
    if len(known_values) < 2:
        return True
    max_range = MIN_RELATIVE_RANGE * abs(known_values).max()
    return bool(numpy.ptp(known_values) <= max_range)


def _is_repetition(column: NDArray[Any], earlier: NDArray[Any]) -> bool:
    """Return whether a column is a linear function of an earlier one.

    Only columns that are known in the same samples can be compared. Others are no repetitions.
    """
    is_known = ~numpy.isnan(column)
    is_known_earlier = ~numpy.isnan(earlier)
    if (is_known != is_known_earlier).any():
        return False
    correlation = abs(numpy.corrcoef(earlier[is_known], column[is_known])[0, 1])
    # The correlation is NaN if rounding leaves one of the columns without variance.
    return bool(numpy.isnan(correlation) or correlation > MAX_CORRELATION)


def _column(name: str, labels: Mapping[str, str], prefixes: Mapping[str, str]) -> EnvironmentColumn:
    """Return the column ``name`` with its label, its unit, and the factor from SI units to this unit.

    ``labels`` has the labels of the columns that belong to objects, by the column's name. ``prefixes`` has the beginning
    of the labels of the columns that belong to a piece, by the piece's name.
    """
    _, si_unit = label_and_unit(name)
    unit, scale = READERS_UNITS.get(si_unit, (si_unit, 1.0))
    label = labels.get(name) or column_label(name, prefixes)
    return EnvironmentColumn(name, label, unit, scale)
