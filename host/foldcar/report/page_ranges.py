"""Sentences on the swept ranges: a gap that may hide a border, and ends at which success still rises."""

from collections.abc import Sequence

import numpy

from foldcar.car.design_parameters import declared, key_of
from foldcar.evidence.evidence import Evidence
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import design_text, label_and_unit, percent, threshold_text, value_text

# A rise of the rate at an end of the range counts from here (0 to 1).
MIN_RISE = 0.02
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
    """Return a sentence on the gap where the side of the threshold is less certain than at any simulated design."""
    x = effects.parameters
    # (parameter's name, low, high, a design in the middle)
    gaps = []
    for index, name in enumerate(names):
        values = numpy.unique(x[:, index])
        steps = numpy.diff(values)
        for low, high in numpy.column_stack([values[:-1], values[1:]])[steps > MIN_GAP_FACTOR * numpy.median(steps)]:
            ends = x[(x[:, index] == low) | (x[:, index] == high)].copy()
            ends[:, index] = (low + high) // 2 if (values % 1 == 0).all() else (low + high) / 2
            gaps += [(name, low, high, middle) for middle in numpy.unique(ends, axis=0)]
    if not gaps:
        return []
    # The probability to reach the threshold: of the simulated designs, then of those in gaps.
    reach = (effects.rates(numpy.vstack([x, *(middle for *_, middle in gaps)])) >= threshold).mean(axis=0)
    doubt = numpy.minimum(reach, 1 - reach)
    index = len(x) + int(doubt[len(x) :].argmax())
    if doubt[index] < max(MIN_DOUBT, doubt[: len(x)].max()):
        return []
    name, low, high, middle = gaps[index - len(x)]
    between = f"{label_and_unit(name)[0]} {value_text(name, low)} and {value_text(name, high)}"
    car = design_text(dict(zip(names, middle.tolist(), strict=True)))
    chance = f"a {percent(reach[index])} chance to reach {threshold_text(threshold)} in {simulation}"
    return [f"Nothing was simulated between {between}; sweep there first: {car} has {chance}."]


def _rising_ends(effects: Effects, names: Sequence[str]) -> list[str]:
    """Return sentences on ends of ranges at which success still rises."""
    sentences = []
    for index, name in enumerate(names):
        effect = effects.effect(index)
        if len(effect.grid) < 3:
            continue
        # The indices of an end and of its neighbour, and the probability that success rises at the end.
        for end, inner, rises in ((0, 1, effect.rises[0]), (-1, -2, effect.rises[1])):
            higher = effect.mean[end] - effect.mean[inner] >= MIN_RISE and effect.mean[end] == effect.mean.max()
            value = float(effect.grid[end])
            if higher and rises > 0.95 and _extendable(name, value, end == -1):
                where = f"{label_and_unit(name)[0]} {value_text(name, value)}"
                end_name = "upper" if end else "lower"
                sentences.append(
                    f"Success still rises at {where}, the range's {end_name} end: extend it if it can be built."
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
