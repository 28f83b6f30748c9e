"""Reads trials from a CSV file: one row for each trial, or one for ``count`` equal trials.

Input: a file with the columns ``outcome``, ``source`` and ``vehicle_type``, and optionally ``experiment``, ``sample``,
``count``, ``car`` (built or simulated; default: built), ``car_name``, ``elapsed_time_s``, ``note``, ``operator``,
``started_utc`` and parameters of the design (``width_mm``, …). Missing parameters are taken from the experiment if it was
swept and does not vary them; else they are foldcar's defaults. At least one parameter must be given.
A file that `foldcar export --trials` wrote has more columns, among them ``uuid``: such a row is the same trial as in the
store that exported it, with its corrections and deviations.
Columns are separated by commas, or by semicolons, with decimal points or decimal commas. Empty rows and empty columns at
the right are ignored; there are no comments. Output: rows for :meth:`TrialWriter.import_trials`.
"""

import csv
import io
import math
import re
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from foldcar.car.design import Design, DesignError, compose_columns
from foldcar.car.design_parameters import key_of, parameters
from foldcar.errors import FoldcarError
from foldcar.evidence.design_evidence import design_label
from foldcar.shown_text import breaks_line, shown_line, without_apostrophe
from foldcar.statistics.words import count, design_text
from foldcar.store.info import ExperimentInfo
from foldcar.store.other_drives import LIMIT_OVERRUN_S
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, CARS, LONGEST_S, MAX_ID, TRIAL_OUTCOMES, checked_name
from foldcar.trials.exported_trials import EXPORTED, exported_facts, parquet_text, require_corrected
from foldcar.typed import decimal_number, did_you_mean, read_text, whole_number

REQUIRED = ("vehicle_type", "outcome", "source")
OPTIONAL = ("experiment", "count", "car", "car_name", "sample", "elapsed_time_s", "note", "operator", "started_utc")
MAX_COUNT = 100_000
# Namespace of the UUIDs of imported trials.
IMPORT_NAMESPACE = uuid.UUID("4685ff4d-fc48-5e4d-ac46-0c50b74c77a7")
# How many cars that were not swept are named: those with the most trials.
SHOWN_CARS = 5
NOTHING: Mapping[str, ExperimentInfo] = {}


