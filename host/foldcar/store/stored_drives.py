"""The stored inputs of an experiment's runs: ids of texts by design and by sample.

Input: a store. Output: ids, and the texts of docs/carsim.md to which they refer.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME, DESIGN, EXPERIMENT


@dataclass(frozen=True)
class StoredDrives:
    """The inputs of an experiment's runs, as ids of the store's texts.

    ``bodies`` and ``settings`` are lists by design, like ``parameters`` and ``positions``; ``scenes`` and ``variations``
    map samples, in ascending order, to ids. ``dynamic`` is whether the program runs beside the simulation, None if that
    is unknown.
    """

    store: Store
    experiment: str
    parameters: list[dict[str, Any]]
    positions: list[int]
    bodies: list[int]
    settings: list[int]
    scenes: dict[int, int]
    variations: dict[int, int]
    dynamic: bool | None

    def text(self, table: str, row_id: int) -> str:
        """Return the JSON text of a row of ``body``, ``scene``, ``settings`` or ``variation``. Raises StoreError."""
        return str(self.store.row(BY_NAME[table], id=row_id)["json"])

    def value(self, table: str, row_id: int) -> dict[str, Any]:
        """Return the parsed JSON object of a text."""
        result: dict[str, Any] = json.loads(self.text(table, row_id))
        return result

    @cached_property
    def varied(self) -> bool:
        """Whether any car differs from its design."""
        return any(self.value("variation", variation) for variation in set(self.variations.values()))


def read_drives(store: Store, experiment: str) -> StoredDrives:
    """Return the inputs of the runs of ``experiment``, read once from an open store. Raises StoreError."""
    return store.once(("drives", experiment), lambda: _read(store, experiment))


def _read(store: Store, experiment: str) -> StoredDrives:
    row = store.row(EXPERIMENT, id=experiment)
    designs = list(store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
    dynamic = store.row(BY_NAME["environment"], id=row["environment_id"])["dynamic"]
    sampled = "WHERE environment_id = ? AND sample < ? ORDER BY sample"
    samples = store.rows(BY_NAME["sample"], sampled, row["environment_id"], row["environments"])
    draws = store.rows(BY_NAME["draw"], "WHERE spread_id = ?", row["spread_id"])
    return StoredDrives(
        store,
        experiment,
        [json.loads(design["parameters"]) for design in designs],
        [design["position"] for design in designs],
        [design["body_id"] for design in designs],
        [design["settings_id"] for design in designs],
        {sample["sample"]: sample["scene_id"] for sample in samples},
        {draw["sample"]: draw["variation_id"] for draw in draws},
        # None: no sweep has determined yet whether the program runs beside the simulation.
        None if dynamic is None else bool(dynamic),
    )
