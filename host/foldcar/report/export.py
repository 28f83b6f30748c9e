"""A store's runs as CSV or Parquet: a row per run, in the store's order.

There is a column for each design parameter, each recorded value, and each sampled value of scene and built car
(:mod:`foldcar.report.environment_values`). `passed` is true or false, and empty where the
experiment does not define success. Values recorded as numbers, texts or
truths stay so; series and all else are JSON text, in Parquet lists where all of that name are alike.

Input: an open Store. Output: a file, written whole or not at all, or a text stream. Rows are streamed.
"""

import csv
import io
import itertools
import json
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

from foldcar.outputs import atomic_file
from foldcar.report.environment_values import environment_values
from foldcar.report.parquet import field, list_cell, list_type
from foldcar.simulation.results import NUMBERS, Result, has_passed
from foldcar.store.reader import Store

TEXT_COLUMNS = ("experiment", "vehicle", "environment")
RESULT_COLUMNS = (*TEXT_COLUMNS, "sample", "outcome", "passed", *NUMBERS, "message")
RECORDED_PREFIX = "recorded_"
BATCH_ROWS = 10_000

# What a recorded value is in a file, by the types of all its values; whatever mixes or nests is JSON.
RECORDED_KINDS = {
    "number": {"integer", "real", "null"},
    "text": {"text", "null"},
    "truth": {"true", "false", "null"},
}

Cell = str | float | int | None


def export_csv(store: Store, file: Path, failed: bool = False) -> int:
    """Write the runs, or the ``failed`` ones, as CSV atomically; returns the number of rows. FoldcarError.

    Numbers are read back exactly.
    """
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        rows = write_csv(store, text, failed)
        text.detach()
    return rows


def write_csv(store: Store, text: TextIO, failed: bool = False) -> int:
    """Write the runs, or the ``failed`` ones, as CSV to an open text stream; returns the number of rows."""
    writer = csv.writer(text, lineterminator="\n")
    design, recorded, sampled = store.design_columns(), _recorded_kinds(store), _Sampled(store)
    writer.writerow([*_columns(design, recorded), *sampled.names])
    count = 0
    for cells in _rows(store, design, recorded, sampled, failed):
        writer.writerow([_csv_cell(cell) for cell in cells])
        count += 1
    text.flush()
    return count


def export_parquet(store: Store, file: Path, failed: bool = False) -> int:
    """Write the runs, or the ``failed`` ones, as Parquet atomically; returns the number of rows. FoldcarError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    design, recorded, sampled = store.design_columns(), _recorded_kinds(store), _Sampled(store)
    nested = [name for name, kind in recorded.items() if kind == "json"]
    found = {name: list_type(result.recorded.get(name) for result in store.results()) for name in nested}
    lists = {name: kind for name, kind in found.items() if kind is not None}
    of_kind = {"number": pa.float64(), "text": pa.string(), "truth": pa.bool_(), "json": pa.string()}
    types = {
        **dict.fromkeys((*TEXT_COLUMNS, "outcome", "message"), pa.string()),
        "sample": pa.int64(),
        "passed": pa.bool_(),
        **{f"{RECORDED_PREFIX}{name}": lists.get(name, of_kind[kind]) for name, kind in recorded.items()},
    }
    columns = [*_columns(design, recorded), *sampled.names]
    schema = pa.schema([field(column, types.get(column, pa.float64())) for column in columns])
    count = 0
    with atomic_file(file) as binary, pq.ParquetWriter(binary, schema) as writer:
        for batch in _batches(_rows(store, design, recorded, sampled, failed, lists)):
            writer.write_table(pa.table(dict(zip(columns, zip(*batch, strict=True), strict=True)), schema=schema))
            count += len(batch)
    return count


class _Sampled:
    """The sampled values of runs; ``names`` are the columns of all experiments."""

    def __init__(self, store: Store) -> None:
        infos = store.info().experiments.values() if store.holds_study() else ()
        self._tables = {info.id: environment_values(store, info) for info in infos}
        self.names = list(dict.fromkeys(one.name for table in self._tables.values() for one in table.columns))
        places = {id: {one.name: at for at, one in enumerate(table.columns)} for id, table in self._tables.items()}
        self._places = {id: [at.get(name) for name in self.names] for id, at in places.items()}

    def cells(self, result: Result) -> list[float | None]:
        """A run's values, in the order of the names; None for what its environment lacks."""
        row = self._tables[result.experiment].values[result.sample].tolist()
        found = (None if at is None else row[at] for at in self._places[result.experiment])
        return [None if value is None or value != value else value for value in found]


def _recorded_kinds(store: Store) -> dict[str, str]:
    """The kind of each recorded value by name: ``number``, ``text``, ``truth`` (boolean) or ``json``."""
    return {
        name: next((kind for kind, takes in RECORDED_KINDS.items() if types <= takes), "json")
        for name, types in store.recorded_types().items()
    }


def _columns(design: list[str], recorded: Mapping[str, str]) -> list[str]:
    return [*RESULT_COLUMNS, *design, *(f"{RECORDED_PREFIX}{name}" for name in recorded)]


def _rows(
    store: Store,
    design: list[str],
    recorded: Mapping[str, str],
    sampled: "_Sampled",
    failed: bool,
    lists: Collection[str] = (),
) -> Iterator[list[Any]]:
    defined = store.judged_experiments()
    for result in store.results():
        if not failed or result.outcome == "failed":
            passed = has_passed(result.outcome) if result.experiment in defined else None
            yield [*_cells(result, passed, design, recorded, lists), *sampled.cells(result)]


def _cells(
    result: Result, passed: bool | None, design: list[str], recorded: Mapping[str, str], lists: Collection[str]
) -> list[Any]:
    return [
        result.experiment,
        result.vehicle,
        result.environment,
        result.sample,
        result.outcome,
        passed,
        *(result.metrics[name] for name in NUMBERS),
        result.message,
        *(result.design.get(column) for column in design),
        *(
            list_cell(result.recorded.get(name)) if name in lists else _recorded_cell(result, name, kind)
            for name, kind in recorded.items()
        ),
    ]


def _recorded_cell(result: Result, name: str, kind: str) -> Cell:
    if name not in result.recorded:
        return None
    value = result.recorded[name].value
    cell: Cell = json.dumps(value) if kind == "json" else value
    return cell


def _csv_cell(cell: Cell) -> Cell:
    if isinstance(cell, bool):
        return json.dumps(cell)
    return repr(cell).removesuffix(".0") if isinstance(cell, float) else cell


def _batches(rows: Iterator[list[Any]]) -> Iterator[list[list[Any]]]:
    while batch := list(itertools.islice(rows, BATCH_ROWS)):
        yield batch
