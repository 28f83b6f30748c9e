"""Reads what `foldcar export --trials` adds to a table of trials: identity, corrections, deviations; and Parquet files.

Input: cells of a row, or a Parquet file. Output: columns of the store's table of trials, or the text of a CSV file.
"""

import csv
import io
import json
import math
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config
from typing_extensions import NotRequired, TypedDict

from foldcar.errors import FoldcarError
from foldcar.installation import require
from foldcar.shown_text import spreadsheet_cell
from foldcar.store.shapes import Number
from foldcar.store.trial_records import TRIAL_OUTCOMES
from foldcar.store.writer import canonical_json

# Further columns of trials that another store exported. Number and log stay behind.
EXPORTED = (
    "trial", "uuid", "ending", "ended_utc", "firmware_build", "design_hash", "log", "log_sha256", "scenic_program",
    "environment_fingerprint", "settings", "corrections", "deviations",
)  # fmt: skip
# Columns whose cells are taken over as they are.
UNCHECKED = ("ending", "ended_utc", "firmware_build", "design_hash", "scenic_program", "environment_fingerprint")
Deviations = dict[str, tuple[Number, Number, Number]]


@with_config(ConfigDict(extra="forbid"))
class ExportedSettings(TypedDict):
    """What a trial was driven with, as a run of docs/carsim.md."""

    speed_m_s: Number
    yaw_rate_rad_s: Number
    time_limit_s: Number
    parameters: NotRequired[dict[str, Number]]


@with_config(ConfigDict(extra="forbid"))
class ExportedCorrection(TypedDict):
    """A correction of an exported trial."""

    corrected_utc: str
    field: Literal["outcome", "elapsed_time_s", "note", "operator", "car", "car_name", "withdrawn"]
    before: str | int | float | None
    after: str | int | float | None
    reason: str
    operator: str


def exported_facts(place: str, row: Mapping[str, str]) -> dict[str, Any]:
    """Return the facts of a trial that only a table from `foldcar export` has, such as its identity and corrections.

    ``row`` is the trial's row. Error messages begin with ``place``. Raises FoldcarError.
    """
    facts: dict[str, Any] = {name: row[name] for name in UNCHECKED if name in row}
    facts["uuid"] = _uuid(place, row["uuid"])

    corrections: list[ExportedCorrection] = _parsed_cell(place, row, "corrections", list[ExportedCorrection], "[]")
    for correction in corrections:
        outcomes = {correction["before"], correction["after"]}
        if correction["field"] == "outcome" and not outcomes <= set(TRIAL_OUTCOMES):
            raise FoldcarError(f"{place}: corrections: an outcome is not one of {', '.join(TRIAL_OUTCOMES)}")
    facts["corrections"] = corrections

    deviations: Deviations = _parsed_cell(place, row, "deviations", Deviations, "{}")
    facts["deviations"] = canonical_json({name: list(pose) for name, pose in deviations.items()})

    settings = _parsed_cell(place, row, "settings", ExportedSettings | None, "null")
    if settings is not None:
        # In the parsed settings all numbers are floating-point numbers. The store keeps whole numbers as they are, so
        # take the numbers from the cell.
        facts["settings"] = canonical_json(json.loads(row["settings"]))
    return facts


def _uuid(place: str, text: str) -> str:
    """Return a UUID in its usual form. Raises FoldcarError if the text is not a UUID."""
    try:
        return str(uuid.UUID(text))
    except ValueError:
        raise FoldcarError(f'{place}: uuid: "{text}" is not a UUID') from None


def _parsed_cell(place: str, row: Mapping[str, str], name: str, shape: Any, default: str) -> Any:
    """Return the JSON value in a cell of a row; the cell's text is ``default`` if the row lacks it.

    Raises FoldcarError if the value does not have the type ``shape``.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(shape)
    try:
        return adapter.validate_json(row.get(name, default))
    except ValidationError as error:
        reason = error.errors()[0]["msg"].lower()
        raise FoldcarError(f"{place}: {name}: {row[name][:80]} is not as foldcar exports it: {reason}") from None


def require_corrected(place: str, trial: Mapping[str, Any]) -> None:
    """Raise FoldcarError if an exported trial contradicts its own corrections. The message begins with ``place``.

    Each field must have the value that its latest correction gave it. A person who changes the cell in a spreadsheet
    does not add a correction.
    """
    # Python's sorting keeps the order of corrections that were made in the same second.
    oldest_first = sorted(trial["corrections"], key=lambda correction: str(correction["corrected_utc"]))
    corrected_values: dict[str, Any] = {}
    for correction in oldest_first:
        corrected_values[correction["field"]] = correction["after"]
    for name, corrected_value in corrected_values.items():
        # The table has no column for "withdrawn", and it contains only trials that are not withdrawn (0).
        value = 0 if name == "withdrawn" else trial.get(name)
        if not _is_same(value, corrected_value):
            raise FoldcarError(
                f"{place}: {name}: {value} is not what the trial's corrections made it, {corrected_value}: use "
                "`foldcar trials correct` after the import"
            )


def _is_same(value: Any, corrected_value: Any) -> bool:
    """Return whether a cell of the imported table still has the value that a correction gave it.

    Texts are compared word by word, because the import removes superfluous spaces; a blank text is equal to None, an
    empty cell. Numbers may differ slightly, because spreadsheets round them.
    """
    if isinstance(value, str | None) and isinstance(corrected_value, str | None):
        return (value or "").split() == (corrected_value or "").split()
    if isinstance(value, int | float) and isinstance(corrected_value, int | float):
        return math.isclose(value, corrected_value, rel_tol=1e-6)
    return bool(value == corrected_value)


def parquet_text(file: Path) -> str:
    """Return the trials of a Parquet file as the text of a CSV file. Raises FoldcarError."""
    require("parquet")
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        rows = pq.read_table(file).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise FoldcarError(f"{file}: cannot be read: {error}") from None
    text = io.StringIO()
    # A carriage return in a cell would end the row when the text is read, so such a cell needs quotes. Python's writer
    # adds them only if the line end contains a carriage return.
    writer = csv.writer(text, lineterminator="\r\n")
    # The first line has the names of the columns, which are the keys of each row.
    writer.writerow(list(rows[0]) if rows else [])
    for row in rows:
        moved = row.get("deviations") or []
        poses = {entry["name"]: [entry["x_m"], entry["y_m"], entry["heading_rad"]] for entry in moved}
        cells = {**row, "deviations": json.dumps(poses)} if "deviations" in row else row
        # `foldcar export` writes the cells of CSV files in the same way, so both are read in the same way.
        writer.writerow(["" if cell is None else spreadsheet_cell(cell) for cell in cells.values()])
    return text.getvalue()
