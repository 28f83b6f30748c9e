"""The adviser's sentences: which designs reach the threshold, the evidence for it, and reasons to build a design.

Verbs follow probability: designs *reach* the threshold with a chance of at least KNOWN, *probably* with at least
PROBABLE.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy
from numpy.typing import NDArray

from foldcar.inference.belief import Belief
from foldcar.inference.comparison import ExperimentComparison
from foldcar.inference.design_evidence import DesignEvidence
from foldcar.inference.evidence import Evidence
from foldcar.statistics import selection
from foldcar.statistics.gap import OPTIMISTIC, PESSIMISTIC
from foldcar.statistics.words import count, listed, percent, points, span_text

KNOWN, PROBABLE = 0.975, 0.8
# Number of designs that one sentence names.
NAMED = 3

# Why to build a design before there are trials, by its place in the feasible region.
_FIRST_REASONS = {
    selection.MIDDLE: "the middle of the feasible region: if it fails, the whole region is in doubt",
    selection.LOWER_EDGE: "the lower edge of the feasible region: shows whether the border is where simulation sees it",
    selection.UPPER_EDGE: "the upper edge of the feasible region: shows whether the border is where simulation sees it",
    selection.EDGE: "an edge of the feasible region: shows whether the border is where simulation sees it",
    selection.BELOW: "just outside, below the region: bounds it, or shows that simulation is too strict",
    selection.ABOVE: "just outside, above the region: bounds it, or shows that simulation is too strict",
    selection.OUTSIDE: "just outside the region: bounds it, or shows that simulation is too strict",
    selection.BEST: "the best in simulation, though no design reaches the threshold there",
    selection.END: "an end of the range: in simulation the whole range is feasible, so it contains no border",
}


@dataclass(frozen=True, slots=True)
class Undecided:
    """A design whose interval contains the threshold.

    ``at`` is whether the whole interval is within the precision of the threshold. About ``trials`` further trials decide
    with an even chance on which side the design is.
    """

    label: str
    design: Mapping[str, float | str]
    at: bool
    trials: int


def headline(evidence: Evidence, belief: Belief, compared: ExperimentComparison, threshold: float) -> str:
    """Return the first sentence of the advice: which designs reach the threshold, and where trials contradict simulation.

    Before the first trial it is about simulation, afterwards about built cars.
    """
    limit, simulation = percent(threshold), evidence.info.simulation
    chances = belief.chances(threshold)
    best = int(chances.argmax())
    best_chance = f"{belief.labels[best]} has the best chance, {percent(chances[best])}"
    if not belief.driven:
        built = f"No car was driven yet; of built cars {best_chance}." if len(chances) > 1 else "No car was driven yet."
        return f"In {simulation} {_reaching_in_simulation(belief, evidence, threshold)}. {built}"
    verdicts = []
    for verdict in (OPTIMISTIC, PESSIMISTIC):
        names = [design.label for design in compared.designs if design.verdict == verdict]
        verdicts += [f"{verdict} at {listed(names)}"] if names else []
    start = f"Trials contradict {simulation}: it is {' and '.join(verdicts)}. " if verdicts else ""
    # The belief is not trusted for undriven designs beside a design whose trials contradict those of the others.
    trusted = ~numpy.isin(numpy.arange(len(chances)), belief.contradictions.undriven_neighbours)
    reaching = trusted & (chances >= KNOWN)
    probable = trusted & (chances >= PROBABLE) & (chances < KNOWN)
    if reaching.any():
        probably = f"; {_names(belief, evidence, probable)} probably" if probable.any() else ""
        verb = "reaches" if _is_singular(reaching) else "reach"
        return f"{start}{_capital(_names(belief, evidence, reaching))} {verb} {limit}{probably}."
    if probable.any():
        verb = "reaches" if _is_singular(probable) else "reach"
        min_chance = f"a chance of at least {percent(chances[probable].min())}"
        return f"{start}{_capital(_names(belief, evidence, probable))} probably {verb} {limit}, with {min_chance}."
    if len(chances) == 1:
        return f"{start}Whether the design reaches {limit} is not known: its chance is {percent(chances[0])}."
    return f"{start}No design is known to reach {limit}; {best_chance}."


def grounds(evidence: Evidence, belief: Belief, threshold: float) -> str:
    """Return the evidence for the headline: simulated rates, designs that simulation cannot rank, numbers of trials."""
    sentences, simulation = [], evidence.info.simulation
    if belief.driven:
        sentences.append(f"In {simulation} {_reaching_in_simulation(belief, evidence, threshold)}.")
    rates = belief.simulation
    # Designs whose interval reaches the best design's rate.
    tied = rates[:, 2] >= rates[:, 0].max()
    if tied.sum() > 1:
        low, high = (percent(float(end)) for end in (rates[tied, 0].min(), rates[tied, 0].max()))
        span = low if low == high else f"{low.removesuffix(' %')} to {high}"
        driven = "" if not belief.driven or belief.trials[tied].any() else "; none of these was driven"
        # If all are tied, `_names` says "each of 5 designs"; here that must read "the best 5 designs".
        names = _names(belief, evidence, tied).replace("each of", "the best", 1)
        sentences.append(f"{_capital(simulation)} cannot rank {names} ({span}){driven}.")
    driven_designs = sorted(evidence.driven, key=lambda design: -design.trials_passed / len(design.trials))
    if driven_designs:
        counts = [
            f"{design.trials_passed} of {len(design.trials)} at {design.label}" for design in driven_designs[:NAMED]
        ]
        rest = f", of {count(len(driven_designs), 'driven design')}" if len(driven_designs) > NAMED else ""
        sentences.append(f"Trials that passed: {listed(counts)}{rest}.")
    return " ".join(sentences)


def undecided_text(undecided: Sequence[Undecided], precision: float) -> str:
    """Return a sentence on the undecided designs near the threshold, and one on the others: how many trials may decide.

    Returns "" if no design is undecided.
    """
    sentences = []
    for near_threshold in (True, False):
        # ``at``: the whole interval is near the threshold.
        group = [design for design in undecided if design.at == near_threshold]
        group.sort(key=lambda design: design.trials)
        if not group:
            continue
        unnamed = [count(len(group) - NAMED, "further design")] if len(group) > NAMED else []
        names = listed([*(design.label for design in group[:NAMED]), *unnamed])
        verb = "is" if len(group) == 1 else "are"
        where = f"within {points(precision, sign=False)} points of the threshold" if near_threshold else "undecided"
        of_first = f" of {group[0].label}" if len(group) > 1 else ""
        sentences.append(f"{names} {verb} {where}; some {_rounded(group[0].trials)} more trials{of_first} may tell.")
    return _capital(" ".join(sentences))


def first_reason(place: str, design: DesignEvidence, simulation: str) -> str:
    """Return the reason to build a design before there are trials."""
    return f"{_FIRST_REASONS[place]}; {simulation} passes {percent(design.runs_passed / design.runs)}"


def next_reason(belief: Belief, index: int, threshold: float) -> str:
    """Return the reason to build a design next, given the trials so far."""
    low, high = belief.built[index].low, belief.built[index].high
    if low < threshold <= high:
        chance = percent(belief.chances(threshold)[index])
        parts = [
            f"its rate is {percent(low)} to {percent(high)}: it reaches {percent(threshold)} with a chance of {chance}"
        ]
    else:
        parts = [f"its rate is {percent(low)} to {percent(high)}, which bounds its neighbours'"]
    chance_of_best = float((belief.draws.argmax(axis=1) == index).mean())
    # Without evidence all designs have the same chance; mention a chance that is clearly higher.
    if chance_of_best >= 1.5 / len(belief.designs):
        parts.append(f"it is the best with a chance of {percent(chance_of_best)}")
    design = belief.designs[index]
    if design.trials:
        parts.append(f"{design.trials_passed} of {count(len(design.trials), 'trial')} passed")
    return "; ".join(parts)


def _reaching_in_simulation(belief: Belief, evidence: Evidence, threshold: float) -> str:
    """Return which designs reach the threshold in simulation, such as "75 to 150 mm reach 75 %"."""
    rate, low, _ = belief.simulation.T
    limit, reach, confident = percent(threshold), rate >= threshold, low >= threshold
    if not reach.any():
        if not sum(design.runs_passed for design in belief.designs):
            return "no run passed"
        best = int(rate.argmax())
        named = "" if len(rate) == 1 else f", {belief.labels[best]},"
        return f"no design reaches {limit}; the best{named} passes {percent(rate[best])}"
    verb = "reaches" if _is_singular(reach) else "reach"
    text = f"{_names(belief, evidence, reach)} {verb} {limit}"
    if (confident == reach).all():
        return f"{text} with 95 % confidence"
    if not confident.any():
        if len(rate) == 1:
            return f"{text}, but not with 95 % confidence"
        return f"{text}, none with 95 % confidence"
    return f"{text}, {_names(belief, evidence, confident)} with 95 % confidence each"


def _names(belief: Belief, evidence: Evidence, chosen: NDArray[numpy.bool_]) -> str:
    """Name the designs of the mask ``chosen`` (n,): ranges of neighbours if one parameter varies, else their number."""
    number, total = int(chosen.sum()), len(chosen)
    if total == 1:
        return "the design"
    if number == total:
        return f"each of {total:,} designs"
    if len(evidence.parameters) != 1:
        return belief.labels[int(chosen.argmax())] if number == 1 else f"{number:,} of {total:,} designs"
    order = numpy.argsort(belief.parameters[:, 0], kind="stable")
    values, is_chosen = belief.parameters[order, 0], chosen[order]
    ranges = []
    # Groups of neighbours, in ascending order, that are either all chosen or all not.
    for group in numpy.split(numpy.arange(total), numpy.flatnonzero(numpy.diff(is_chosen)) + 1):
        if is_chosen[group[0]]:
            ranges.append(span_text(evidence.parameters[0], float(values[group[0]]), float(values[group[-1]])))
    return listed(ranges)


def _is_singular(chosen: NDArray[numpy.bool_]) -> bool:
    """Return whether the verb after :func:`_names` is singular."""
    return bool(chosen.sum() == 1 or chosen.all())


def _rounded(number: int) -> str:
    """Return a number rounded up to two significant digits."""
    step = 10 ** max(0, len(str(number)) - 2)
    return f"{-(-number // step) * step:,}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
