"""Driven designs whose trials contradict those of the others, beside which rates of designs not driven are not known.

That the difference of trials and simulation is smooth (:mod:`foldcar.analysis.pooled_bias`) is an assumption: a lone
design that fails between good ones breaks it. So each design's trials are predicted from those of the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.built_cars import SPREADS, BuiltCars
from foldcar.analysis.gaussian_process import unit_range
from foldcar.analysis.pooled_bias import pooled_bias
from foldcar.analysis.words import listed

# Results that the others' trials make less probable than this contradict them (both tails; docs/statistics.md).
LEAST_PROBABILITY = 0.05
# Fewer driven designs say nothing of each other; of more than MOST_CHECKED those with most trials are checked.
LEAST_DRIVEN, MOST_CHECKED = 3, 24
DRAWS = 1000


@dataclass(frozen=True)
class Contradictions:
    """Indices of driven ``designs`` that contradict the others, and of those not driven ``beside`` them."""

    designs: tuple[int, ...] = ()
    beside: tuple[int, ...] = ()

    def remark(self, labels: Sequence[str]) -> list[str]:
        """A sentence that names them, if there are any."""
        if not self.designs:
            return []
        named, some = listed([labels[index] for index in self.designs]), [labels[index] for index in self.beside]
        which = f" ({listed([*some[:3], *[f'{len(some) - 3} more'] * (len(some) > 3)])})" if some else ""
        return [
            f"The trials of {named} contradict those of the other designs: rates of designs not driven beside "
            f"{'it' if len(self.designs) == 1 else 'them'}{which} are not to be trusted."
        ]


NONE = Contradictions()


def contradictions(
    parameters: ArrayLike, runs: ArrayLike, trials: ArrayLike, cars: Sequence[BuiltCars | None] | None = None
) -> Contradictions:
    """Check designs (d, k) with runs and trials (d, 2), passed and all, as :func:`pooled_bias` takes them.

    ``cars`` (d,) drove the trials, None of designs without; else all cars of a design are alike.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    driven = numpy.flatnonzero(y[:, 1])
    if len(driven) < LEAST_DRIVEN or not x.size:
        return NONE
    told = driven[numpy.argsort(-y[driven, 1], kind="stable")][:MOST_CHECKED]
    known = tuple(_car_facts(cars[index] if cars is not None else None, y[index]) for index in told)
    probable = _probabilities(*(tuple(map(tuple, one[told].tolist())) for one in (x, f, y)), known)
    flagged = sorted(told[probable < LEAST_PROBABILITY].tolist())
    if not flagged:
        return NONE
    return Contradictions(tuple(flagged), tuple(numpy.flatnonzero(_beside(unit_range(x), driven, flagged)).tolist()))


def _car_facts(cars: BuiltCars | None, trials: NDArray[Any]) -> Any:
    if cars is None:
        alike = tuple(float(spread == 0) for spread in SPREADS)
        return (float(trials[0]),), (float(trials[1]),), (0.0,), alike
    return tuple(tuple(getattr(cars, name).tolist()) for name in ("passed", "counted", "shift", "weights"))


# A page is made again and again while a sweep runs.
@lru_cache(32)
def _probabilities(parameters: Any, runs: Any, trials: Any, cars: Any) -> NDArray[Any]:
    """How probable each design's trials (d,), or less probable ones, are by the others'."""
    y, built = numpy.array(trials), [BuiltCars(*map(numpy.array, one)) for one in cars]
    random, found = numpy.random.default_rng(1), []
    for index, one in enumerate(built):
        others = y.copy()
        others[index] = 0
        rate = pooled_bias(parameters, runs, others, built).draws(DRAWS)[:, index].clip(1e-9, 1 - 1e-9)
        counts = one.count_draws(rate, random)
        tails = (counts <= one.passed.sum()).mean(), (counts >= one.passed.sum()).mean()
        found.append(2 * float(min(tails)))
    return numpy.array(found)


def _beside(unit: NDArray[Any], driven: NDArray[Any], flagged: Sequence[int]) -> NDArray[Any]:
    """Whether designs are not driven and no driven one lies between them and a flagged one.

    Between: nearer to both than they are to each other (the relative neighbourhood of Toussaint 1980,
    doi:10.1016/0031-3203(80)90066-7); of one parameter, between their values.
    """
    found = numpy.zeros(len(unit), dtype=bool)
    apart = numpy.sqrt(((unit[:, None] - unit[driven][None]) ** 2).sum(axis=2))
    for index in flagged:
        away = numpy.sqrt(((unit - unit[index]) ** 2).sum(axis=1))
        found |= ~((apart < away[:, None]) & (away[driven] < away[:, None]) & (driven != index)).any(axis=1)
    found[driven] = False
    return found
