"""The evidence of a store: for each experiment its designs with runs and trials, and the belief about them.

A trial is compared with the simulation of the same environment. This is the stored run, or a new run if the obstacles
were not placed as planned.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.evidence import remarks
from foldcar.evidence.belief import Belief, read_belief
from foldcar.evidence.design_evidence import (
    DesignEvidence,
    PairedTrial,
    design_key,
    in_family,
)
from foldcar.evidence.designs_with_runs import simulated_design, swept_designs
from foldcar.evidence.resimulation import Resimulation
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.info import ExperimentInfo
from foldcar.store.other_drives import other_drives
from foldcar.store.reader import Store
from foldcar.store.run_arrays import RunArrays, run_arrays
from foldcar.store.trial_records import SIMULATED, Trial, left_out_text, select_trials

NO_RUNS = RunArrays(
    numpy.empty(0, numpy.int64), numpy.empty(0, numpy.int64), numpy.empty(0, numpy.uint8), numpy.empty((0, len(NUMBERS)))
)
# Values of those fields of ExperimentInfo that are unknown for an experiment without runs.
UNKNOWN: dict[str, Any] = {
    **dict.fromkeys(("speed_m_s", "seed", "condition", "variation_seed")),
    **dict.fromkeys(("environments", "timeout_s", "yaw_rate_rad_s", "planned_runs", "stored_runs"), 0),
    **dict.fromkeys(("vehicle", "environment", "carsim_build"), ""),
}


@dataclass(frozen=True)
class Evidence:
    """The evidence of one experiment.

    ``designs`` are the swept ones of the family in its order, then those of the family with trials only, then others.
    ``runs`` are the stored ones; their ``design`` is an index into ``designs``. ``belief`` is about the designs of the
    family; None without enough runs in other realities, or if success is undefined. ``remarks`` are sentences for
    readers. ``simulated_trials`` is the number of trials by simulated cars that count as trials of built ones,
    ``uncounted_trials`` that of trials by built cars that were aborted, or driven otherwise or elsewhere than the runs.
    """

    info: ExperimentInfo
    designs: tuple[DesignEvidence, ...]
    runs: RunArrays
    belief: Belief | None
    remarks: tuple[str, ...]
    simulated_trials: int = 0
    uncounted_trials: int = 0

    @property
    def parameters(self) -> tuple[str, ...]:
        """The varied design parameters."""
        return tuple(self.info.varied)

    @cached_property
    def family(self) -> tuple[DesignEvidence, ...]:
        """The designs of the family, which come first."""
        return tuple(
            design for design in self.designs if design.swept or in_family(self.info, design.vehicle_type, design.design)
        )

    @property
    def swept(self) -> int:
        """The number of designs that were swept, which come first."""
        return sum(design.swept for design in self.designs)

    @property
    def driven(self) -> list[DesignEvidence]:
        """The designs with trials that count."""
        return [design for design in self.designs if design.trials]

    @cached_property
    def run_counts(self) -> NDArray[Any]:
        """The runs of each design of the family (family, 2): number passed, number that counts."""
        counts = [(design.runs_passed, design.runs) for design in self.family]
        return numpy.array(counts, dtype=int).reshape(-1, 2)

    @cached_property
    def trial_counts(self) -> NDArray[Any]:
        """The trials of each design of the family (family, 2): number passed, number that counts."""
        counts = [(design.trials_passed, len(design.trials)) for design in self.family]
        return numpy.array(counts, dtype=int).reshape(-1, 2)

    @cached_property
    def outcome_counts(self) -> NDArray[Any]:
        """The number of runs of each design of the family by outcome (family, OUTCOMES)."""
        return numpy.array([design.outcome_counts for design in self.family], dtype=int).reshape(-1, len(OUTCOMES))

    @cached_property
    def values(self) -> dict[str, list[float]]:
        """The values of each varied parameter in the family, ascending."""
        return {name: sorted({float(design.design[name]) for design in self.family}) for name in self.info.varied}

    def index_of(self, car: Trial | DesignEvidence) -> int | None:
        """Return the index in the family of a trial's design, or of another experiment's design; None if absent."""
        return self._indices.get(design_key(car.vehicle_type, car.design))

    @cached_property
    def _indices(self) -> dict[Any, int]:
        return {design_key(design.vehicle_type, design.design): index for index, design in enumerate(self.family)}


def simulated_text(evidence: Evidence) -> str:
    """Return the words that begin every answer in which trials of simulated cars count, else an empty text."""
    return "Trials of SIMULATED cars count here as trials of built ones. " if evidence.simulated_trials else ""


def read_evidence(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Evidence]:
    """Read the evidence of every swept experiment, or of ``experiment``; an empty list if no sweep has begun.

    With ``simulated_trials``, trials of simulated cars count as if built cars had driven them; a remark says so. Raises
    FoldcarError if the store cannot be read or has no such experiment.
    """
    if not store.holds_study():
        return []
    infos = store.info().experiments
    resimulation = Resimulation(store)
    return [
        _evidence(store, infos[name], run_arrays(store, name), resimulation, simulated_trials)
        for name in store.experiment_ids(experiment)
    ]


def read_unswept(store: Store, simulated_trials: bool = False) -> dict[str, Evidence]:
    """Read the evidence of experiments that have trials but no simulated runs.

    Each experiment and type of car has an evidence of its own, whose key is a name that says so.

    ``simulated_trials`` is as in :func:`read_evidence`.
    """
    swept = swept_ids(store)
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in store.trials():
        if trial.experiment not in swept:
            groups.setdefault((trial.experiment, trial.vehicle_type), []).append(trial)
    evidence_by_name = {}
    for (experiment, vehicle_type), trials in groups.items():
        evidence_by_name[f"{experiment}: {vehicle_type}, trials only"] = _evidence(
            store, _unswept_info(trials), NO_RUNS, resimulation=None, simulated_trials=simulated_trials, trials=trials
        )
    return evidence_by_name


def unswept_trials(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Trial]:
    """Return the completed trials of experiments that were not swept; the options as in :func:`read_evidence`."""
    selected_trials, _ = select_trials(store.trials(experiment), simulated_trials)
    swept = swept_ids(store)
    return [trial for trial in selected_trials if trial.completed and trial.experiment not in swept]


def no_trial_text(evidence: Evidence, nothing_driven: str) -> str:
    """Return why there is no trial to learn from; ``nothing_driven`` says that no built car was driven."""
    return "no trial counts yet" if evidence.uncounted_trials else nothing_driven


def swept_ids(store: Store) -> set[str]:
    """Return the names of all swept experiments.

    An experiment is swept if its runs were simulated. The result has the experiments' names in the store and in the
    listing. The two differ if an experiment was swept with another engine of the simulator, or with other values of the
    simulator's uncertain parameters. If these values were random, the listed name is left out, because the runs are not
    compared with trials.
    """
    if not store.holds_study():
        return set()
    infos = store.info().experiments
    listed_ids = {info.listed_id for info in infos.values() if not info.is_over_realities}
    return set(infos) | listed_ids


def _unswept_info(trials: Sequence[Trial]) -> ExperimentInfo:
    """Describe an experiment without runs; parameters with several values in the trials are the varied ones."""
    # The values of each design parameter. A design may lack a parameter that others have.
    values_by_name: dict[str, set[float]] = {}
    for trial in trials:
        for name, value in trial.design.items():
            values_by_name.setdefault(name, set()).add(value)
    varied = {name: tuple(sorted(values)) for name, values in values_by_name.items() if len(values) > 1}
    fixed = {name: min(values) for name, values in values_by_name.items() if len(values) == 1}
    first_trial = trials[0]
    return ExperimentInfo(
        **UNKNOWN,
        id=first_trial.experiment,
        vehicle_type=first_trial.vehicle_type,
        varied=varied,
        fixed=fixed,
        scenic_program=first_trial.scenic_program or "an unknown program",
        scenic_params={},
        variation={},
        success_rule="a trial has passed as its operator judged",
        success_defined=True,
    )


def _evidence(
    store: Store,
    info: ExperimentInfo,
    runs: RunArrays,
    resimulation: Resimulation | None,
    simulated_trials: bool,
    trials: Sequence[Trial] | None = None,
) -> Evidence:
    """Assemble an experiment's evidence: its designs with runs and trials, the belief about them, and remarks.

    If ``trials`` is None, those of the listed experiment are read. ``resimulation`` makes missing runs; it is None for an
    experiment without runs.
    """
    trials = list(store.trials(info.listed_id)) if trials is None else trials
    other_programs = {} if resimulation is None else store.trials_in_other_environments(info)
    selected, _ = select_trials(trials, simulated_trials)
    trials, sentences = _comparable_trials(info, trials, other_programs, simulated_trials)
    if resimulation is not None:
        different = other_drives(store, info, trials)
        sentences += remarks.trials_driven_otherwise(different.values())
        trials = [trial for trial in trials if trial.id not in different]
    trials_by_key: dict[Any, list[Trial]] = {}
    for trial in trials:
        trials_by_key.setdefault(design_key(trial.vehicle_type, trial.design), []).append(trial)
    swept = [] if resimulation is None else swept_designs(store, info, runs)
    swept_by_key = {design_key(info.vehicle_type, design.design): design for design in swept}
    unswept_by_key = _unswept_designs(info, trials_by_key, swept_by_key, resimulation)
    if resimulation is not None:
        sentences += remarks.unswept_designs(list(unswept_by_key.values()))
    designs = {**swept_by_key, **{key: design for key, (design, _) in unswept_by_key.items()}}
    ids_in_samples = set[int]() if resimulation is None else store.trials_in_environment(info)
    with_trials = []
    for key, design in designs.items():
        with_trials.append(_with_trials(info, design, trials_by_key.get(key, []), ids_in_samples, resimulation))
    simulated = sum(trial.standing == SIMULATED for trial in trials)
    uncounted = len(selected) - sum(trial.completed for trial in trials)
    evidence = Evidence(info, tuple(with_trials), runs, None, (), simulated, uncounted)
    belief = None
    if resimulation is not None:
        completed_trials = [trial for trial in trials if trial.completed]
        belief = read_belief(store, info, evidence.family, completed_trials, bool(simulated))
    if info.success_defined:
        sentences += remarks.cars_without_names(with_trials)
        sentences += remarks.on_pairs(with_trials) if resimulation is not None else []
    sentences += resimulation.remarks(info.id) if resimulation is not None else []
    if belief is not None:
        sentences += belief.remarks()
    return replace(evidence, belief=belief, remarks=(*remarks.on_runs(store, info), *sentences))


def _unswept_designs(
    info: ExperimentInfo,
    trials_by_key: Mapping[Any, Sequence[Trial]],
    swept_by_key: Mapping[Any, DesignEvidence],
    resimulation: Resimulation | None,
) -> dict[Any, tuple[DesignEvidence, str | None]]:
    """Return the designs that have trials but were not swept, by their keys, as :func:`simulated_design` returns them.

    Designs of the experiment's family come first.
    """
    unswept = [key for key in trials_by_key if key not in swept_by_key]
    simulated_by_key = {}
    # Designs with most trials are simulated first, because the number of new runs is limited.
    for key in sorted(unswept, key=lambda key: -len(trials_by_key[key])):
        simulated_by_key[key] = simulated_design(info, trials_by_key[key][0], resimulation)

    def is_outside_family(key: Any) -> bool:
        """Return whether the design with this key is outside the experiment's family."""
        design, _ = simulated_by_key[key]
        return not in_family(info, design.vehicle_type, design.design)

    return {key: simulated_by_key[key] for key in sorted(unswept, key=is_outside_family)}


