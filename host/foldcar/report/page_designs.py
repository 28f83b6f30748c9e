"""The designs of an experiment as columns for the page: values, names, counts with intervals, belief, measures.

Input: an open store. Output: Designs, lists and arrays in the order of the family; designs that only trials have follow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.advice.comparison import compare_evidence
from foldcar.advice.evidence import PairedTrial, by_car, car_remarks, read_evidence, simulated_spread
from foldcar.advice.resimulation import Resimulation
from foldcar.analysis import rate
from foldcar.analysis.built_cars import BuiltCars
from foldcar.analysis.gap import OPTIMISTIC, PESSIMISTIC
from foldcar.analysis.pooled_bias import MOST_POOLED, NONE, Contradictions, PooledBias, contradictions, pooled_bias
from foldcar.analysis.rate import Rate
from foldcar.analysis.smoothed_simulation import SmoothedSimulation, smoothed_simulation
from foldcar.analysis.words import design_text, label_and_unit
from foldcar.report.page_measures import measures
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.frames import RunArrays, run_arrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, SIMULATED, Trial

Design = Mapping[str, float]
NO_RUNS = RunArrays(
    numpy.empty(0, numpy.int64), numpy.empty(0, numpy.int64), numpy.empty(0, numpy.uint8), numpy.empty((0, len(NUMBERS)))
)


@dataclass(frozen=True)
class Designs:
    """``designs`` are the first ``swept`` of the family, then those of ``trials`` only; ``names`` as readers see them."""

    store: Store
    info: ExperimentInfo
    designs: Sequence[Design]
    swept: int
    names: Sequence[str]
    runs: RunArrays
    trials: Sequence[Trial]

    @cached_property
    def values(self) -> dict[str, list[float]]:
        """The values that occur of each parameter that varies, ascending."""
        found = {name: {one[name] for one in self.designs if name in one} for name in self.info.varied}
        return {name: sorted(some) for name, some in found.items()}

    @cached_property
    def ends(self) -> NDArray[Any]:
        """How many runs of each design ended in each way (designs, OUTCOMES)."""
        kinds, number = len(OUTCOMES), len(self.designs)
        counts = numpy.bincount(self.runs.design * kinds + self.runs.outcome, minlength=number * kinds)
        found: NDArray[Any] = counts.reshape(number, kinds)
        return found

    @cached_property
    def counted(self) -> NDArray[Any]:
        """The runs that belong in a rate: passed and all of them (designs, 2)."""
        all_runs = self.ends.sum(axis=1) - self.ends[:, OUTCOMES.index(REJECTED)]
        return numpy.column_stack([self.ends[:, OUTCOMES.index("passed")], all_runs])

    @cached_property
    def elsewhere(self) -> dict[int, str | None]:
        """Trials that do not count here: those driven in another environment than the runs, by number."""
        return self.store.trials_elsewhere(self.info) if self.swept else {}

    @cached_property
    def tried(self) -> NDArray[Any]:
        """The trials of built cars that count: passed and all of them (designs, 2)."""
        return self._tried(BUILT)

    @cached_property
    def pretended(self) -> NDArray[Any]:
        """The trials of simulated cars that are shown, which count in no rate: passed and all of them (designs, 2)."""
        return self._tried(SIMULATED)

    def _tried(self, standing: str) -> NDArray[Any]:
        some = [[trial.outcome == "passed" for trial in mine] for mine in self._counting(standing)]
        return numpy.array([(sum(passed), len(passed)) for passed in some], dtype=int).reshape(-1, 2)

    def car_remarks(self) -> list[str]:
        """What is said of cars of one design."""
        names = zip(self.names, self._counting(BUILT), strict=True)
        of_designs = {name: [trial.car_name for trial in some] for name, some in names}
        return list(car_remarks([one for one in self.cars if one is not None], of_designs))

    def _counting(self, standing: str) -> list[list[Trial]]:
        """The completed trials of that standing by design."""
        found: list[list[Trial]] = [[] for _ in self.designs]
        for trial in self.trials:
            index = self.index_of(trial)
            here = trial.completed and trial.id not in self.elsewhere
            if trial.standing == standing and here and index is not None:
                found[index].append(trial)
        return found

    @cached_property
    def cars(self) -> list[BuiltCars | None]:
        """The trials that count of each design by the car that drove, None without."""
        again = Resimulation(self.store)
        here = self.store.trials_here(self.info) if self.swept and self.trials else set[int]()
        found: list[BuiltCars | None] = []
        for trials, (passed, runs) in zip(self._counting(BUILT), self.counted.tolist(), strict=True):
            simulated = again.cars(self.info, trials, here) if trials and self.swept else None
            shares = {} if simulated is None else simulated.shares
            some = [PairedTrial(one.outcome, None, None, False, shares.get(one.id), one.car_name) for one in trials]
            found.append(by_car(some, simulated_spread(simulated), passed, runs) if some else None)
        return found

    @property
    def interval_name(self) -> str:
        """What the intervals of simulated rates are called."""
        return rate.interval_name(self.info.until is not None)

    def index_of(self, trial: Trial) -> int | None:
        """The place of a trial's design; None if it is of another family."""
        return self._places.get(_key(trial.vehicle_type, trial.design))

    def name_of(self, trial: Trial) -> str:
        """A design of another family for the reader."""
        differing = {name: value for name, value in trial.design.items() if self.info.fixed.get(name) != value}
        of = "" if trial.vehicle_type == self.info.vehicle_type else f"{trial.vehicle_type} of "
        return of + design_text(differing)

    @cached_property
    def _places(self) -> dict[Any, int]:
        return {_key(self.info.vehicle_type, one): index for index, one in enumerate(self.designs)}

    def columns(self, threshold: float) -> dict[str, Any]:
        """The page's columns; a design is good or bad if its belief's interval is on one side of ``threshold``."""
        driven, believed = self.driven, self.believed
        places = {name: {value: at for at, value in enumerate(some)} for name, some in self.values.items()}
        return {
            "value": [[places[name][one[name]] if name in one else None for name in places] for one in self.designs],
            "name": list(self.names),
            "swept": [index < self.swept for index in range(len(self.designs))],
            "runs": self.counted[:, 1].tolist(),
            "passed": self.counted[:, 0].tolist(),
            "rate": [round(p / n, 6) if n else None for p, n in self.counted.tolist()],
            "low": [one and one[0] for one in self.simulated],
            "high": [one and one[1] for one in self.simulated],
            "outcomes": self.ends.T.tolist(),
            "trials": self.tried[:, 1].tolist(),
            "trials_passed": self.tried[:, 0].tolist(),
            "cars": [0 if one is None else len(one.passed) for one in self.cars],
            "trials_low": [one and one[0] for one in driven],
            "trials_high": [one and one[1] for one in driven],
            "belief": [one and one[0] for one in believed],
            "belief_low": [one and one[1] for one in believed],
            "belief_high": [one and one[2] for one in believed],
            "verdict": [
                "open" if one is not None and at in self.contradicting.beside else verdict(one, threshold)
                for at, one in enumerate(self.judged)
            ],
            "refuted": [self.refuted.get(name) for name in self.names],
            "measures": measures(self.store, self.info, self.designs, self.runs),
        }

    @cached_property
    def simulated(self) -> list[tuple[float, float] | None]:
        """The 95 % interval of each design's simulated rate."""
        return self.intervals(self.counted, self.info.until is not None)

    @cached_property
    def driven(self) -> list[tuple[float, float] | None]:
        """The 95 % interval of the rate of the cars that drove the trials that count, by design."""
        return self.intervals(self.tried)

    @cached_property
    def believed(self) -> list[tuple[float, float, float] | None]:
        """What is believed of a further built car of each design: rate, low, high, by simulation and trials together.

        Also before trials that allows for what simulation may be wrong by. A design without runs has its trials alone.
        """
        rates: dict[int, Rate] = {}
        for index, (cars, ends) in enumerate(zip(self.cars, self.driven, strict=True)):
            if not self.counted[index, 1] and ends is not None and cars is not None:
                rates[index] = cars.rate()
        if self.bias is not None:
            rates |= dict(zip(self.known.tolist(), self.bias.rates(least=0), strict=True))
        known = [rates.get(index) for index in range(len(self.designs))]
        return [None if rate is None else _rounded(rate) for rate in known]

    @cached_property
    def judged(self) -> list[tuple[float, float, float] | None]:
        """What a design is called good or bad by: the belief once there are trials, before that simulation's rate."""
        if self.pooled is not None:
            return self.believed
        return [
            believed if ends is None else (round(passed / runs, 6), *ends)
            for believed, (passed, runs), ends in zip(self.believed, self.counted.tolist(), self.simulated, strict=True)
        ]

    @cached_property
    def known(self) -> NDArray[Any]:
        """The designs with runs that count, by index."""
        return numpy.flatnonzero(self.counted[:, 1])

    @property
    def pooled(self) -> PooledBias | None:
        """What trials and simulation say together of the designs with runs; None if no such design was driven."""
        return self.bias if self.tried[self.known, 1].any() else None

    @cached_property
    def contradicting(self) -> Contradictions:
        """The driven designs whose trials contradict the others', and those beside them."""
        known = self.known
        if not self.info.success_defined or not self.info.varied:
            return NONE
        simulation = self._smoothed
        found = contradictions(self._known_values, self.counted[known], self.tried[known], self._known_cars, simulation)
        return Contradictions(tuple(known[list(found.designs)].tolist()), tuple(known[list(found.beside)].tolist()))

    @cached_property
    def bias(self) -> PooledBias | None:
        """The difference of trials and simulation at the designs with runs, before trials that it may have."""
        known = self.known
        if not len(known) or not self.info.success_defined:
            return None
        # Of many driven designs those with most trials tell most.
        told = known[numpy.argsort(-self.tried[known, 1], kind="stable")][:MOST_POOLED]
        trials = numpy.where(numpy.isin(known, told)[:, None], self.tried[known], 0)
        return pooled_bias(self._known_values, self.counted[known], trials, self._known_cars, self._smoothed)

    @cached_property
    def _smoothed(self) -> SmoothedSimulation:
        """Simulation's success at the designs with runs, smoothed over them."""
        runs, known = self.runs, self.known
        samples, environment = numpy.unique(runs.sample, return_inverse=True)
        passed = numpy.full((len(self.designs), len(samples)), numpy.nan)
        counts = runs.outcome != OUTCOMES.index(REJECTED)
        passed[runs.design[counts], environment[counts]] = runs.outcome[counts] == OUTCOMES.index("passed")
        return smoothed_simulation(self._known_values, self.counted[known].astype(float), passed[known])

    @property
    def _known_values(self) -> NDArray[Any]:
        """The varied parameters (known, k) of the designs with runs."""
        x = numpy.array([[self.designs[index][name] for name in self.values] for index in self.known.tolist()])
        return x.reshape(len(self.known), len(self.values))

    @property
    def _known_cars(self) -> list[BuiltCars | None]:
        return [self.cars[index] for index in self.known.tolist()]

    @cached_property
    def refuted(self) -> dict[str, str]:
        """How trials contradict simulation, by the name of the design, as `foldcar compare` has it: all hold together."""
        if not self.swept or not self.trials:
            return {}
        (found,) = compare_evidence(read_evidence(self.store, self.info.id)).experiments
        return {one.label: one.verdict for one in found.designs if one.verdict in (OPTIMISTIC, PESSIMISTIC)}

    def intervals(self, counts: NDArray[Any], stopped: bool = False) -> list[tuple[float, float] | None]:
        """The 95 % interval of each rate of (designs, 2) passed and all; None where success or the rate is undefined."""
        if not self.info.success_defined:
            return [None] * len(counts)
        found: list[tuple[float, float] | None] = []
        for passed, number in counts.tolist():
            ends = rate.rate_interval(passed, number, stopped) if number else None
            found.append(ends and (round(ends[0], 6), round(ends[1], 6)))
        return found


