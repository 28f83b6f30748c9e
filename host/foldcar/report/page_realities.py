"""The realities that page and figures draw, and what the trials have taught about the simulator's unknowns."""

import math

import numpy

from foldcar.belief.answers import Estimate, Unknown
from foldcar.belief.priors import NAMES, FloatArray
from foldcar.evidence.belief import Belief, taught
from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import PageRealities, TaughtUnknown

# Realities that the main chart draws.
REALITIES = 100


def drawn_realities(evidence: Evidence) -> tuple[FloatArray, FloatArray] | None:
    """Draw random values of the simulator's unknown parameters, and return them with the designs' success rates.

    A *reality* is one such set of values, for example of friction and backlash. It is drawn from the belief: the
    probability distribution of these values, given the trials. The values are (REALITIES, parameters). The rates are
    (REALITIES, designs of the family). They are NaN for designs that do not belong to the belief. Returns None if there
    is no belief.
    """
    belief = evidence.belief
    if belief is None:
        return None
    values, rates = belief.answers.realities(REALITIES)
    rates_of_family = numpy.full((REALITIES, len(evidence.family)), numpy.nan)
    rates_of_family[:, belief.design_indices] = rates
    return values, rates_of_family


def page_realities(evidence: Evidence) -> PageRealities | None:
    """Return the realities that the page draws, and what the trials have taught about reality.

    A reality is a set of values of the simulator's unknown parameters, with the success rates of the designs at these
    values. ``taught`` are sentences, and ``learned`` is the error of the fast approximation of these rates. Returns None
    if there is no belief.
    """
    belief, drawn = evidence.belief, drawn_realities(evidence)
    if belief is None or drawn is None:
        return None
    values, rates = drawn
    return {
        "driven": belief.driven,
        "names": list(NAMES),
        "values": [[_rounded(value) for value in row] for row in values.tolist()],
        "rates": [[_rate_or_none(rate) for rate in row] for row in rates.tolist()],
        "unknowns": [_unknown(unknown) for unknown in belief.answers.unknowns],
        "taught": taught(belief.answers),
        "learned": {"runs": belief.answers.learned.runs, "error": belief.answers.learned.error},
    }


def other_remarks(belief: Belief | None, remarks: list[str]) -> list[str]:
    """Return the remarks without the sentences of ``taught``, which the page shows in a part of their own."""
    if belief is None:
        return list(remarks)
    taught_sentences = taught(belief.answers)
    return [remark for remark in remarks if remark not in taught_sentences]


def _unknown(unknown: Unknown) -> TaughtUnknown:
    """Return a row of the page about an unknown parameter of the simulator: its estimate before and after the trials.

    ``measured`` is its measured value or None. ``taught`` is whether the trials have changed the estimate noticeably.
    """
    return {
        "name": unknown.parameter.name,
        "unit": unknown.parameter.unit,
        "meaning": unknown.parameter.meaning,
        "before": _ends(unknown.before),
        "after": _ends(unknown.after),
        "measured": unknown.measured,
        "taught": unknown.taught,
    }


def _ends(estimate: Estimate) -> list[float]:
    """Return low, middle and high of an estimate."""
    return [_rounded(value) for value in (estimate.low, estimate.value, estimate.high)]


def _rounded(value: float) -> float:
    """Return the number with four digits."""
    return float(f"{value:.4g}")


def _rate_or_none(rate: float) -> float | None:
    """Return a rate with three decimals; None for NaN, the rate of a design outside the belief."""
    return None if math.isnan(rate) else round(rate, 3)
