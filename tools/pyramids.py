"""Searches sizes of step pyramids with which the width study in MuJoCo shows what the publication says of its Figure 6.

Usage: pyramids.py FOLDER PAGE [--jobs N]. Input: scenarios/width_study.json and its environment. Output: sizes that fit,
on the terminal; PAGE with the text between its marks replaced: rates with the environment's own sizes, and how widely
those that fit range. FOLDER keeps what is simulated: a second call simulates nothing that is there.

Designs of a Latin hypercube, then those that promise most, are simulated in the same samples. Gaussian processes, one a
width, learn the logit of the rate from them. Among round sizes those are proposed whose neighbours fit too, and these are
confirmed in samples of another seed.
"""

import argparse
import dataclasses
import hashlib
import itertools
import json
import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from page_block import replaced
from scipy.special import betainc, logit
from scipy.stats import norm, qmc
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from foldcar.belief.priors import FloatArray
from foldcar.car.body import body_json
from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO, MULTIBODY
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import read_study

LISTING = Path(__file__).resolve().parents[1] / "scenarios" / "width_study.json"
NEAR_X_M = 0.45


class Size(NamedTuple):
    """A size: least and greatest value, and the step to which it is rounded (mm; friction 1)."""

    name: str
    low: float
    high: float
    step: float


SIZES = (
    Size("step_height", 26, 33, 0.5),
    Size("top_side", 60, 120, 5),
    Size("tread", 25, 50, 5),
    Size("offset", 75, 110, 5),
    Size("spacing", 380, 480, 10),
    Size("friction", 0.6, 0.95, 0.05),
)


class Statement(NamedTuple):
    """The share of runs that pass at ``width_mm`` is above (``side`` 1) or below (-1) ``bound``."""

    width_mm: int
    side: int
    bound: float


# 65 mm is navy, 95 mm the left edge of green, 115 mm its middle, 180 mm the right edge of blue; between them from these.
STATEMENTS = (
    Statement(65, -1, 0.5),
    *(Statement(width, -1, 0.75) for width in (80, 85, 90)),
    *(Statement(width, 1, 0.75) for width in (95, 105, 115, 130)),
    *(Statement(width, 1, 0.5) for width in (150, 165, 180)),
    Statement(180, -1, 0.75),
    *(Statement(width, -1, 0.5) for width in (185, 190, 220)),
)
WIDTHS = tuple(sorted({statement.width_mm for statement in STATEMENTS}))

SEARCH_SEED, CONFIRM_SEED, PAGE_SEED = 2001, 2004, 2006
FIRST_DESIGNS, FIRST_SCENES = 40, 12
MORE_DESIGNS, MORE_SCENES = 20, 24
CONFIRMED, CONFIRM_SCENES = 3, 100
PAGE_SCENES = 200
CANDIDATES = 4000
# Logits at which rates of so few runs are 0 or 1 in effect.
LARGEST_LOGIT = 3.5
# What smooth processes cannot say of a rate.
MISFIT_LOGIT = 0.3
# Sizes fit if no statement is less probable than this.
REFUTED = 0.05

BEGIN, END = "<!-- pyramids of tools/pyramids.py -->", "<!-- end -->"

Counts = dict[int, int]


class Bench:
    """Simulates sizes at widths; keeps counts in ``file``, for one build of a simulator."""

    def __init__(self, file: Path, engine: str, jobs: int) -> None:
        (self.experiment,) = read_study(LISTING).experiments
        self._carsim = Carsim(engine=engine)
        self._jobs = jobs
        self._file = file
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        self._kept: dict[str, Counts] = {}
        for line in lines:
            key, counts = json.loads(line)
            self._kept[key] = {int(width): passed for width, passed in counts.items()}

    @property
    def widths_mm(self) -> list[int]:
        """All widths of the study."""
        return [round(design.values["width"]) for design in self.experiment.family]

    def passed(self, params: Mapping[str, float], seed: int, scenes: int, widths_mm: Sequence[int]) -> Counts:
        """How many of samples 0 to ``scenes`` - 1 of the environment with ``params`` each width passes."""
        environment = ExperimentEnvironment(dataclasses.replace(self.experiment, scenic_params=params, seed=seed))
        drawn = {str(k): canonical_json(environment.sample(k)) for k in range(scenes)}
        bodies, settings = self._cars(tuple(widths_mm))
        facts = {"build": self._carsim.build, "bodies": bodies, "settings": settings, "scenes": drawn}
        key = hashlib.sha256(canonical_json(facts).encode()).hexdigest()[:24]
        if key not in self._kept:
            requests = [
                RunRequest(width, k, settings[width], f"{width} mm, {dict(params)}, sample {k}", int(k))
                for k in drawn
                for width in bodies
            ]
            counts = dict.fromkeys(widths_mm, 0)
            with ThreadPoolExecutor(self._jobs) as pool:
                shares = [requests[first :: self._jobs] for first in range(self._jobs)]
                answered = list(pool.map(lambda share: self._carsim.run(bodies, drawn, share), shares))
            for share, answers in zip(shares, answered, strict=True):
                for request, answer in zip(share, answers, strict=True):
                    counts[int(request.body)] += outcome_of(answer) == "passed"
            self._kept[key] = counts
            with self._file.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, counts]) + "\n")
        return self._kept[key]

    @cache  # noqa: B019
    def _cars(self, widths_mm: tuple[int, ...]) -> tuple[dict[str, str], dict[str, str]]:
        bodies, settings, table = {}, {}, self._carsim.parameter_table()
        for design in self.experiment.family:
            if design.values["width"] in widths_mm:
                name, body = f"{design.values['width']:.0f}", body_json(design)
                bodies[name] = canonical_json(body)
                settings[name] = canonical_json(self.experiment.settings(design, body, table))
        return bodies, settings


