"""A store's runs, and its trials that count, as CSV or Parquet: a row each, in the store's order.

Runs have a column for each design parameter, each recorded value, and each sampled value of scene and built car
(:mod:`foldcar.report.environment_values`). `passed` is true or false, and empty if the experiment does not define
success. Recorded numbers, strings and booleans keep their type. Series and other values are JSON text; in Parquet they
are lists if all values of a name have one type. Trials, with aborted ones, have a column for each design parameter.
Unknown values are empty.

Input: an open Store. Output: a file, written whole or not at all, or a text stream. Runs are streamed.
"""

import csv
import io
import itertools
import json
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any, TextIO

from foldcar.outputs import atomic_file
from foldcar.report.environment_values import EnvironmentValues, environment_values
from foldcar.shown_text import spreadsheet_cell
from foldcar.simulation.results import METRICS, NUMBERS, Recorded, Result, has_passed
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, left_out_text, select_trials

TEXT_COLUMNS = ("experiment", "vehicle", "environment")
RESULT_COLUMNS = (*TEXT_COLUMNS, "sample", "outcome", "passed", *NUMBERS, "message")
RECORDED_PREFIX = "recorded_"
BATCH_ROWS = 10_000
# Columns of trials before and after those of the design.
TRIAL_HEAD = ("experiment", "vehicle_type")
TRIAL_TAIL = (
    "sample", "outcome", "ending", "elapsed_time_s", "note", "operator", "started_utc", "ended_utc", "firmware_build",
    "design_hash", "log", "log_sha256", "source", "car", "car_name", "scenic_program", "uuid",
)  # fmt: skip

# The kind of a recorded value's column, by the JSON types of all its values; mixed or nested values are JSON.
RECORDED_KINDS = {
    "number": {"integer", "real", "null"},
    "text": {"text", "null"},
    "truth": {"true", "false", "null"},
}
UNITS = {**{metric.name: metric.unit for metric in METRICS}, "elapsed_time_s": "s"}
# Units that names of parameters and sampled values end in.
SUFFIXES = ("mm", "deg", "m", "rad", "v", "us")


def export_csv(store: Store, file: Path, failed: bool = False) -> int:
    """Write the runs of a store to a CSV file, and return the number of rows.

    If ``failed`` is True, only the failed runs are written. The file appears only when it is complete. Its numbers have
    so many digits that they are read back exactly. Raises FoldcarError if the store cannot be read or the file cannot be
    written.
    """
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        rows = write_csv(store, text, failed)
        # Otherwise the wrapper would close the file, which atomic_file still needs.
        text.detach()
    return rows


def write_csv(store: Store, text: TextIO, failed: bool = False) -> int:
    """Write the runs, or only the ``failed`` ones, as CSV to an open text stream; return the number of rows."""
    table = _RunTable(store, failed)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(spreadsheet_cell, table.columns))
    count = 0
    for cells in table.rows():
        writer.writerow([_csv_cell(cell) for cell in cells])
        count += 1
    text.flush()
    return count


