"""The belief about an experiment's designs: its realities, weighed by its trials and by what was measured.

`select`, `compare`, `log`, the report and the API read their answers from it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from foldcar.belief.answers import MOVED, Answers, Unknown, believe
from foldcar.belief.learning import Learned, learn, nominal_runs
from foldcar.belief.priors import NAMES, built_priors, measured_priors
from foldcar.belief.weighing import SCENE_TRUST, Trials
from foldcar.evidence.design_evidence import DesignEvidence
from foldcar.evidence.supply import measured_supply
from foldcar.statistics.words import count, estimate_text, percent, points_text
from foldcar.store.info import ExperimentInfo
from foldcar.store.measured import measured_values
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.trial_records import Trial
from foldcar.study.reality_runs import MIN_LEARNED, offered_runs, planned_reality_runs

# The time grows with the number of cars: of more cars, those with most trials count.
MAX_CARS = 60


@dataclass(frozen=True)
class Belief:
    """Belief about the ``designs`` of a family; ``design_indices`` (n,) are their indices in the evidence.

    The ``answers`` are about these designs, in their order.
    ``notes`` are sentences on what was measured or assumed. ``measured`` has the measured values by name.
    """

    designs: tuple[DesignEvidence, ...]
    design_indices: NDArray[Any]
    answers: Answers
    notes: tuple[str, ...] = ()
    measured: Mapping[str, float] | None = None

    @property
    def driven(self) -> bool:
        """Whether there are trials that count."""
        return self.answers.driven

    @property
    def labels(self) -> list[str]:
        """The designs' names."""
        return [design.label for design in self.designs]

    def row_of(self, design: DesignEvidence) -> int | None:
        """Return the index of a design in the belief; None if it is not about this design."""
        return next((row for row, own in enumerate(self.designs) if own is design or own.label == design.label), None)

    def remarks(self) -> list[str]:
        """Return sentences on how far to trust the belief, and on what the trials have taught."""
        return [
            *self._learning_remarks(),
            *self.notes,
            *self._car_remarks(),
            *taught(self.answers),
            *self._surprise_remarks(),
        ]

    def _car_remarks(self) -> list[str]:
        """Return a sentence on how much cars of one design differ, if several cars of a design drove."""
        trials = self.answers.trials
        if len(trials.design) == len(trials.driven):
            return []
        before, after = self.answers.car_sd
        low, high = self.answers.single_cars(self.answers.best)
        return [
            f"Cars of one design differ by {after:.1f} in log-odds, by the trials of several cars; {before:.1f} was "
            f"assumed. So two of three further cars of {self.labels[self.answers.best]} pass between {percent(low)} and "
            f"{percent(high)} of their trials."
        ]

    def _learning_remarks(self) -> list[str]:
        learned = self.answers.learned
        more = offered_runs(learned.runs, learned.error)
        if more is None or learned.error is None:
            return []
        return [
            f"The success rate was learned from {learned.runs:,} runs in other realities with a typical error of "
            f"{points_text(learned.error)}: `foldcar sweep --realities {more}` "
            "makes it smaller."
        ]

    def _surprise_remarks(self) -> list[str]:
        return [
            f"{surprise.passed} of {count(surprise.counted, 'trial')} passed at {self.labels[surprise.design]}. The "
            f"trials of all other designs lead one to expect {percent(surprise.expected.low)} to "
            f"{percent(surprise.expected.high)}. Check this car, its trials and the designs beside it."
            for surprise in self.answers.surprises
        ]


def taught(answers: Answers) -> list[str]:
    """Return what the trials have taught about the simulator's unknowns, in sentences."""
    if not answers.driven:
        return []
    sentences = []
    for unknown in sorted(answers.unknowns, key=lambda unknown: -abs(unknown.shift)):
        name, unit = unknown.parameter.name, unknown.parameter.unit
        if unknown.measured is not None and unknown.wrong >= 0.5:
            sentences.append(
                f"The measurement of {name} may be wrong: the trials contradict {unknown.measured:.3g} {unit} "
                f"with a probability of {percent(unknown.wrong)}. Measure it again."
            )
        elif unknown.taught and unknown.measured is None:
            sentences.append(_taught(unknown))
    if answers.grown:
        sentences.append(
            "No reality explains the trials well: the unexplained error had to grow from "
            f"{answers.unexplained[0]:.1f} to {answers.unexplained[1]:.1f} in log-odds. Something is wrong that is not "
            "among the unknowns."
        )
    return sentences


def _taught(unknown: Unknown) -> str:
    """Return a sentence on an unknown that the trials have moved or narrowed."""
    parameter, after, before = unknown.parameter, unknown.after, unknown.before
    # Lengths are a few millimetres.
    factor, unit = {"×": (1.0, "times what is simulated"), "m": (1000.0, "mm")}.get(parameter.unit, (1.0, parameter.unit))
    now, earlier = (estimate_text(factor * part.value, factor * part.low, factor * part.high) for part in (after, before))
    direction = "higher" if after.value > before.value else "lower"
    if abs(unknown.shift) < MOVED:
        return f"The trials narrow {parameter.name} to {now} {unit}; before them it was {earlier}."
    return f"By the trials, {parameter.name} is probably {direction} than assumed: {now} {unit}; before them {earlier}."


