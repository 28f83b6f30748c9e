"""Renews the tables of docs/calibration.md: the published trials calibrated, and calibration tried on known truths.

Usage: calibration.py FOLDER PAGE. FOLDER keeps what is simulated: a second call simulates nothing that is there. Input:
the width study and the published trials. Output: the page with the text between its marks replaced.

Truths: parameters drawn from the prior, success rates of WIDTHS simulated with them. Trials are drawn from these rates,
with a discrepancy drawn from its prior; CALIBRATED widths are inferred from, the others predicted. All replicates
share the emulator of the published calibration, and one sample of the prior that is weighted by the likelihood.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import expit, logit, logsumexp

from foldcar.calibration.emulator import LARGEST_LOGIT, Emulator
from foldcar.calibration.experiment import CalibrationRun, Simulator, SweptExperiment, count_trials, read_experiment
from foldcar.calibration.inference import Inference, infer
from foldcar.calibration.parameters import PARAMETERS, FloatArray, values_of
from foldcar.calibration.posterior import DISCREPANCY, log_likelihood
from foldcar.calibration.summary import summarise
from foldcar.outputs import atomic_file
from foldcar.simulation.carsim import Carsim
from foldcar.store.reader import Store

PROJECT = Path(__file__).resolve().parents[1]
RUNS, SEED = 24_000, 1
WIDTHS = (65, 80, 95, 115, 140, 180)
CALIBRATED = (65, 95, 115, 180)
TRUTHS, SCENES, REPLICATES, TRIALS = 80, 30, 4, 12
# Parameters on the page: from this share of explained variance on.
SHOWN = 0.2
PRIOR_DRAWS = 80_000
CONFIDENCE = 0.9
# Numbers of the truths' runs, so that they share no scatter with the calibration's.
FIRST_NUMBER = 10_000_000


def main(folder: Path, page: Path) -> None:
    """Simulate what is missing in ``folder`` and renew the tables of ``page``."""
    folder.mkdir(parents=True, exist_ok=True)
    store = swept_store(folder / "width_study.db")
    with Store.open(store) as opened:
        experiment = read_experiment(opened, "1")
        counts = count_trials(opened, experiment, simulated=False)
        nominal = nominal_runs(opened, experiment)
    simulator = Simulator(experiment, Carsim(), len(os.sched_getaffinity(0)), SEED)
    designs = [width_index(experiment, width) for width in WIDTHS]
    rates = kept(folder / "truths.pickle", lambda: rates_of(simulator, true_scores(), designs))
    inference: Inference = kept(folder / "inference.pickle", lambda: infer(simulator, counts, RUNS))
    summary = summarise(inference, experiment, nominal, SEED, RUNS, leave_one_out=True)
    tables = {"published": published(summary), "parameters": parameters(summary), "findings": said(summary)}
    tables["truths"] = truths(rates, inference, designs, nominal)
    text = page.read_text(encoding="utf-8")
    for mark, lines in tables.items():
        begin, end = f"<!-- {mark} of tools/calibration.py -->", "<!-- end -->"
        head, _, rest = text.partition(begin)
        _, _, tail = rest.partition(end)
        if not tail:
            sys.exit(f"{page}: has no marks {begin} and {end}")
        text = "\n".join([head + begin, *lines, end]) + tail
    with atomic_file(page) as file:
        file.write(text.encode())


def kept(file: Path, made: Callable[[], Any]) -> Any:
    """What the file keeps, or else what is made and kept in it."""
    if not file.exists():
        with atomic_file(file) as part:
            part.write(pickle.dumps(made()))
    return pickle.loads(file.read_bytes())


def swept_store(store: Path) -> Path:
    """The width study's store with the published trials."""
    if not store.exists():
        foldcar("sweep", "scenarios/width_study.json", "--store", store)
        foldcar("trials", "import", store, "scenarios/published_trials.csv")
    return store


def foldcar(*words: str | Path) -> None:
    """Run a command of foldcar in the project's folder."""
    command = [sys.executable, "-c", "from foldcar.cli import main; main()", *map(str, words)]
    subprocess.run(command, cwd=PROJECT, check=True)


