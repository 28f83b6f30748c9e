"""The belief about an experiment's designs: its realities, weighed by its trials and by what was measured.

`select`, `compare`, `log`, the report and the API read their answers from it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from foldcar.belief.answers import MOVED, Answers, Estimate, Unknown, believe
from foldcar.belief.learning import Learned, learn, nominal_runs
from foldcar.belief.priors import NAMES, built_priors, measured_priors
from foldcar.belief.trials import Trials
from foldcar.belief.weighing import SCENE_TRUST
from foldcar.evidence.design_evidence import Design, DesignEvidence, PairedTrial
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
# A measurement is doubted if it is more probably wrong than right.
DOUBTED_MEASUREMENT = 0.5


class DrivenCar(NamedTuple):
    """A built car with trials: the index of its design in the belief, and its name, None if it has none."""

    design_index: int
    name: str | None


class TrialGroup(NamedTuple):
    """The trials of one car in one scene: the index of the car, and the sample, None if unknown."""

    car_index: int
    sample: int | None


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
        for row, own_design in enumerate(self.designs):
            if own_design is design or own_design.label == design.label:
                return row
        return None

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
        """Return a sentence on how much cars of one design differ, or nothing if only one car of each design drove."""
        trials = self.answers.trials
        driven_cars, driven_designs = len(trials.design), len(trials.driven)
        if driven_cars == driven_designs:
            return []
        # By how much cars of one design differ: what was assumed before the trials, and what the trials have taught.
        assumed_sd, learned_sd = self.answers.car_sd
        best = self.answers.best
        low, high = self.answers.single_cars(best)
        return [
            f"Cars of one design differ by {learned_sd:.1f} in log-odds, by the trials of several cars; {assumed_sd:.1f} "
            f"was assumed. So about two thirds of the further cars of {self.labels[best]} pass between "
            f"{percent(low)} and {percent(high)} of their trials."
        ]

    def _learning_remarks(self) -> list[str]:
        """Return a sentence on the error of the learned success rate; an empty list if more runs would not reduce it."""
        learned = self.answers.learned
        advised_runs = offered_runs(learned.runs, learned.error)
        if advised_runs is None or learned.error is None:
            return []
        return [
            f"The success rate was learned from {learned.runs:,} runs in other realities with a typical error of "
            f"{points_text(learned.error)}: `foldcar sweep --realities {advised_runs}` makes it smaller."
        ]

    def _surprise_remarks(self) -> list[str]:
        """Return a sentence on each design whose trials contradict what all other trials lead one to expect."""
        sentences = []
        for surprise in self.answers.surprises:
            expected = surprise.expected
            sentences.append(
                f"{surprise.passed} of {count(surprise.counted, 'trial')} passed at {self.labels[surprise.design]}. The "
                f"trials of all other designs lead one to expect {percent(expected.low)} to {percent(expected.high)}. "
                "Check this car, its trials and the designs beside it."
            )
        return sentences


def taught(answers: Answers) -> list[str]:
    """Return what the trials have taught about the simulator's unknowns, in sentences."""
    if not answers.driven:
        return []
    sentences = []
    for unknown in sorted(answers.unknowns, key=lambda unknown: -abs(unknown.shift)):
        parameter = unknown.parameter
        if unknown.measured is not None and unknown.wrong >= DOUBTED_MEASUREMENT:
            sentences.append(
                f"The measurement of {parameter.name} may be wrong: the trials contradict {unknown.measured:.3g} "
                f"{parameter.unit} with a probability of {percent(unknown.wrong)}. Measure it again."
            )
        elif unknown.taught and unknown.measured is None:
            sentences.append(_change_text(unknown))
    if answers.unexplained_has_grown:
        error_before, error_after = answers.unexplained
        sentences.append(
            f"No reality explains the trials well: the unexplained error had to grow from {error_before:.1f} to "
            f"{error_after:.1f} in log-odds. Something is wrong that is not among the unknowns."
        )
    return sentences


