"""A store's runs as CSV or Parquet: a row per run, a column per design parameter, in the store's order.

Input: an open Store. Output: a file, written whole or not at all, or a text stream. Rows are streamed.
"""

import csv
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from foldcar.atomic_file import atomic_file
from foldcar.results import Result
from foldcar.store import Store

TEXT_COLUMNS = ("experiment", "vehicle", "environment")
RESULT_COLUMNS = (
    *TEXT_COLUMNS,
    "sample",
    "outcome",
    "elapsed_time_s",
    "distance_to_target_m",
    "consumed_energy_j",
    "max_roll_rad",
    "max_pitch_rad",
)
BATCH_ROWS = 10_000

Cell = str | float | int | None


def export_csv(store: Store, file: Path) -> int:
    """Write ``file``; gives the number of rows. Numbers read back to the same values."""
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        rows = write_csv(store, text)
        text.detach()
    return rows


def write_csv(store: Store, text: TextIO) -> int:
    """Write to an open text stream; gives the number of rows."""
    writer = csv.writer(text, lineterminator="\n")
    design = store.design_columns()
    writer.writerow((*RESULT_COLUMNS, *design))
    count = 0
    for result in store.results():
        writer.writerow([_csv_cell(cell) for cell in _cells(result, design)])
        count += 1
    text.flush()
    return count


def export_parquet(store: Store, file: Path) -> int:
    """Write ``file``; gives the number of rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    design = store.design_columns()
    types = {**dict.fromkeys((*TEXT_COLUMNS, "outcome"), pa.string()), "sample": pa.int64()}
    columns = (*RESULT_COLUMNS, *design)
    schema = pa.schema([(column, types.get(column, pa.float64())) for column in columns])
    count = 0
    with atomic_file(file) as binary, pq.ParquetWriter(binary, schema) as writer:
        for batch in _batches(_cells(result, design) for result in store.results()):
            writer.write_table(
                pa.table(dict(zip(columns, zip(*batch, strict=True), strict=True)), schema=schema)
            )
            count += len(batch)
    return count


def _cells(result: Result, design: list[str]) -> list[Cell]:
    return [
        *(getattr(result, column) for column in RESULT_COLUMNS),
        *(result.design.get(column) for column in design),
    ]


def _csv_cell(cell: Cell) -> Cell:
    return repr(cell).removesuffix(".0") if isinstance(cell, float) else cell


def _batches(rows: Iterator[list[Cell]]) -> Iterator[list[list[Cell]]]:
    while batch := list(itertools.islice(rows, BATCH_ROWS)):
        yield batch
