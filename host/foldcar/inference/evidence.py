"""The evidence of a store, read once: for each experiment its designs with runs and trials, and what is believed of them.

A trial is compared with the simulation of the same environment: the stored run, or a run made now where the trial was
placed otherwise than planned.
"""

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.inference import remarks
from foldcar.inference.belief import Belief, believe
from foldcar.inference.design_evidence import (
    DesignEvidence,
    PairedTrial,
    design_key,
    design_label,
    in_family,
    simulated_spread,
)
from foldcar.inference.resimulation import Resimulation
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.frames import RunArrays, run_arrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED, Trial, left_out_text, select_trials

NO_RUNS = RunArrays(
    numpy.empty(0, numpy.int64), numpy.empty(0, numpy.int64), numpy.empty(0, numpy.uint8), numpy.empty((0, len(NUMBERS)))
)
# What is unknown of an experiment that was not swept.
UNKNOWN: dict[str, Any] = {
    **dict.fromkeys(("speed_m_s", "seed", "condition", "variation_seed")),
    **dict.fromkeys(("environments", "timeout_s", "yaw_rate_rad_s", "planned_runs", "stored_runs"), 0),
    **dict.fromkeys(("vehicle", "environment", "carsim_build"), ""),
}


@dataclass(frozen=True)
class Evidence:
    """One experiment: ``designs`` of the family in its order, then those of it that only trials have, then others.

    ``runs`` are the stored ones; their ``design`` is an index into ``designs``. ``belief`` is about the designs of the
    family with runs; None if there are none, or success is undefined. ``remarks``: what readers must know besides.
    """

    info: ExperimentInfo
    designs: tuple[DesignEvidence, ...]
    runs: RunArrays
    belief: Belief | None
    remarks: tuple[str, ...]

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
        """How many runs of each design of the family passed, and how many count (family, 2)."""
        return numpy.array([(design.runs_passed, design.runs) for design in self.family], dtype=int).reshape(-1, 2)

    @cached_property
    def trial_counts(self) -> NDArray[Any]:
        """How many trials of each design of the family passed, and how many count (family, 2)."""
        return numpy.array([(design.trials_passed, len(design.trials)) for design in self.family], dtype=int).reshape(
            -1, 2
        )

    @cached_property
    def outcome_counts(self) -> NDArray[Any]:
        """How many runs of each design of the family ended in each way (family, OUTCOMES)."""
        return numpy.array([design.outcome_counts for design in self.family], dtype=int).reshape(-1, len(OUTCOMES))

    @cached_property
    def values(self) -> dict[str, list[float]]:
        """The values that occur of each varied parameter, ascending."""
        return {name: sorted({float(design.design[name]) for design in self.family}) for name in self.info.varied}

    def index_of(self, car: Trial | DesignEvidence) -> int | None:
        """Return the place in the family of a trial's design, or of another experiment's; None without one."""
        return self._places.get(design_key(car.vehicle_type, car.design))

    @cached_property
    def _places(self) -> dict[Any, int]:
        return {design_key(design.vehicle_type, design.design): index for index, design in enumerate(self.family)}


def read_evidence(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Evidence]:
    """Read the evidence of every swept experiment, or of one; none if no sweep has begun.

    ``simulated_trials``: trials of simulated cars instead of those of built ones; a remark says so. Raises FoldcarError.
    """
    if not store.holds_study():
        return []
    infos = store.info().experiments
    resimulation = Resimulation(store)
    return [
        _evidence(store, infos[name], run_arrays(store, name), resimulation, simulated_trials)
        for name in store.experiment_ids(experiment)
    ]


def read_unswept(store: Store) -> dict[str, Evidence]:
    """Read the evidence of experiments with trials only, one for each type of car, by a name of its own."""
    swept = swept_ids(store)
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in store.trials():
        if trial.experiment not in swept:
            groups.setdefault((trial.experiment, trial.vehicle_type), []).append(trial)
    return {
        f"{name}: {vehicle_type}, trials only": _evidence(store, _unswept_info(trials), NO_RUNS, None, False, trials)
        for (name, vehicle_type), trials in groups.items()
    }


