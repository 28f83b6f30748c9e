"""Reads trials from a CSV file: one row for each trial, or one for ``count`` equal trials.

Input: a file with the columns ``outcome``, ``source`` and ``vehicle_type``, and optionally ``experiment``, ``sample``,
``count``, ``car`` (built or simulated; built if it does not say), ``car_name``, ``elapsed_time_s``, ``note``,
``operator``, ``started_utc`` and parameters of the design (``width_mm``, …). Those that are left out are those of the
experiment, if it was swept, which must not vary them; else foldcar's defaults, but never all of them.
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
from foldcar.statistics.words import count, design_text
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, CARS, LONGEST_S, MAX_ID, TRIAL_OUTCOMES, checked_name
from foldcar.typed import decimal_number, did_you_mean, read_text, whole_number

NEEDED = ("vehicle_type", "outcome", "source")
OPTIONAL = ("experiment", "count", "car", "car_name", "sample", "elapsed_time_s", "note", "operator", "started_utc")
MAX_COUNT = 100_000
# The namespace of imported trials' UUIDs.
IMPORTS = uuid.UUID("4685ff4d-fc48-5e4d-ac46-0c50b74c77a7")
# Cars that are named, those with the most trials.
SHOWN = 5
NOTHING: Mapping[str, ExperimentInfo] = {}


def read_trials(
    file: Path,
    experiment: str | None,
    swept: Mapping[str, ExperimentInfo] = NOTHING,
    announce: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """The trials in ``file``; ``experiment`` is that of rows without one, ``swept`` are those of the store.

    ``announce`` is told which defaults were taken. FoldcarError naming line and column.
    """
    text = read_text(file)
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
    rows: Counter[str] = Counter()
    # A number with a decimal comma, and one that has a decimal point or is grouped by thousands, as 1.095.
    marks: dict[str, str] = {}
    for number, cells in lines:
        if len(cells) < len(header) or any(cells[len(header) :]):
            raise FoldcarError(f"{file}: line {number}: has {len(cells)} cells, the header {len(header)}")
        row = {name: cell for name, cell in zip(header, cells, strict=False) if cell}
        if separator == ";":
            for name in decimals & row.keys():
                mark = "," if "," in row[name] else "." if re.fullmatch(r"\d{1,3}(\.\d{3})+", row[name]) else ""
                marks |= {mark: f'"{row[name]}" in line {number}'} if mark else {}
                row[name] = row[name].replace(",", ".")
            if len(marks) > 1:
                shown = " beside ".join(marks.values())
                raise FoldcarError(f"{file}: {shown}: write numbers with decimal commas and without points")
        trial, copies = _trial(f"{file}: line {number}", row, experiment, swept, defaults)
        source = trial["source"]
        rows[source] += 1
        # What identifies an imported trial: its source, the row among those of the source, which of equal trials it is.
        places = (f"{source}\n{rows[source]}\n{index}" for index in range(1, copies + 1))
        trials += [{"uuid": str(uuid.uuid5(IMPORTS, place)), **trial} for place in places]
    if not trials:
        raise FoldcarError(f"{file}: contains no trials")
    if defaults:
        announce(f"{file}: does not tell all of its cars; taken by default: {design_text(defaults)}")
    return trials


def _rows(file: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield each row that is not empty: the number of its first line, and its cells. Raises FoldcarError."""
    reader = csv.reader(io.StringIO(text), delimiter=separator, strict=True)
    number = 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                yield number, stripped
            number = reader.line_num + 1
    except csv.Error as error:
        raise FoldcarError(f"{file}: line {number}: {error}") from None


def _check_header(file: Path, header: list[str]) -> None:
    design = [parameter.column for parameter in parameters().values()]
    known = [*NEEDED, *OPTIONAL, *design]
    if len(header) == 1 and (separator := next((sign for sign in "\t|" if sign in header[0]), None)):
        shown = "tabs" if separator == "\t" else f'"{separator}"'
        raise FoldcarError(f"{file}: its columns are separated by {shown}; separate them by commas or semicolons")
    for name in header:
        if name not in known and key_of(name) is None:
            close = did_you_mean(name.lower(), known)
            raise FoldcarError(f'{file}: unknown column "{name}"; known: {", ".join(known)}{close}')
        if header.count(name) > 1:
            raise FoldcarError(f'{file}: column "{name}" occurs twice')
    for name in NEEDED:
        if name not in header:
            raise FoldcarError(f'{file}: has no column "{name}"')