def read_trials(
    file: Path,
    experiment: str | None,
    swept: Mapping[str, ExperimentInfo] = NOTHING,
    announce: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """Return the trials in ``file`` as rows for :meth:`TrialWriter.import_trials`.

    ``experiment`` is that of rows which name none, ``swept`` are the store's experiments by name. ``announce`` is called
    with a sentence if cars have parameters that neither the file nor the sweep gives, and foldcar's defaults are used.
    Raises FoldcarError that names line and column.
    """
    text = parquet_text(file) if file.suffix.lower() == ".parquet" else read_text(file)
    first_line = text.lstrip().partition("\n")[0]
    # No column's name has a comma or a semicolon.
    separator = ";" if ";" in first_line and "," not in first_line else ","
    lines = _rows(file, text, separator)
    header = next(lines, (0, [""]))[1]
    while header and not header[-1]:
        header.pop()
    if not header:
        raise FoldcarError(f"{file}: contains no trials")
    _check_header(file, header)
    decimals = {"elapsed_time_s", *(name for name in header if key_of(name))}
    trials: list[dict[str, Any]] = []
    defaults: dict[str, float] = {}
    row_counts_by_source: Counter[str] = Counter()
    # An example of a number with a decimal comma, and of one with a decimal point or grouped by thousands, as 1.095.
    example_by_mark: dict[str, str] = {}
    for line_number, cells in lines:
        if len(cells) < len(header) or any(cells[len(header) :]):
            raise FoldcarError(f"{file}: line {line_number}: has {count(len(cells), 'cell')}, the header {len(header)}")
        row = {name: without_apostrophe(cell) for name, cell in zip(header, cells, strict=False) if cell}
        if separator == ";":
            for name in decimals & row.keys():
                example = f'"{row[name]}" in line {line_number}'
                if "," in row[name]:
                    example_by_mark[","] = example
                elif re.fullmatch(r"\d{1,3}(\.\d{3})+", row[name]):
                    example_by_mark["."] = example
                row[name] = row[name].replace(",", ".")
            if len(example_by_mark) > 1:
                examples = " beside ".join(example_by_mark.values())
                raise FoldcarError(f"{file}: {examples}: use only decimal commas, without points")
        trial, trial_count = _trial(f"{file}: line {line_number}", row, experiment, swept, defaults)
        if "uuid" in trial:
            trials.append(trial)
            continue
        source = trial["source"]
        row_counts_by_source[source] += 1
        for number_in_row in range(1, trial_count + 1):
            # A trial is identified by its source, its row among those of the source, and its number in the row.
            identity = f"{source}\n{row_counts_by_source[source]}\n{number_in_row}"
            trials.append({"uuid": str(uuid.uuid5(IMPORT_NAMESPACE, identity)), **trial})
    if not trials:
        raise FoldcarError(f"{file}: contains no trials")
    if defaults:
        announce(f"{file}: does not have all parameters of its cars; defaults are used: {design_text(defaults)}")
    return trials


def _rows(file: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield each row that is not empty: the number of its first line, and its cells. Raises FoldcarError."""
    reader = csv.reader(io.StringIO(text), delimiter=separator, strict=True)
    # A cell may have several lines, so a row may, too.
    line_number = 1
    try:
        for cells in reader:
            stripped_cells = [cell.strip() for cell in cells]
            if any(stripped_cells):
                yield line_number, stripped_cells
            line_number = reader.line_num + 1
    except csv.Error as error:
        raise FoldcarError(f"{file}: line {line_number}: {error}") from None


def _check_header(file: Path, header: list[str]) -> None:
    """Raise FoldcarError for unknown, repeated and missing columns."""
    parameter_columns = [parameter.column for parameter in parameters().values()]
    is_export = "uuid" in header
    known_columns = [*REQUIRED, *OPTIONAL, *(EXPORTED if is_export else ()), *parameter_columns]
    if len(header) == 1:
        for separator, separator_text in (("\t", "tabs"), ("|", '"|"')):
            if separator in header[0]:
                raise FoldcarError(
                    f"{file}: its columns are separated by {separator_text}; separate them by commas or semicolons"
                )
    for name in header:
        if name not in known_columns and key_of(name) is None:
            hint = did_you_mean(name.lower(), known_columns)
            if is_export:
                hint = "; parameters of your own modules need --components FILE"
            raise FoldcarError(f'{file}: unknown column "{name}"; known: {", ".join(known_columns)}{hint}')
        if header.count(name) > 1:
            raise FoldcarError(f'{file}: column "{name}" occurs twice')
    for name in REQUIRED:
        if name not in header:
            raise FoldcarError(f'{file}: has no column "{name}"')


def _trial(
    place: str,
    row: Mapping[str, str],
    experiment: str | None,
    swept: Mapping[str, ExperimentInfo],
    defaults: dict[str, float],
) -> tuple[dict[str, Any], int]:
    """Return the trial of a row, without its UUID, and the number of equal trials in the row."""
    is_export = "uuid" in row
    for name in REQUIRED:
        # A trial that foldcar drove has no source.
        if name not in row and not (is_export and name == "source"):
            raise FoldcarError(f"{place}: {name}: is empty")
    # Spreadsheets capitalise what is typed into a cell.
    outcome = "_".join(row["outcome"].lower().replace("-", " ").split())
    car = row.get("car", BUILT).lower()
    if outcome not in TRIAL_OUTCOMES:
        close = did_you_mean(outcome, TRIAL_OUTCOMES)
        raise FoldcarError(f'{place}: outcome: "{row["outcome"]}" is not one of {", ".join(TRIAL_OUTCOMES)}{close}')
    if car not in CARS:
        raise FoldcarError(f'{place}: car: "{row["car"]}" is not one of {", ".join(CARS)}')
    experiment_id = row.get("experiment", experiment)
    if experiment_id is None:
        raise FoldcarError(f"{place}: experiment: is empty; fill it or use --experiment ID")
    if breaks_line(experiment_id):
        shown_id = shown_line(experiment_id)
        raise FoldcarError(f'{place}: experiment: "{shown_id}" has line breaks')
    # An exported trial has just the parameters that it has, and so no defaults to announce.
    design = _design(place, row, experiment_id, swept.get(experiment_id), {} if is_export else defaults)
    trial: dict[str, Any] = {
        "experiment": experiment_id,
        "vehicle_type": design.type,
        "design": design.columns,
        "outcome": outcome,
        "source": row.get("source"),
        "car": car,
        **{name: row[name] for name in ("note", "operator", "started_utc") if name in row},
    }
    if "car_name" in row:
        trial["car_name"] = checked_name(row["car_name"], f"{place}: car_name")
    if "sample" in row:
        trial["sample"] = _number(place, row, "sample", whole_number, maximum=MAX_ID)
    if "elapsed_time_s" in row:
        trial["elapsed_time_s"] = time_s = _number(place, row, "elapsed_time_s", decimal_number, maximum=LONGEST_S)
        info = swept.get(experiment_id)
        # foldcar drove an exported trial without a source, maybe under another limit: its comparison says so.
        is_driven = is_export and "source" not in row
        if info and not is_driven and outcome == "passed" and time_s > info.timeout_s + LIMIT_OVERRUN_S:
            raise FoldcarError(
                f"{place}: elapsed_time_s: {time_s:g} is above the time limit of {info.timeout_s:g} s, so the trial has "
                "not passed"
            )
    if "started_utc" in row:
        trial["started_utc"] = _time_utc(place, row["started_utc"])
    if is_export:
        exported = {name: value for name, value in design.columns.items() if name in row}
        trial |= {**exported_facts(place, row), "design": exported}
        require_corrected(place, trial)
    count = _number(place, row, "count", whole_number, minimum=1, maximum=MAX_COUNT) if "count" in row else 1
    return trial, int(count)


def _design(
    place: str, row: Mapping[str, str], experiment_id: str, swept: ExperimentInfo | None, defaults: dict[str, float]
) -> Design:
    """Return the design of the car in a row of the table.

    ``swept`` is the experiment as it was swept, or None. A parameter that the row lacks has the value of the sweep, if
    that is the same for all of its cars. Otherwise it has foldcar's default value, and is added to ``defaults``.
    """
    given_values = {name: _number(place, row, name, decimal_number) for name in row if key_of(name)}
    if swept is not None and row["vehicle_type"] == swept.vehicle_type:
        missing_columns = [name for name in swept.varied if name not in given_values]
        if missing_columns:
            reason = f'experiment "{experiment_id}" has several values'
            raise FoldcarError(f"{place}: {', '.join(missing_columns)}: missing; {reason}")
        given_values = {**swept.fixed, **given_values}
    # The sweep may have parameters of modules that are not loaded now.
    known_values = {name: value for name, value in given_values.items() if key_of(name)}
    try:
        design = compose_columns(row["vehicle_type"], known_values)
    except DesignError as error:
        raise FoldcarError(f"{place}: {error}") from error
    if not given_values:
        raise FoldcarError(f"{place}: has no parameters of the car; give some of {', '.join(design.columns)}")
    for name, value in design.columns.items():
        if name not in given_values:
            defaults[name] = value
    return design


def _number(
    place: str,
    row: Mapping[str, str],
    name: str,
    parse: Callable[[str], float],
    minimum: int = 0,
    maximum: float = math.inf,
) -> float:
    """Return a cell of a row as a number.

    ``parse`` is decimal_number or whole_number. Raises FoldcarError if the cell is not such a number, or is outside its
    limits.
    """
    try:
        value = parse(row[name])
    except ValueError:
        kind_text = "whole " if parse is whole_number else ""
        raise FoldcarError(f'{place}: {name}: "{row[name]}" is not a {kind_text}number') from None
    # NaN is the only number that differs from itself. math.isfinite cannot be used, because it fails for very large whole
    # numbers.
    is_nan = value != value
    if abs(value) == math.inf or is_nan:
        raise FoldcarError(f"{place}: {name}: {row[name]} is not finite")
    if value > maximum:
        raise FoldcarError(f"{place}: {name}: {row[name]} is above the maximum {maximum}")
    if value < minimum:
        raise FoldcarError(f"{place}: {name}: {row[name]} is below the minimum {minimum}")
    # Adding 0 turns -0.0 into 0.0.
    return value + 0


def _time_utc(place: str, text: str) -> str:
    """Return the date, or date and time, as written; a time with a time zone is converted to UTC."""
    try:
        # Python 3.10 cannot parse the Z that stands for UTC.
        time = datetime.fromisoformat(text.removesuffix("Z"))
        if not time.utcoffset():
            # There is no time zone, or it is UTC.
            return text
        return time.astimezone(timezone.utc).isoformat()
    except (ValueError, OverflowError):
        raise FoldcarError(
            f'{place}: started_utc: "{text}" is not a date, or date and time, such as 2026-05-01T09:30:00'
        ) from None


def swept_experiments(store: Path) -> dict[str, ExperimentInfo]:
    """Return a store's experiments, each by its name in the listing and by its name in the store.

    Returns {} if there is no store or no study in it.
    """
    if not store.exists():
        return {}
    with Store.open(store) as opened_store:
        if not opened_store.holds_study():
            return {}
        infos = opened_store.info().experiments.values()
    by_listed_name = {info.listed_id: info for info in infos}
    by_stored_name = {info.id: info for info in infos}
    return by_listed_name | by_stored_name


def import_notes(store: Path, trials: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a remark on each experiment, sample and car of the trials that was not swept in the store's study."""
    swept = swept_experiments(store)
    trials_by_experiment: dict[str, list[Mapping[str, Any]]] = {}
    for trial in trials:
        trials_by_experiment.setdefault(trial["experiment"], []).append(trial)
    notes: list[str] = []
    for name, trials_of_experiment in trials_by_experiment.items():
        samples = {trial["sample"] for trial in trials_of_experiment if "sample" in trial}
        if name in swept:
            notes += _notes_on_cars(store, name, swept[name], trials_of_experiment)
            number_of_samples = swept[name].environments
            for sample in sorted(samples):
                if sample >= number_of_samples:
                    last = number_of_samples - 1
                    notes.append(f'experiment "{name}" was swept in samples 0 to {last}; sample {sample} has no runs')
            continue
        if swept:
            notes.append(f'experiment "{name}" was not swept in {store}, only {", ".join(swept)}')
        if samples:
            notes.append(
                f'experiment "{name}" was not swept yet, so its samples are not paired with runs; to pair them, '
                "sweep first and then import"
            )
    return notes


def _notes_on_cars(store: Path, name: str, swept: ExperimentInfo, trials: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a remark on each car of the trials that the experiment was not swept with, at most SHOWN_CARS of them."""
    with Store.open(store) as opened_store:
        swept_designs = {frozenset(design.items()) for design in opened_store.designs(swept.id).values()}
    unswept_trial_counts: Counter[str] = Counter()
    for trial in trials:
        has_swept_type = trial["vehicle_type"] == swept.vehicle_type
        if not has_swept_type or frozenset(trial["design"].items()) not in swept_designs:
            unswept_trial_counts[design_label(swept, trial["vehicle_type"], trial["design"])] += 1
    for car, trial_count in unswept_trial_counts.most_common(SHOWN_CARS):
        yield f'experiment "{name}" was swept without a car of {car}; it has {count(trial_count, "trial")}'