def scenic_params(sizes: FloatArray) -> dict[str, float]:
    """The environment's parameters (m) of SIZES (mm)."""
    values = {size.name: round(float(value), 4) for size, value in zip(SIZES, sizes, strict=True)}
    friction, spacing = values.pop("friction"), values.pop("spacing")
    params = {name: value / 1000 for name, value in values.items()}
    params |= {"near_x": NEAR_X_M, "far_x": NEAR_X_M + spacing / 1000, "friction": friction}
    return {name: round(value, 7) for name, value in params.items()}


def likelihoods(counts: Counts, scenes: int) -> list[float]:
    """The posterior probability of each statement under Jeffreys' prior."""
    likelihoods = []
    for statement in STATEMENTS:
        below = float(
            betainc(counts[statement.width_mm] + 0.5, scenes - counts[statement.width_mm] + 0.5, statement.bound)
        )
        likelihoods.append(below if statement.side < 0 else 1 - below)
    return likelihoods


class Emulator:
    """Gaussian processes of the logit of success at WIDTHS over sizes scaled to 0 to 1."""

    def __init__(self, points: FloatArray, counts: Sequence[Counts], scenes: Sequence[int]) -> None:
        self._processes: dict[int, tuple[float, Any]] = {}
        runs = np.asarray(scenes, float)
        for width in WIDTHS:
            rates = (np.array([count[width] for count in counts]) + 0.5) / (runs + 1)
            logits = np.clip(logit(rates), -LARGEST_LOGIT, LARGEST_LOGIT)
            mean = float(logits.mean())
            kernel = ConstantKernel(4.0, (0.3, 50)) * RBF([0.7] * len(SIZES), (0.2, 10))
            # The binomial's variance, by the delta method.
            noise = 1 / ((runs + 1) * rates * (1 - rates))
            process = GaussianProcessRegressor(kernel, alpha=noise + MISFIT_LOGIT**2)
            with warnings.catch_warnings():
                # A size that does not matter at this width has the greatest length scale.
                warnings.simplefilter("ignore", ConvergenceWarning)
                self._processes[width] = mean, process.fit(points, logits - mean)

    def score(self, points: FloatArray) -> FloatArray:
        """The sum of the statements' log probabilities at each point."""
        total = np.zeros(len(points))
        for width, (mean, process) in self._processes.items():
            above, sd = process.predict(points, return_std=True)
            for statement in STATEMENTS:
                if statement.width_mm == width:
                    margin = statement.side * (mean + above - logit(statement.bound))
                    total += norm.logcdf(margin / np.hypot(sd, MISFIT_LOGIT))
        return total


def unscaled(points: FloatArray) -> FloatArray:
    """Sizes (mm) of points within 0 to 1."""
    low, high = np.array([size.low for size in SIZES]), np.array([size.high for size in SIZES])
    return np.asarray(low + points * (high - low))


def scaled(sizes: FloatArray) -> FloatArray:
    """Points within 0 to 1 of sizes (mm)."""
    low, high = np.array([size.low for size in SIZES]), np.array([size.high for size in SIZES])
    return np.asarray((sizes - low) / (high - low))