def nominal_runs(store: Store, experiment: SweptExperiment) -> dict[int, tuple[int, int]]:
    """Passed and all nominal runs of each design."""
    found: dict[int, tuple[int, int]] = {}
    for result in store.results("1"):
        index = experiment.design_of({name: float(value) for name, value in result.design.items()})
        assert index is not None
        passed, runs = found.get(index, (0, 0))
        found[index] = (passed + (result.outcome == "passed"), runs + 1)
    return found


def published(summary: dict[str, Any]) -> list[str]:
    """Each width's trials, nominal and calibrated success, predictions with and without its own trials."""
    head = ["width (mm)", "trials", "nominal", "calibrated", "predicted", "without"]
    rows = []
    for one, left in zip(summary["designs"], summary["leave_one_out"], strict=True):
        simulated = f"{100 * one['simulated']['median']:.0f} ({ends(one['simulated'])})"
        trials = f"{one['passed']}/{one['counted']}: {100 * one['passed'] / one['counted']:.0f}"
        width = f"{one['design']['width_mm']:g}"
        predictions = (ends(one["predicted"]), ends(left["predicted"]))
        rows.append([width, trials, f"{100 * one['nominal']:.0f}", simulated, *predictions])
    return table(head, rows)


def parameters(summary: dict[str, Any]) -> list[str]:
    """The parameters that the trials tell of, before and after, and how much of their variance the trials explain."""
    rows = []
    for one in summary["parameters"]:
        if (one["explained"] or 0) >= SHOWN:
            told = (one["prior"], one["posterior"])
            before, after = (f"{p['median']:.2g} ({p['low']:.2g} to {p['high']:.2g})" for p in told)
            rows.append([one["name"], before, after, f"{100 * one['explained']:.0f}"])
    return table(["parameter", "prior", "posterior", "explained %"], rows)


def said(summary: dict[str, Any]) -> list[str]:
    """Correlations, next trials and the likelihood."""
    likelihood = summary["log_likelihood"]
    strongest = summary["correlations"][:3]
    pairs = ", ".join(f"{' and '.join(one['parameters'])} {one['correlation']:+.2f}" for one in strongest)
    return [
        f"- {summary['findings'][0]}",
        f"- Log-likelihood: {likelihood['expected']:.1f} on average, {likelihood['nominal']:.1f} nominal, "
        f"{likelihood['best']:.1f} at best.",
        f"- The trials cannot tell apart what is correlated: {pairs}.",
        f"- {summary['findings'][-1].partition('; ')[0]}.",
    ]


def true_scores() -> FloatArray:
    """Scores (TRUTHS, parameters) of the known parameters."""
    return np.random.default_rng(SEED + 1000).standard_normal((TRUTHS, len(PARAMETERS)))


def truths(
    rates: FloatArray, inference: Inference, designs: Sequence[int], nominal: Mapping[int, tuple[int, int]]
) -> list[str]:
    """How often 90 % intervals contain known parameters, and how well held-out designs are predicted."""
    scores, features = true_scores(), inference.features[list(designs)]
    replicates = Replicates(inference.emulator, features)
    known = [WIDTHS.index(width) for width in CALIBRATED]
    held_out = [i for i in range(len(WIDTHS)) if i not in known]
    stream = np.random.default_rng(SEED)
    covered, calibrated, uncalibrated, prior = [], [], [], []
    for truth in range(TRUTHS):
        for _ in range(REPLICATES):
            tau = float(DISCREPANCY.value(stream.standard_normal()))
            chance = expit(logit(rates[truth]) + tau * stream.standard_normal(len(WIDTHS)))
            passed = stream.binomial(TRIALS, chance).astype(float)
            weights = replicates.weights(known, passed)
            covered.append(replicates.covered(weights, np.append(scores[truth], 0.0))[:-1])
            for one in held_out:
                k, n = nominal[designs[one]]
                calibrated.append(replicates.log_score(weights, one, passed[one]))
                prior.append(replicates.log_score(replicates.even, one, passed[one]))
                uncalibrated.append(nominal_score((k + 0.5) / (n + 1), passed[one]))
    shares = 100 * np.mean(covered, axis=0)
    wrong = expit(inference.emulator.logits(scores, features)) - rates
    noise = np.mean(rates * (1 - rates)) / SCENES
    error = 100 * np.sqrt(max(0.0, float(np.mean(wrong**2) - noise)))
    return [
        f"- {100 * CONFIDENCE:.0f} % intervals contain the true parameters in {shares.mean():.1f} % of {len(covered)} "
        f"replicates ({TRUTHS} truths), by parameter in {np.min(shares):.0f} to {np.max(shares):.0f} %.",
        f"- Held-out widths: mean log score {np.mean(calibrated):.2f} calibrated, {np.mean(prior):.2f} with the prior, "
        f"{np.mean(uncalibrated):.2f} uncalibrated.",
        f"- The emulator is {error:.0f} points off simulated rates (root mean square, over the whole prior).",
    ]


