"""What a calibration says, as JSON values: parameters, designs, correlations, findings in words, next trials.

Input: an Inference, nominal runs by design. Output: the object that the store keeps and the command prints. Rates and
shares are 0 to 1; ``low`` and ``high`` are the ends of 90 % intervals.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binom

from foldcar.inference.calibration.drive_features import CLIMBING, FAMILIES, FAMILY_NAMES, SPEED, TIPPING, TURNING
from foldcar.inference.calibration.experiment import SweptExperiment
from foldcar.inference.calibration.inference import Inference
from foldcar.inference.calibration.parameters import MEASURABLE, NAMES, PARAMETERS, FloatArray, Parameter, ScorePrior
from foldcar.inference.calibration.posterior import DISCREPANCY, PATH_DISCREPANCY
from foldcar.inference.calibration.predictions import (
    TRIALS,
    Rates,
    log_score,
    rank_next_trials,
    rates_of,
    share_interval,
    trial_chances,
)
from foldcar.statistics.words import design_text, listed

CONFIDENCE = 0.9
# A larger error of the emulator in a rate is reported.
TOLERATED = 0.03
SHOWN_TRIALS = 3
# Shares of the prior's variance: a parameter is as unknown as before below the first, known better from the second on.
UNTOLD, TOLD = 0.1, 0.3
# Correlations from here on are reported; at most this many.
CORRELATED, MOST_PAIRS = 0.25, 3
# Misfits of paths from this size on are reported.
WORTH = 1.15
_LACKS = {
    SPEED: "look at supply, servos and rolling on flat ground",
    CLIMBING: "look at heights, friction, torque and the centre of mass",
    TURNING: "look at sides that are not alike: wheels, camber, a centre of mass aside",
    TIPPING: "look at track, heights and the centre of mass",
}

# Passed and all nominal runs of designs, by their index.
Nominal = Mapping[int, tuple[int, int]]


def summarise(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, seed: int, runs: int, leave_one_out: bool
) -> dict[str, Any]:
    """The summary; ``leave_one_out`` also predicts each design from the trials of the others."""
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
        "car_sd": inference.problem.emulator.car_sd,
        "correlations": _correlations(inference),
        "designs": _designs(inference, experiment, nominal, rates, chances),
        "log_likelihood": _log_likelihood(inference, nominal, rates, chances),
        "emulator": {"error": rates.emulator_error, "check_runs": len(inference.table)},
        "misfits": misfits(inference),
        "notes": list(observed.notes),
        "next_trials": [
            {
                "design": experiment.varied(trials.design),
                "obstacle_height": trials.height,
                "trials": TRIALS,
                "bits": round(trials.bits, 3),
                "parameter": trials.parameter,
            }
            for trials in rank_next_trials(inference, experiment)[:SHOWN_TRIALS]
        ],
    }
    if leave_one_out:
        summary["leave_one_out"] = left_out(inference, experiment, nominal, rates, seed)
    summary["findings"] = findings(summary)
    return summary


def left_out(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, rates: Rates, seed: int
) -> list[dict[str, Any]]:
    """Predict each design's trials from those of the others, with the log scores of what happened.

    The emulator is the same: it knows the simulator only. Empty if there are fewer than two designs.
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
                "predicted": _ends(chances, CONFIDENCE),
                "log_score": log_score(chances, passed),
                "nominal_log_score": _nominal_log_score(nominal.get(design), passed, counted),
            }
        )
    return rows


def misfits(inference: Inference) -> list[dict[str, Any]]:
    """How far paths of trials lie from simulated ones: by family of features, in standard deviations of runs.

    ``size`` over all trials and features of the family under the posterior, which chance alone brings to 1, in one case
    of twenty above ``by_chance``; ``offset`` is the mean.
    """
    residuals = inference.problem.residuals(inference.posterior.scores[inference.chosen])
    if residuals is None:
        return []
    rows = []
    for family in FAMILY_NAMES:
        columns = residuals[..., [name == family for name in FAMILIES]]
        known = np.isfinite(columns[0])
        trials = known.any(axis=-1)
        if trials.any():
            # Each trial by the mean square of its features; the car's share makes trials of one car alike.
            sizes = np.nanmean(columns[:, trials] ** 2, axis=(0, 2))
            by_chance = float(1 + 1.645 / np.sqrt(2 * known.sum()))
            size, offset = float(np.sqrt(sizes.mean())), float(np.nanmean(columns))
            rows.append({"family": family, "trials": len(sizes), "size": size, "by_chance": by_chance, "offset": offset})
    return rows


