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

    ``parameters``, ``positions``, ``bodies`` and ``settings`` are lists with one entry for each design, in the
    experiment's order; the last two are ids. ``scenes`` and ``variations`` map samples, in ascending order, to ids. A
    variation is how the built cars of a sample differ from their designs. ``dynamic`` is whether the Scenic program runs
    beside the simulation, None if that is unknown.
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
        """Return the JSON object that :meth:`text` returns as a text."""
        result: dict[str, Any] = json.loads(self.text(table, row_id))
        return result

    @cached_property
    def varied(self) -> bool:
        """Whether any car differs from its design."""
        # The variation of a car that does not differ from its design is {}.
        return any(self.value("variation", variation_id) for variation_id in set(self.variations.values()))


def read_drives(store: Store, experiment: str) -> StoredDrives:
    """Return the inputs of the runs of ``experiment``, read once from an open store. Raises StoreError."""
    return store.once(("drives", experiment), lambda: _read_drives(store, experiment))


def _read_drives(store: Store, experiment: str) -> StoredDrives:
    """Read the inputs of the runs of ``experiment`` from the tables: of its designs and of its samples.

    A run simulates one design in one sample. The sample has a scene, and a variation: how the built car differs from its
    design.
    """
    row = store.row(EXPERIMENT, id=experiment)
    designs = list(store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
    environment = store.row(BY_NAME["environment"], id=row["environment_id"])
    # None: no sweep has determined yet whether the program runs beside the simulation.
    dynamic = None if environment["dynamic"] is None else bool(environment["dynamic"])
    samples = store.rows(
        BY_NAME["sample"],
        "WHERE environment_id = ? AND sample < ? ORDER BY sample",
        row["environment_id"],
        row["environments"],
    )
    draws = store.rows(BY_NAME["draw"], "WHERE spread_id = ?", row["spread_id"])
    return StoredDrives(
        store=store,
        experiment=experiment,
        parameters=[json.loads(design["parameters"]) for design in designs],
        positions=[design["position"] for design in designs],
        bodies=[design["body_id"] for design in designs],
        settings=[design["settings_id"] for design in designs],
        scenes={sample["sample"]: sample["scene_id"] for sample in samples},
        variations={draw["sample"]: draw["variation_id"] for draw in draws},
        dynamic=dynamic,
    )