def export_parquet(store: Store, file: Path, failed: bool = False) -> int:
    """Write the runs of a store to a Parquet file, and return the number of rows.

    If ``failed`` is True, only the failed runs are written. The file appears only when it is complete. Raises
    FoldcarError if the store cannot be read or the file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = _RunTable(store, failed)
    list_types = _types_of_recorded_lists(store, table)
    types = dict.fromkeys((*TEXT_COLUMNS, "outcome", "message"), pa.string())
    types |= {"sample": pa.int64(), "passed": pa.bool_()}
    type_of_kind = {"number": pa.float64(), "text": pa.string(), "truth": pa.bool_(), "json": pa.string()}
    for name, kind in table.recorded.items():
        types[f"{RECORDED_PREFIX}{name}"] = list_types.get(name, type_of_kind[kind])
    # All other columns are numbers.
    schema = pa.schema([_field(column, types.get(column, pa.float64())) for column in table.columns])
    count = 0
    rows = table.rows(list_types)
    with atomic_file(file) as binary, pq.ParquetWriter(binary, schema) as writer:
        while batch := list(itertools.islice(rows, BATCH_ROWS)):
            columns = list(zip(*batch, strict=True))
            writer.write_table(pa.table(columns, schema=schema))
            count += len(batch)
    return count


def _types_of_recorded_lists(store: Store, table: "_RunTable") -> dict[str, Any]:
    """Return pyarrow's type of each recorded name whose values become Parquet lists, because they have one list type.

    Other values that are neither numbers, strings nor booleans remain JSON text.
    """
    list_types = {}
    for name, kind in table.recorded.items():
        if kind == "json":
            type_of_lists = list_type(result.recorded.get(name) for result in store.results())
            if type_of_lists is not None:
                list_types[name] = type_of_lists
    return list_types


def export_trials(store: Store, file: Path, simulated_trials: bool) -> tuple[int, str | None]:
    """Write trials of built cars atomically, as Parquet if the file ends in .parquet, else as CSV.

    ``simulated_trials`` adds trials of simulated cars. Settings are JSON (docs/carsim.md, run). Corrections are JSON: a
    list of objects with the fields of Correction, oldest first. Deviations in CSV are JSON: {name: [x in m, y in m,
    heading in rad]}; in Parquet a list of name, x_m, y_m, heading_rad. `foldcar trials import` reads both files. Returns
    the number of rows, and a sentence on trials that are left out, None without any. Raises FoldcarError if the store
    cannot be read or the file cannot be written.
    """
    trials, left_out = select_trials(store.trials(), simulated_trials)
    columns = _trial_columns(store, trials)
    deviations = [trial.deviations for trial in trials]
    with atomic_file(file) as binary:
        if file.suffix.lower() == ".parquet":
            _write_trials_as_parquet(binary, columns, deviations, numbers=_design_names(trials))
        else:
            text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow([*columns, "deviations"])
            rows = zip(*columns.values(), map(json.dumps, deviations), strict=True)
            writer.writerows(map(spreadsheet_cell, row) for row in rows)
            # Otherwise the wrapper would close the file, which atomic_file still needs.
            text.detach()
    return len(trials), left_out_text(left_out)


def _design_names(trials: Sequence[Trial]) -> list[str]:
    """Return the names of the design parameters that any of the trials has, in order of appearance."""
    names: dict[str, None] = {}
    for trial in trials:
        names |= dict.fromkeys(trial.design)
    return list(names)


def _trial_columns(store: Store, trials: Sequence[Trial]) -> dict[str, list[Any]]:
    """Return the columns of a table of trials by name, each with a value for each trial, without the deviations."""
    corrections: dict[int, list[dict[str, Any]]] = {trial.id: [] for trial in trials}
    for correction in store.corrections():
        if correction.trial in corrections:
            fields_of_correction = asdict(correction)
            corrections[fields_of_correction.pop("trial")].append(fields_of_correction)
    fingerprints, settings = store.environments_of_trials(), store.settings_of_trials()
    columns: dict[str, list[Any]] = {"trial": [trial.id for trial in trials]}
    for name in TRIAL_HEAD:
        columns[name] = [getattr(trial, name) for trial in trials]
    for name in _design_names(trials):
        columns[name] = [trial.design.get(name) for trial in trials]
    for name in TRIAL_TAIL:
        columns[name] = [getattr(trial, name) for trial in trials]
    columns["environment_fingerprint"] = [fingerprints.get(trial.id) for trial in trials]
    columns["settings"] = [settings.get(trial.id) for trial in trials]
    columns["corrections"] = [json.dumps(corrections[trial.id]) if corrections[trial.id] else None for trial in trials]
    return columns


def _write_trials_as_parquet(
    binary: IO[bytes],
    columns: Mapping[str, list[Any]],
    deviations: Sequence[Mapping[str, Sequence[float]]],
    numbers: Sequence[str],
) -> None:
    """Write a table of trials to an open Parquet file.

    ``numbers`` are the columns of design parameters. ``deviations`` has, for each trial, how far objects stood from their
    planned positions, by their names: x (m), y (m) and heading (rad).
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = dict.fromkeys(("trial", "sample"), pa.int64())
    types |= dict.fromkeys(("elapsed_time_s", *numbers), pa.float64())
    fields = [_field(name, types.get(name, pa.string())) for name in columns]
    pose = ("x_m", "y_m", "heading_rad")
    deviation_type = pa.struct([("name", pa.string()), *(_field(name, pa.float64()) for name in pose)])
    deviation_column = []
    for deviations_of_trial in deviations:
        objects = []
        for name, values in deviations_of_trial.items():
            objects.append({"name": name, **dict(zip(pose, values, strict=True))})
        deviation_column.append(objects)
    schema = pa.schema([*fields, ("deviations", pa.list_(deviation_type))])
    pq.write_table(pa.table([*columns.values(), deviation_column], schema=schema), binary)


def _recorded_kind(types: Collection[str]) -> str:
    """Return the first of RECORDED_KINDS that holds all these JSON types, else ``json``."""
    for kind, held_types in RECORDED_KINDS.items():
        if held_types.issuperset(types):
            return kind
    return "json"


