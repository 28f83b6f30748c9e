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
    facts: dict[str, Any] = {
        name: row[name]
        for name in ("ending", "ended_utc", "firmware_build", "design_hash", "scenic_program", "environment_fingerprint")
        if name in row
    }
    try:
        facts["uuid"] = str(uuid.UUID(row["uuid"]))
    except ValueError:
        raise FoldcarError(f'{place}: uuid: "{row["uuid"]}" is not a UUID') from None
    defaults = {"deviations": "{}", "corrections": "[]", "settings": "null"}
    shapes: dict[str, Any] = {
        "deviations": Deviations,
        "corrections": list[ExportedCorrection],
        "settings": ExportedSettings | None,
    }
    for name, shape in shapes.items():
        try:
            adapter: TypeAdapter[Any] = TypeAdapter(shape)
            facts[name] = adapter.validate_json(row.get(name, defaults[name]))
        except ValidationError as error:
            reason = error.errors()[0]["msg"].lower()
            raise FoldcarError(f"{place}: {name}: {row[name][:80]} is not as foldcar exports it: {reason}") from None
    for correction in facts["corrections"]:
        if correction["field"] == "outcome" and not {correction["before"], correction["after"]} <= set(TRIAL_OUTCOMES):
            raise FoldcarError(f"{place}: corrections: an outcome is not one of {', '.join(TRIAL_OUTCOMES)}")
    settings = facts.pop("settings")
    if settings is not None:
        # The check has turned whole numbers into floating-point numbers. So read the numbers again
        # from the cell, to get the same text as in the store.
        facts["settings"] = canonical_json(json.loads(row["settings"]))
    facts["deviations"] = canonical_json({name: list(pose) for name, pose in facts["deviations"].items()})
    return facts


def require_corrected(place: str, trial: Mapping[str, Any]) -> None:
    """Raise FoldcarError if an exported trial contradicts its own corrections.

    A field must have the value that its latest correction gave it. A person may have changed the cell in a spreadsheet.
    """
    # Sorting keeps the order of corrections that were made in the same second, so the last of them counts.
    corrections = sorted(trial["corrections"], key=lambda correction: str(correction["corrected_utc"]))
    for name, after in {correction["field"]: correction["after"] for correction in corrections}.items():
        # Only trials that are not withdrawn are exported, so the present value of "withdrawn" is 0.
        value = 0 if name == "withdrawn" else trial.get(name)
        if not _is_same(value, after):
            raise FoldcarError(
                f"{place}: {name}: {value} is not what the trial's corrections made it, {after}: use "
                "`foldcar trials correct` after the import"
            )


def _is_same(value: Any, after: Any) -> bool:
    """Return whether a cell has a correction's value; spreadsheets shorten numbers, and the import shortens spaces.

    An empty or blank text is an empty cell, None.
    """
    if isinstance(value, str | None) and isinstance(after, str | None):
        return (value or "").split() == (after or "").split()
    if isinstance(value, int | float) and isinstance(after, int | float):
        return math.isclose(value, after, rel_tol=1e-6)
    return bool(value == after)


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
