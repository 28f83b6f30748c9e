"""Why a design is worth building, in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy

from foldcar.advice.evidence import DesignEvidence
from foldcar.advice.outlook import Outlook
from foldcar.analysis import selection
from foldcar.analysis.words import count, listed, percent, points, span_text

# Undecided designs that are named.
NAMED = 3

_FIRST = {
    selection.MIDDLE: "the middle of the feasible region: if it fails, simulation is wrong where it is surest",
    selection.LOWER_EDGE: "the lower edge of the feasible region: is the border where simulation sees it?",
    selection.UPPER_EDGE: "the upper edge of the feasible region: is the border where simulation sees it?",
    selection.EDGE: "an edge of the feasible region: is the border where simulation sees it?",
    selection.BELOW: "just outside, below the region: bounds it, or shows that simulation is too strict",
    selection.ABOVE: "just outside, above the region: bounds it, or shows that simulation is too strict",
    selection.OUTSIDE: "just outside the region: bounds it, or shows that simulation is too strict",
    selection.BEST: "the best in simulation, though no design reaches the threshold there",
    selection.END: "an end of the range, all of which is feasible in simulation: no border is in it",
}


@dataclass(frozen=True, slots=True)
class Undecided:
    """A design that may reach the threshold or not; ``at`` it: within the precision on both sides.

    Some ``trials`` more would tell, as likely as not.
    """

    label: str
    design: Mapping[str, float | str]
    at: bool
    trials: int


def undecided_text(undecided: Sequence[Undecided], precision: float) -> str:
    """Which designs are left undecided and what deciding takes, as a clause."""
    if not undecided:
        return "which is decided for every design"
    parts = []
    for at in (True, False):
        some = sorted((one for one in undecided if one.at == at), key=lambda one: one.trials)
        if some:
            stand = "stand" + "s" * (len(some) == 1)
            how = f"{stand} within {points(precision, sign=False)} points of it" if at else "may reach it or not"
            more = [count(len(some) - NAMED, "further design")] if len(some) > NAMED else []
            first = f" of {some[0].label}" if len(some) > 1 else ""
            tell = f"some {_rounded(some[0].trials)} more trials{first} would tell as likely as not"
            parts.append(f"{listed([*(one.label for one in some[:NAMED]), *more])} {how} ({tell})")
    return " and ".join(parts)


def _rounded(number: int) -> str:
    step = 10 ** max(0, len(str(number)) - 2)
    return f"{-(-number // step) * step:,}"


def first_reason(place: str, one: DesignEvidence, simulation: str) -> str:
    """Why a design is built before there are trials."""
    return f"{_FIRST[place]}; {simulation} passes {percent(one.runs_passed / one.runs)}"


def next_reason(seen: Outlook, index: int, threshold: float) -> str:
    """Why a design is tried next, from what is believed of it."""
    parts = []
    above = float((seen.draws[:, index] >= threshold).mean())
    best = float((seen.draws.argmax(axis=1) == index).mean())
    low, high = numpy.quantile(seen.draws[:, index], [0.025, 0.975])
    if seen.pooled is not None:
        low, high = seen.pooled[index].low, seen.pooled[index].high
    if low < threshold <= high:
        span = f"its rate may be {percent(low)} to {percent(high)}"
        parts.append(f"{span}: reaches {percent(threshold)} with a chance of {percent(above)}")
    else:
        parts.append(f"its rate is {percent(low)} to {percent(high)}, which bounds its neighbours'")
    if best >= 1.5 / len(seen.designs):
        parts.append(f"it is the best with a chance of {percent(best)}")
    one = seen.designs[index]
    if one.trials:
        parts.append(f"it was driven: {one.trials_passed} of {count(len(one.trials), 'trial')} passed")
    return "; ".join(parts)


def region_text(seen: Outlook, threshold: float, parameters: Sequence[str], simulation: str) -> str:
    """The feasible region in ``simulation``, as it is called: ranges of the one parameter, or how many designs."""
    feasible = seen.smooth[:, 0] >= threshold
    limit, total = percent(threshold), len(seen.designs)
    considered = " considered" if seen.thinned else ""
    if not feasible.any():
        return f"In {simulation} no design{considered} reaches {limit}."
    if feasible.all():
        what = "the design" if total == 1 else f"each of {total} designs{considered}"
        return f"In {simulation} {what} reaches {limit}."
    if len(parameters) != 1:
        return f"In {simulation} {int(feasible.sum())} of {total} designs{considered} reach {limit}."
    order = numpy.argsort(seen.parameters[:, 0], kind="stable")
    values, inside = seen.parameters[order, 0], feasible[order]
    ranges = []
    for run in numpy.split(numpy.arange(total), numpy.flatnonzero(numpy.diff(inside)) + 1):
        if inside[run[0]]:
            ranges.append(span_text(parameters[0], float(values[run[0]]), float(values[run[-1]])))
    return f"In {simulation} {limit} is reached at {listed(ranges)}."