class Replicates:
    """A sample of the prior with the logits of WIDTHS, to be weighted by any trials."""

    def __init__(self, emulator: Emulator, features: FloatArray) -> None:
        latent = np.random.default_rng(SEED + 2000).standard_normal((PRIOR_DRAWS, len(PARAMETERS) + 1))
        self.scores = latent[:, :-1]
        self.tau = np.asarray(DISCREPANCY.value(latent[:, -1]))
        self.logits = np.vstack([emulator.logits(part, features) for part in np.array_split(self.scores, 20)])
        self.even = np.full(PRIOR_DRAWS, 1 / PRIOR_DRAWS)
        # The log-likelihood of every count of every width.
        counts = range(TRIALS + 1)
        self._table = np.stack([self._likelihood(float(count)) for count in counts], axis=-1)

    def weights(self, known: Sequence[int], passed: FloatArray) -> FloatArray:
        """The posterior's weights of the draws."""
        found = sum(self._table[:, one, int(passed[one])] for one in known)
        return np.asarray(np.exp(found - logsumexp(found)))

    def covered(self, weights: FloatArray, truth: FloatArray) -> FloatArray:
        """Whether the central interval of each parameter contains the truth, 0 or 1; the last is the discrepancy's."""
        columns = np.column_stack([self.scores, self.tau])
        below = np.array([weights[columns[:, i] < value].sum() for i, value in enumerate(truth)])
        return ((below > (1 - CONFIDENCE) / 2) & (below < (1 + CONFIDENCE) / 2)).astype(float)

    def log_score(self, weights: FloatArray, width: int, passed: float) -> float:
        """The log probability of that many trials passed of a width without trials."""
        return float(np.log(weights @ np.exp(self._table[:, width, int(passed)])))

    def _likelihood(self, count: float) -> FloatArray:
        widths = self.logits.shape[1]
        return log_likelihood(self.logits, self.tau, np.full(widths, count), np.full(widths, float(TRIALS)))


def rates_of(simulator: Simulator, scores: FloatArray, designs: Sequence[int]) -> FloatArray:
    """Success rates (truths, designs) in SCENES scenes, smoothed as (k + ½)/(n + 1)."""
    scenes = len(simulator.experiment.scenes)
    results = simulator.passed(
        CalibrationRun(design, values, number % scenes, FIRST_NUMBER + number)
        for truth, values in enumerate(values_of(scores))
        for design in designs
        for number in range(truth * SCENES, (truth + 1) * SCENES)
    )
    passed = np.array([bool(one) for one in results]).reshape(len(scores), len(designs), SCENES).sum(axis=2)
    return np.asarray((passed + 0.5) / (SCENES + 1))


def nominal_score(rate: float, passed: float) -> float:
    """The log probability of that many trials passed at that rate."""
    clipped = np.clip(logit(rate), -LARGEST_LOGIT, LARGEST_LOGIT)
    one = np.ones(1)
    return float(log_likelihood(clipped * one[:, None], 0 * one, passed * one, TRIALS * one)[0, 0])


def width_index(experiment: SweptExperiment, width: float) -> int:
    """The index of the design of that width (mm)."""
    return next(i for i, design in enumerate(experiment.designs) if design.parameters["width_mm"] == width)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown."""
    return [f"|{'|'.join(head)}|", "|---" * len(head) + "|", *(f"|{'|'.join(row)}|" for row in rows)]


def ends(interval: dict[str, float]) -> str:
    """An interval in percent."""
    return f"{100 * interval['low']:.0f} to {100 * interval['high']:.0f}"


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
