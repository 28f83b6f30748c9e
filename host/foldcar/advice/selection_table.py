"""A selection as an object for JSON and as a CSV file; names end with their units, shares are 0 to 1."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from foldcar.advice.csv_rows import write_csv
from foldcar.advice.selecting import Recommendation, Selection


def selection_object(one: Selection) -> dict[str, Any]:
    """The selection as plain data; what is unknown is None."""
    plain = {
        name: getattr(one, name)
        for name in ("threshold", "precision", "enough", "loss", "sentence", "environments", "telling", "remarks")
    }
    designs = [{**asdict(design), "design": dict(design.design)} for design in one.recommendations]
    leader = None if one.leader is None else dict(one.leader)
    return {"experiment": one.info.id, **plain, "leader": leader, "recommendations": designs}


def write_selection(found: Sequence[Selection], file: Path) -> None:
    """Write a row for each recommended design as CSV, atomically. FoldcarError."""
    rows = [_row(one, rank, design) for one in found for rank, design in enumerate(one.recommendations, 1)]
    write_csv(rows, file)


def _row(one: Selection, rank: int, design: Recommendation) -> dict[str, Any]:
    row: dict[str, Any] = {"experiment": one.info.id, "rank": rank, **design.design, "place": design.place}
    row |= {"reason": design.reason, "built": design.built, "trials_done": design.trials_done, "trials": design.trials}
    for name, rate in (("simulated", design.simulated), ("expected", design.expected)):
        row |= {f"{name}{end}": None if rate is None else repr(getattr(rate, part)) for end, part in ENDS.items()}
    row |= {part: None if design.cost is None else getattr(design.cost, part) for part in ("sheets", "minutes")}
    return row | {"environments": " ".join(str(sample) for sample in one.environments[: design.trials])}


ENDS = {"": "value", "_low": "low", "_high": "high"}