def _comparable_trials(
    info: ExperimentInfo, trials: Sequence[Trial], other_programs: Mapping[int, str | None], simulated_trials: bool
) -> tuple[list[Trial], list[str]]:
    """Choose the trials that are compared with the runs. Return them, and remarks on them and on those left out.

    Aborted trials are among the chosen ones. Trials in other environments than the runs are left out. ``other_programs``
    has an entry for each of these: the trial's number and the Scenic program of its environment. ``simulated_trials`` is
    whether trials of simulated cars are chosen, too. Runs *over realities*, whose simulator's parameters are random, are
    compared with no trials.
    """
    selected_trials, left_out = select_trials(trials, simulated_trials)
    if info.is_over_realities:
        return [], remarks.trials_beside_realities(info, len(selected_trials))
    left_out_sentence = left_out_text(left_out)
    sentences = [] if left_out_sentence is None else [left_out_sentence]
    sentences += remarks.on_trials(info, selected_trials)
    comparable_trials = []
    programs_of_left_out = []
    for trial in selected_trials:
        if trial.id in other_programs:
            programs_of_left_out.append(other_programs[trial.id])
        else:
            comparable_trials.append(trial)
    sentences += remarks.trials_in_other_environments(programs_of_left_out, info)
    return comparable_trials, sentences


