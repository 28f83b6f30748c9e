"""Sentences on the swept ranges: a gap that may hide a border, and ends at which success still rises."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from foldcar.car.design_parameters import declared, key_of
from foldcar.evidence.evidence import Evidence
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import design_text, label_and_unit, percent, threshold_text, value_text

# A rise of the rate at an end of the range counts from here (0 to 1).
MIN_RISE = 0.02
# It counts if success rises with a greater probability than this.
MIN_RISE_PROBABILITY = 0.95
# Neighbouring values are a gap if their distance exceeds the median step by this factor. It is worth a sentence if the
# side of the threshold of a design in it is wrong with at least this probability.
MIN_GAP_FACTOR, MIN_DOUBT = 1.5, 0.05


def range_sentences(evidence: Evidence, effects: Effects | None, indices: Sequence[int], threshold: float) -> list[str]:
    """Return the sentences; ``effects`` is the smooth model of the parameters with ``indices``."""
    if effects is None or evidence.info.searched:
        return []
    names = [list(evidence.values)[index] for index in indices]
    return [*_gap(effects, names, threshold, evidence.info.simulation), *_rising_ends(effects, names)]


def _gap(effects: Effects, names: Sequence[str], threshold: float, simulation: str) -> list[str]:
    """Return a sentence on the gap between simulated values that most needs runs; an empty list if no gap needs any.

    The model gives the probability that a design in the middle of a gap reaches the threshold. Runs are needed most in
    the gap whose probability is nearest to 1/2. If that of a simulated design is even nearer, runs of this design are
    needed more than runs in any gap, and there is no sentence.
    """
    simulated_designs = effects.parameters
    gaps = _gaps(simulated_designs, names)
    if not gaps:
        return []
    number = len(simulated_designs)
    designs = numpy.vstack([simulated_designs, *(gap.design for gap in gaps)])
    # For each design the probability that it reaches the threshold, and how uncertain this is: 0 to 1/2.
    chances = (effects.rates(designs) >= threshold).mean(axis=0)
    doubts = numpy.minimum(chances, 1 - chances)
    doubts_of_simulated, doubts_of_gaps = doubts[:number], doubts[number:]
    if doubts_of_gaps.max() < max(MIN_DOUBT, doubts_of_simulated.max()):
        return []
    gap_index = int(doubts_of_gaps.argmax())
    gap, gap_chance = gaps[gap_index], chances[number + gap_index]
    label, _ = label_and_unit(gap.parameter)
    between = f"{label} {value_text(gap.parameter, gap.low)} and {value_text(gap.parameter, gap.high)}"
    car = design_text(dict(zip(names, gap.design.tolist(), strict=True)))
    chance = f"a {percent(gap_chance)} chance to reach {threshold_text(threshold)} in {simulation}"
    return [f"Nothing was simulated between {between}; sweep there first: {car} has {chance}."]


class _Gap(NamedTuple):
    """A gap between two neighbouring values of a parameter, and a design in its middle."""

    parameter: str
    low: float
    high: float
    design: NDArray[Any]


def _gaps(designs: NDArray[Any], names: Sequence[str]) -> list[_Gap]:
    """Return the gaps between the values of each parameter, each with a design in its middle.

    ``designs`` (d, parameters) are the parameters of the simulated designs. A gap lies between two successive values of a
    parameter whose distance is much greater than usual. If designs at its ends have several combinations of the other
    parameters, the gap is returned once for each combination.
    """
    gaps = []
    for index, name in enumerate(names):
        column = designs[:, index]
        values = numpy.unique(column)
        are_whole = (values % 1 == 0).all()
        steps = numpy.diff(values)
        for place in numpy.flatnonzero(steps > MIN_GAP_FACTOR * numpy.median(steps)):
            low, high = values[place], values[place + 1]
            # The designs at both ends of the gap, moved into its middle.
            middle = (low + high) // 2 if are_whole else (low + high) / 2
            middle_designs = designs[(column == low) | (column == high)]
            middle_designs[:, index] = middle
            for design in numpy.unique(middle_designs, axis=0):
                gaps.append(_Gap(name, low, high, design))
    return gaps


def _rising_ends(effects: Effects, names: Sequence[str]) -> list[str]:
    """Return a sentence for each end of a parameter's range at which the success rate still rises.

    ``names`` are the parameters of ``effects``, each of which has the mean success rate on a grid of the parameter's
    values.
    """
    sentences = []
    for index, name in enumerate(names):
        effect = effects.effect(index)
        if len(effect.grid) < 3:
            continue
        label, _ = label_and_unit(name)
        # The indices of an end and of its neighbour on the grid, and the probability that success rises towards the end.
        lower_probability, upper_probability = effect.rises
        ends = (("lower", 0, 1, lower_probability), ("upper", -1, -2, upper_probability))
        for end_name, end, neighbour, probability in ends:
            rise = effect.mean[end] - effect.mean[neighbour]
            is_highest = effect.mean[end] >= effect.mean.max()
            if rise < MIN_RISE or not is_highest or probability <= MIN_RISE_PROBABILITY:
                continue
            value = float(effect.grid[end])
            if _extendable(name, value, upwards=end_name == "upper"):
                place = f"{label} {value_text(name, value)}"
                sentences.append(
                    f"Success still rises at {place}, the range's {end_name} end: extend it if it can be built."
                )
    return sentences


def _extendable(name: str, value: float, upwards: bool) -> bool:
    """Return whether the limits of the design parameter ``name`` allow a value beyond this one, up or down."""
    key = key_of(name)
    # Only design parameters have limits.
    if key is None:
        return True
    parameter = declared(key)
    if upwards:
        return value < parameter.maximum
    # A minimum that depends on the parts is a function; whether a smaller car can be built shows when it is swept.
    return not isinstance(parameter.minimum, float | int) or value > parameter.minimum
