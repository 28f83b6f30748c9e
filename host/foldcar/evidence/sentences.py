"""The adviser's sentences.

Verbs follow probability, here and everywhere: a design *reaches* the threshold with a chance of at least REACHES,
*probably* with at least PROBABLY. The *best* design is the one with the highest expected rate of built cars.
"""

from dataclasses import dataclass

import numpy
from numpy.typing import NDArray

from foldcar.belief.advice import MIN_GAIN, AdvisedStep
from foldcar.belief.answers import PROBABLY, REACHES, Estimate
from foldcar.evidence.belief import Belief
from foldcar.evidence.evidence import Evidence, no_trial_text
from foldcar.statistics.rate import rate_interval
from foldcar.statistics.words import count, listed, percent, percent_below, percent_number, span_text, threshold_text

# Number of designs that one sentence names.
NAMED = 3
# No design is likely to reach a threshold if the best chance is smaller.
UNLIKELY = 0.2
MEASUREMENTS = {
    "obstacle_height": "the obstacles' height",
    "com_height_m": "the height of the car's centre of mass",
    "track_m": "the distance between left and right wheels",
}


def works(belief: Belief, evidence: Evidence, threshold: float) -> str:
    """Return the line that answers "Want a car that works?": which car to take, and its success rate.

    It is a car that the user has, unless a further car of the best design is expected to do better. The rates are
    followed by their intervals. At the end, the line says which designs reach ``threshold``.
    """
    answers = belief.answers
    best_label = belief.labels[answers.best]
    best_rate = band_text(answers.built[answers.best])
    owned_car = car_to_take(belief)
    if owned_car is not None:
        owned_rate = band_text(answers.cars[owned_car].rate)
        text = (
            f"Take the car that you have, {car_text(belief, owned_car)}: {owned_rate}. A further car of the best design, "
            f"{best_label}: {best_rate}."
        )
    elif belief.driven:
        text = f"{_capital(best_label)}: {best_rate} for a further car."
    else:
        no_trial = no_trial_text(evidence, "no car was driven yet")
        text = f"{_capital(best_label)}: {best_rate} for a built car, a guess from simulation: {no_trial}."
    return f"Want a car that works? {text} {reaching(belief, evidence, threshold)}"


def car_to_take(belief: Belief) -> int | None:
    """Return the number of the driven car to take; None if a further car of the best design is expected to do better."""
    answers = belief.answers
    car_rates = [car.rate.value for car in answers.cars]
    if not car_rates:
        return None
    best_car_rate, further_car_rate = max(car_rates), answers.built[answers.best].value
    return None if best_car_rate < further_car_rate else car_rates.index(best_car_rate)


def reaching(belief: Belief, evidence: Evidence, threshold: float) -> str:
    """Return a sentence that names the designs that reach the threshold, and those that probably do.

    If there are none, the sentence names the design with the best chance. If that chance is small, it says that no design
    is likely to reach the threshold.
    """
    chances = belief.answers.chances(threshold)
    limit = threshold_text(threshold)
    does_reach = chances >= REACHES
    probably_reaches = (chances >= PROBABLY) & ~does_reach
    clauses = []
    if does_reach.any():
        clauses.append(f"{_names(belief, evidence, does_reach, 'reach')} {limit}")
    if probably_reaches.any():
        clauses.append(f"{_names(belief, evidence, probably_reaches, 'probably reach')} {limit}")
    if clauses:
        return f"{_capital('; '.join(clauses))}."
    best = int(chances.argmax())
    if chances[best] < UNLIKELY:
        if len(chances) == 1:
            return f"It is not likely to reach {limit} when built."
        return f"No design is likely to reach {limit} when built."
    if len(chances) == 1:
        return f"Its chance to reach {limit} is {percent(chances[best])}."
    return f"{_capital(belief.labels[best])} has the best chance to reach {limit}: {percent(chances[best])}."