class Search:
    """What was tried: points, counts, numbers of scenes."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.points: list[FloatArray] = []
        self.counts: list[Counts] = []
        self.scenes: list[int] = []

    def run(self) -> None:
        """The Latin hypercube, then one design after another."""
        stream = np.random.default_rng(SEARCH_SEED)
        for point in qmc.LatinHypercube(len(SIZES), rng=stream).random(FIRST_DESIGNS):
            self._try(point, FIRST_SCENES)
        for _ in range(MORE_DESIGNS):
            emulator = self.emulator()
            anywhere = stream.random((CANDIDATES, len(SIZES)))
            best = self.points[int(np.argmax(emulator.score(np.array(self.points))))]
            near = np.clip(best + 0.1 * stream.standard_normal((CANDIDATES, len(SIZES))), 0, 1)
            candidates = np.vstack([anywhere, near])
            self._try(candidates[int(np.argmax(emulator.score(candidates)))], MORE_SCENES)

    def emulator(self) -> Emulator:
        """What is learned so far."""
        return Emulator(np.array(self.points), self.counts, self.scenes)

    def proposed(self) -> Iterator[FloatArray]:
        """Round sizes (mm), best first: by the mean score of themselves and of their neighbours half a step away."""
        emulator, stream = self.emulator(), np.random.default_rng(SEARCH_SEED + 1)
        steps = np.array([size.step for size in SIZES])
        sizes = unscaled(stream.random((10 * CANDIDATES, len(SIZES))))
        sizes = np.unique(np.round(np.round(sizes / steps) * steps, 4), axis=0)
        promising = sizes[np.argsort(-emulator.score(scaled(sizes)))[:300]]
        around = stream.uniform(-0.5, 0.5, (32, len(SIZES))) * steps
        robust = [float(np.mean(emulator.score(scaled(sizes + around)))) for sizes in promising]
        yield from promising[np.argsort(-np.array(robust))]

    def _try(self, point: FloatArray, scenes: int) -> None:
        sizes = unscaled(point)
        rates = self.bench.passed(scenic_params(sizes), SEARCH_SEED, scenes, WIDTHS)
        self.points.append(point)
        self.counts.append(rates)
        self.scenes.append(scenes)
        print(len(self.points), sizes_text(sizes), rates_text(rates, scenes), flush=True)


def sizes_text(sizes: FloatArray) -> str:
    """Sizes in a line."""
    return ", ".join(f"{size.name} {value:.4g}" for size, value in zip(SIZES, sizes, strict=True))


def rates_text(counts: Counts, scenes: int) -> str:
    """Rates by width, in percent, and the log probability of the statements."""
    score = np.log(np.maximum(likelihoods(counts, scenes), 1e-12)).sum()
    rates = " ".join(f"{width}: {100 * passed / scenes:.0f}" for width, passed in counts.items())
    return f"{rates} % ({score:.1f})"


def fits(counts: Counts, scenes: int) -> bool:
    """Whether the counts refute none of the statements."""
    return min(likelihoods(counts, scenes)) >= REFUTED


def table(rows: Mapping[str, Counts], scenes: int) -> list[str]:
    """Rates by width in per cent, a column for each of ``rows``."""
    lines = [f"|width (mm)|{'|'.join(rows)}|", "|---" * (len(rows) + 1) + "|"]
    for width in WIDTHS:
        cells = [f"{100 * counts[width] / scenes:.0f}" for counts in rows.values()]
        lines.append(f"|{width}|{'|'.join(cells)}|")
    return lines


def renew(page: Path, lines: Sequence[str]) -> None:
    """Put the lines between the page's marks."""
    between = "".join(f"{line}\n" for line in lines)
    try:
        text = replaced(page.read_text(encoding="utf-8"), page, BEGIN, END, between)
    except FoldcarError as error:
        sys.exit(str(error))
    with atomic_file(page) as file:
        file.write(text.encode())


def main() -> None:
    """Search, confirm, renew the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("page", type=Path)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(options.folder / "mujoco.jsonl", MUJOCO, options.jobs)
    search = Search(bench)
    search.run()
    tried = zip(search.points, search.counts, search.scenes, strict=True)
    fitting = sum(fits(counts, scenes) for _, counts, scenes in tried)
    for sizes in itertools.islice(search.proposed(), CONFIRMED):
        result = bench.passed(scenic_params(sizes), CONFIRM_SEED, CONFIRM_SCENES, WIDTHS)
        print(f"in {CONFIRM_SCENES} fresh scenes:", sizes_text(sizes), rates_text(result, CONFIRM_SCENES), flush=True)
    shown = {"MuJoCo": bench, "multibody": Bench(options.folder / "multibody.jsonl", MULTIBODY, options.jobs)}
    rates = {name: bench.passed({}, PAGE_SEED, PAGE_SCENES, WIDTHS) for name, bench in shown.items()}
    sentence = f"Of {len(search.points)} sets of sizes tried, {fitting} fit too."
    renew(options.page, [*table(rates, PAGE_SCENES), "", sentence])


if __name__ == "__main__":
    main()
