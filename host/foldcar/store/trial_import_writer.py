"""Writes imported trials to the results store: from tables of any origin, and from tables that foldcar has exported.

Input: rows of the table of trials. Output: new trials, and new corrections of stored trials, in one transaction.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from foldcar.store.errors import StoreError
from foldcar.store.info import listed_id
from foldcar.store.rows import Row
from foldcar.store.store_connection import StoreConnection
from foldcar.store.tables import CORRECTION, EXPERIMENT, TRIAL


class _Origin(NamedTuple):
    """Where trials of an experiment come from, if that is known: the id of the environment, and its Scenic program."""

    environment_id: int | None
    program: str | None


class TrialImportWriter(StoreConnection):
    """A store opened for importing trials. All methods raise StoreError."""

    def import_trials(self, trials: list[dict[str, Any]]) -> list[int]:
        """Store the imported trials that are not stored yet. Return the numbers of the new trials.

        Each of ``trials`` is a row of the table of trials, with its ``uuid``. A trial that another store has exported
        also has ``environment_fingerprint``, ``settings`` (JSON) and ``corrections`` (rows of that table, oldest first).
        The other fields of such a trial have the values to which they were corrected. If the trial is stored already,
        only the corrections that the stored trial lacks are added. Raises StoreError if a trial is stored with other
        contents; then nothing is stored.
        """
        new_numbers = []
        with self._transaction():
            # The environment and the Scenic program of each experiment that the new trials name.
            origins: dict[str, _Origin] = {}
            for imported in trials:
                trial = dict(imported)
                corrections: list[Row] = trial.pop("corrections", [])
                self._replace_inputs_by_ids(trial)
                stored_trials = self.rows(TRIAL, "WHERE uuid = ?", trial["uuid"])
                if stored_trials:
                    (stored_trial,) = stored_trials
                    self._require_same(_uncorrected(trial, corrections), stored_trial)
                    self._add_corrections(stored_trial, corrections)
                else:
                    experiment = trial["experiment"]
                    if experiment not in origins:
                        origins[experiment] = self._origin(experiment)
                    new_numbers.append(self._add_imported(trial, corrections, origins[experiment]))
        return new_numbers

    def _replace_inputs_by_ids(self, trial: dict[str, Any]) -> None:
        """Store the environment and the settings of an imported trial, if it has them, and replace them by their ids."""
        fingerprint = trial.pop("environment_fingerprint", None)
        if fingerprint is not None:
            trial["environment_id"] = self._identify("environment", "fingerprint", fingerprint)
        settings = trial.pop("settings", None)
        if settings is not None:
            trial["settings_id"] = self._put_text("settings", settings)

    def _add_imported(self, trial: Mapping[str, Any], corrections: Iterable[Row], origin: _Origin) -> int:
        """Store an imported trial with its corrections, and return its number.

        ``origin`` has the environment and the program of the trial's experiment. A trial that names no environment or no
        program gets these. A trial without a sample was driven in an unknown scene, so it gets no environment.
        """
        defaults = {
            "deviations": "{}",
            "ending": "imported",
            "note": "",
            "operator": "",
            "withdrawn": 0,
            "environment_id": origin.environment_id if trial.get("sample") is not None else None,
            "scenic_program": origin.program,
        }
        row = {**defaults, **trial, "design": json.dumps(trial["design"])}
        number = self._add(TRIAL, row)
        for correction in corrections:
            self._add(CORRECTION, {**correction, "trial_id": number})
        return number

    def _add_corrections(self, trial: Row, corrections: Iterable[Row]) -> None:
        """Add the corrections that a stored trial lacks, and change its fields accordingly.

        If a field was corrected several times, it gets the value of the latest correction.
        """
        stored_corrections = self.rows(CORRECTION, "WHERE trial_id = ? ORDER BY id", trial["id"])
        for correction in corrections:
            row = {**correction, "trial_id": trial["id"]}
            # Stored corrections have numbers in addition.
            if any({**row, "id": stored["id"]} == stored for stored in stored_corrections):
                continue
            is_latest = True
            for stored in stored_corrections:
                if stored["field"] == row["field"] and stored["corrected_utc"] > row["corrected_utc"]:
                    is_latest = False
            if is_latest:
                trial[row["field"]] = row["after"]
            self._add(CORRECTION, row)
        self._update(TRIAL, trial)

    def _require_same(self, trial: Mapping[str, Any], stored: Row) -> None:
        """Raise StoreError if an imported trial differs from the stored trial with the same UUID.

        Both are compared as they were before any correction. ``trial`` has its uncorrected values.
        ``stored`` has corrected ones, so its corrections are undone first.
        """
        corrections = self.rows(CORRECTION, "WHERE trial_id = ? ORDER BY id", stored["id"])
        earlier_trial = _uncorrected(stored, corrections)
        earlier_trial["design"] = json.loads(earlier_trial["design"])
        for name in ("experiment", "vehicle_type", "design", "sample", "outcome"):
            value, earlier_value = trial.get(name), earlier_trial[name]
            if value == earlier_value:
                continue
            source = f'row of "{trial["source"]}"' if trial.get("source") else "trial of another store"
            origin = f"trial {stored['id']} was imported from the same {source}"
            difference = f"{name} was {earlier_value}, not {value}"
            raise StoreError(f"{self.path}: {origin}, but {difference}: correct it, or give other rows another source")

    def _origin(self, experiment: str) -> _Origin:
        """Return the environment and the Scenic program of the runs of an experiment, which is named as in its listing.

        Both are None if the experiment was not swept, or was swept in several environments.
        """
        program_by_environment: dict[int, str | None] = {}
        for row in self.rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            # A sweep in a reality, such as another friction, has another environment than trials have.
            is_in_reality = facts.get("reality") is not None
            if is_in_reality:
                continue
            if listed_id(row["id"], reality=None, engine=facts.get("engine", "")) == experiment:
                program_by_environment[row["environment_id"]] = facts.get("scenic_program")
        if len(program_by_environment) != 1:
            return _Origin(environment_id=None, program=None)
        ((environment_id, program),) = program_by_environment.items()
        return _Origin(environment_id, program)


def _uncorrected(trial: Mapping[str, Any], corrections: Sequence[Row]) -> Row:
    """Return a trial as it was before its ``corrections``, which are ordered oldest first."""
    # The first correction of a field comes last, and so its value counts.
    earlier_values = {correction["field"]: correction["before"] for correction in reversed(corrections)}
    return {**trial, **earlier_values}
