"""Summarises a calibration as JSON values: parameters, designs, correlations, findings in words.

Input: an Inference, nominal runs by design. Output: the object that the store keeps and the command prints. Rates and
fractions are 0 to 1; ``low`` and ``high`` are the ends of 90 % intervals.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binom

from foldcar.belief.priors import (
    MEASURABLE,
    NAMES,
    PARAMETERS,
    FloatArray,
    Parameter,
    ScorePrior,
    prior_interval,
)
from foldcar.inference.calibration.experiment import SweptExperiment
from foldcar.inference.calibration.inference import Inference
from foldcar.inference.calibration.posterior import DISCREPANCY
from foldcar.inference.calibration.predictions import Rates, fraction_interval, log_score, rates_of, trial_chances
from foldcar.statistics.words import design_text, listed

CONFIDENCE = 0.9
# A larger error of the emulator in a rate is reported.
MAX_EMULATOR_ERROR = 0.03
# Reductions of a parameter's variance: below the first trials are uninformative, from the second on informative.
UNINFORMATIVE, INFORMATIVE = 0.1, 0.3
# Correlations from this size on are reported, at most MAX_PAIRS of them.
MIN_CORRELATION, MAX_PAIRS = 0.25, 3
# Passed and all nominal runs of designs, by their index.
Nominal = Mapping[int, tuple[int, int]]


def summarise(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, seed: int, runs: int, leave_one_out: bool
) -> dict[str, Any]:
    """Return the summary of an inference that took ``runs`` simulations.

    ``nominal`` are the numbers (passed, counted) of nominal runs by the design's index. ``leave_one_out`` also predicts
    each design from the trials of the other designs.
    """
    observed, rates = inference.problem.observed, rates_of(inference, experiment, seed)
    counts = observed.counts()
    trials = {design: counted for design, (_, counted) in counts.items()}
    chances = trial_chances(inference.problem, inference.posterior, trials, rates.errors(inference.designs))
    summary: dict[str, Any] = {
        "experiment": experiment.info.id,
        "seed": seed,
        "runs": runs,
        "simulated_trials": observed.simulated,
        "parameters": _parameters(inference),
        # Standard deviation of the log-odds of cars of one design.
        "car_sd": inference.problem.emulator.car_sd,
        "correlations": _correlations(inference),
        "designs": _designs(inference, experiment, nominal, rates, chances),
        "log_likelihood": _log_likelihood(inference, nominal, rates, chances),
        "emulator": {"error": rates.emulator_error, "check_runs": len(inference.table)},
        "notes": list(observed.notes),
    }
    if leave_one_out:
        summary["leave_one_out"] = left_out(inference, experiment, nominal, rates, seed)
    summary["findings"] = findings(summary)
    return summary


def left_out(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, rates: Rates, seed: int
) -> list[dict[str, Any]]:
    """Predict each design's trials from those of the other designs: a row for each design, with the log score.

    The emulator stays the same, because it was fitted to simulations only. Returns no rows for fewer than two designs.
    """
    observed, errors, rows = inference.problem.observed, rates.errors(inference.designs), []
    counts = observed.counts()
    for design, (passed, counted) in counts.items() if len(counts) > 1 else ():
        problem = replace(inference.problem, observed=observed.without(design))
        chances = trial_chances(problem, problem.posterior(seed), {design: counted}, errors)[design]
        rows.append(
            {
                "design": experiment.varied(design),
                "passed": passed,
                "counted": counted,
                "predicted": _predicted_interval(chances, CONFIDENCE),
                "log_score": log_score(chances, passed),
                "nominal_log_score": _nominal_log_score(nominal.get(design), passed, counted),
            }
        )
    return rows


def _nominal_log_score(runs: tuple[int, int] | None, passed: int, counted: int) -> float | None:
    """Return the log probability of the trials at the rate of nominal ``runs`` (passed, all); None without runs."""
    if runs is None or not runs[1]:
        return None
    return float(binom.logpmf(passed, counted, (runs[0] + 0.5) / (runs[1] + 1)))


def _parameters(inference: Inference) -> list[dict[str, Any]]:
    """Return a row for each parameter and for the discrepancy, with its prior and its posterior."""
    problem, posterior = inference.problem, inference.posterior
    rows = []
    for index, (parameter, scores) in enumerate(zip(PARAMETERS, posterior.scores.T, strict=True)):
        prior = problem.priors.get(index, ScorePrior(0.0, 1.0, parameter.source))
        # The reduction of the prior's variance; a measured value has no variance.
        variance_reduction = max(0.0, 1 - float(scores.var()) / prior.sd**2) if index in problem.free else None
        rows.append(_parameter(parameter, np.asarray(parameter.value(scores)), prior, variance_reduction))
    return [*rows, _parameter(DISCREPANCY, posterior.discrepancy, ScorePrior(0.0, 1.0, DISCREPANCY.source), None)]


def _parameter(
    parameter: Parameter, values: FloatArray, prior: ScorePrior, variance_reduction: float | None
) -> dict[str, Any]:
    """Return the row of a parameter with posterior draws ``values`` (n,)."""
    return {
        **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "nominal")},
        "source": prior.source,
        "prior": dict(zip(("low", "median", "high"), prior_interval(parameter, prior), strict=True)),
        "posterior": _quantiles(values),
        # The fraction of the prior's variance that the trials removed.
        "explained": variance_reduction,
    }


def _correlations(inference: Inference) -> list[dict[str, Any]]:
    """Return the correlations of all pairs of parameters, strongest first."""
    free = inference.problem.free
    matrix = np.atleast_2d(np.corrcoef(inference.posterior.scores[:, free].T))
    # Each pair once: ``second`` comes before ``first``.
    pairs = [
        {"parameters": [NAMES[second], NAMES[first]], "correlation": round(float(matrix[i, j]), 3)}
        for i, first in enumerate(free)
        for j, second in enumerate(free[:i])
    ]
    return sorted(pairs, key=lambda pair: -abs(pair["correlation"]))


def _designs(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, rates: Rates, chances: Mapping[int, FloatArray]
) -> list[dict[str, Any]]:
    """Return a row for each checked design: its trials, and its rates in simulation and of built cars.

    If the design has trials, ``predicted`` is the interval of the fraction that passes in as many trials of another car.
    """
    counts, rows = inference.problem.observed.counts(), []
    for column, design in enumerate(inference.designs.tolist()):
        calibrated, built = rates.calibrated[:, column], rates.predicted[:, column]
        passed, counted = counts.get(design, (0, 0))
        # Runs of the sweep, with the simulator's nominal parameters.
        nominal_passed, runs = nominal.get(design, (0, 0))
        row: dict[str, Any] = {
            "design": experiment.varied(design),
            "passed": passed,
            "counted": counted,
            "nominal": nominal_passed / runs if runs else None,
            "simulated": {**_quantiles(calibrated), "mean": float(calibrated.mean())},
            "built": {**_quantiles(built), "mean": float(built.mean())},
        }
        if counted:
            row["predicted"] = _predicted_interval(chances[design], CONFIDENCE)
            row["predicted_95"] = _predicted_interval(chances[design], 0.95)
        rows.append(row)
    return rows


def _log_likelihood(
    inference: Inference, nominal: Nominal, rates: Rates, chances: Mapping[int, FloatArray]
) -> dict[str, float | None]:
    """Return log-likelihoods of the numbers of passed trials under four predictions of the designs' rates.

    ``draws`` is the mean over the published draws, ``nominal`` uses the rates of nominal runs, ``best`` the trials' own
    rates, the highest likelihood possible. ``expected`` is that of new cars, whose discrepancy is integrated out.
    """
    counts = inference.problem.observed.counts()
    published = dict(zip(inference.designs.tolist(), rates.calibrated[inference.chosen].T, strict=True))
    scores = [_nominal_log_score(nominal.get(design), k, n) for design, (k, n) in counts.items()]
    defined_scores = [score for score in scores if score is not None]
    return {
        "expected": sum(log_score(chances[design], k) for design, (k, _) in counts.items()),
        "draws": float(sum(binom.logpmf(k, n, published[design]).mean() for design, (k, n) in counts.items())),
        "nominal": sum(defined_scores) if len(defined_scores) == len(scores) else None,
        "best": float(sum(binom.logpmf(k, n, k / n) for k, n in counts.values())),
    }


def _quantiles(values: FloatArray) -> dict[str, float]:
    """Return the median of draws (n,) and the ends of their central CONFIDENCE interval."""
    low, high, median = np.quantile(values, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2, 0.5]).tolist()
    return {"low": low, "high": high, "median": median}


def _predicted_interval(chances: FloatArray, confidence: float) -> dict[str, float]:
    """Return the interval of the fraction that passes, for log probabilities (n, trials + 1)."""
    return dict(zip(("low", "high"), fraction_interval(chances, confidence), strict=True))


def findings(summary: Mapping[str, Any]) -> list[str]:
    """Return sentences about the summary; the first says whether the calibration explains the trials."""
    findings = [*_fit(summary), *_learned(summary)]
    strong = [pair for pair in summary["correlations"] if abs(pair["correlation"]) >= MIN_CORRELATION]
    for pair in strong[:MAX_PAIRS]:
        first, second = pair["parameters"]
        direction = "lower" if pair["correlation"] > 0 else "higher"
        findings.append(
            f"The trials cannot tell {first} and {second} apart (correlation {pair['correlation']:+.2f}): lower {first} "
            f"with {direction} {second} explains them as well."
        )
    if summary["emulator"]["error"] > MAX_EMULATOR_ERROR:
        findings.append(
            f"The emulator erred by {100 * summary['emulator']['error']:.0f} points in the rate of a design with trials: "
            "take more --runs."
        )
    inferred = [parameter["name"] for parameter in summary["parameters"] if parameter["explained"] is not None]
    if measurable := [name for name in MEASURABLE if name in inferred]:
        findings.append(f"Measuring often tells more than trials: {listed(measurable)} (`foldcar trials measure`).")
    return findings


def _fit(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield whether the calibrated simulator explains the trials, and whether its discrepancy exceeds the prior."""
    designs = [design for design in summary["designs"] if design["counted"]]
    outside = [
        design_text(design["design"])
        for design in designs
        if not design["predicted_95"]["low"] <= design["passed"] / design["counted"] <= design["predicted_95"]["high"]
    ]
    if outside:
        yield (
            f"The trials of {listed(outside)} lie outside the 95 % intervals that the calibrated simulator predicts: no "
            "set of these parameters explains them."
        )
    else:
        yield f"The calibrated simulator's 95 % intervals cover the trials of all {len(designs)} designs."
    discrepancy = next(parameter for parameter in summary["parameters"] if parameter["name"] == DISCREPANCY.name)
    if discrepancy["posterior"]["median"] > 1.3 * discrepancy["prior"]["median"]:
        yield "The discrepancy is larger than its prior: the simulator lacks something that decides the trials."


def _learned(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield which parameters the trials narrowed, by falling reduction of variance, and which they did not."""
    rows = [parameter for parameter in summary["parameters"] if parameter["explained"] is not None]
    for row in sorted(rows, key=lambda row: -row["explained"]):
        if row["explained"] >= INFORMATIVE:
            before, after = (
                f"{ends['median']:.3g} ({ends['low']:.2g} to {ends['high']:.2g})"
                for ends in (row["prior"], row["posterior"])
            )
            yield f"{row['name']} is {after} {row['unit']}, before the trials {before}."
    uninformed = [row["name"] for row in rows if row["explained"] < UNINFORMATIVE]
    if uninformed:
        yield f"The trials say almost nothing about {listed(uninformed)}: the intervals are those of the prior."
