"""Numbers as the page reads them: arrays in base64, and an experiment's runs one by one."""

import base64
from typing import Any

import numpy
from numpy.typing import ArrayLike

from foldcar.report.page_designs import Designs
from foldcar.simulation.results import NUMBERS


def packed(values: ArrayLike, kind: str) -> dict[str, str]:
    """An array of numpy's type ``kind`` as the page reads it."""
    found = numpy.ascontiguousarray(values, dtype=numpy.dtype(kind).newbyteorder("<"))
    return {"type": kind, "data": base64.b64encode(found.tobytes()).decode("ascii")}


def least_kind(values: numpy.typing.NDArray[Any]) -> str:
    """The smallest of the page's unsigned types, of two bytes at least, that holds whole numbers from 0."""
    return "uint16" if not len(values) or values.max() < 1 << 16 else "uint32"


def packed_runs(designs: Designs) -> dict[str, Any]:
    """The runs in the order of design and environment, with their outcomes and times (s)."""
    runs = designs.runs
    return {
        "n": len(runs.design),
        "design": packed(runs.design, least_kind(runs.design)),
        "environment": packed(runs.sample, least_kind(runs.sample)),
        "outcome": packed(runs.outcome, "uint8"),
        "time_s": packed(runs.metrics[:, NUMBERS.index("elapsed_time_s")], "float32"),
    }