def read_designs(store: Store, info: ExperimentInfo, trials: Sequence[Trial]) -> Designs:
    """The designs of an experiment and those of the same family that only ``trials`` have. StoreError."""
    # An experiment that has trials only is not among the swept ones.
    runs = run_arrays(store, info.id) if info.id in store.experiment_ids() else NO_RUNS
    family: list[Design] = [{name: float(x) for name, x in one.items()} for one in store.designs(info.id).values()]
    known = {_key(info.vehicle_type, one) for one in family}
    others: dict[Any, Design] = {}
    for trial in trials:
        key = _key(trial.vehicle_type, trial.design)
        same = all(trial.design.get(name) == value for name, value in info.fixed.items())
        if key not in known and same and trial.vehicle_type == info.vehicle_type:
            others.setdefault(key, trial.design)
    designs = [*family, *others.values()]
    names = [design_text({name: one[name] for name in info.varied if name in one}) for one in designs]
    return Designs(store, info, designs, len(family), names, runs, trials)


def parameter_columns(designs: Designs) -> list[dict[str, Any]]:
    """The parameters that vary, with all values that occur."""
    found = []
    for name, values in designs.values.items():
        label, unit = label_and_unit(name)
        found.append({"name": name, "label": label, "unit": unit, "values": values})
    return found


def verdict(believed: tuple[float, float, float] | None, threshold: float) -> str | None:
    """Whether a design is good, bad or open, by the interval of what is believed of it."""
    if believed is None:
        return None
    _, low, high = believed
    return "good" if low > threshold else "bad" if high < threshold else "open"


def _rounded(rate: Rate) -> tuple[float, float, float]:
    return round(rate.value, 6), round(rate.low, 6), round(rate.high, 6)


def _key(vehicle_type: str, design: Design) -> Any:
    return vehicle_type, tuple(sorted(design.items()))
