"""Choose which designs to build next for one experiment, and put the advice into words.

Input: the evidence of an experiment and the belief about its designs. Output: a Selection.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy
from numpy.typing import NDArray

from foldcar.inference.belief import Belief
from foldcar.inference.comparison import compare_experiment
from foldcar.inference.costs import FILLING, PLACING_MIN, Cost, car_min, cost, trial_min
from foldcar.inference.design_evidence import Design
from foldcar.inference.evidence import Evidence
from foldcar.inference.sentences import Undecided, first_reason, grounds, headline, next_reason, undecided_text
from foldcar.statistics.built_cars import PRIOR, SPREADS
from foldcar.statistics.pooled_bias import MAX_POOLED
from foldcar.statistics.rate import Rate, rate_interval
from foldcar.statistics.selection import (
    BATCHES,
    Effort,
    Placed,
    choose_designs,
    correlation_within_cars,
    expected_loss,
    first_designs,
    further_effort,
    gain_per_hour,
    informative_environments,
    split_sample_best,
    trials_needed,
    trials_to_decide,
)
from foldcar.statistics.words import count, listed, percent, points, rate_text
from foldcar.store.info import ExperimentInfo

# Designs to build next are compared by the gain from this many trials, an afternoon's work.
ROUND_TRIALS = 10
# Undriven designs that are considered; of more, evenly spaced ones, because the work grows with the number of pairs.
MAX_CANDIDATES = 400
# Trials are enough if the leader's expected loss (0 to 1) is at most MAX_LOSS and the precision, and an hour of work
# gains less than MIN_GAIN: in the leader's rate, or in the fraction of designs on the right side of the threshold.
MAX_LOSS, MIN_GAIN = 0.05, 0.01
# A design is not worth building if its chances to reach the threshold and to be the best (0 to 1) are both smaller.
MIN_CHANCE = 0.025
NEXT = "next"


@dataclass(frozen=True)
class Recommendation:
    """A design to try next.

    ``place`` is its place in the feasible region (:mod:`foldcar.statistics.selection`), or NEXT after trials; ``reason``
    explains it. ``simulated`` is the rate of its runs, ``expected`` the rate of a new car by simulation and trials.
    ``cars`` new cars with ``trials`` new trials in all narrow its interval to the wanted precision. ``built`` is whether
    it was driven before. ``cost`` is None if the car cannot be folded.
    """

    label: str
    design: Design
    place: str
    reason: str
    simulated: Rate
    expected: Rate
    built: bool
    trials_done: int
    cars: int
    trials: int
    cost: Cost | None


@dataclass(frozen=True, repr=False)
class Selection:
    """The advice for one experiment; print it to read it.

    ``headline`` is the answer, ``grounds`` the evidence for it, ``next_step`` what to do. ``enough`` is whether further
    trials are not worth their time; then there are no recommendations. ``environments`` are the samples to set up for the
    recommended designs; in the first ``telling`` of them the designs' simulated results differ. ``leader`` is the best
    design by trials and simulation. ``loss`` (0 to 1) is its expected loss against the truly best design, ``gain`` (0 to
    1) the greatest expected gain of an hour of work. Leader, loss and gain are None before trials. ``basis`` states the
    assumptions of the costs.
    """

    info: ExperimentInfo
    threshold: float
    precision: float
    headline: str
    grounds: str = ""
    next_step: str = ""
    recommendations: tuple[Recommendation, ...] = ()
    environments: tuple[int, ...] = ()
    telling: int = 0
    enough: bool = False
    leader: Design | None = None
    loss: float | None = None
    gain: float | None = None
    undecided: tuple[Undecided, ...] = ()
    remarks: tuple[str, ...] = ()
    basis: str = ""

    @property
    def sentence(self) -> str:
        """Headline, grounds and next step."""
        return " ".join(text for text in (self.headline, self.grounds, self.next_step) if text)

    def __repr__(self) -> str:
        rows = [
            f"  {design.label}: {design.trials} trials of {count(design.cars, 'car')}; {design.reason}"
            for design in self.recommendations
        ]
        return "\n".join([f"Experiment {self.info.id}: {self.sentence}", *rows])


@dataclass(frozen=True)
class Adviser:
    """Advises on one experiment.

    A good design's rate reaches the ``threshold`` (0 to 1). Trials narrow a rate to ± ``precision`` (0 to 0.5).
    """

    evidence: Evidence
    belief: Belief
    threshold: float
    precision: float

    def selection(self, build: int) -> Selection:
        """Return the advice, with up to ``build`` designs to build."""
        belief, info, threshold = self.belief, self.evidence.info, self.threshold
        best, loss = expected_loss(belief.draws)
        # Enough is known if stopping now loses little, and a further hour of work gains little.
        enough = belief.driven and loss <= min(MAX_LOSS, self.precision) and self._gain < MIN_GAIN
        placed = [] if enough else self._placed(build)
        recommended = tuple(self._recommendation(place) for place in placed)
        rows = [place.index for place in placed]
        # New trials take environments in which the recommended designs were not driven yet.
        driven_samples = {trial.sample for index in rows for trial in belief.designs[index].trials}
        driven_columns = [column for column, sample in enumerate(belief.samples.tolist()) if sample in driven_samples]
        trials_per_design = max((design.trials for design in recommended), default=0)
        # The new trials' environments, as columns of belief.passed (designs, environments).
        columns = informative_environments(belief.passed[rows], trials_per_design, driven_columns) if rows else []
        # In these the recommended designs differ: some pass in simulation and some do not.
        differing = [column for column in columns if numpy.ptp(belief.passed[rows][:, column]) > 0]
        return Selection(
            info,
            threshold,
            self.precision,
            headline=headline(self.evidence, belief, compare_experiment(self.evidence), threshold),
            grounds=grounds(self.evidence, belief, threshold),
            next_step=self._next_step(recommended, belief.labels[best], loss, enough),
            recommendations=recommended,
            environments=tuple(int(belief.samples[column]) for column in columns),
            telling=len(differing),
            enough=enough,
            leader=belief.designs[best].design if belief.driven else None,
            loss=loss if belief.driven else None,
            gain=self._gain if belief.driven else None,
            undecided=self._undecided if belief.driven else (),
            remarks=self._remarks(missing_environments=trials_per_design - len(columns)),
            basis=self._basis,
        )

    def _placed(self, build: int) -> list[Placed]:
        """Choose up to ``build`` designs, the most useful first.

        Before trials they mark the region of designs that simulation finds good. Otherwise, and for the remaining number,
        they are those with the greatest expected gain from ROUND_TRIALS trials.
        """
        belief, first = self.belief, []
        if not belief.driven:
            rate, low, high = belief.simulation.T
            # Largest where the rate is near the threshold, compared with the width of its interval.
            uncertainty = 1 / (1 + numpy.abs(rate - self.threshold) / numpy.maximum(high - low, 1e-9))
            first = first_designs(belief.parameters, rate, uncertainty, self.threshold)[:build]
        first_indices = [placed.index for placed in first]
        candidates = numpy.union1d(self._open_candidates, numpy.array(first_indices, dtype=int))
        # Trials need not decide designs that are nearer to the threshold than this; before the first trial, all count.
        zone = self.precision if belief.driven else 0.0
        # From here on, indices into the candidates.
        chosen = numpy.searchsorted(candidates, first_indices).tolist()
        chosen_next = choose_designs(
            belief.draws[:, candidates], self.threshold, ROUND_TRIALS, build - len(first), chosen, zone=zone
        )
        return [*first, *(Placed(int(candidates[index]), NEXT) for index in chosen_next)]

    @cached_property
    def _candidates(self) -> NDArray[numpy.int64]:
        """The indices of the driven designs, and of at most MAX_CANDIDATES undriven ones, evenly spaced."""
        undriven = numpy.flatnonzero(self.belief.trials == 0)
        if len(undriven) > MAX_CANDIDATES:
            undriven = undriven[numpy.linspace(0, len(undriven) - 1, MAX_CANDIDATES).round().astype(int)]
        return numpy.union1d(undriven, numpy.flatnonzero(self.belief.trials))

    @property
    def _open_candidates(self) -> NDArray[numpy.int64]:
        """The candidates that may be best or on either side of the threshold; without such candidates, all."""
        belief, candidates = self.belief, self._candidates
        chances = belief.chances(self.threshold)[candidates]
        best_chances = (belief.draws.argmax(axis=1)[:, None] == candidates).mean(axis=0)
        is_open = ((chances > MIN_CHANCE) & (chances < 1 - MIN_CHANCE)) | (best_chances > MIN_CHANCE)
        return candidates[is_open] if is_open.any() else candidates

    @cached_property
    def _gain(self) -> float:
        """The greatest expected gain of an hour of work, 0 to 1."""
        candidates = self._candidates.tolist()
        minutes_per_trial = [trial_min(self.belief.designs[index].mean_time_s) for index in candidates]
        # (BATCHES, candidates)
        work_min = [
            [
                self._effort(index, batch).work_min(self._car_min, minutes)
                for index, minutes in zip(candidates, minutes_per_trial, strict=True)
            ]
            for batch in BATCHES
        ]
        return gain_per_hour(self.belief.draws[:, self._candidates], self.threshold, self.precision, work_min)

    def _effort(self, index: int, further: int, min_total: int = 0) -> Effort:
        """Return the work for ``further`` independent trials of a design, and for at least ``min_total`` in all."""
        design = self.belief.designs[index]
        trials_of_cars = [] if design.cars is None else design.cars.counted.astype(int).tolist()
        minutes = trial_min(design.mean_time_s)
        return further_effort(further, self._correlations[index], self._car_min, minutes, trials_of_cars, min_total)

    @cached_property
    def _spreads(self) -> NDArray[numpy.float64]:
        """The standard deviation (designs,) of the log-odds of each design's cars.

        A design whose cars were not simulated has the mean of the other designs, or the prior mean.
        """
        # PRIOR itself, not a copy, marks designs whose cars were not simulated.
        spreads = [None if design.spread is PRIOR else float(design.spread @ SPREADS) for design in self.belief.designs]
        simulated = [spread for spread in spreads if spread is not None]
        mean_spread = sum(simulated) / len(simulated) if simulated else float(PRIOR @ SPREADS)
        return numpy.array([mean_spread if spread is None else spread for spread in spreads])

    @cached_property
    def _correlations(self) -> list[float]:
        """The correlation of trials of one car, for each design."""
        # A tenth of the draws is precise enough.
        draws = self.belief.draws[::10].T
        return [correlation_within_cars(rates, spread) for rates, spread in zip(draws, self._spreads, strict=True)]

    @cached_property
    def _car_min(self) -> float:
        """The minutes to cut and build a car; the designs of an experiment are of one vehicle type."""
        return car_min(self.belief.designs[0].vehicle_type)

    @property
    def _basis(self) -> str:
        """The assumptions behind sheets, minutes and numbers of trials, as sentences."""
        return (
            f"Sheets are an estimate: 12 x 12 inch, of which the pieces fill {FILLING:.0%}. Minutes assume "
            f"{self._car_min:.0f} min to cut and build a car (without headers and firmware), {PLACING_MIN:g} min to "
            "place a trial, and the time that simulation drives. "
            f"Cars and trials are planned for cars of a design that differ by {self._spreads.mean():.1f} in log-odds "
            "(standard deviation)."
        )

    @cached_property
    def _undecided(self) -> tuple[Undecided, ...]:
        """The designs whose interval contains the threshold, and undriven neighbours of contradictory trials."""
        belief, limit, precision, result = self.belief, self.threshold, self.precision, []
        for index, (design, rate) in enumerate(zip(belief.designs, belief.built, strict=True)):
            is_doubtful = index in belief.contradictions.undriven_neighbours
            if is_doubtful or rate.low < limit <= rate.high:
                trials = max(1, trials_to_decide(belief.draws[:, index], limit) - len(design.trials))
                near_threshold = not is_doubtful and limit - precision <= rate.low and rate.high <= limit + precision
                result.append(Undecided(design.label, design.design, near_threshold, trials))
        return tuple(result)

    def _recommendation(self, placed: Placed) -> Recommendation:
        """Return a chosen design with its reason, rates, further work and cost."""
        index, design = placed.index, self.belief.designs[placed.index]
        needed = trials_needed(self.belief.draws[:, index], self.precision)
        effort = self._effort(index, further=1, min_total=needed)
        if placed.place == NEXT:
            reason = next_reason(self.belief, index, self.threshold)
        else:
            reason = first_reason(placed.place, design, self.evidence.info.simulation)
        return Recommendation(
            design.label,
            design.design,
            placed.place,
            reason,
            simulated=design.simulated(),
            expected=self.belief.built[index],
            built=bool(design.trials),
            trials_done=len(design.trials),
            cars=effort.cars,
            trials=effort.trials,
            cost=cost(design, effort),
        )

    def _remarks(self, missing_environments: int) -> tuple[str, ...]:
        """Return the remarks of the advice, then those of the evidence.

        ``missing_environments`` is how many environments the trials of a design lack.
        """
        belief, info, sentences = self.belief, self.evidence.info, []
        best_index, passed, counted = split_sample_best(belief.passed)
        if counted and len(belief.designs) > 1:
            rate = rate_text(passed / counted, *rate_interval(passed, counted, info.until is not None))
            sentences.append(
                f"Best in {info.simulation}: {belief.labels[best_index]}, {rate}, chosen in one half of the environments "
                "and counted in the other."
            )
        thinned = len(belief.designs) - len(self._candidates)
        if thinned:
            sentences.append(f"{count(thinned, 'design')} between these were left out of the choice, to save time.")
        if belief.unpooled:
            sentences.append(f"Of the driven designs the {MAX_POOLED} with most trials count.")
        if missing_environments > 0:
            sentences.append(
                f"{count(missing_environments, 'trial')} of a design must repeat an environment: sweep more of them."
            )
        return (*sentences, *self.evidence.remarks)

    def _next_step(self, recommended: Sequence[Recommendation], leader: str, loss: float, enough: bool) -> str:
        """Return a sentence on what to do next, or that trials are enough; ``leader`` is the label of the best design."""
        loss_text = f"{points(loss, sign=False)} points"
        if enough:
            gain = points(MIN_GAIN, sign=False)
            stop = (
                f"Enough: expected loss if you stop with {leader}: {loss_text}; an hour of work wins less than {gain} "
                "point."
            )
            return f"{stop} {undecided_text(self._undecided, self.precision)}".strip()
        first = recommended[0]
        index = self.belief.labels.index(first.label)
        chance = f"{percent(self.belief.chances(self.threshold)[index])} chance to reach {percent(self.threshold)}"
        cars = f" of {count(first.cars, 'car')}" if first.cars else ""
        design = self.belief.designs[index]
        minutes = first.cars * self._car_min + first.trials * trial_min(design.mean_time_s)
        hours = f", about {_hours(round(minutes))}"
        later_text = f"; then {listed([design.label for design in recommended[1:]])}" if len(recommended) > 1 else ""
        verb = "build" if first.cars else "drive"
        plan = f"Next, {verb} {first.label}: {chance}; {count(first.trials, 'trial')}{cars}{hours}{later_text}."
        if not self.belief.driven:
            return plan
        gain = f"an hour of work wins up to {100 * self._gain:.1f}"
        return f"{plan} Expected loss if you stop with {leader}: {loss_text}; {gain}."


def _hours(minutes: int) -> str:
    return f"{minutes} min" if minutes < 90 else f"{minutes / 60:.0f} hours"
