"""What a store tells of each design of an experiment: runs in sampled environments, and trials of built cars.

A trial has beside it what simulation makes of the same environment: the stored run, or a run made now where the trial
was placed otherwise than planned.
"""

from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.advice.resimulation import Resimulation, SimulatedCars
from foldcar.analysis.built_cars import PRIOR, BuiltCars, shift, simulated_weights
from foldcar.analysis.rate import Rate
from foldcar.analysis.words import count, design_text
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.frames import run_arrays
from foldcar.store.info import REALITY_KIND, ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED, Trial, left_out_text, select_trials

# Designs that are named in one remark.
SHOWN = 5

Design = Mapping[str, float | str]


@dataclass(frozen=True)
class PairedTrial:
    """A completed trial of a built car; ``simulated`` is 1 if simulation passes in its environment, 0 if not.

    ``simulated`` is None where that is not known; ``again`` says that it was simulated now, as it was placed.
    ``sample`` is None where the environment is not known. ``expected``: the share, 0 to 1, of several simulated cars of
    the design that pass there, None if they were not simulated. ``car_name`` None: of the design's car without a name.
    """

    outcome: str
    sample: int | None
    simulated: int | None
    again: bool
    expected: float | None = None
    car_name: str | None = None

    @property
    def passed(self) -> bool:
        """Whether the car passed."""
        return self.outcome == "passed"


@dataclass(frozen=True)
class DesignEvidence:
    """One design: ``passed`` (runs,) tells of its runs in the environments ``samples`` (runs,) whether they passed.

    Rejected runs, in the environments ``rejected``, are not among them. ``swept`` is False for a design of trials that
    the sweep lacks, whose runs were made now or are none. ``label`` is its name for the reader, ``outcomes`` counts all
    runs by outcome, ``mean_time_s`` is that of the runs that count (None without).
    ``stopped``: its runs are those of a sweep that stopped when it knew. ``spread``: the weights of how much its cars
    differ (:mod:`foldcar.analysis.built_cars`), as simulated cars do or as is assumed.
    """

    vehicle_type: str
    design: Design
    label: str
    swept: bool
    samples: NDArray[Any]
    passed: NDArray[Any]
    outcomes: Mapping[str, int]
    mean_time_s: float | None
    trials: tuple[PairedTrial, ...] = ()
    aborted: int = 0
    stopped: bool = False
    rejected: frozenset[int] = frozenset()
    spread: NDArray[Any] = field(default_factory=lambda: PRIOR)

    def simulated(self, confidence: float = 0.95) -> Rate:
        """The rate of its runs, at least one."""
        return Rate.counted(self.runs_passed, self.runs, count(self.runs, "run"), self.stopped, confidence)

    @property
    def runs(self) -> int:
        """The number of runs that belong in a rate."""
        return len(self.passed)

    @property
    def runs_passed(self) -> int:
        """The number of those that passed."""
        return int(self.passed.sum())

    @property
    def trials_passed(self) -> int:
        """The number of trials that passed."""
        return sum(trial.passed for trial in self.trials)

    @property
    def cars(self) -> BuiltCars | None:
        """The trials by the car that drove; None without trials."""
        return by_car(self.trials, self.spread, self.runs_passed, self.runs) if self.trials else None

    @property
    def paired(self) -> list[PairedTrial]:
        """The trials with a simulation of their environment."""
        return [trial for trial in self.trials if trial.simulated is not None]


def by_car(trials: Sequence[PairedTrial], spread: NDArray[Any], runs_passed: int, runs: int) -> BuiltCars:
    """Trials of one design, at least one, by the car that drove."""
    cars: dict[str | None, list[PairedTrial]] = {}
    for trial in trials:
        cars.setdefault(trial.car_name, []).append(trial)
    passed, counted = numpy.array([(sum(one.passed for one in some), len(some)) for some in cars.values()], float).T
    overall = (runs_passed + 0.5) / (runs + 1)
    shifts = [shift([one.expected for one in some], overall) for some in cars.values()]
    return BuiltCars(passed, counted, numpy.array(shifts), spread)