def _nominal_log_score(runs: tuple[int, int] | None, passed: int, counted: int) -> float | None:
    """The log probability of the trials if a car passes as often as nominal ``runs`` (passed, all); None without runs."""
    if runs is None or not runs[1]:
        return None
    return float(binom.logpmf(passed, counted, (runs[0] + 0.5) / (runs[1] + 1)))


def _parameters(inference: Inference) -> list[dict[str, Any]]:
    problem, posterior = inference.problem, inference.posterior
    rows = []
    for index, (parameter, scores) in enumerate(zip(PARAMETERS, posterior.scores.T, strict=True)):
        prior = problem.priors.get(index, ScorePrior(0.0, 1.0, parameter.source))
        # The share of the prior's variance that is gone; a measured value leaves nothing to explain.
        explained = max(0.0, 1 - float(scores.var()) / prior.sd**2) if index in problem.free else None
        rows.append(_parameter(parameter, np.asarray(parameter.value(scores)), prior, explained))
    discrepancies = [(DISCREPANCY, posterior.discrepancy)]
    if problem.features is not None:
        for family, values in zip(FAMILY_NAMES, posterior.path_discrepancy.T, strict=True):
            discrepancies.append((replace(PATH_DISCREPANCY, name=f"{PATH_DISCREPANCY.name} {family}"), values))
    return rows + [_parameter(one, values, ScorePrior(0.0, 1.0, one.source), None) for one, values in discrepancies]


def _parameter(parameter: Parameter, values: FloatArray, prior: ScorePrior, explained: float | None) -> dict[str, Any]:
    before = [float(parameter.value(prior.mean + prior.sd * z)) for z in (-1.6448536, 0.0, 1.6448536)]
    return {
        **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "nominal")},
        "source": prior.source,
        "prior": dict(zip(("low", "median", "high"), before, strict=True)),
        "posterior": _middle(values),
        "explained": explained,
    }


def _correlations(inference: Inference) -> list[dict[str, Any]]:
    """Of all pairs of parameters, the strongest first."""
    free = inference.problem.free
    matrix = np.atleast_2d(np.corrcoef(inference.posterior.scores[:, free].T))
    pairs = [
        {"parameters": [NAMES[second], NAMES[first]], "correlation": round(float(matrix[i, j]), 3)}
        for i, first in enumerate(free)
        for j, second in enumerate(free[:i])
    ]
    return sorted(pairs, key=lambda pair: -abs(pair["correlation"]))


def _designs(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, rates: Rates, chances: Mapping[int, FloatArray]
) -> list[dict[str, Any]]:
    """Every checked design: those with trials have shares of as many trials of another car, ``predicted``, too."""
    counts, rows = inference.problem.observed.counts(), []
    for column, design in enumerate(inference.designs.tolist()):
        calibrated, built = rates.calibrated[:, column], rates.predicted[:, column]
        passed, counted = counts.get(design, (0, 0))
        nominal_passed, runs = nominal.get(design, (0, 0))
        row: dict[str, Any] = {
            "design": experiment.varied(design),
            "passed": passed,
            "counted": counted,
            "nominal": nominal_passed / runs if runs else None,
            "simulated": {**_middle(calibrated), "mean": float(calibrated.mean())},
            "built": {**_middle(built), "mean": float(built.mean())},
        }
        if counted:
            row["predicted"] = _ends(chances[design], CONFIDENCE)
            row["predicted_95"] = _ends(chances[design], 0.95)
        rows.append(row)
    return rows


