"""Which designs are worth building next, and why, in words: before any trial, and again after each round of them.

Input: a store, or its evidence. Output: a Selection of each swept experiment. Before trials it names the middle, the
edges and the outside of the feasible region, as the publication of the width study chose; after trials the designs
whose trials would tell most about which design is best and which ones reach the threshold.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy
from threadpoolctl import threadpool_limits

from foldcar.advice.evidence import Design, Evidence, read_evidence
from foldcar.advice.outlook import Outlook, outlook
from foldcar.advice.reasons import Undecided, first_reason, next_reason, region_text, undecided_text
from foldcar.analysis.built_cars import PRIOR, SPREADS
from foldcar.analysis.pooled_bias import MOST_POOLED
from foldcar.analysis.rate import Rate, rate_interval
from foldcar.analysis.selection import (
    BATCHES,
    Effort,
    Placed,
    choose,
    correlation_within_cars,
    expected_loss,
    first_designs,
    further_effort,
    gain_per_hour,
    honest_best,
    telling_environments,
    trials_needed,
    trials_to_tell,
)
from foldcar.analysis.words import count, listed, percent, points, rate_text
from foldcar.calibration.parameters import MEASURABLE
from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.simulation.results import no_rate_text
from foldcar.store.calibrations import measured_values
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store

BUILD, THRESHOLD, PRECISION = 4, 0.75, 0.15
# Trials whose information is compared between designs: what an afternoon allows.
ROUND_TRIALS = 10
# It is enough when the leader lacks no more on average (0 to 1; or the precision, if that is less), and an hour of work
# wins less of success by a better leader, or of designs put right.
MOST_LOSS, LEAST_GAIN = 0.05, 0.01
NEXT = "next"
MACHINE = "silhouette"
# Assumptions, to be replaced by one's own experience: a desktop cutter in film (mm/s), folding, wiring and finding the
# neutrals of a car's servos, and placing the obstacles of a trial (minutes).
CUTTING_MM_S, ASSEMBLY_MIN, PLACING_MIN = 20.0, 90.0, 3.0
BASIS = (
    "Sheets: 12 x 12 inch, 12 x 24 where a piece is longer, as `foldcar pattern` nests them. Minutes assume cutting at "
    f"{CUTTING_MM_S:g} mm/s, {ASSEMBLY_MIN:g} min to fold, wire and adjust a car, {PLACING_MIN:g} min to place a trial, "
    "and the time that simulation drives."
)


@dataclass(frozen=True)
class Cost:
    """``sheets`` of film, 0 where no car is to be built; ``minutes`` for the cars and the trials."""

    sheets: int
    minutes: int


@dataclass(frozen=True)
class Recommendation:
    """A design to try. ``place`` is one of :mod:`foldcar.analysis.selection`, or NEXT after trials; ``reason`` says why.

    ``expected`` is the rate that trials and simulation give together, None before two designs were driven. ``cars`` more
    and ``trials`` more in all bring its interval to the precision asked for; ``built``: trials of this design are there.
    ``cost`` None: the car cannot be cut, or was not nested.
    """

    label: str
    design: Design
    place: str
    reason: str
    simulated: Rate
    expected: Rate | None
    built: bool
    trials_done: int
    cars: int
    trials: int
    cost: Cost | None


@dataclass(frozen=True)
class Selection:
    """The advice for one experiment: the answer in ``sentence``, then what it rests on.

    ``enough`` says that more trials are not worth their time; then there are no recommendations. ``environments`` are the
    samples to set up for all recommended designs, ``telling`` of them tell the designs apart in simulation. ``leader``:
    the best design by trials and simulation together; ``loss``: how much (0 to 1) it lacks on average to the best there
    may be. ``gain``: what an hour of work wins at most, as LEAST_GAIN. All three are None before trials. ``undecided``:
    the designs whose interval holds the threshold.
    """

    info: ExperimentInfo
    threshold: float
    precision: float
    recommendations: tuple[Recommendation, ...]
    environments: tuple[int, ...]
    telling: int
    enough: bool
    leader: Design | None
    loss: float | None
    gain: float | None
    undecided: tuple[Undecided, ...]
    sentence: str
    remarks: tuple[str, ...]


def select(
    store: Store,
    build: int = BUILD,
    threshold: float | None = None,
    precision: float = PRECISION,
    experiment: str | None = None,
    with_cost: bool = True,
    simulated_trials: bool = False,
) -> list[Selection]:
    """Advice for every swept experiment, or one: up to ``build`` designs each; none if nothing was swept.

    ``threshold`` (0 to 1) is the success that a good design reaches; None: the listing's highest, or THRESHOLD.
    ``precision`` is the half-width (0 to 0.5) to which trials are to bring a rate. ``simulated_trials``: go by trials of
    simulated cars instead of built ones. FoldcarError.
    """
    evidence = read_evidence(store, experiment, simulated_trials)
    found = select_evidence(evidence, build, threshold, precision, with_cost)
    if not simulated_trials:
        found = [replace(one, remarks=(*measure_first(store, one), *one.remarks)) for one in found]
    return [replace(one, sentence=f"SIMULATED trials. {one.sentence}") for one in found] if simulated_trials else found


def measure_first(store: Store, selection: Selection) -> list[str]:
    """Return a remark that names what was not measured of the built cars and obstacles, if more trials are advised."""
    missing = [name for name in MEASURABLE if name not in measured_values(store, selection.info.listed_id)]
    # There is no leader before trials.
    if not missing or selection.leader is None or not selection.recommendations:
        return []
    return [f"Measure first, before more trials: {listed(missing)} (`foldcar trials measure`)."]


def select_evidence(
    evidence: Sequence[Evidence],
    build: int = BUILD,
    threshold: float | None = None,
    precision: float = PRECISION,
    with_cost: bool = True,
) -> list[Selection]:
    """As :func:`select`, from evidence that was read; ``with_cost`` nests the sheets, a second a car."""
    found = []
    for one in evidence:
        limit = threshold if threshold is not None else max(one.info.thresholds, default=THRESHOLD)
        seen = outlook(one) if one.info.success_defined else None
        if seen is None:
            nothing = None, None, None, (), _nothing(one)
            found.append(Selection(one.info, limit, precision, (), (), 0, False, *nothing, one.remarks))
        else:
            choice = _Choice(one, seen, limit, precision)
            # Threads for matrices of some tens of rows only wait for each other.
            with threadpool_limits(1):
                found.append(choice.selection(build, with_cost))
    return found


def _nothing(one: Evidence) -> str:
    if not one.info.success_defined:
        return "Nothing to select: success is undefined in this environment, so that no design is better than another."
    if one.info.stored_runs:
        return f"Nothing to select: {no_rate_text(one.info.stored_runs)}."
    return "Nothing to select: no runs are stored yet; sweep the listing with `foldcar sweep`."


@dataclass(frozen=True)
class _Choice:
    """What one experiment's selection is made of."""

    evidence: Evidence
    seen: Outlook
    threshold: float
    precision: float

    def selection(self, build: int, with_cost: bool) -> Selection:
        seen, enough, leader, loss, gain = self.seen, False, None, None, None
        if seen.driven:
            best, loss = expected_loss(seen.draws)
            leader, gain = seen.designs[best].design, self._gain
            enough = seen.pooled is not None and loss <= min(MOST_LOSS, self.precision) and gain < LEAST_GAIN
        placed = [] if enough else self._placed(build)
        recommended = tuple(self._recommendation(one, with_cost) for one in placed)
        rows = [one.index for one in placed]
        met = {trial.sample for index in rows for trial in seen.designs[index].trials}
        known = [index for index, sample in enumerate(seen.samples) if sample in met]
        wanted = max((one.trials for one in recommended), default=0)
        columns = telling_environments(seen.passed[rows], wanted, known) if rows else []
        telling = int(sum(numpy.ptp(seen.passed[rows][:, column]) > 0 for column in columns))
        samples = tuple(int(seen.samples[column]) for column in columns)
        info, remarks = self.evidence.info, self._remarks(recommended, wanted, len(samples))
        sentence = self._sentence(recommended, enough, loss)
        return Selection(
            info, self.threshold, self.precision, recommended, samples, telling, enough, leader, loss, gain,
            self._undecided, sentence, remarks,
        )  # fmt: skip

    def _placed(self, build: int) -> list[Placed]:
        """The designs, the most useful first."""
        seen, first = self.seen, []
        if not seen.driven:
            rate, low, high = seen.smooth.T
            # How little is known of each design's side of the threshold.
            doubt = 1 / (1 + numpy.abs(rate - self.threshold) / numpy.maximum(high - low, 1e-9))
            first = first_designs(seen.parameters, rate, doubt, self.threshold)[:build]
        taken = [one.index for one in first]
        zone = self.precision if seen.driven else 0.0
        more = choose(seen.draws, self.threshold, ROUND_TRIALS, build - len(first), taken, zone=zone)
        return [*first, *(Placed(index, NEXT) for index in more)]

    @cached_property
    def _gain(self) -> float:
        """What an hour of work wins at most."""
        each_min = [trial_min(one.mean_time_s) for one in self.seen.designs]
        work = [[self._effort(at, n).work_min(ASSEMBLY_MIN, one) for at, one in enumerate(each_min)] for n in BATCHES]
        return gain_per_hour(self.seen.draws, self.threshold, self.precision, work)

    def _effort(self, index: int, further: int, least: int = 0) -> Effort:
        """The work for so many further independent trials of a design, or ``least`` in all."""
        one = self.seen.designs[index]
        driven = [] if one.cars is None else one.cars.counted.astype(int).tolist()
        return further_effort(further, self._alike[index], ASSEMBLY_MIN, trial_min(one.mean_time_s), driven, least)

    @cached_property
    def _alike(self) -> list[float]:
        """The correlation of trials of one car, by design; where no cars were simulated, as the others' differ."""
        own = [None if one.spread is PRIOR else float(one.spread @ SPREADS) for one in self.seen.designs]
        known = [spread for spread in own if spread is not None]
        if not known:
            return [0.0] * len(own)
        spreads = [sum(known) / len(known) if spread is None else spread for spread in own]
        # Some of the draws are enough.
        some = self.seen.draws[::10].T
        return [correlation_within_cars(rates, spread) for rates, spread in zip(some, spreads, strict=True)]

    @cached_property
    def _undecided(self) -> tuple[Undecided, ...]:
        """The designs whose rate may lie on both sides of the threshold, or is not to be trusted."""
        seen, limit, zone, found = self.seen, self.threshold, self.precision, []
        for index, (one, known) in enumerate(zip(seen.designs, seen.pooled or (), strict=False)):
            doubted = index in seen.contradicting.beside
            if doubted or known.low < limit <= known.high:
                more = max(1, trials_to_tell(seen.draws[:, index], limit) - len(one.trials))
                at = not doubted and limit - zone <= known.low and known.high <= limit + zone
                found.append(Undecided(one.label, one.design, at, more))
        return tuple(found)

    def _recommendation(self, placed: Placed, with_cost: bool) -> Recommendation:
        seen, index = self.seen, placed.index
        one = seen.designs[index]
        expected = None if seen.pooled is None else seen.pooled[index]
        done = len(one.trials)
        effort = self._effort(index, 1, trials_needed(seen.draws[:, index], self.precision))
        if placed.place == NEXT:
            reason = next_reason(seen, index, self.threshold)
        else:
            reason = first_reason(placed.place, one, self.evidence.info.simulation)
        if effort.cars + bool(done) > 1:
            reason += f"; {effort.each} trials of each car, as cars of one design differ"
        price = cost(one.vehicle_type, one.design, effort, one.mean_time_s) if with_cost else None
        return Recommendation(
            one.label, one.design, placed.place, reason, one.simulated(), expected, bool(done), done, effort.cars,
            effort.trials, price,
        )  # fmt: skip

    def _remarks(self, recommended: Sequence[Recommendation], wanted: int, environments: int) -> tuple[str, ...]:
        seen, info = self.seen, self.evidence.info
        remarks = [region_text(seen, self.threshold, self.evidence.parameters, info.simulation)]
        best, passed, number = honest_best(seen.passed)
        if number and len(seen.designs) > 1:
            rate = rate_text(passed / number, *rate_interval(passed, number, info.until is not None))
            remarks.append(
                f"Best in {info.simulation}: {seen.designs[best].label}, {rate}, chosen in one half of the environments "
                "and counted in the other."
            )
        if seen.thinned:
            left = f"{count(seen.thinned, 'design')} between these were left out of the choice, to save time"
            driven = sum(bool(one.trials) for one in seen.designs)
            most = f"; of the driven ones the {MOST_POOLED} with most trials count" if driven == MOST_POOLED else ""
            remarks.append(f"{left}{most}.")
        if all(one.spread is PRIOR for one in seen.designs):
            remarks.append(
                "Cars and trials are planned as if all cars of a design were alike: how they differ is not simulated."
            )
        if environments < wanted:
            remarks.append(f"Only {environments} environments are left that no chosen car has met: sweep more of them.")
        remarks += seen.contradicting.remark([one.label for one in seen.designs])
        return (*remarks, *self.evidence.remarks)

    def _sentence(self, recommended: Sequence[Recommendation], enough: bool, loss: float | None) -> str:
        seen, limit, simulation = self.seen, percent(self.threshold), self.evidence.info.simulation
        # In the order of the family, not of use.
        order = {one.label: row for row, one in enumerate(seen.designs)}
        named = listed(sorted((one.label for one in recommended), key=order.__getitem__))
        if loss is None and not (seen.smooth[:, 0] >= self.threshold).any():
            return f"Build {named}: no trials yet, and no design reaches {limit} in {simulation}; first the best."
        if loss is None:
            return f"Build {named}: no trials yet, so these mark the region that reaches {limit} in {simulation}."
        best, _ = expected_loss(seen.draws)
        known = None if seen.pooled is None else seen.pooled[best]
        shown = "" if known is None else f" with {rate_text(known.value, known.low, known.high)}"
        leads = f"by trials and {simulation} together {seen.designs[best].label} leads{shown}"
        loses = f"to settle for it loses {points(loss, sign=False)} points on average against the best there may be"
        if not enough:
            return f"Next, try {named}: {leads}; {loses}, and an hour of work may win {100 * self._gain:.1f}."
        rates, unsure = zip(seen.designs, seen.pooled or (), strict=True), {one.label for one in self._undecided}
        above = [one.label for one, known in rates if known.low >= self.threshold and one.label not in unsure]
        reach = f"{listed(above)} reach" if len(above) > 1 else f"{above[0] if above else 'no design'} reaches"
        rest, worth = undecided_text(self._undecided, self.precision), points(LEAST_GAIN, sign=False)
        return f"Enough: {reach} {limit}, {rest}; {leads}; {loses}, and an hour of work wins less than {worth} point."


def trial_min(drive_s: float | None) -> float:
    """The minutes of a trial of ``drive_s`` (None: unknown, then without)."""
    return PLACING_MIN + (drive_s or 0.0) / 60


def cost(vehicle_type: str, design: Mapping[str, float | str], effort: Effort, drive_s: float | None) -> Cost | None:
    """The cost of cars and trials of ``drive_s`` each (None: unknown); None if they cannot be cut."""
    driving_min = effort.trials * trial_min(drive_s)
    if not effort.cars:
        return Cost(0, math.ceil(driving_min))
    # Sheets take half a second to import, and a report has none.
    from foldcar.fabrication.patterns.options import options
    from foldcar.fabrication.patterns.sheets import on_a_larger_sheet, pattern

    try:
        composed = compose_columns(vehicle_type, design)
        folded = folded_car(composed)
        cut = pattern(folded, on_a_larger_sheet(folded, options(MACHINE)), composed.title)
    except (FoldcarError, ValueError):
        return None
    cutting_min = cut.cut_length_mm / CUTTING_MM_S / 60
    return Cost(effort.cars * len(cut.sheets), math.ceil(effort.cars * (cutting_min + ASSEMBLY_MIN) + driving_min))
