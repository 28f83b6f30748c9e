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
    """Return the line on which car to take if a car is wanted that works."""
    answers, labels = belief.answers, belief.labels
    best = answers.best
    rate = answers.built[best]
    guess = "" if belief.driven else f", a guess from simulation: {no_trial_text(evidence, 'no car was driven yet')}"
    text = f"{_capital(labels[best])}: {band_text(rate)} for a {'further' if belief.driven else 'built'} car{guess}."
    owned = car_to_take(belief)
    if owned is not None:
        text = (
            f"Take the car that you have, {car_text(belief, owned)}: {band_text(answers.cars[owned].rate)}. A "
            f"further car of the best design, {labels[best]}: {band_text(rate)}."
        )
    return f"Want a car that works? {text} {reaching(belief, evidence, threshold)}"


def car_to_take(belief: Belief) -> int | None:
    """Return the number of the driven car to take; None if a further car of the best design is expected to do better."""
    answers = belief.answers
    rates = [car.rate.value for car in answers.cars]
    if not rates or max(rates) < answers.built[answers.best].value:
        return None
    return rates.index(max(rates))


def reaching(belief: Belief, evidence: Evidence, threshold: float) -> str:
    """Return which designs reach the threshold, in the words of REACHES and PROBABLY."""
    chances, limit = belief.answers.chances(threshold), threshold_text(threshold)
    known, probable = chances >= REACHES, (chances >= PROBABLY) & (chances < REACHES)
    if known.any() or probable.any():
        parts = []
        for chosen, adverb in ((known, ""), (probable, "probably ")):
            if chosen.any():
                parts.append(f"{_names(belief, evidence, chosen, f'{adverb}reach')} {limit}")
        return f"{_capital('; '.join(parts))}."
    best = int(chances.argmax())
    if chances[best] < UNLIKELY:
        if len(chances) == 1:
            return f"It is not likely to reach {limit} when built."
        return f"No design is likely to reach {limit} when built."
    if len(chances) == 1:
        return f"Its chance to reach {limit} is {percent(chances[best])}."
    return f"{_capital(belief.labels[best])} has the best chance to reach {limit}: {percent(chances[best])}."


def grounds(evidence: Evidence, threshold: float) -> str:
    """Return the evidence: which designs reach the threshold in the runs, and how many trials passed."""
    info = evidence.info
    start = "Expected over realities," if info.is_over_realities else f"In {info.simulation}"
    sentences = [f"{start} {_reaching_in_simulation(evidence, threshold)}."]
    driven_designs = sorted(evidence.driven, key=lambda design: -design.trials_passed / len(design.trials))
    if driven_designs:
        counts = [
            f"{design.trials_passed} of {len(design.trials)} at {design.label}" for design in driven_designs[:NAMED]
        ]
        others = len(driven_designs) - NAMED
        rest = f"; {count(others, 'more design')} {'was' if others == 1 else 'were'} driven" if others > 0 else ""
        sentences.append(f"Trials that passed: {listed(counts)}{rest}.")
    return " ".join(sentences)


def afternoon(gain: float) -> str:
    """Return a sentence on what another afternoon is expected to gain (0 to 1)."""
    if gain < MIN_GAIN:
        return "Another afternoon is expected to gain less than one point."
    return f"This is expected to raise the rate of the recommended design by {count(round(100 * gain), 'point')}."


def step_text(belief: Belief, step: AdvisedStep, trials: int) -> str:
    """Return a step in words, such as ``build 100 mm and drive it 10 times``."""
    if step.kind == "measure":
        return f"measure {measurement(step.parameter)}"
    assert step.design is not None
    label = belief.labels[step.design]
    if step.kind == "drive":
        assert step.car is not None
        return f"drive {car_text(belief, step.car)} {trials} more times"
    return f"build {'a second car of ' if step.second else ''}{label} and drive it {trials} times"


def measurement(parameter: str) -> str:
    """Return what is measured, in words."""
    return MEASUREMENTS[parameter]


def car_text(belief: Belief, car: int) -> str:
    """Return a car that drove in words: its design, and its name if it has one."""
    answer = belief.answers.cars[car]
    name = "" if answer.name is None else f" ({answer.name})"
    return f"the car of {belief.labels[answer.design]}{name}"


def band_text(rate: Estimate) -> str:
    """Return a rate with its interval: ``41 % (14 to 73)``."""
    return f"{percent(rate.value)} ({percent_number(rate.low)} to {percent_number(rate.high)})"


def _reaching_in_simulation(evidence: Evidence, threshold: float) -> str:
    """Return which designs reach the threshold in nominal simulation, such as "75 to 150 mm reach 75 %"."""
    simulated = numpy.array([bool(design.runs) for design in evidence.family])
    counts = evidence.run_counts
    passed, runs = counts[:, 0], numpy.maximum(counts[:, 1], 1)
    limit = threshold_text(threshold)
    reach = simulated & (passed / runs >= threshold)
    if not reach.any():
        if not passed.sum():
            return "no run passed"
        rates = numpy.where(simulated, passed / runs, -1)
        best = int(rates.argmax())
        best_rate = percent_below(passed[best] / runs[best], threshold)
        if len(evidence.family) == 1:
            return f"the design does not reach {limit}; it passes {best_rate}"
        tied = int((rates == rates[best]).sum())
        if tied == simulated.sum() and tied > 1:
            return f"no design reaches {limit}; each passes {best_rate}"
        if tied > 1:
            return f"no design reaches {limit}; the best {tied:,} pass {best_rate}"
        named = "" if simulated.sum() == 1 else f", {evidence.family[best].label},"
        return f"no design reaches {limit}; the best{named} passes {best_rate}"
    low = [
        rate_interval(int(p), int(n), design.sequential)[0] if n else 0.0
        for design, (p, n) in zip(evidence.family, counts.tolist(), strict=True)
    ]
    confident = reach & (numpy.array(low) >= threshold)
    counted = _Counted(simulated, "designs with runs")
    text = f"{_with_verb(_family_names(evidence, reach, counted), reach, 'reach')} {limit}"
    if (confident == reach).all():
        return f"{text} with 95 % confidence"
    if not confident.any():
        return f"{text}, {'but not' if len(reach) == 1 else 'none'} with 95 % confidence"
    return f"{text}, {_family_names(evidence, confident, counted)} with 95 % confidence each"


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
    """Name the designs of the family in the mask ``chosen`` (n,): ranges if one parameter varies, else their number.

    ``counted`` designs are those that could have been chosen.
    """
    number, total = int(chosen.sum()), len(chosen)
    if total == 1:
        return "the design"
    if number == total or (number > 1 and number == counted.mask.sum() and len(evidence.parameters) != 1):
        return f"each of {counted.count()}"
    if len(evidence.parameters) != 1:
        return evidence.family[int(chosen.argmax())].label if number == 1 else counted.count(number)
    (name,) = evidence.parameters
    all_values = numpy.array([float(design.design[name]) for design in evidence.family])
    order = numpy.argsort(all_values, kind="stable")
    values, is_chosen = all_values[order], chosen[order]
    ranges = []
    # Groups of neighbours, in ascending order, that are either all chosen or all not.
    for group in numpy.split(numpy.arange(total), numpy.flatnonzero(numpy.diff(is_chosen)) + 1):
        if is_chosen[group[0]]:
            ranges.append(span_text(name, float(values[group[0]]), float(values[group[-1]])))
    return listed(ranges)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