def _trial(
    place: str,
    row: Mapping[str, str],
    experiment: str | None,
    swept: Mapping[str, ExperimentInfo],
    defaults: dict[str, float],
) -> tuple[dict[str, Any], int]:
    """The trial of a row, without its UUID, and how many equal ones the row stands for."""
    for name in NEEDED:
        if name not in row:
            raise FoldcarError(f"{place}: {name}: is empty")
    # Spreadsheets capitalise what is typed into a cell.
    outcome = "_".join(row["outcome"].lower().replace("-", " ").split())
    car = row.get("car", BUILT).lower()
    if outcome not in TRIAL_OUTCOMES:
        close = did_you_mean(outcome, TRIAL_OUTCOMES)
        raise FoldcarError(f'{place}: outcome: "{row["outcome"]}" is not one of {", ".join(TRIAL_OUTCOMES)}{close}')
    if car not in CARS:
        raise FoldcarError(f'{place}: car: "{row["car"]}" is not one of {", ".join(CARS)}')
    named = row.get("experiment", experiment)
    if named is None:
        raise FoldcarError(f"{place}: experiment: is empty; fill it or use --experiment ID")
    design = _design(place, row, named, swept.get(named), defaults)
    trial: dict[str, Any] = {
        "experiment": named,
        "vehicle_type": design.type,
        "design": design.columns,
        "outcome": outcome,
        "source": row["source"],
        "car": car,
        **{name: row[name] for name in ("note", "operator", "started_utc") if name in row},
    }
    if "car_name" in row:
        trial["car_name"] = checked_name(row["car_name"], f"{place}: car_name")
    if "sample" in row:
        trial["sample"] = _number(place, row, "sample", whole_number, most=MAX_ID)
    if "elapsed_time_s" in row:
        trial["elapsed_time_s"] = _number(place, row, "elapsed_time_s", decimal_number, most=LONGEST_S)
    if "started_utc" in row:
        trial["started_utc"] = _time_utc(place, row["started_utc"])
    count = _number(place, row, "count", whole_number, least=1, most=MAX_COUNT) if "count" in row else 1
    return trial, int(count)


def _design(
    place: str, row: Mapping[str, str], named: str, swept: ExperimentInfo | None, defaults: dict[str, float]
) -> Design:
    """The car of a row; ``defaults`` gets what nobody has told of it."""
    told = {name: _number(place, row, name, decimal_number) for name in row if key_of(name)}
    of_family = swept is not None and row["vehicle_type"] == swept.vehicle_type
    if swept is not None and of_family:
        missing = [name for name in swept.varied if name not in told]
        if missing:
            raise FoldcarError(f'{place}: {", ".join(missing)}: is not given; experiment "{named}" has several values')
        told = {**swept.fixed, **told}
    try:
        design = compose_columns(row["vehicle_type"], {name: value for name, value in told.items() if key_of(name)})
    except DesignError as error:
        raise FoldcarError(f"{place}: {error}") from error
    if not told:
        raise FoldcarError(f"{place}: does not tell the car: give its parameters, as {', '.join(design.columns)}")
    defaults.update({name: value for name, value in design.columns.items() if name not in told})
    return design


def _number(
    place: str, row: Mapping[str, str], name: str, kind: Callable[[str], float], least: int = 0, most: float = math.inf
) -> float:
    try:
        value = kind(row[name])
    except ValueError:
        whole = "whole " if kind is whole_number else ""
        raise FoldcarError(f'{place}: {name}: "{row[name]}" is not a {whole}number') from None
    if not least <= value <= most or value == math.inf:
        limit = f"above the maximum {most}" if value > most else f"below the minimum {least} or not finite"
        raise FoldcarError(f"{place}: {name}: {row[name]} is {limit}")
    return value


def _time_utc(place: str, text: str) -> str:
    """The date, or date and time, as written; a time of another zone in UTC."""
    try:
        # Python 3.10 does not read the Z.
        time = datetime.fromisoformat(text.removesuffix("Z"))
        return text if not time.utcoffset() else time.astimezone(timezone.utc).isoformat()
    except (ValueError, OverflowError):
        raise FoldcarError(
            f'{place}: started_utc: "{text}" is not a date, or date and time, such as 2026-05-01T09:30:00'
        ) from None


def swept_experiments(store: Path) -> dict[str, ExperimentInfo]:
    """The experiments of a store by their names in the listing; none if it holds no study, or is not there yet."""
    if not store.exists():
        return {}
    with Store.open(store) as opened:
        if not opened.holds_study():
            return {}
        infos = opened.info().experiments.values()
    return {**{info.listed_id: info for info in infos}, **{info.id: info for info in infos}}


def import_notes(store: Path, trials: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sentence for each experiment, sample and car that the store's study has not."""
    swept = swept_experiments(store)
    notes = []
    for name in dict.fromkeys(trial["experiment"] for trial in trials):
        mine = [trial for trial in trials if trial["experiment"] == name]
        samples = {trial["sample"] for trial in mine if "sample" in trial}
        if name not in swept:
            if swept:
                notes.append(f'experiment "{name}" was not swept in {store}, only {", ".join(swept)}')
            if samples:
                notes.append(
                    f'experiment "{name}" was not swept yet: no run is ever paired with its samples; to pair them, sweep '
                    "first and import then"
                )
            continue
        info = swept[name]
        with Store.open(store) as opened:
            known = {frozenset(design.items()) for design in opened.designs(info.id).values()}
        strange: Counter[str] = Counter()
        for trial in mine:
            told = {key: value for key, value in trial["design"].items() if info.fixed.get(key) != value}
            is_there = trial["vehicle_type"] == info.vehicle_type and frozenset(trial["design"].items()) in known
            strange[design_text(told) or trial["vehicle_type"]] += not is_there
        for car, number in (+strange).most_common(SHOWN):
            notes.append(f'experiment "{name}" was swept without a car of {car}; it has {count(number, "trial")}')
        for sample in sorted(sample for sample in samples if sample >= info.environments):
            last = info.environments - 1
            notes.append(f'experiment "{name}" was swept in samples 0 to {last}; sample {sample} has no runs')
    return notes
