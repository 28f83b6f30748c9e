"""The posterior of an experiment's designs: success in simulation, and success of built cars by simulation and trials.

`select`, `compare`, the report and the API share it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from foldcar.inference.design_evidence import DesignEvidence
from foldcar.statistics.pooled_bias import MAX_POOLED, Contradictions, contradictions, pooled_bias
from foldcar.statistics.rate import Rate
from foldcar.statistics.smoothed_simulation import smoothed_simulation

# Number of draws of the rates; fewer for many designs, so that draws times designs is at most MAX_NUMBERS.
MAX_DRAWS, MIN_DRAWS, MAX_NUMBERS = 3000, 500, 2_000_000


@dataclass(frozen=True)
class Belief:
    """Belief about n designs with runs.

    ``design_indices`` (n,) are their indices in the evidence, ``parameters`` (n, k) their varied parameters. ``passed``
    (n, environments) is 1 where the run passed, 0 where it failed, NaN without a run, in the environments ``samples``.
    ``trials`` (n,) is the number that counts. ``simulation`` (n, 3) is success in this simulator, smoothed over designs:
    rate, low, high (95 %). ``built`` is the success rate of a new car of each design, ``draws`` (draws, n) are joint
    draws of these rates. ``unpooled`` is the number of driven designs left out, because MAX_POOLED others have more
    trials.
    """

    designs: tuple[DesignEvidence, ...]
    design_indices: NDArray[Any]
    parameters: NDArray[Any]
    samples: NDArray[Any]
    passed: NDArray[Any]
    trials: NDArray[Any]
    simulation: NDArray[Any]
    built: tuple[Rate, ...]
    draws: NDArray[Any]
    contradictions: Contradictions
    unpooled: int

    @property
    def driven(self) -> bool:
        """Whether there are trials that count."""
        return bool(self.trials.any())

    @property
    def labels(self) -> list[str]:
        """The designs' names."""
        return [design.label for design in self.designs]

    def chances(self, threshold: float) -> NDArray[Any]:
        """Return the probability (n,) that a new car of each design has a rate of ``threshold`` (0 to 1) or more."""
        return numpy.asarray((self.draws >= threshold).mean(axis=0))


def believe(designs: Sequence[DesignEvidence], design_indices: Sequence[int], names: Sequence[str]) -> Belief | None:
    """Infer the success rates of ``designs``, all of which have runs; return None if there are no designs.

    ``names`` are the parameters in which the designs differ, ``design_indices`` their indices in the evidence. Simulation
    is smoothed over designs; trials then correct the smoothed rates.
    """
    if not designs:
        return None
    parameters = numpy.array([[float(design.design[name]) for name in names] for design in designs]).reshape(
        len(designs), -1
    )
    # (designs, 2): numbers passed and in all.
    runs = numpy.array([(design.runs_passed, design.runs) for design in designs], dtype=float)
    trials = numpy.array([(design.trials_passed, len(design.trials)) for design in designs], dtype=float)
    # The work grows with the cube of the number of driven designs, so only those with most trials are used.
    dropped = numpy.argsort(-trials[:, 1], kind="stable")[MAX_POOLED:]
    unpooled = int((trials[dropped, 1] > 0).sum())
    trials[dropped] = 0
    cars = [design.cars if counted else None for design, counted in zip(designs, trials[:, 1].tolist(), strict=True)]
    samples = numpy.unique(numpy.concatenate([design.samples for design in designs]))
    # (designs, samples): NaN where a design has no run in the sample.
    passed = numpy.full((len(designs), len(samples)), numpy.nan)
    for row, design in enumerate(designs):
        passed[row, numpy.searchsorted(samples, design.samples)] = design.passed
    # The matrices are so small that threads would only wait for each other.
    with threadpool_limits(1):
        simulation = smoothed_simulation(parameters, runs, passed)
        bias = pooled_bias(parameters, runs, trials, cars, simulation)
        draws = bias.draws(max(MIN_DRAWS, min(MAX_DRAWS, MAX_NUMBERS // len(designs))))
        contradicting = contradictions(parameters, runs, trials, cars, simulation)
        return Belief(
            tuple(designs), numpy.array(design_indices), parameters, samples, passed, trials=trials[:, 1],
            simulation=simulation.rates(), built=tuple(bias.rates()), draws=draws, contradictions=contradicting,
            unpooled=unpooled,
        )  # fmt: skip
