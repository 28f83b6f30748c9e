"""Reads the experiments that a report shows, from an open store: evidence, advice, trials, effects of parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy

from foldcar.evidence.adviser import Selection
from foldcar.evidence.evidence import Evidence, read_evidence, read_unswept
from foldcar.evidence.selecting import select_evidence
from foldcar.evidence.sentences import car_to_take
from foldcar.report.page_designs import DesignColumns
from foldcar.report.page_effects import read_effects
from foldcar.statistics.effects import Effects
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, select_trials
from foldcar.study.search.design_simulator import fresh_id

# Of the publication's figure 6.
THRESHOLDS = (0.5, 0.75)


@dataclass(frozen=True)
class ReportedExperiment:
    """An experiment, prepared for page and figures; ``name`` identifies it on the page.

    ``trials`` are shown. ``effects`` is the smooth model of the parameters with indices ``parameter_indices``, None
    without one. ``fresh`` is the evidence on a search's best designs in fresh environments.
    """

    name: str
    evidence: Evidence
    selection: Selection
    trials: Sequence[Trial]
    thresholds: tuple[float, ...]
    effects: Effects | None
    parameter_indices: list[int]
    fresh: Evidence | None = None

    @property
    def info(self) -> ExperimentInfo:
        """The experiment in the store."""
        return self.evidence.info

    @cached_property
    def columns(self) -> DesignColumns:
        """The designs as columns."""
        return DesignColumns(self.evidence)

    @cached_property
    def recommended(self) -> int | None:
        """The index of the design that the report recommends; None if there are neither a belief nor runs.

        With a belief, it is the design whose car is expected to pass most often: a car that has driven, or a newly built
        car. Without a belief, it is the design with the highest success rate in simulation.
        """
        belief = self.evidence.belief
        if belief is not None:
            driven_car = car_to_take(belief)
            # The index of the design among those of the belief.
            design = belief.answers.best if driven_car is None else belief.answers.cars[driven_car].design
            return int(belief.design_indices[design])
        passed_runs, counted_runs = self.evidence.run_counts.T
        if not counted_runs.any():
            return None
        # Divides by 1 instead of 0 for designs without runs.
        rates = passed_runs / numpy.maximum(counted_runs, 1)
        return int(rates.argmax())


def read_experiments(
    store: Store, thresholds: Sequence[float] = (), simulated_trials: bool = False
) -> list[ReportedExperiment]:
    """Read the experiments of a store in their order, then those with trials only.

    ``thresholds`` of success are 0 to 1; without any, each experiment has its listing's, or THRESHOLDS.
    With ``simulated_trials``, trials of simulated cars count as if built cars had driven them. Raises FoldcarError if the
    store cannot be read.
    """
    swept = {evidence.info.id: evidence for evidence in read_evidence(store, simulated_trials=simulated_trials)}
    unswept = read_unswept(store, simulated_trials)
    # The advice is about the highest threshold.
    highest_threshold = max(thresholds, default=None)
    selections = select_evidence(list(swept.values()), threshold=highest_threshold)
    selections += select_evidence(list(unswept.values()), threshold=highest_threshold)
    named_evidence = [*swept.items(), *unswept.items()]
    experiments = []
    for (name, evidence), selection in zip(named_evidence, selections, strict=True):
        info = evidence.info
        trials: list[Trial] = []
        # Trials are not shown beside rates that are expected over realities.
        if not info.is_over_realities:
            trials = list(store.trials(info.listed_id))
        if name in unswept:
            # Each type of car has its own entry.
            trials = [trial for trial in trials if trial.vehicle_type == info.vehicle_type]
        shown_trials, _ = select_trials(trials, simulated_trials)
        effects, parameter_indices = read_effects(evidence)
        experiments.append(
            ReportedExperiment(
                name=name,
                evidence=evidence,
                selection=selection,
                trials=shown_trials,
                thresholds=tuple(sorted(set(thresholds))) or info.thresholds or THRESHOLDS,
                effects=effects,
                parameter_indices=parameter_indices,
                fresh=swept.get(fresh_id(name)) if info.searched else None,
            )
        )
    return experiments
