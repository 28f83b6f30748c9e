"""A digest of a store's runs: the same for the same keys with the same results, however and whenever they came about.

Input: a store. Output: the sum, modulo 2^256, of the SHA-256 of every run as a JSON array: the build's name, the hashes
of body, scene, settings and variation, the outcome, the metrics by name, the message, what was recorded. So neither the
order of rows nor their numbers in the file count, nor listings, experiments and trials.
"""

import hashlib
import itertools
import json
from collections.abc import Iterator
from typing import Any

from foldcar.simulation.results import NUMBERS
from foldcar.store.reader import Store
from foldcar.store.rows import Row
from foldcar.store.tables import BY_NAME, RECORDED, RUN

BITS = 256


def store_digest(store: Store) -> tuple[str, int]:
    """The digest in hexadecimal digits, and how many runs it is of. StoreError."""
    names = {
        column: {row["id"]: row[name] for row in store.rows(BY_NAME[column.removesuffix("_id")])}
        for column, name in zip(RUN.key, ("name", "hash", "hash", "hash", "hash"), strict=True)
    }
    total = runs = 0
    for row, recorded in _with_recorded(store):
        key = [names[column].get(row[column], row[column]) for column in RUN.key]
        result = [row["outcome"], {name: row[name] for name in NUMBERS}, row["message"], recorded]
        text = json.dumps([key, result], sort_keys=True, separators=(",", ":"))
        total += int.from_bytes(hashlib.sha256(text.encode()).digest(), "big")
        runs += 1
    return f"{total % (1 << BITS):0{BITS // 4}x}", runs


def _with_recorded(store: Store) -> Iterator[tuple[Row, list[Any]]]:
    """Every run with what was recorded in it, as [name, kind, JSON text] in the order of names."""
    order = f"ORDER BY {', '.join(RUN.order)}"
    groups = itertools.groupby(
        store.rows(RECORDED, f"{order}, name"), lambda row: tuple(row[column] for column in RUN.key)
    )
    key, group = next(groups, (None, iter(())))
    for row in store.rows(RUN, order):
        if key == tuple(row[column] for column in RUN.key):
            yield row, [[one["name"], one["kind"], one["value"]] for one in group]
            key, group = next(groups, (None, iter(())))
        else:
            yield row, []