def columns(
    designs: Sequence[DesignEvidence], parameters: Sequence[str]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Parameters (designs, k), runs and trials (designs, 2): passed and all."""
    x = [[float(one.design[name]) for name in parameters] for one in designs]
    runs = [(one.runs_passed, one.runs) for one in designs]
    trials = [(one.trials_passed, len(one.trials)) for one in designs]
    found, *counts = (numpy.array(rows, dtype=float) for rows in (x, runs, trials))
    return found.reshape(len(designs), len(parameters)), counts[0].reshape(-1, 2), counts[1].reshape(-1, 2)


def simulated_spread(cars: SimulatedCars | None) -> NDArray[Any]:
    """The weights of how much a design's cars differ: as simulated ones do, or as is assumed."""
    return PRIOR if cars is None else simulated_weights(cars.passed.sum(axis=1), cars.passed.shape[1])


@dataclass(frozen=True)
class Evidence:
    """One experiment: its designs in the order of the family, then those of trials only; ``remarks`` for the reader."""

    info: ExperimentInfo
    designs: tuple[DesignEvidence, ...]
    remarks: tuple[str, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """The varied design parameters."""
        return tuple(self.info.varied)

    def in_family(self, one: DesignEvidence) -> bool:
        """Whether a design is one of the family, swept or not: it differs in the varied parameters only."""
        fixed = self.info.fixed
        return (
            one.vehicle_type == self.info.vehicle_type
            and all(one.design.get(name) == value for name, value in fixed.items())
            and set(one.design) == {*fixed, *self.info.varied}
        )

    @property
    def driven(self) -> list[DesignEvidence]:
        """The designs with trials that count."""
        return [one for one in self.designs if one.trials]


def read_evidence(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Evidence]:
    """The evidence of every swept experiment, or of one; none if no sweep has begun.

    ``simulated_trials``: trials of simulated cars instead of those of built ones; a remark says so. FoldcarError.
    """
    if not store.holds_study():
        return []
    infos = store.info().experiments
    again = Resimulation(store)
    return [_evidence(store, infos[name], again, simulated_trials) for name in store.experiment_ids(experiment)]


def unswept_trials(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Trial]:
    """The trials of built cars that count, or of simulated ones instead, in experiments that were not swept."""
    kept, _ = _kept(store, experiment, simulated_trials)
    swept = swept_ids(store)
    return [trial for trial in kept if trial.completed and trial.experiment not in swept]


def swept_ids(store: Store) -> set[str]:
    """The experiments that trials may be compared with, by their names in the listing and in the store."""
    infos = store.info().experiments if store.holds_study() else {}
    return {*infos, *(info.listed_id for info in infos.values())}


def run_remarks(store: Store, info: ExperimentInfo) -> list[str]:
    """What is said of runs wherever they count: what their engine cannot know, how many are missing or rejected."""
    found = [info.warning] if info.warning else []
    if info.stored_runs < info.planned_runs:
        stored = f"{info.stored_runs:,} of {info.planned_runs:,} runs are stored"
        found.append(f"Unfinished: {stored}; the command that started the sweep resumes it.")
    counts = store.design_counts(info.id)
    rejected = sum(counts.runs) - sum(counts.counted)
    if rejected:
        without = sum(runs > 0 and not counted for runs, counted in zip(counts.runs, counts.counted, strict=True))
        have = "has" if without == 1 else "have"
        rest = f" {count(without, 'design')} {have} no other run, and so no rate." if without else ""
        found.append(
            f"{rejected} of {sum(counts.runs)} runs were rejected: they violated a requirement of the program. Scenic "
            f"discards such runs; they count neither as passed nor as not passed.{rest}"
        )
    return found


def _evidence(store: Store, info: ExperimentInfo, again: Resimulation, simulated_trials: bool) -> Evidence:
    trials, remarks = _trials(store, info, simulated_trials)
    remarks = [*run_remarks(store, info), *remarks]
    designs = {_key(info.vehicle_type, one.design): one for one in _swept(store, info)}
    by_design: dict[Any, list[Trial]] = {}
    for trial in trials:
        by_design.setdefault(_key(trial.vehicle_type, trial.design), []).append(trial)
    unswept = [key for key in by_design if key not in designs]
    # Those with most trials first: not all of many are simulated.
    made = {key: _unswept(info, by_design[key][0], again) for key in sorted(unswept, key=lambda k: -len(by_design[k]))}
    designs |= {key: made[key][0] for key in unswept}
    remarks += _unswept_remarks([made[key] for key in unswept])
    here = store.trials_here(info)
    found = [_with_trials(info, one, by_design.get(key, []), here, again) for key, one in designs.items()]
    return Evidence(info, tuple(found), (*remarks, *_car_remarks(found), *_pair_remarks(found), *again.remarks(info.id)))


def _swept(store: Store, info: ExperimentInfo) -> Iterator[DesignEvidence]:
    """The designs of the family with their runs."""
    runs, designs = run_arrays(store, info.id), list(store.designs(info.id).values())
    order = numpy.argsort(runs.design, kind="stable")
    each = numpy.split(order, numpy.searchsorted(runs.design[order], numpy.arange(1, len(designs))))
    elapsed_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    # Of no design split makes one part.
    for design, all_rows in zip(designs, each, strict=False):
        discarded = runs.outcome[all_rows] == OUTCOMES.index(REJECTED)
        rows = all_rows[~discarded]
        times = elapsed_s[rows][~numpy.isnan(elapsed_s[rows])]
        yield DesignEvidence(
            info.vehicle_type,
            dict(design),
            design_text({name: design[name] for name in info.varied}),
            True,
            runs.sample[rows],
            runs.outcome[rows] == OUTCOMES.index("passed"),
            Counter(OUTCOMES[code] for code in runs.outcome[all_rows].tolist()),
            float(times.mean()) if len(times) else None,
            stopped=info.until is not None,
            rejected=frozenset(runs.sample[all_rows[discarded]].tolist()),
        )


def _unswept(info: ExperimentInfo, trial: Trial, again: Resimulation) -> tuple[DesignEvidence, str | None]:
    """A design of trials that the sweep lacks, simulated now if that is possible; else why not."""
    differing = {name: value for name, value in trial.design.items() if info.fixed.get(name) != value}
    label = design_text({name: value for name, value in trial.design.items() if name in info.varied or name in differing})
    if trial.vehicle_type != info.vehicle_type:
        label = f"{trial.vehicle_type} of {label}"
    found, why_not = again.design(info, trial)
    outcomes = [outcome for outcome, _ in found]
    times = [time_s for _, time_s in found if time_s is not None]
    evidence = DesignEvidence(
        trial.vehicle_type,
        trial.design,
        label,
        False,
        numpy.arange(len(found)),
        numpy.array([outcome == "passed" for outcome in outcomes], dtype=bool),
        Counter(outcomes),
        float(numpy.mean(times)) if times else None,
    )
    return evidence, why_not


def _unswept_remarks(made: Sequence[tuple[DesignEvidence, str | None]]) -> Iterator[str]:
    """What is said of designs that the sweep lacks: of each, or of many with the same fate together."""
    fates: dict[str | None, list[DesignEvidence]] = {}
    for one, why_not in made:
        fates.setdefault(why_not, []).append(one)
    for why_not, some in fates.items():
        named = [(f"{one.label} is", "it was") for one in some]
        if len(some) > SHOWN:
            named = [(f"{_named([one.label for one in some])} are", "they were")]
        for name, was in named:
            if why_not is None:
                yield f"{name} not in the sweep: {was} simulated now, in {some[0].runs} environments."
            else:
                yield f"{name} not in the sweep, and cannot be simulated now: {why_not}."


def _kept(store: Store, experiment: str | None, simulated_trials: bool) -> tuple[list[Trial], list[str]]:
    """The trials of built cars, or of simulated ones instead, aborted ones among them, and what is said of the others."""
    kept, left_out = select_trials(store.trials(experiment), simulated_trials)
    text = left_out_text(left_out)
    remarks = [] if text is None else [text]
    if not simulated_trials:
        return kept, remarks
    simulated = [trial for trial in kept if trial.standing == SIMULATED]
    built = f"; {count(len(kept) - len(simulated), 'trial')} of built cars left out" if len(simulated) < len(kept) else ""
    return simulated, [f"SIMULATED trials: of simulated cars, not of built ones{built}.", *remarks]


def _trials(store: Store, info: ExperimentInfo, simulated_trials: bool) -> tuple[list[Trial], list[str]]:
    """The trials to compare, aborted ones among them, and what is said of those left out or driven elsewhere."""
    kept, remarks = _kept(store, info.listed_id, simulated_trials)
    if info.under is not None and kept:
        remarks.append(
            f"The runs are of {info.under}: parameters of a file, not what trials say."
            if info.under.startswith(REALITY_KIND)
            else f"The runs are of the {info.under}, which goes by trials of experiment {info.listed_id}: where they "
            "agree with those trials it is by fit, which later trials may test."
        )
    corrected = sum(trial.corrections > 0 for trial in kept)
    if corrected:
        remarks.append(f"{count(corrected, 'trial')} corrected afterwards: the latest correction counts.")
    elsewhere = store.trials_elsewhere(info)
    remarks += elsewhere_remarks([elsewhere[trial.id] for trial in kept if trial.id in elsewhere], info)
    return [trial for trial in kept if trial.id not in elsewhere], remarks


def elsewhere_remarks(programs: Iterable[str | None], info: ExperimentInfo) -> list[str]:
    """A sentence for each Scenic program of trials that were driven in another environment than the experiment's runs."""
    remarks = []
    for program, number in Counter(programs).items():
        trials = f"{count(number, 'trial')} left out: driven"
        if program == info.scenic_program:
            remarks.append(
                f"{trials} in other samples of {program} than the runs: its text, parameters or seed, or foldcar, have "
                "changed. Sweep the environment as it was then to compare them."
            )
        else:
            remarks.append(f"{trials} in {program or 'an unknown program'}, not in {info.scenic_program}.")
    return remarks


def _with_trials(
    info: ExperimentInfo,
    evidence: DesignEvidence,
    trials: Sequence[Trial],
    here: Container[int],
    again: Resimulation,
) -> DesignEvidence:
    stored = dict(zip(evidence.samples.tolist(), evidence.passed.tolist(), strict=True))
    found = []
    completed = [trial for trial in trials if trial.completed]
    cars = again.cars(info, completed, here) if completed else None
    for trial in completed:
        expected = None if cars is None else cars.shares.get(trial.id)
        planned = trial.id in here and not trial.deviations and trial.sample is not None
        if planned and (trial.sample in stored or trial.sample in evidence.rejected):
            simulation = stored.get(trial.sample)
            known = None if simulation is None else int(simulation)
            found.append(PairedTrial(trial.outcome, trial.sample, known, False, expected, trial.car_name))
            continue
        outcome = again.trial(info, trial)
        simulated = None if outcome is None else int(outcome == "passed")
        sample = trial.sample if trial.id in here else None
        found.append(PairedTrial(trial.outcome, sample, simulated, simulated is not None, expected, trial.car_name))
    aborted, spread = len(trials) - len(completed), simulated_spread(cars)
    return replace(evidence, trials=tuple(found), aborted=aborted, spread=spread) if trials else evidence


def _car_remarks(designs: Sequence[DesignEvidence]) -> Iterator[str]:
    names = {one.label: [trial.car_name for trial in one.trials] for one in designs}
    return car_remarks([one.cars for one in designs if one.cars is not None], names)


def car_remarks(driven: Sequence[BuiltCars], names: Mapping[str, Sequence[str | None]]) -> Iterator[str]:
    """What is said of cars of one design; ``names`` are those of the cars of a design's trials, by its own."""
    nameless = [label for label, some in names.items() if some.count(None) > 1]
    if nameless:
        yield (
            f"Trials without a car's name are taken for those of one car of their design, at {_named(nameless)}: "
            "`foldcar log --car` and `foldcar trials correct --car-name` tell cars apart."
        )
    for known, what in ((False, "is assumed"), (True, "is that of simulated ones")):
        spreads = sorted(one.spread for one in driven if (one.weights is not PRIOR) == known)
        if spreads:
            low, high = (f"{spreads[at]:.1f}" for at in (0, -1))
            ends = low if low == high else f"{low} to {high}"
            yield f"How much cars of a design differ, {ends} in log-odds (standard deviation), {what}."


def _named(some: Sequence[str]) -> str:
    shown = ", ".join(some[:SHOWN])
    return shown if len(some) <= SHOWN else f"{shown} and {count(len(some) - SHOWN, 'further design')}"


def _pair_remarks(designs: Sequence[DesignEvidence]) -> Iterator[str]:
    trials = [trial for one in designs for trial in one.trials]
    again = sum(trial.again for trial in trials)
    if again:
        what = "placed otherwise than planned, or has no stored run" if again == 1 else "placed otherwise, or have no run"
        yield f"{count(again, 'trial')} {what}: simulated again as placed."
    alone = sum(trial.simulated is None for trial in trials)
    if alone:
        yield (
            f"{alone} of {len(trials)} trials cannot be paired with a run of the same environment, which is not known, "
            "not simulated or rejected: they count by their rate alone."
        )
    met = [[trial.sample for trial in one.trials if trial.sample is not None] for one in designs]
    repeated = sum(len(samples) - len(set(samples)) for samples in met)
    if repeated:
        yield (
            f"{count(repeated, 'trial')} repeat an environment of the same design: intervals take environments as "
            "independent, and are too narrow by that."
        )


def _key(vehicle_type: str, design: Design) -> Any:
    return vehicle_type, tuple(sorted(design.items()))