class _RunTable:
    """The runs of a store as rows of cells; ``recorded`` has each recorded name's kind, of RECORDED_KINDS or ``json``."""

    def __init__(self, store: Store, failed: bool) -> None:
        """Read what the columns are. If ``failed`` is True, the table has the failed runs only."""
        self._store, self._failed = store, failed
        self._design_names = store.design_columns()
        self.recorded = {name: _recorded_kind(types) for name, types in store.recorded_types().items()}
        # The sampled values of scene and car, a table for each experiment.
        self._sampled_values: dict[str, EnvironmentValues] = {}
        if store.experiment_ids():
            for info in store.info().experiments.values():
                self._sampled_values[info.id] = environment_values(store, info)
        # Their names in all experiments, in order of appearance. A dictionary has each name once.
        names: dict[str, None] = {}
        for values in self._sampled_values.values():
            names |= dict.fromkeys(column.name for column in values.columns)
        self._sampled_names = list(names)
        recorded_columns = [f"{RECORDED_PREFIX}{name}" for name in self.recorded]
        self.columns = [*RESULT_COLUMNS, *self._design_names, *recorded_columns, *self._sampled_names]

    def rows(self, lists: Collection[str] = ()) -> Iterator[list[Any]]:
        """Yield a list of cells for each run. Recorded values whose name is in ``lists`` are lists, not JSON text."""
        judged_experiments = self._store.judged_experiments()
        for result in self._store.results():
            if self._failed and result.outcome != "failed":
                continue
            is_judged = result.experiment in judged_experiments
            yield [
                # The columns of RESULT_COLUMNS.
                result.experiment,
                result.vehicle,
                result.environment,
                result.sample,
                result.outcome,
                has_passed(result.outcome) if is_judged else None,
                *(result.metrics[name] for name in NUMBERS),
                result.message,
                *(result.design.get(name) for name in self._design_names),
                *self._recorded_cells(result, lists),
                *self._sampled_cells(result),
            ]

    def _recorded_cells(self, result: Result, lists: Collection[str]) -> Iterator[Any]:
        """Yield a run's recorded values, in the order of ``recorded``; those whose name is in ``lists`` as lists."""
        for name, kind in self.recorded.items():
            if name in lists:
                yield list_cell(result.recorded.get(name))
            else:
                yield _recorded_cell(result.recorded, name, kind)

    def _sampled_cells(self, result: Result) -> Iterator[float | None]:
        """Yield a run's sampled values of scene and car, in the order of the columns.

        A value is None if the run's environment lacks it.
        """
        experiment_values = self._sampled_values[result.experiment]
        values = experiment_values.values[result.sample].tolist()
        names = (column.name for column in experiment_values.columns)
        value_by_name = dict(zip(names, values, strict=True))
        for name in self._sampled_names:
            value = value_by_name.get(name, math.nan)
            yield None if math.isnan(value) else value


def _recorded_cell(recorded: Mapping[str, Recorded], name: str, kind: str) -> Any:
    """Return a recorded value as a cell, as JSON text if its ``kind`` is json; None if the run has no such value."""
    if name not in recorded:
        return None
    value = recorded[name].value
    return json.dumps(value) if kind == "json" else value


def _csv_cell(cell: Any) -> Any:
    """Return a cell as CSV has it: booleans as in JSON, whole numbers without ``.0``, text that is no formula."""
    if isinstance(cell, bool):
        return json.dumps(cell)
    if isinstance(cell, float):
        return repr(cell).removesuffix(".0")
    return spreadsheet_cell(cell)


def _field(name: str, kind: Any) -> Any:
    """Return pyarrow's field of the type ``kind``. If the field has a unit, its metadata has it as ``unit``."""
    import pyarrow as pa

    unit: str | None = None
    _, _, suffix = name.rpartition("_")
    if name in UNITS:
        unit = UNITS[name]
    elif suffix in SUFFIXES:
        unit = suffix
    return pa.field(name, kind, metadata=None if unit is None else {"unit": unit})


def list_type(recorded: Iterable[Recorded | None]) -> Any:
    """Return the list type of pyarrow that can hold all these recorded values, or None if no list type can.

    For lists of numbers it is list<double>. For series it is list<struct<time_s, value>>.
    """
    import pyarrow as pa

    known_records = [record for record in recorded if record is not None and record.value is not None]
    if not known_records or not all(isinstance(record.value, list) for record in known_records):
        return None
    is_series = [record.kind == "series" for record in known_records]
    if not any(is_series):
        return _type_of([record.value for record in known_records])
    if not all(is_series):
        return None
    values = []
    for record in known_records:
        values += [value for _, value in record.value]
    value_type = _type_of(values)
    if value_type is None:
        return None
    time = pa.field("time_s", pa.float64(), metadata={"unit": "s"})
    return pa.list_(pa.struct([time, ("value", value_type)]))


def list_cell(recorded: Recorded | None) -> Any:
    """Return a value as a cell of a column of :func:`list_type`; None if the run has no such value."""
    if recorded is None:
        return None
    if recorded.kind != "series":
        return recorded.value
    return [{"time_s": time_s, "value": value} for time_s, value in recorded.value or ()]


def _type_of(values: list[Any]) -> Any:
    """Return pyarrow's type of numbers, booleans, strings, or lists of one of these; None for other or mixed values."""
    import pyarrow as pa

    try:
        arrow_type = pa.array(values).type
    except (pa.ArrowException, OverflowError):
        return None
    return _type_with_float_numbers(arrow_type)


def _type_with_float_numbers(arrow_type: Any) -> Any:
    """Return the type of the Parquet column for values of a type of pyarrow, or None if they cannot be in a column.

    Integers and values of an unknown type become floating-point numbers, also in lists.
    """
    import pyarrow as pa
    from pyarrow import types

    if types.is_list(arrow_type):
        element_type = _type_with_float_numbers(arrow_type.value_type)
        return None if element_type is None else pa.list_(element_type)
    if types.is_integer(arrow_type) or types.is_null(arrow_type):
        return pa.float64()
    if types.is_floating(arrow_type) or types.is_boolean(arrow_type) or types.is_string(arrow_type):
        return arrow_type
    return None