def read_belief(
    store: Store, info: ExperimentInfo, family: Sequence[DesignEvidence], trials: Sequence[Trial], simulated: bool
) -> Belief | None:
    """Return the belief about the designs of a family that is swept, or driven within the swept ranges.

    ``trials`` are those that count, ``simulated`` is whether simulated cars drove some of them. Returns None if there
    are too few runs in other realities, or if success is undefined. Raises FoldcarError.
    """
    learned = learned_rate(store, info)
    if learned is None:
        return None
    limits = {name: (min(values), max(values)) for name, values in info.varied.items()}
    inside = [
        index
        for index, design in enumerate(family)
        if all(low <= float(design.design[name]) <= high for name, (low, high) in limits.items())
    ]
    designs = [family[index] for index in inside]
    parameters = numpy.array([[float(design.design[name]) for name in info.varied] for design in designs])
    # A car that `foldcar log` drove has reported the hash of its design, so it was built from the sheets. How other cars
    # were built is unknown, and a simulated car may have any centre of mass.
    from_sheets = not simulated and all(trial.source is None and trial.design_hash for trial in trials)
    drives = read_drives(store, info.id)
    supply = measured_supply(store.path, [] if simulated else trials, drives.value("body", drives.bodies[0]))
    known = built_priors(info.vehicle_type, from_sheets, supply.ratio)
    notes = [] if supply.note is None else [supply.note]
    if len({(design.label, trial.car_name) for design in designs for trial in design.trials}) > MAX_CARS:
        notes.append(f"Of the cars that drove, the {MAX_CARS} with most trials count.")
    measured = measured_values(store, info.listed_id)
    known |= measured_priors(measured, f"{store.path}: measured value")
    parameters = parameters.reshape(len(designs), -1)
    # The swept designs, from which the rate was learned, come first in the family.
    swept = len(learned.design_offsets)
    offsets = numpy.array([learned.design_offsets[index] if index < swept else 0.0 for index in inside])
    # The matrices are so small that threads would only wait for each other.
    with threadpool_limits(1):
        answers = believe(
            learned, parameters, _trials(designs, learned), known, [NAMES.index(name) for name in measured],
            offsets,
        )  # fmt: skip
    return Belief(tuple(designs), numpy.array(inside, int), answers, tuple(notes), measured)


def learned_rate(store: Store, info: ExperimentInfo) -> Learned | None:
    """Return the success rate learned from an experiment's runs in other realities; None with fewer than MIN_LEARNED."""
    if not info.success_defined or not info.stored_runs or info.under is not None:
        return None

    def read() -> Learned | None:
        runs = planned_reality_runs(store, info.id, info.variation_seed, info.environments)
        if len(runs) < MIN_LEARNED:
            return None
        designs = numpy.array(
            [[float(design[name]) for name in info.varied] for design in store.designs(info.id).values()]
        )
        nominal = nominal_runs(info.variation, store.design_counts(info.id))
        with threadpool_limits(1):
            return learn(runs, designs.reshape(len(designs), -1), nominal)

    return store.once(("learned", info.id), read)


def _trials(designs: Sequence[DesignEvidence], learned: Learned) -> Trials:
    """Return the designs' trials, grouped by car and scene."""
    driven = [((row, trial.car_name), trial) for row, design in enumerate(designs) for trial in design.trials]
    trials_of_car = Counter(car for car, _ in driven)
    most = {car for car, _ in trials_of_car.most_common(MAX_CARS)}
    cars = {car: index for index, car in enumerate(car for car in trials_of_car if car in most)}
    passed: Counter[tuple[int, int | None]] = Counter()
    counted: Counter[tuple[int, int | None]] = Counter()
    for car, trial in driven:
        if car in cars:
            passed[cars[car], trial.sample] += trial.passed
            counted[cars[car], trial.sample] += 1
    groups = list(counted)
    easier = [SCENE_TRUST * learned.scene_offsets.get(sample, 0.0) if sample is not None else 0.0 for _, sample in groups]
    return Trials(
        numpy.array([row for row, _ in cars], int),
        tuple(name for _, name in cars),
        numpy.array([car for car, _ in groups], int),
        numpy.array([passed[group] for group in groups], float),
        numpy.array([counted[group] for group in groups], float),
        numpy.array(easier, float),
    )


def why_no_belief(info: ExperimentInfo) -> str:
    """Return a sentence on why nothing is said of built cars, or not more than the rates say."""
    if info.is_over_realities:
        return f"Trials do not change these rates: sweep experiment {info.listed_id} to learn from trials."
    if info.no_realities:
        return f"Nothing is said of built cars: {info.no_realities}."
    return (
        "Nothing is said of built cars: the store has too few runs in other realities to learn from. `foldcar sweep` "
        "adds them."
    )
