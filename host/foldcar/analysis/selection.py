"""Which designs to try next, how many trials they need, and in which environments, from draws of the true rates.

Draws are those of :mod:`foldcar.analysis.truth_draws`: what is believed of all designs together.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError

MOST_TRIALS = 10_000


@dataclass(frozen=True)
class Value:
    """What ``trials`` more trials of each design (designs,) are worth on average, 0 to 1.

    ``choice``: by how much more the design that is best then would pass than the one that is best now (the knowledge
    gradient, Frazier, Powell and Dayanik 2008). ``threshold``: by how much smaller the share of designs would be that are
    put on the wrong side of the threshold.
    """

    trials: int
    choice: NDArray[Any]
    threshold: NDArray[Any]

    @property
    def total(self) -> NDArray[Any]:
        """Both together."""
        found: NDArray[Any] = self.choice + self.threshold
        return found


def value_of_trials(draws: ArrayLike, threshold: float, trials: int) -> Value:
    """The value of ``trials`` trials of each design, over how many of them would pass; ``draws`` (draws, designs)."""
    from scipy.stats import binom

    p = numpy.asarray(draws, dtype=float)
    reached = (p >= threshold).astype(float)
    now = numpy.max(p.mean(axis=0))
    wrong_now = numpy.minimum(reached.mean(axis=0), 1 - reached.mean(axis=0)).mean()
    choice, right = numpy.zeros(p.shape[1]), numpy.zeros(p.shape[1])
    for design in range(p.shape[1]):
        # Rows: outcomes of the trials; columns: draws, by their weight once the outcome is known.
        chance = binom.pmf(numpy.arange(trials + 1)[:, None], trials, p[:, design]) / len(p)
        choice[design] = (chance @ p).max(axis=1).sum() - now
        above = chance @ reached
        below = chance.sum(axis=1, keepdims=True) - above
        right[design] = wrong_now - numpy.minimum(above, below).sum(axis=0).mean()
    # Rounding may leave a hair below 0.
    return Value(trials, choice.clip(0), right.clip(0))


def choose(draws: ArrayLike, threshold: float, trials: int, number: int, chosen: Sequence[int] = ()) -> list[int]:
    """Up to ``number`` more designs, first those whose trials are worth most beside those of the ``chosen`` ones.

    What two tell alike counts once: a design whose rate goes with a chosen one's counts by the rest of its variance.
    """
    p = numpy.asarray(draws, dtype=float)
    # Where nothing is worth a trial the least known designs come first.
    value = value_of_trials(p, threshold, trials).total + 1e-9
    found = list(chosen)
    while len(found) < min(len(chosen) + number, p.shape[1]):
        left = value * _unexplained(p, found)
        left[found] = -numpy.inf
        found.append(int(left.argmax()))
    return found[len(chosen) :]


def _unexplained(draws: NDArray[Any], chosen: Sequence[int]) -> NDArray[Any]:
    """The share of each design's variance (designs,) that a linear regression on the chosen designs leaves."""
    if not chosen:
        return numpy.ones(draws.shape[1])
    centred = draws - draws.mean(axis=0)
    basis, _ = numpy.linalg.qr(centred[:, list(chosen)])
    rest = centred - basis @ (basis.T @ centred)
    variance = (centred**2).sum(axis=0)
    found: NDArray[Any] = (rest**2).sum(axis=0) / numpy.where(variance > 0, variance, 1.0)
    return found


def trials_needed(rates: ArrayLike, half_width: float, confidence: float = 0.95) -> int:
    """How many trials make Wilson's interval as narrow as ``half_width`` (0 to 0.5), on average over possible ``rates``.

    At most MOST_TRIALS.
    """
    if not 0 < half_width < 0.5:
        raise FoldcarError(f"a half-width must be between 0 and 0.5; it is {half_width:g}")
    p = numpy.asarray(rates, dtype=float).ravel()
    low, high = 1, MOST_TRIALS
    while low < high:
        middle = (low + high) // 2
        if _mean_half_width(p, middle, confidence) <= half_width:
            high = middle
        else:
            low = middle + 1
    return low


def _mean_half_width(rates: NDArray[Any], number: int, confidence: float) -> float:
    """The mean over rates of the half-width of Wilson's interval when a share of the rate has passed."""
    from scipy.stats import norm

    z = norm.ppf((1 + confidence) / 2)
    widths = numpy.sqrt(rates * (1 - rates) / number + (z / (2 * number)) ** 2) * z / (1 + z**2 / number)
    return float(widths.mean())


def telling_environments(passed: ArrayLike, number: int, met: Collection[int] = ()) -> list[int]:
    """Environments that represent all, and in which simulation tells the designs apart as often as may be.

    ``passed`` (designs, environments): simulation's results, NaN where there is none; ``met`` are not chosen again. Each
    choice brings the designs' shares of passed runs nearest to those of all environments; of equally good ones the one in
    which the designs differ most. So trials in them are not of harder or easier environments than the others.
    Deterministic. The telling ones stand first.
    """
    table = numpy.asarray(passed, dtype=float)
    known = ~numpy.isnan(table).any(axis=0)
    free = [index for index in numpy.flatnonzero(known) if index not in met]
    if not free:
        return []
    shares = table[:, known].mean(axis=1)
    spread = table.std(axis=0)
    chosen: list[int] = []
    total = numpy.zeros(len(table))
    for size in range(1, min(number, len(free)) + 1):
        left = numpy.array([index for index in free if index not in chosen])
        off = (((total[:, None] + table[:, left]) / size - shares[:, None]) ** 2).sum(axis=0)
        # Differences below a tenth of an environment are none.
        order = numpy.lexsort((left, -spread[left], numpy.round(off * size**2, 1)))
        chosen.append(int(left[order[0]]))
        total = total + table[:, chosen[-1]]
    return sorted(chosen, key=lambda index: (-spread[index], index))


def honest_best(passed: ArrayLike) -> tuple[int, int, int]:
    """The best design in simulation, and how many of how many runs it passed in environments that did not choose it.

    ``passed`` (designs, environments), NaN where there is no run. Every second environment chooses, the others count: the
    rate of the best of many in the environments that chose it is too high.
    """
    table = numpy.asarray(passed, dtype=float)
    choosing, counting = table[:, 0::2], table[:, 1::2]
    known = (~numpy.isnan(choosing)).sum(axis=1)
    shares = (numpy.nansum(choosing, axis=1) + 0.5) / (known + 1)
    # Of equally good ones the middle one: neighbours that are as good make it a safer choice.
    ties = numpy.flatnonzero(shares >= shares.max() - 1e-12)
    best = int(ties[len(ties) // 2])
    counted = counting[best][~numpy.isnan(counting[best])]
    return best, int(counted.sum()), len(counted)


def expected_loss(draws: ArrayLike) -> tuple[int, float]:
    """The design of the highest mean rate, and by how much the truly best one passes more often, 0 to 1, on average."""
    p = numpy.asarray(draws, dtype=float)
    best = int(numpy.argmax(p.mean(axis=0)))
    return best, float((p.max(axis=1) - p[:, best]).mean())
