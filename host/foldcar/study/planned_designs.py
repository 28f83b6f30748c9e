"""The designs of an experiment with the simulator's input. They are not folded again if the store holds them.

Input: an experiment, a store. Output: planned designs. Folding a car takes about 10 ms. For thousands of designs that is
longer than finding out that no run is missing.
"""

import hashlib
import json
import zlib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

from foldcar.car.body import TableRow, body_json
from foldcar.car.design import Design
from foldcar.car.user_modules import components_digest
from foldcar.scenes.fingerprint import code_digest
from foldcar.store.designs import StoredDesigns, stored_designs
from foldcar.store.writer import PlannedDesign
from foldcar.study.experiments import Experiment, ListedStudy

PACKAGE = Path(__file__).resolve().parents[1]
# Code and data on which designs depend.
CODE = (PACKAGE / "car", PACKAGE / "study")


class PlannedDesigns:
    """The designs of an experiment in the family's order; ``fingerprint`` is a hash of everything they depend on."""

    def __init__(self, experiment: Experiment, table: Mapping[str, TableRow], stored: StoredDesigns | None) -> None:
        """Fold every design, unless the same designs are stored, as equal fingerprints say. Raises FoldcarError."""
        self._experiment, self._table = experiment, table
        self.fingerprint = designs_fingerprint(experiment, table)
        if stored is not None and stored.fingerprint == self.fingerprint:
            experiment.family.mark_buildable(stored.parameters)
            # None means that no design is folded yet. This is done when the designs are iterated over.
            self._texts: list[bytes] | None = None
        else:
            self._texts = []
            for design in self._folded():
                text = json.dumps([design.columns, design.body, design.settings])
                # Compressed to a fifth of their size, because they stay in memory until the store is opened.
                self._texts.append(zlib.compress(text.encode(), level=1))

    def __iter__(self) -> Iterator[PlannedDesign]:
        if self._texts is None:
            yield from self._folded()
        else:
            for text in self._texts:
                yield PlannedDesign(*json.loads(zlib.decompress(text)))

    def __len__(self) -> int:
        return len(self._experiment.family)

    def _folded(self) -> Iterator[PlannedDesign]:
        """Yield the designs of the family, each folded now."""
        for design in self._experiment.family:
            yield planned_design(self._experiment, design, self._table)


def planned_designs(study: ListedStudy, store: Path, table: Mapping[str, TableRow]) -> dict[str, PlannedDesigns]:
    """Return the checked designs of every experiment by its id. Raises FoldcarError."""
    stored_by_id = stored_designs(store, [experiment.id for experiment in study.experiments])
    designs_by_id = {}
    for experiment in study.experiments:
        designs_by_id[experiment.id] = PlannedDesigns(experiment, table, stored_by_id.get(experiment.id))
    return designs_by_id


def planned_design(experiment: Experiment, design: Design, table: Mapping[str, TableRow]) -> PlannedDesign:
    """Return a design with its input for the simulator. Raises FoldcarError."""
    body = body_json(design)
    return PlannedDesign(design.columns, body, experiment.settings(design, body, table))


def designs_fingerprint(experiment: Experiment, table: Mapping[str, TableRow]) -> str:
    """Return a hash of everything that the designs and their settings depend on.

    These are the family, the experiment's settings, the firmware's parameters, code, and the user's modules.
    """
    family = experiment.family
    # The order is part of the hash.
    inputs = [
        family.type,
        repr(family.parts),
        dict(family.choices),
        family.members,
        experiment.timeout_s,
        experiment.speed_m_s,
        experiment.yaw_rate_rad_s,
        repr(sorted(table.items())),
        version("numpy"),
        _code_digest(),
        components_digest(),
    ]
    return hashlib.sha256(json.dumps(inputs).encode()).hexdigest()


@cache
def _code_digest() -> str:
    """Return a hash of the code and data on which designs depend."""
    return code_digest(CODE)
