"""What a calibration says, as JSON values: parameters, designs, correlations, findings in words, next trials.

Input: an Inference, nominal runs by design. Output: the object that the store keeps and the command prints. Rates and
shares are 0 to 1; ``low`` and ``high`` are the ends of 90 % intervals.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.special import expit

from foldcar.analysis.words import design_text, listed, percent
from foldcar.calibration.experiment import SweptExperiment, TrialCounts
from foldcar.calibration.inference import Inference, posterior_of
from foldcar.calibration.parameters import NAMES, PARAMETERS, FloatArray, Parameter
from foldcar.calibration.posterior import DISCREPANCY
from foldcar.calibration.predictions import TRIALS, interval, log_score, predicted_shares, rank_next_trials

CONFIDENCE = 0.9
SHOWN_TRIALS = 3
# Shares of the prior's variance: a parameter is as unknown as before below the first, known better from the second on.
UNTOLD, TOLD = 0.1, 0.3
# Correlations from here on are told; at most this many.
CORRELATED, MOST_PAIRS = 0.25, 3
# Emulator and simulation may differ by this in the rate of a design.
TOLERATED = 0.06

# Passed and all nominal runs of designs, by their index.
Nominal = Mapping[int, tuple[int, int]]


def summarise(
    inference: Inference, experiment: SweptExperiment, nominal: Nominal, seed: int, runs: int, leave_one_out: bool
) -> dict[str, Any]:
    """The summary; ``leave_one_out`` also predicts each design from the trials of the others."""
    counts = inference.counts
    summary: dict[str, Any] = {
        "experiment": experiment.info.id,
        "seed": seed,
        "runs": runs,
        "simulated_trials": counts.simulated,
        "parameters": _parameters(inference),
        "correlations": _correlations(inference),
        "designs": _designs(inference, experiment, nominal, seed),
        "log_likelihood": _log_likelihood(inference, nominal),
        "check_runs": inference.check_runs,
        "notes": list(counts.notes),
        "next_trials": [],
    }
    if leave_one_out:
        summary["leave_one_out"] = left_out(inference, experiment, nominal, seed)
    for one in rank_next_trials(inference, experiment)[:SHOWN_TRIALS]:
        told = {"design": varied(experiment, one.design), "obstacle_height": one.height, "trials": TRIALS}
        summary["next_trials"].append({**told, "bits": round(one.bits, 3), "parameter": one.parameter})
    summary["findings"] = findings(summary)
    return summary


def varied(experiment: SweptExperiment, design: int) -> dict[str, float]:
    """The parameters of a design that tell it from others of its family."""
    return {name: float(experiment.designs[design].parameters[name]) for name in experiment.info.varied}


def left_out(inference: Inference, experiment: SweptExperiment, nominal: Nominal, seed: int) -> list[dict[str, Any]]:
    """Each design's trials as predicted from those of the others, with the log scores of what happened.

    The emulator is the same: it knows the simulator only. Nothing if there are fewer than two designs.
    """
    counts, stream, rows = inference.counts, np.random.default_rng(seed), []
    for index, design in enumerate(counts.designs if len(counts.designs) > 1 else ()):
        kept = [i for i in range(len(counts.designs)) if i != index]
        designs, passes, trials = (tuple(one[i] for i in kept) for one in (counts.designs, counts.passed, counts.counted))
        others = TrialCounts(designs, passes, trials, counts.simulated, ())
        posterior = posterior_of(inference.emulator, inference.features, others, seed, inference.known)
        logit = inference.emulator.logits(posterior.scores, inference.features[[design]])[:, 0]
        passed, counted = counts.passed[index], counts.counted[index]
        shares = predicted_shares(logit, posterior.discrepancy, counted, stream)
        rows.append(
            {
                "design": varied(experiment, design),
                "passed": passed,
                "counted": counted,
                "predicted": _ends(shares),
                "log_score": log_score(logit, posterior.discrepancy, passed, counted),
                "nominal_log_score": nominal_log_score(nominal.get(design), passed, counted),
            }
        )
    return rows


def nominal_log_score(runs: tuple[int, int] | None, passed: int, counted: int) -> float | None:
    """The log probability of the trials if a car passes as often as nominal ``runs`` (passed, all) did; None without."""
    if runs is None or not runs[1]:
        return None
    return _log_binomial(passed, counted, (runs[0] + 0.5) / (runs[1] + 1))


def _log_binomial(passed: int, counted: int, rate: float) -> float:
    # It takes a second to import, and a report without calibrations needs none of it.
    from scipy.stats import binom

    return float(binom.logpmf(passed, counted, rate))


def _parameters(inference: Inference) -> list[dict[str, Any]]:
    rows = []
    for index, (parameter, scores) in enumerate(zip(PARAMETERS, inference.posterior.scores.T, strict=True)):
        values = np.asarray(parameter.value(scores))
        if index in inference.known:
            # It was measured: there is nothing to infer.
            same = dict.fromkeys(("low", "median", "high"), float(values[0]))
            measured = {"source": "measured (--known)", "prior": same, "posterior": same}
            rows.append({**_parameter(parameter, values, None), **measured})
        else:
            rows.append(_parameter(parameter, values, scores))
    return [*rows, _parameter(DISCREPANCY, inference.posterior.discrepancy, None)]


def _parameter(parameter: Parameter, values: FloatArray, scores: FloatArray | None) -> dict[str, Any]:
    prior = [float(parameter.value(z)) for z in (-1.6448536, 0.0, 1.6448536)]
    return {
        **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "source", "nominal")},
        "prior": dict(zip(("low", "median", "high"), prior, strict=True)),
        "posterior": {**_ends(values), "median": float(np.median(values))},
        # Share of the prior's variance that is gone; scores have variance 1 before.
        "explained": None if scores is None else max(0.0, 1 - float(scores.var())),
    }


def _correlations(inference: Inference) -> list[dict[str, Any]]:
    """Of all pairs of parameters, the strongest first."""
    free = [i for i in range(len(NAMES)) if i not in inference.known]
    matrix = np.atleast_2d(np.corrcoef(inference.posterior.scores[:, free].T))
    pairs = [
        (NAMES[first], NAMES[second], float(matrix[i, j]))
        for i, first in enumerate(free)
        for j, second in enumerate(free[:i])
    ]
    ranked = sorted(pairs, key=lambda pair: -abs(pair[2]))
    return [{"parameters": [b, a], "correlation": round(r, 3)} for a, b, r in ranked]


def _designs(inference: Inference, experiment: SweptExperiment, nominal: Nominal, seed: int) -> list[dict[str, Any]]:
    counts, posterior = inference.counts, inference.posterior
    stream, rows = np.random.default_rng(seed), []
    for index, design in enumerate(counts.designs):
        logit, counted = inference.logits[:, index], counts.counted[index]
        rates = expit(logit)
        shares = predicted_shares(logit, posterior.discrepancy, counted, stream)
        passed, runs = nominal.get(design, (0, 0))
        rows.append(
            {
                "design": varied(experiment, design),
                "passed": counts.passed[index],
                "counted": counted,
                "nominal": passed / runs if runs else None,
                "simulated": {**_ends(rates), "median": float(np.median(rates)), "mean": float(rates.mean())},
                "checked": float(inference.checked[index]),
                "emulated": float(rates[inference.chosen].mean()),
                "predicted": {**_ends(shares), "mean": float(shares.mean())},
                "predicted_95": dict(zip(("low", "high"), interval(shares, 0.95), strict=True)),
            }
        )
    return rows


def _log_likelihood(inference: Inference, nominal: Nominal) -> dict[str, float | None]:
    """Of the trials: mean over the posterior, by nominal runs, and the best that any rates could have."""
    counts = inference.counts
    trials = list(zip(counts.designs, counts.passed, counts.counted, strict=True))
    scores = [nominal_log_score(nominal.get(design), k, n) for design, k, n in trials]
    told = [score for score in scores if score is not None]
    return {
        "expected": float(inference.posterior.log_likelihood.mean()),
        "nominal": sum(told) if len(told) == len(scores) else None,
        "best": sum(_log_binomial(k, n, k / n) for _, k, n in trials),
    }


def _ends(values: FloatArray) -> dict[str, float]:
    return dict(zip(("low", "high"), interval(values, CONFIDENCE), strict=True))


def findings(summary: Mapping[str, Any]) -> list[str]:
    """What the numbers say and cannot say, in sentences; the first is whether the trials are explained."""
    told = [*_fit(summary), *_known_better(summary)]
    strong = [one for one in summary["correlations"] if abs(one["correlation"]) >= CORRELATED]
    for one in strong[:MOST_PAIRS]:
        first, second = one["parameters"]
        other = "lower" if one["correlation"] > 0 else "higher"
        told.append(
            f"The trials cannot tell {first} and {second} apart (correlation {one['correlation']:+.2f}): lower {first} "
            f"with {other} {second} explains them as well."
        )
    told += [
        f"Simulated under the calibration, {design_text(one['design'])} passes {percent(one['checked'])}, the emulator "
        f"said {percent(one['emulated'])}: take more --runs."
        for one in summary["designs"]
        if abs(one["checked"] - one["emulated"]) > TOLERATED
    ]
    if found := summary["next_trials"]:
        trials = "; of ".join(_trials(one) for one in found)
        told.append(f"Most would be learned by {found[0]['trials']} trials of {trials}.")
    return told


def _fit(summary: Mapping[str, Any]) -> Iterator[str]:
    designs = summary["designs"]
    outside = [
        design_text(one["design"])
        for one in designs
        if not one["predicted_95"]["low"] <= one["passed"] / one["counted"] <= one["predicted_95"]["high"]
    ]
    if outside:
        yield (
            f"The trials of {listed(outside)} lie outside the 95 % intervals that the calibrated simulator predicts: no "
            "set of these parameters explains them."
        )
    else:
        yield f"The calibrated simulator's 95 % intervals cover the trials of all {len(designs)} designs."
    (discrepancy,) = (one for one in summary["parameters"] if one["name"] == "discrepancy")
    if discrepancy["posterior"]["median"] > 1.3 * discrepancy["prior"]["median"]:
        yield "A discrepancy larger than assumed before is needed: the simulator lacks something that the cars have."


def _known_better(summary: Mapping[str, Any]) -> Iterator[str]:
    rows = [one for one in summary["parameters"] if one["explained"] is not None]
    for one in sorted(rows, key=lambda row: -row["explained"]):
        if one["explained"] >= TOLD:
            before, after = (
                f"{ends['median']:.3g} ({ends['low']:.2g} to {ends['high']:.2g})"
                for ends in (one["prior"], one["posterior"])
            )
            yield f"{one['name']} is {after} {one['unit']}, before the trials {before}."
    untold = [one["name"] for one in rows if one["explained"] < UNTOLD]
    if untold:
        yield f"The trials say next to nothing about {', '.join(untold)}: their intervals are those assumed before."


def _trials(one: Mapping[str, Any]) -> str:
    height = one["obstacle_height"]
    at = "" if height == 1 else f" with obstacles {100 * height:.0f} % as high"
    return f"{design_text(one['design'])}{at} ({one['bits']:.2f} bits, most about {one['parameter']})"
