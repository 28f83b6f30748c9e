"""Which designs to try next, how many trials they need, and in which environments, from draws of the true rates.

Draws are those of :mod:`foldcar.analysis.truth_draws`: what is believed of all designs together.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError

# A design is decided if it is believed above, or below, the threshold with this probability.
SURE = 0.95
MOST_TRIALS = 10_000


@dataclass(frozen=True)
class Information:
    """What ``trials`` more trials of each design (designs,) would tell, in bits.

    ``best`` is about which design is best; ``threshold`` about which designs reach the threshold, summed over all.
    """

    trials: int
    best: NDArray[Any]
    threshold: NDArray[Any]

    @property
    def total(self) -> NDArray[Any]:
        """Both together."""
        found: NDArray[Any] = self.best + self.threshold
        return found


def information(draws: ArrayLike, threshold: float, trials: int) -> Information:
    """The mutual information of the number that passes of ``trials`` trials with what is to be decided.

    ``draws`` (draws, designs) of the true rates.
    """
    from scipy.stats import binom

    p = numpy.asarray(draws, dtype=float)
    best, reached = p.argmax(axis=1), p >= threshold
    about_best, about_threshold = numpy.zeros(p.shape[1]), numpy.zeros(p.shape[1])
    labels, groups = numpy.unique(best, return_inverse=True)
    # Rows: draws by which design is best there; then by which designs reach the threshold.
    is_best = numpy.eye(len(labels))[groups]
    for design in range(p.shape[1]):
        chance = binom.pmf(numpy.arange(trials + 1), trials, p[:, design, None])
        overall = chance.mean(axis=0)
        about_best[design] = _divergence(is_best, chance, overall)
        reaching = reached.astype(float)
        weights = reaching.mean(axis=0)
        for part, weight in ((reaching, weights), (1 - reaching, 1 - weights)):
            about_threshold[design] += float(_divergences(part, chance, overall) @ weight)
    return Information(trials, about_best, about_threshold)


def _divergence(groups: NDArray[Any], chance: NDArray[Any], overall: NDArray[Any]) -> float:
    return float(_divergences(groups, chance, overall) @ groups.mean(axis=0))


def _divergences(groups: NDArray[Any], chance: NDArray[Any], overall: NDArray[Any]) -> NDArray[Any]:
    """How much (bits) the outcomes' distribution within each group, a column of 0 and 1, diverges from the overall."""
    from scipy.special import xlogy

    sizes = groups.sum(axis=0)
    within = (groups.T @ chance) / sizes.clip(1)[:, None]
    found: NDArray[Any] = (xlogy(within, within) - xlogy(within, overall.clip(1e-300))).sum(axis=1) / numpy.log(2)
    return numpy.where(sizes > 0, found, 0.0)


def choose(draws: ArrayLike, threshold: float, trials: int, number: int, chosen: Sequence[int] = ()) -> list[int]:
    """Up to ``number`` more designs, by what their trials tell that those of the ``chosen`` ones do not.

    Information is counted once: a design whose rate goes with that of a chosen one counts by the rest of its variance.
    """
    p = numpy.asarray(draws, dtype=float)
    bits = information(p, threshold, trials).total
    found = list(chosen)
    while len(found) < min(len(chosen) + number, p.shape[1]):
        left = bits * _unexplained(p, found)
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


def undecided(draws: ArrayLike, threshold: float) -> NDArray[Any]:
    """Which designs (designs,) are believed neither above nor below the threshold with the probability SURE."""
    above = (numpy.asarray(draws) >= threshold).mean(axis=0)
    found: NDArray[Any] = (above < SURE) & (above > 1 - SURE)
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
    best = int(p.mean(axis=0).argmax())
    return best, float((p.max(axis=1) - p[:, best]).mean())
