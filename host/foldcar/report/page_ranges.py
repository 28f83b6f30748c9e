"""What the page says of the swept ranges: a gap that may hide a border, ends at which success still rises."""

from collections.abc import Sequence

import numpy

from foldcar.car.design_parameters import declared, key_of
from foldcar.inference.evidence import Evidence
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import design_text, label_and_unit, percent, value_text

# A rate that rises by less than this at an end of the range (0 to 1) does not count.
MIN_RISE = 0.02
# Neighbouring values are a gap if they are further apart than the median step by this factor. It is worth a sentence if a
# design in it is on the wrong side of the threshold with at least this probability.
WIDE, MIN_DOUBT = 1.5, 0.05


def range_sentences(evidence: Evidence, effects: Effects | None, places: Sequence[int], threshold: float) -> list[str]:
    """Return the sentences; ``effects`` is the smooth model of simulation of the parameters at ``places``."""
    if effects is None or evidence.info.searched:
        return []
    names = [list(evidence.values)[place] for place in places]
    return [*_gap(effects, names, threshold, evidence.info.simulation), *_ends(effects, names)]


def _gap(effects: Effects, names: Sequence[str], threshold: float, simulation: str) -> list[str]:
    """The gap in which simulation's side of the threshold is less sure than at any design."""
    x, gaps = effects.parameters, []
    for at, name in enumerate(names):
        values = numpy.unique(x[:, at])
        steps = numpy.diff(values)
        for low, high in numpy.column_stack([values[:-1], values[1:]])[steps > WIDE * numpy.median(steps)]:
            beside = x[(x[:, at] == low) | (x[:, at] == high)].copy()
            beside[:, at] = (low + high) // 2 if (values % 1 == 0).all() else (low + high) / 2
            gaps += [(name, low, high, middle) for middle in numpy.unique(beside, axis=0)]
    if not gaps:
        return []
    reach = (effects.rates(numpy.vstack([x, *(middle for *_, middle in gaps)])) >= threshold).mean(axis=0)
    doubt = numpy.minimum(reach, 1 - reach)
    at = len(x) + int(doubt[len(x) :].argmax())
    if doubt[at] < max(MIN_DOUBT, doubt[: len(x)].max()):
        return []
    name, low, high, middle = gaps[at - len(x)]
    between = f"{label_and_unit(name)[0]} {value_text(name, low)} and {value_text(name, high)}"
    car = design_text(dict(zip(names, middle.tolist(), strict=True)))
    chance = f"a {percent(reach[at])} chance to reach {percent(threshold)} in {simulation}"
    return [f"Nothing was simulated between {between}; sweep there first: {car} has {chance}."]


def _ends(effects: Effects, names: Sequence[str]) -> list[str]:
    """Ends of ranges at which success still rises."""
    ends = []
    for at, name in enumerate(names):
        effect = effects.effect(at)
        if len(effect.grid) < 3:
            continue
        for end, inner, rises in ((0, 1, effect.rises[0]), (-1, -2, effect.rises[1])):
            higher = effect.mean[end] - effect.mean[inner] >= MIN_RISE and effect.mean[end] == effect.mean.max()
            value = float(effect.grid[end])
            if higher and rises > 0.95 and _extendable(name, value, end == -1):
                where = f"{label_and_unit(name)[0]} {value_text(name, value)}"
                end_name = "upper" if end else "lower"
                ends.append(f"Success still rises at {where}, the range's {end_name} end: extend it if it can be built.")
    return ends


def _extendable(name: str, value: float, upwards: bool) -> bool:
    """Whether cars with a value beyond may be asked for."""
    key = key_of(name)
    if key is None:
        return True
    parameter = declared(key)
    if upwards:
        return value < parameter.maximum
    return not isinstance(parameter.minimum, float | int) or value > parameter.minimum