def unswept_trials(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Trial]:
    """Return the trials of built cars that count, or of simulated ones instead, in experiments that were not swept."""
    kept, _ = _select(list(store.trials(experiment)), simulated_trials)
    swept = swept_ids(store)
    return [trial for trial in kept if trial.completed and trial.experiment not in swept]


def swept_ids(store: Store) -> set[str]:
    """Return the experiments that trials may be compared with, by their names in the listing and in the store."""
    infos = store.info().experiments if store.holds_study() else {}
    return {*infos, *(info.listed_id for info in infos.values())}


def _unswept_info(trials: Sequence[Trial]) -> ExperimentInfo:
    """An experiment without runs: parameters with several values vary."""
    first, designs = trials[0], [trial.design for trial in trials]
    values = {
        name: sorted({design[name] for design in designs if name in design}) for design in designs for name in design
    }
    # A design without a parameter has no place among the values of it.
    varied = {name: tuple(known) for name, known in values.items() if len(known) > 1}
    return ExperimentInfo(
        **UNKNOWN,
        id=first.experiment,
        vehicle_type=first.vehicle_type,
        varied=varied,
        fixed={name: known[0] for name, known in values.items() if name not in varied},
        scenic_program=first.scenic_program or "an unknown program",
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
    """Assemble an experiment's evidence; ``trials`` are those of its listed experiment unless given.

    Without ``resimulation`` nothing is simulated now.
    """
    trials = list(store.trials(info.listed_id)) if trials is None else trials
    elsewhere = {} if resimulation is None else store.trials_elsewhere(info)
    trials, said = _trials(info, trials, elsewhere, simulated_trials)
    by_design: dict[Any, list[Trial]] = {}
    for trial in trials:
        by_design.setdefault(design_key(trial.vehicle_type, trial.design), []).append(trial)
    designs = {
        design_key(info.vehicle_type, one.design): one
        for one in (_swept(store, info, runs) if resimulation is not None else ())
    }
    unswept = [key for key in by_design if key not in designs]
    # Those with most trials first: not all of many are simulated.
    most_first = sorted(unswept, key=lambda key: -len(by_design[key]))
    made = {key: _unswept(info, by_design[key][0], resimulation) for key in most_first}
    # Designs of the family stand before others.
    unswept.sort(key=lambda key: not in_family(info, *_design_of(by_design[key])))
    designs |= {key: made[key][0] for key in unswept}
    if resimulation is not None:
        said += remarks.unswept_designs([made[key] for key in unswept])
    here = set[int]() if resimulation is None else store.trials_here(info)
    found = [_with_trials(info, design, by_design.get(key, []), here, resimulation) for key, design in designs.items()]
    evidence = Evidence(info, tuple(found), runs, None, ())
    known = [(place, design) for place, design in enumerate(evidence.family) if design.runs and info.success_defined]
    belief = believe([one for _, one in known], [place for place, _ in known], list(info.varied))
    if info.success_defined:
        said += remarks.cars_of_designs(found)
        said += remarks.pairs(found) if resimulation is not None else []
    said += resimulation.remarks(info.id) if resimulation is not None else []
    if belief is not None:
        said += belief.contradicting.remark(belief.labels)
    return replace(evidence, belief=belief, remarks=(*remarks.runs(store, info), *said))


def _design_of(trials: Sequence[Trial]) -> tuple[str, Mapping[str, float]]:
    return trials[0].vehicle_type, trials[0].design


def _swept(store: Store, info: ExperimentInfo, runs: RunArrays) -> list[DesignEvidence]:
    """The designs of the family with their runs."""
    designs = list(store.designs(info.id).values())
    order = numpy.argsort(runs.design, kind="stable")
    each = numpy.split(order, numpy.searchsorted(runs.design[order], numpy.arange(1, len(designs))))
    elapsed_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    result = []
    # Split makes one part of no design.
    for design, all_rows in zip(designs, each, strict=False):
        discarded = runs.outcome[all_rows] == OUTCOMES.index(REJECTED)
        rows = all_rows[~discarded]
        times = elapsed_s[rows][~numpy.isnan(elapsed_s[rows])]
        result.append(
            DesignEvidence(
                info.vehicle_type,
                dict(design),
                design_label(info, info.vehicle_type, design),
                True,
                runs.sample[rows],
                runs.outcome[rows] == OUTCOMES.index("passed"),
                Counter(OUTCOMES[code] for code in runs.outcome[all_rows].tolist()),
                float(times.mean()) if len(times) else None,
                sequential=info.until is not None,
                rejected=frozenset(runs.sample[all_rows[discarded]].tolist()),
            )
        )
    return result


def _unswept(info: ExperimentInfo, trial: Trial, resimulation: Resimulation | None) -> tuple[DesignEvidence, str | None]:
    """A design that only trials have, simulated now if that is possible; else the reason why not."""
    ended, reason = ([], None) if resimulation is None else resimulation.design(info, trial)
    outcomes = [outcome for outcome, _ in ended]
    times = [time_s for _, time_s in ended if time_s is not None]
    design = DesignEvidence(
        trial.vehicle_type,
        trial.design,
        design_label(info, trial.vehicle_type, trial.design),
        False,
        numpy.arange(len(ended)),
        numpy.array([outcome == "passed" for outcome in outcomes], dtype=bool),
        Counter(outcomes),
        float(numpy.mean(times)) if times else None,
    )
    return design, reason


def _select(trials: Sequence[Trial], simulated_trials: bool) -> tuple[list[Trial], list[str]]:
    """The trials of built cars, or of simulated ones instead, aborted ones among them; remarks on the others."""
    kept, left_out = select_trials(trials, simulated_trials)
    text = left_out_text(left_out)
    said = [] if text is None else [text]
    if not simulated_trials:
        return kept, said
    simulated = [trial for trial in kept if trial.standing == SIMULATED]
    return simulated, [remarks.simulated_cars(len(kept) - len(simulated)), *said]


def _trials(
    info: ExperimentInfo, trials: Sequence[Trial], elsewhere: Mapping[int, str | None], simulated_trials: bool
) -> tuple[list[Trial], list[str]]:
    """The trials to compare, aborted ones among them; remarks on them and on those left out or driven elsewhere."""
    kept, said = _select(trials, simulated_trials)
    said += remarks.trials(info, kept)
    said += remarks.trials_in_other_environments([elsewhere[trial.id] for trial in kept if trial.id in elsewhere], info)
    return [trial for trial in kept if trial.id not in elsewhere], said


def _with_trials(
    info: ExperimentInfo,
    design: DesignEvidence,
    trials: Sequence[Trial],
    here: Container[int],
    resimulation: Resimulation | None,
) -> DesignEvidence:
    """The design with its trials, each beside the simulation of its environment."""
    if not trials:
        return design
    stored = dict(zip(design.samples.tolist(), design.passed.tolist(), strict=True))
    completed = [trial for trial in trials if trial.completed]
    cars = resimulation.cars(info, completed, here) if completed and resimulation is not None else None
    paired = []
    for trial in completed:
        expected = None if cars is None else cars.fractions.get(trial.id)
        sample = trial.sample if trial.id in here else None
        planned = sample is not None and not trial.deviations
        if planned and (sample in stored or sample in design.rejected):
            simulated, resimulated = (int(stored[sample]) if sample in stored else None), False
        else:
            outcome = None if resimulation is None else resimulation.trial(info, trial)
            simulated, resimulated = (None, False) if outcome is None else (int(outcome == "passed"), True)
        paired.append(PairedTrial(trial.outcome, sample, simulated, resimulated, expected, trial.car_name))
    aborted = len(trials) - len(completed)
    return replace(design, trials=tuple(paired), aborted=aborted, spread=simulated_spread(cars))
