"""The feasible region of a grid of designs: those that reach a threshold of success, its edges, middle and outside.

Works for one and for several parameters: an edge is a feasible design beside one that is not, the middle is the feasible
design farthest from all that are not and from the ends of the range.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.truth_draws import unit_range

MIDDLE, LOWER_EDGE, UPPER_EDGE, EDGE, BELOW, ABOVE, OUTSIDE, BEST, END = (
    "middle", "lower edge", "upper edge", "edge", "below", "above", "outside", "best", "end of the range",
)  # fmt: skip


@dataclass(frozen=True)
class Placed:
    """A design, by its index, and its place in the feasible region: one of MIDDLE, LOWER_EDGE, … of this module."""

    index: int
    place: str


def first_designs(
    parameters: ArrayLike, rates: ArrayLike, uncertainty: ArrayLike, threshold: float
) -> list[Placed]:
    """The designs to build before there are trials, the most useful first.

    ``parameters`` (designs, k), ``rates`` (designs,) of simulation, their ``uncertainty`` (designs,; the larger, the less
    is known of the border there), ``threshold``: all rates 0 to 1. In order: the middle, the edge whose border is less
    known, designs outside on both sides, the other edge. Without a feasible design: the best one. Without a border in the
    range: the middle and the range's ends.
    """
    x, p, doubt = (numpy.asarray(values, dtype=float) for values in (parameters, rates, uncertainty))
    feasible = p >= threshold
    if not feasible.any():
        return [Placed(int(numpy.argmax(p)), BEST)]
    unit = unit_range(x)
    middle = _middle(unit, feasible)
    found = [Placed(middle, MIDDLE)]
    if feasible.all():
        sums = unit.sum(axis=1)
        ends = [index for index in (int(numpy.argmin(sums)), int(numpy.argmax(sums))) if index != middle]
        return found + [Placed(index, END) for index in dict.fromkeys(ends)]
    edges = _opposite(_edges(unit, feasible), doubt, unit, middle)
    outside = _opposite(numpy.flatnonzero(~feasible), -numpy.abs(p - threshold / 2), unit, middle, edges[:1])
    ordered = [*((index, EDGE) for index in edges[:1]), *((index, OUTSIDE) for index in outside)]
    ordered += [(index, EDGE) for index in edges[1:]]
    taken = {middle}
    for index, place in ordered:
        if index not in taken:
            taken.add(index)
            found.append(Placed(index, _side(x, index, middle, place)))
    return found


def _middle(unit: NDArray[Any], feasible: NDArray[Any]) -> int:
    step = _steps(unit)
    ends = numpy.minimum(unit, 1 - unit) + step
    # A parameter that does not vary has no ends.
    to_end = numpy.where(numpy.ptp(unit, axis=0) > 0, ends, numpy.inf).min(axis=1, initial=numpy.inf)
    others = unit[~feasible]
    to_border = numpy.full(len(unit), numpy.inf)
    if len(others):
        to_border = numpy.sqrt(((unit[:, None, :] - others[None, :, :]) ** 2).sum(axis=2)).min(axis=1)
    depth = numpy.where(feasible, numpy.minimum(to_border, to_end), -numpy.inf)
    # Of several equally deep ones the central one.
    best = numpy.flatnonzero(depth >= depth.max() - 1e-9)
    return int(best[len(best) // 2])


def _edges(unit: NDArray[Any], feasible: NDArray[Any]) -> NDArray[Any]:
    """The feasible designs with an infeasible neighbour: one step away along one parameter."""
    step = _steps(unit)
    others = unit[~feasible]
    found = []
    for index in numpy.flatnonzero(feasible):
        apart = numpy.abs(others - unit[index])
        near = (apart <= 1.01 * step).all(axis=1) & ((apart > 1e-9).sum(axis=1) == 1)
        if near.any():
            found.append(index)
    # On a grid with gaps no neighbour may be there: the feasible design nearest to an infeasible one.
    if not found:
        inside = numpy.flatnonzero(feasible)
        apart = numpy.sqrt(((unit[inside][:, None, :] - others[None, :, :]) ** 2).sum(axis=2)).min(axis=1)
        found = [inside[int(apart.argmin())]]
    return numpy.array(found)


def _steps(unit: NDArray[Any]) -> NDArray[Any]:
    """The largest distance of neighbouring values of each parameter."""
    return numpy.array([numpy.diff(numpy.unique(column)).max(initial=0.0) for column in unit.T])


def _opposite(
    indices: NDArray[Any], score: NDArray[Any], unit: NDArray[Any], middle: int, apart_from: Sequence[int] = ()
) -> list[int]:
    """Two of the highest score, the first opposite of ``apart_from`` as seen from the middle, the second of the first."""
    chosen: list[int] = []
    before = list(apart_from)
    for _ in range(min(2, len(indices))):
        left = numpy.array([index for index in indices if index not in chosen])
        if before:
            opposite = (unit[left] - unit[middle]) @ (unit[before[-1]] - unit[middle]) < 0
            left = left[opposite] if opposite.any() else left
        chosen.append(int(left[score[left].argmax()]))
        before = list(chosen)
    return chosen


def _side(x: NDArray[Any], index: int, middle: int, place: str) -> str:
    """The place with its side, where one parameter varies."""
    varied = numpy.flatnonzero(numpy.ptp(x, axis=0) > 0)
    if len(varied) != 1:
        return place
    lower = x[index, varied[0]] < x[middle, varied[0]]
    if place == EDGE:
        return LOWER_EDGE if lower else UPPER_EDGE
    return BELOW if lower else ABOVE