def _change_text(unknown: Unknown) -> str:
    """Return a sentence on how the trials have moved or narrowed an unknown parameter of the simulator."""
    name, unit, factor = unknown.parameter.name, unknown.parameter.unit, 1.0
    if unit == "×":
        unit = "times what is simulated"
    elif unit == "m":
        # The lengths among the unknowns are a few millimetres.
        unit, factor = "mm", 1000.0
    before_text = _scaled_text(unknown.before, factor)
    after_text = _scaled_text(unknown.after, factor)
    if abs(unknown.shift) < MOVED:
        return f"The trials narrow {name} to {after_text} {unit}; before them it was {before_text}."
    direction = "higher" if unknown.after.value > unknown.before.value else "lower"
    return f"By the trials, {name} is probably {direction} than assumed: {after_text} {unit}; before them {before_text}."


def _scaled_text(estimate: Estimate, factor: float) -> str:
    """Return an estimate and its interval, multiplied by ``factor``, such as ``0.85 (0.7 to 1)``."""
    return estimate_text(factor * estimate.value, factor * estimate.low, factor * estimate.high)


def read_belief(
    store: Store, info: ExperimentInfo, family: Sequence[DesignEvidence], trials: Sequence[Trial], simulated: bool
) -> Belief | None:
    """Return the belief about the designs of a family, or None if there is nothing to learn from.

    The belief has the swept designs, and the driven designs whose parameters lie within the ranges of the sweep.
    ``trials`` are the trials that count. ``simulated`` is whether simulated cars drove some of them. There is nothing to
    learn from if success is undefined, or if there are too few runs in other realities. Raises FoldcarError.
    """
    learned = learned_rate(store, info)
    if learned is None:
        return None
    design_indices = _indices_within_swept_ranges(info, family)
    designs = [family[index] for index in design_indices]
    # A car that `foldcar log` drove has reported the hash of its design, so it was built from the sheets. How other cars
    # were built is unknown, and a simulated car may have any centre of mass.
    from_sheets = not simulated and all(trial.source is None and trial.design_hash for trial in trials)
    drives = read_drives(store, info.id)
    first_body = drives.value("body", drives.bodies[0])
    supply = measured_supply(store.path, [] if simulated else trials, first_body)
    notes = [] if supply.note is None else [supply.note]
    cars = {(design.label, trial.car_name) for design in designs for trial in design.trials}
    if len(cars) > MAX_CARS:
        notes.append(f"Of the cars that drove, the {MAX_CARS} with most trials count.")
    measured = measured_values(store, info.listed_id)
    if measured:
        notes.append(_measured_text(measured))
    priors = built_priors(info.vehicle_type, from_sheets, supply.ratio)
    priors |= measured_priors(measured, f"{store.path}: measured value")
    # The swept designs, from which the rate was learned, come first in the family.
    swept = len(learned.design_offsets)
    offsets = [learned.design_offsets[index] if index < swept else 0.0 for index in design_indices]
    # The matrices are so small that threads would only wait for each other.
    with threadpool_limits(1):
        answers = believe(
            learned,
            designs=_varied_values(info, [design.design for design in designs]),
            trials=_trials(designs, learned),
            known=priors,
            measured=[NAMES.index(name) for name in measured],
            offsets=numpy.array(offsets),
        )
    return Belief(tuple(designs), numpy.array(design_indices, int), answers, tuple(notes), measured)


def _measured_text(measured: Mapping[str, float]) -> str:
    """Return a sentence that names the measured values, and says when they are out of date.

    A measured value compares the built with the planned. The store does not know which plan it was compared with.
    """
    values = ", ".join(f"{name} {value:g}" for name, value in measured.items())
    return (
        f"Measured values count: {values}. They are relative to what is simulated now. If you have changed the "
        "environment or the car since you measured, measure again."
    )