def _log_likelihood(
    inference: Inference, nominal: Nominal, rates: Rates, chances: Mapping[int, FloatArray]
) -> dict[str, float | None]:
    """Of the numbers that passed: of all trials of a design, independent and at one rate.

    ``draws`` is the mean over the published draws, ``best`` what the trials' own rates have, ``nominal`` what nominal
    runs have: all three without a discrepancy; ``expected`` is the mean over the posterior with it integrated out.
    """
    counts = inference.problem.observed.counts()
    published = dict(zip(inference.designs.tolist(), rates.calibrated[inference.chosen].T, strict=True))
    scores = [_nominal_log_score(nominal.get(design), k, n) for design, (k, n) in counts.items()]
    known = [score for score in scores if score is not None]
    return {
        "expected": sum(log_score(chances[design], k) for design, (k, _) in counts.items()),
        "draws": float(sum(binom.logpmf(k, n, published[design]).mean() for design, (k, n) in counts.items())),
        "nominal": sum(known) if len(known) == len(scores) else None,
        "best": float(sum(binom.logpmf(k, n, k / n) for k, n in counts.values())),
    }


def _middle(values: FloatArray) -> dict[str, float]:
    low, high, median = np.quantile(values, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2, 0.5]).tolist()
    return {"low": low, "high": high, "median": median}


def _ends(chances: FloatArray, confidence: float) -> dict[str, float]:
    return dict(zip(("low", "high"), share_interval(chances, confidence), strict=True))


def findings(summary: Mapping[str, Any]) -> list[str]:
    """What the numbers say and cannot say, in sentences; the first is whether the trials are explained."""
    findings = [*_fit(summary), *_known_better(summary)]
    strong = [pair for pair in summary["correlations"] if abs(pair["correlation"]) >= CORRELATED]
    for pair in strong[:MOST_PAIRS]:
        first, second = pair["parameters"]
        other = "lower" if pair["correlation"] > 0 else "higher"
        findings.append(
            f"The trials cannot tell {first} and {second} apart (correlation {pair['correlation']:+.2f}): lower {first} "
            f"with {other} {second} explains them as well."
        )
    if summary["emulator"]["error"] > TOLERATED:
        findings.append(
            f"The emulator erred by {100 * summary['emulator']['error']:.0f} points in the rate of a design with trials: "
            "take more --runs."
        )
    if found := summary["next_trials"]:
        trials = "; of ".join(_trials(plan) for plan in found)
        findings.append(f"Most would be learned by {found[0]['trials']} trials of {trials}.")
    inferred = [parameter["name"] for parameter in summary["parameters"] if parameter["explained"] is not None]
    if measurable := [name for name in MEASURABLE if name in inferred]:
        findings.append(f"Measuring often tells more than trials: {listed(measurable)} (`foldcar trials measure`).")
    return findings


def _fit(summary: Mapping[str, Any]) -> Iterator[str]:
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
    tau = next(parameter for parameter in summary["parameters"] if parameter["name"] == DISCREPANCY.name)
    if tau["posterior"]["median"] > 1.3 * tau["prior"]["median"]:
        yield "Rates need a larger discrepancy than assumed before: the simulator lacks what cars have."
    off = [misfit for misfit in summary["misfits"] if misfit["size"] > misfit["by_chance"] and misfit["size"] > WORTH]
    for one in sorted(off, key=lambda one: -one["size"]):
        yield (
            f"Paths differ in {one['family']} from the calibrated simulator's, {one['size']:.1f} times as much as runs "
            f"scatter (by chance below {one['by_chance']:.1f}): {_LACKS[one['family']]}."
        )


def _known_better(summary: Mapping[str, Any]) -> Iterator[str]:
    rows = [parameter for parameter in summary["parameters"] if parameter["explained"] is not None]
    for one in sorted(rows, key=lambda row: -row["explained"]):
        if one["explained"] >= TOLD:
            before, after = (
                f"{ends['median']:.3g} ({ends['low']:.2g} to {ends['high']:.2g})"
                for ends in (one["prior"], one["posterior"])
            )
            yield f"{one['name']} is {after} {one['unit']}, before the trials {before}."
    untold = [row["name"] for row in rows if row["explained"] < UNTOLD]
    if untold:
        yield f"The trials say next to nothing about {', '.join(untold)}: their intervals are those assumed before."


def _trials(one: Mapping[str, Any]) -> str:
    height = one["obstacle_height"]
    at = "" if height == 1 else f" with obstacles {100 * height:.0f} % as high"
    return f"{design_text(one['design'])}{at} ({one['bits']:.2f} bits, most about {one['parameter']})"