def grounds(evidence: Evidence, threshold: float) -> str:
    """Return sentences on which designs reach the threshold in simulation, and how many of their trials passed.

    These are the grounds of the advice on which car to build. ``threshold`` is the success rate that a good car reaches.
    """
    info = evidence.info
    # A reality is a set of random values of what the simulator does not know, such as friction.
    start = "Expected over realities," if info.is_over_realities else f"In {info.simulation}"
    sentences = [f"{start} {_reaching_in_simulation(evidence, threshold)}."]
    driven_designs = sorted(evidence.driven, key=lambda design: -design.trials_passed / len(design.trials))
    if driven_designs:
        named_designs, other_designs = driven_designs[:NAMED], driven_designs[NAMED:]
        counts = [f"{design.trials_passed} of {len(design.trials)} at {design.label}" for design in named_designs]
        sentence = f"Trials that passed: {listed(counts)}"
        if other_designs:
            were = "was" if len(other_designs) == 1 else "were"
            sentence += f"; {count(len(other_designs), 'more design')} {were} driven"
        sentences.append(f"{sentence}.")
    return " ".join(sentences)


def afternoon(gain: float) -> str:
    """Return a sentence on what another afternoon is expected to gain (0 to 1)."""
    if gain < MIN_GAIN:
        return "Another afternoon is expected to gain less than one point."
    return f"This is expected to raise the rate of the recommended design by {count(round(100 * gain), 'point')}."


def step_text(belief: Belief, step: AdvisedStep, trials: int) -> str:
    """Return a step in words, such as ``build 100 mm and drive it 10 times``; ``trials`` is the number of trials."""
    if step.kind == "measure":
        return f"measure {measurement(step.parameter)}"
    if step.kind == "drive":
        assert step.car is not None
        return f"drive {car_text(belief, step.car)} {trials} more times"
    assert step.design is not None
    label = belief.labels[step.design]
    car = f"a second car of {label}" if step.second else label
    return f"build {car} and drive it {trials} times"


def measurement(parameter: str) -> str:
    """Return the measured quantity in words, such as "the obstacles' height"; ``parameter`` is a name of MEASURABLE."""
    return MEASUREMENTS[parameter]


def car_text(belief: Belief, car: int) -> str:
    """Name a car that drove by its design, and by its own name if it has one; ``car`` is its index in the answers."""
    answer = belief.answers.cars[car]
    text = f"the car of {belief.labels[answer.design]}"
    return text if answer.name is None else f"{text} ({answer.name})"


def band_text(rate: Estimate) -> str:
    """Return a rate with its interval: ``41 % (14 to 73)``."""
    return f"{percent(rate.value)} ({percent_number(rate.low)} to {percent_number(rate.high)})"


def _reaching_in_simulation(evidence: Evidence, threshold: float) -> str:
    """Say which designs reach the threshold in nominal simulation, such as "75 to 150 mm reach 75 %".

    The text also says for which of these designs the runs show it with 95 % confidence.
    """
    passed_runs, counted_runs = evidence.run_counts.T
    is_simulated = counted_runs > 0
    # The rate of a design without runs is 0, and does not count.
    rates = passed_runs / numpy.maximum(counted_runs, 1)
    reaches = is_simulated & (rates >= threshold)
    if not reaches.any():
        return _none_reaching(evidence, rates, threshold)
    counted = _Counted(is_simulated, "designs with runs")
    names = _family_names(evidence, reaches, counted)
    text = f"{_with_verb(names, reaches, 'reach')} {threshold_text(threshold)}"
    reaches_confidently = reaches & (_lower_limits(evidence) >= threshold)
    if (reaches_confidently == reaches).all():
        return f"{text} with 95 % confidence"
    if reaches_confidently.any():
        return f"{text}, {_family_names(evidence, reaches_confidently, counted)} with 95 % confidence each"
    if len(evidence.family) == 1:
        return f"{text}, but not with 95 % confidence"
    return f"{text}, none with 95 % confidence"


def _lower_limits(evidence: Evidence) -> NDArray[numpy.float64]:
    """Return the lower end of the 95 % interval of each design's rate in simulation (family,); 0 without runs."""
    lower_limits = []
    for design in evidence.family:
        lower_limit = 0.0
        if design.runs:
            lower_limit, _ = rate_interval(design.runs_passed, design.runs, design.sequential)
        lower_limits.append(lower_limit)
    return numpy.array(lower_limits)


