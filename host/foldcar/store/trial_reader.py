"""Reads the trials of a store, with their corrections, media, inputs and environments."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import fields

from foldcar.store.errors import StoreError
from foldcar.store.info import ExperimentInfo, is_same_program
from foldcar.store.rows import Row
from foldcar.store.snapshot import Snapshot
from foldcar.store.tables import BY_NAME, CORRECTION, ENVIRONMENT, EXPERIMENT, MEDIA, TRIAL
from foldcar.store.trial_records import Correction, Media, Trial, TrialDrive

TRIAL_FIELDS = tuple(field.name for field in fields(Trial))


class TrialReader(Snapshot):
    """The trials in a snapshot of a store. All methods raise StoreError."""

    def trials(self, experiment: str | None = None) -> Iterator[Trial]:
        """Yield all trials, also withdrawn and aborted ones, of all experiments or of one, in the order of numbers."""
        correction_counts = Counter(row["trial_id"] for row in self.rows(CORRECTION))
        # ?1 stands for ``experiment``. If this is None, the condition is true for all rows.
        for row in self.rows(TRIAL, "WHERE ?1 IS NULL OR experiment = ?1 ORDER BY id", experiment):
            values = {
                **row,
                "design": json.loads(row["design"]),
                "deviations": self._deviations(row),
                "withdrawn": bool(row["withdrawn"]),
                "corrections": correction_counts[row["id"]],
            }
            # The table has more columns than a Trial has fields.
            yield Trial(**{name: values[name] for name in TRIAL_FIELDS})

    def is_dynamic_trial(self, number: int) -> bool:
        """Return whether the Scenic program of a trial's environment runs during the simulation; False if unknown."""
        environment_id = self.row(TRIAL, id=number)["environment_id"]
        if environment_id is None:
            return False
        return bool(self.row(ENVIRONMENT, id=environment_id)["dynamic"])

    def trials_in_other_environments(self, info: ExperimentInfo) -> dict[int, str | None]:
        """Return which trials of an experiment were driven in another environment than its runs.

        The success rates of these trials cannot be compared with those of the runs. The result has the trial's Scenic
        program by the trial's number; the program is None if it is unknown.
        """
        ids_in_environment = self.trials_in_environment(info)
        programs_by_trial = {}
        for row in self.rows(TRIAL, "WHERE experiment = ?", info.listed_id):
            if row["id"] in ids_in_environment:
                continue
            program = row["scenic_program"]
            # The environment of an imported trial may be unknown. Then only its program can show that it is another one.
            has_known_environment = row["environment_id"] is not None
            if has_known_environment or not is_same_program(program, info.scenic_program):
                programs_by_trial[row["id"]] = program
        return programs_by_trial

    def trials_in_environment(self, info: ExperimentInfo) -> set[int]:
        """Return the numbers of the trials that were driven in the environment of the experiment's runs.

        The same sample of such a trial and of the runs is the same scene, so they can be compared in pairs. Environments
        are equal if their samples are equal scenes, even if the program's text or foldcar has changed.
        """
        return self.once(("trials in environment", info.id), lambda: self._find_trials_in_environment(info))

    def _find_trials_in_environment(self, info: ExperimentInfo) -> set[int]:
        """Return the ids of the trials that were driven in scenes of the experiment's samples.

        There are three such cases. First, the trial has the environment of the experiment. Second, it has another
        environment with the same scenes. Third, the trial's own scene is equal to the scene of its sample.
        """
        environment_id = self.listed_environment_id(info)
        trials = list(self.rows(TRIAL, "WHERE experiment = ? AND environment_id IS NOT NULL", info.listed_id))
        other_environment_ids = {trial["environment_id"] for trial in trials} - {environment_id}
        # The scenes take time to read, and are needed only for comparisons with other environments.
        scenes = self._sampled_scenes(environment_id) if other_environment_ids else {}
        equal_environment_ids = {environment_id}
        for other_environment_id in other_environment_ids:
            if _has_same_scenes(self._sampled_scenes(other_environment_id), scenes):
                equal_environment_ids.add(other_environment_id)
        trial_ids = set()
        for trial in trials:
            if trial["environment_id"] in equal_environment_ids or self._is_planned_scene(trial, scenes):
                trial_ids.add(trial["id"])
        return trial_ids

    def _is_planned_scene(self, trial: Row, scenes: Mapping[int, str]) -> bool:
        """Return whether a trial's scene, as placed, equals the scene of its sample in ``scenes``."""
        for row in self.rows(BY_NAME["scene"], "WHERE id = ?", trial["scene_id"]):
            return bool(row["json"] == scenes.get(trial["sample"]))
        return False

    def _sampled_scenes(self, environment_id: int) -> dict[int, str]:
        """Return the stored scenes of an environment as JSON texts, by sample."""
        query = "SELECT s.sample, c.json FROM sample s JOIN scene c ON c.id = s.scene_id WHERE s.environment_id = ?"
        return dict(self._rows(query, environment_id))

    def environments_of_trials(self) -> dict[int, str]:
        """Return the fingerprint of the environment of each trial that has one, by the trial's number."""
        query = "SELECT t.id, e.fingerprint FROM trial t JOIN environment e ON e.id = t.environment_id"
        return dict(self._rows(query))

    def settings_of_trials(self) -> dict[int, str]:
        """Return the settings (JSON) that each trial was driven with, by the trial's number; unknown ones are missing."""
        return dict(self._rows("SELECT t.id, s.json FROM trial t JOIN settings s ON s.id = t.settings_id"))

    def listed_environment_id(self, info: ExperimentInfo) -> int:
        """Return the id of the environment that an experiment has in its listing; 0 if it is not stored.

        Trials are driven in this environment. If the experiment was simulated with other parameters of the simulator,
        such as another friction, its runs have an environment of their own. ``info.reality`` has these parameters.
        """
        if info.reality is None:
            return int(self.row(EXPERIMENT, id=info.id)["environment_id"])
        stored_environments = list(self.rows(ENVIRONMENT, "WHERE fingerprint = ?", info.listed_environment))
        if not stored_environments:
            return 0
        return int(stored_environments[0]["id"])

    def trial(self, number: int) -> Trial:
        """Return the trial with that number. Raises StoreError if it does not exist."""
        for trial in self.trials():
            if trial.id == number:
                return trial
        raise StoreError(f"{self.path}: has no trial {number}")

    def _deviations(self, row: Row) -> dict[str, tuple[float, float, float]]:
        """Return how far the car and obstacles of a trial stood from their planned positions, by name.

        A deviation is (x in m, y in m, turn in rad).
        """
        return {name: (x, y, turn) for name, (x, y, turn) in json.loads(row["deviations"]).items()}

    def corrections(self, trial: int | None = None) -> list[Correction]:
        """Return the corrections of all trials or of one, ordered by trial, oldest first."""
        corrections = []
        for row in self.rows(CORRECTION, "WHERE ?1 IS NULL OR trial_id = ?1 ORDER BY trial_id, id", trial):
            del row["id"]
            corrections.append(Correction(trial=row.pop("trial_id"), **row))
        return corrections

    def media(self, trial: int | None = None) -> list[Media]:
        """Return photos and films of all trials or of one, by trial, in the order in which they were attached."""
        rows = self.rows(MEDIA, "WHERE ?1 IS NULL OR trial_id = ?1 ORDER BY trial_id, added_utc, file", trial)
        return [Media(trial=row["trial_id"], kind=row["kind"], file=row["file"], sha256=row["sha256"]) for row in rows]

    def trial_drive(self, number: int) -> TrialDrive | None:
        """Return a trial's body, settings and scene; None if there is no such trial, or one of them is unknown."""
        for trial in self.rows(TRIAL, "WHERE id = ?", number):
            texts = {}
            for name in ("body", "settings", "scene"):
                for row in self.rows(BY_NAME[name], "WHERE id = ?", trial[f"{name}_id"]):
                    texts[name] = row["json"]
            if texts.keys() == {"body", "settings", "scene"}:
                return TrialDrive(**texts)
        return None


def _has_same_scenes(scenes: Mapping[int, str], other_scenes: Mapping[int, str]) -> bool:
    """Return whether two environments have equal scenes in all samples that are stored for both, and at least one."""
    common_samples = scenes.keys() & other_scenes.keys()
    if not common_samples:
        return False
    return all(scenes[sample] == other_scenes[sample] for sample in common_samples)
