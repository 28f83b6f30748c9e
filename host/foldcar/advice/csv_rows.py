"""Rows of different columns as one CSV file."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.atomic_file import atomic_file


def write_csv(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write the rows under all their names, in order of appearance, atomically. FoldcarError."""
    columns = list(dict.fromkeys(name for row in rows for name in row)) or ["experiment"]
    with atomic_file(file) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        text.detach()