def _with_trials(
    info: ExperimentInfo,
    design: DesignEvidence,
    trials: Sequence[Trial],
    ids_in_samples: Container[int],
    resimulation: Resimulation | None,
) -> DesignEvidence:
    """Return the design with its completed trials, each paired with a run in the same environment, if there is one.

    If car and obstacles were placed as planned, this is the stored run; a trial whose stored run was rejected has none.
    Otherwise the trial is simulated now, as it was placed. ``ids_in_samples`` are the ids of the trials that were driven
    in a sampled environment of the runs.
    """
    if not trials:
        return design
    passed_by_sample = dict(zip(design.samples.tolist(), design.passed.tolist(), strict=True))
    paired_trials = []
    for trial in trials:
        if not trial.completed:
            continue
        sample = trial.sample if trial.id in ids_in_samples else None
        unpaired = PairedTrial(trial.outcome, sample, simulated=None, resimulated=False, car_name=trial.car_name)
        was_placed_as_planned = sample is not None and not trial.deviations
        if was_placed_as_planned and sample in passed_by_sample:
            paired_trials.append(replace(unpaired, simulated=int(passed_by_sample[sample])))
        elif was_placed_as_planned and sample in design.rejected:
            paired_trials.append(unpaired)
        else:
            outcome = None if resimulation is None else resimulation.trial(info, trial)
            if outcome is None:
                paired_trials.append(unpaired)
            else:
                paired_trials.append(replace(unpaired, simulated=int(outcome == "passed"), resimulated=True))
    return replace(design, trials=tuple(paired_trials), aborted=len(trials) - len(paired_trials))
