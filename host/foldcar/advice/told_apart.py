"""Which of several designs simulation tells apart from its best one, over the same environments.

Input: results of designs in environments. Output: a sentence for the reader.
"""

from collections.abc import Sequence

import numpy
from numpy.typing import ArrayLike

from foldcar.advice.words import listed, points
from foldcar.analysis.paired import PairedRates, paired_rates

# Of the tests together: each is at this share of their number (Bonferroni).
LEVEL = 0.05
# Fewer environments tell hardly any designs apart.
LEAST = 10
# Designs that differ by less, 0 to 1, are as good as each other.
ALIKE = 0.1


def told_apart_text(passed: ArrayLike, labels: Sequence[str], best: int, others: Sequence[int]) -> str | None:
    """How the ``others`` compare with the ``best``; None if there is nothing to compare.

    ``passed`` (designs, environments) has NaN where there is no run. The best must have been chosen in other
    environments: in those that chose it, it looks better than it is.
    """
    table = numpy.asarray(passed, dtype=float)
    level = LEVEL / max(1, len([one for one in others if one != best]))
    behind: list[str] = []
    ahead: list[str] = []
    close: list[tuple[str, PairedRates]] = []
    environments = 0
    for other in others:
        both = ~numpy.isnan(table[best]) & ~numpy.isnan(table[other])
        if other == best or both.sum() < LEAST:
            continue
        pair = paired_rates(table[best][both], table[other][both], 1 - level)
        environments = max(environments, pair.environments)
        if pair.p_value <= level:
            (behind if pair.difference > 0 else ahead).append(labels[other])
        else:
            close.append((labels[other], pair))
    said = []
    if behind:
        said.append(f"passes more often than {_named(behind)}")
    if ahead:
        said.append(f"passes less often than {_named(ahead)}")
    if close:
        reach = max(pair.high for _, pair in close)
        advised = "choose between these by cost" if reach <= ALIKE else "more environments would tell"
        said.append(
            f"is not told apart from {_named([label for label, _ in close])}, which may pass up to "
            f"{points(reach, sign=False)} points less: {advised}"
        )
    if not said:
        return None
    return (
        f"Over the same {environments} environments, which did not choose it, {labels[best]} {'; it '.join(said)}. "
        f"(McNemar's exact test over runs, {100 * LEVEL:g} % for all comparisons together.)"
    )


def _named(labels: Sequence[str]) -> str:
    return "; ".join(labels) if any("," in label for label in labels) else listed(labels)