def _indices_within_swept_ranges(info: ExperimentInfo, family: Sequence[DesignEvidence]) -> list[int]:
    """Return the indices of the designs whose varied parameters all lie between the lowest and highest swept values."""
    indices = []
    for index, design in enumerate(family):
        if all(min(values) <= float(design.design[name]) <= max(values) for name, values in info.varied.items()):
            indices.append(index)
    return indices


def _varied_values(info: ExperimentInfo, designs: Sequence[Design]) -> NDArray[Any]:
    """Return the values of the varied parameters of each design (designs, varied parameters)."""
    rows = [[float(design[name]) for name in info.varied] for design in designs]
    # Without varied parameters, each row is empty.
    return numpy.array(rows).reshape(len(designs), -1)


def learned_rate(store: Store, info: ExperimentInfo) -> Learned | None:
    """Return the success rate that is learned from an experiment's runs in other realities.

    A *reality* is a set of values of what the simulator does not know exactly, such as friction. The runs with the
    assumed values, which are called nominal, are used for learning, too. Returns None if the experiment defines no
    success, has no runs, was itself simulated in another reality, or has fewer than MIN_LEARNED runs in other realities.
    """
    is_in_other_reality = info.under is not None
    if not info.success_defined or not info.stored_runs or is_in_other_reality:
        return None

    def read() -> Learned | None:
        """Read the runs from the store and learn from them."""
        runs = planned_reality_runs(store, info.id, info.variation_seed, info.environments)
        if len(runs) < MIN_LEARNED:
            return None
        designs = list(store.designs(info.id).values())
        nominal = nominal_runs(info.variation, store.design_counts(info.id))
        with threadpool_limits(1):
            return learn(runs, _varied_values(info, designs), nominal)

    return store.once(("learned", info.id), read)


def _trials(designs: Sequence[DesignEvidence], learned: Learned) -> Trials:
    """Return the trials of the designs, grouped by car and scene.

    If there are more than MAX_CARS cars, only the trials of those with most trials are returned.
    """
    trials_by_car: dict[DrivenCar, list[PairedTrial]] = {}
    for design_index, design in enumerate(designs):
        for trial in design.trials:
            trials_by_car.setdefault(DrivenCar(design_index, trial.car_name), []).append(trial)
    most_first = sorted(trials_by_car, key=lambda car: -len(trials_by_car[car]))
    chosen_cars = set(most_first[:MAX_CARS])
    cars = [car for car in trials_by_car if car in chosen_cars]
    # The number of trials of each group, and how many of them passed.
    counted: Counter[TrialGroup] = Counter()
    passed: Counter[TrialGroup] = Counter()
    for car_index, car in enumerate(cars):
        for trial in trials_by_car[car]:
            group = TrialGroup(car_index, trial.sample)
            counted[group] += 1
            passed[group] += trial.passed
    groups = list(counted)
    return Trials(
        design=numpy.array([car.design_index for car in cars], int),
        names=tuple(car.name for car in cars),
        car=numpy.array([group.car_index for group in groups], int),
        passed=numpy.array([passed[group] for group in groups], float),
        counted=numpy.array([counted[group] for group in groups], float),
        scene_ease=numpy.array([_scene_ease(group.sample, learned) for group in groups], float),
    )


def _scene_ease(sample: int | None, learned: Learned) -> float:
    """Return how much easier the scene of a sample is than an average scene, in log-odds; 0 if it is unknown."""
    if sample is None:
        return 0.0
    return SCENE_TRUST * learned.scene_offsets.get(sample, 0.0)


def why_no_belief(info: ExperimentInfo) -> str:
    """Return a sentence on why there is no belief about built cars."""
    if info.is_over_realities:
        return f"Trials do not change these rates: sweep experiment {info.listed_id} to learn from trials."
    if info.no_realities:
        return f"Nothing is said of built cars: {info.no_realities}."
    return (
        "Nothing is said of built cars: the store has too few runs in other realities to learn from. `foldcar sweep` "
        "adds them."
    )