def _none_reaching(evidence: Evidence, rates: NDArray[numpy.float64], threshold: float) -> str:
    """Return a sentence which says that no design reaches the threshold, and which design is the best, with its rate.

    ``rates`` has the success rate of each design of the family, in simulation with the simulator's nominal values. The
    rate of a design without runs is 0.
    """
    limit = threshold_text(threshold)
    if not rates.any():
        return "no run passed"
    best_rate = percent_below(rates.max(), threshold)
    if len(evidence.family) == 1:
        return f"the design does not reach {limit}; it passes {best_rate}"
    designs_with_runs = sum(design.runs > 0 for design in evidence.family)
    best_designs = int((rates == rates.max()).sum())
    if designs_with_runs == 1:
        best = "the best passes"
    elif best_designs == designs_with_runs:
        best = "each passes"
    elif best_designs > 1:
        best = f"the best {best_designs:,} pass"
    else:
        best = f"the best, {evidence.family[int(rates.argmax())].label}, passes"
    return f"no design reaches {limit}; {best} {best_rate}"


@dataclass(frozen=True)
class _Counted:
    """The designs of the family (n,) that a sentence is about, with what they are called if they are not all of it."""

    mask: NDArray[numpy.bool_]
    noun: str

    def count(self, chosen: int | None = None) -> str:
        """Return ``6 designs`` or ``6 designs with runs``, or ``3 of 6 designs``."""
        number = f"{int(self.mask.sum()):,} {'designs' if self.mask.all() else self.noun}"
        return number if chosen is None else f"{chosen:,} of {number}"


def _names(belief: Belief, evidence: Evidence, chosen: NDArray[numpy.bool_], verb: str) -> str:
    """Name the designs of the belief in the mask ``chosen`` (n,), with the verb."""
    in_family, believed = numpy.zeros((2, len(evidence.family)), bool)
    in_family[belief.design_indices[chosen]] = believed[belief.design_indices] = True
    counted = _Counted(believed, "designs within the swept ranges")
    return _with_verb(_family_names(evidence, in_family, counted), in_family, verb)


def _with_verb(names: str, chosen: NDArray[numpy.bool_], verb: str) -> str:
    """Return names of the designs in the mask ``chosen`` with the verb, singular after one of them or "each of …"."""
    singular = chosen.sum() == 1 or names.startswith("each of ")
    return f"{names} {verb}{'es' if singular else ''}"


def _family_names(evidence: Evidence, chosen: NDArray[numpy.bool_], counted: _Counted) -> str:
    """Return a text that names some designs of the family, those for which ``chosen`` (n,) is True.

    If one parameter varies, these are ranges of its values: "75 to 150 mm". If several vary, it is the name of a single
    design, or a number: "3 of 6 designs". ``counted`` are the designs among which they were chosen.
    """
    if len(chosen) == 1:
        return "the design"
    if chosen.all():
        return f"each of {counted.count()}"
    if len(evidence.parameters) == 1:
        return _value_ranges(evidence, evidence.parameters[0], chosen)
    number = int(chosen.sum())
    if number == 1:
        return evidence.family[int(chosen.argmax())].label
    if number == counted.mask.sum():
        return f"each of {counted.count()}"
    return counted.count(number)


def _value_ranges(evidence: Evidence, parameter: str, chosen: NDArray[numpy.bool_]) -> str:
    """Return the ranges of a parameter's values in which all designs are ``chosen`` (family,), such as "75 to 150 mm"."""
    all_values = numpy.array([float(design.design[parameter]) for design in evidence.family])
    ascending = numpy.argsort(all_values, kind="stable")
    values, is_chosen = all_values[ascending], chosen[ascending]
    # Split between neighbours of which only one is chosen.
    boundaries = numpy.flatnonzero(numpy.diff(is_chosen)) + 1
    ranges = []
    for group in numpy.split(numpy.arange(len(values)), boundaries):
        first, last = group[0], group[-1]
        if is_chosen[first]:
            ranges.append(span_text(parameter, float(values[first]), float(values[last])))
    return listed(ranges)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
