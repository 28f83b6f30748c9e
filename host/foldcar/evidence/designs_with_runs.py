"""The designs of an experiment with their runs: those of a sweep, or runs that are made now."""

from collections import Counter
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.evidence.design_evidence import DesignEvidence, design_label
from foldcar.evidence.resimulation import Resimulation, RunResult
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.run_arrays import RunArrays
from foldcar.store.trial_records import Trial


def swept_designs(store: Store, info: ExperimentInfo, runs: RunArrays) -> list[DesignEvidence]:
    """Return the designs of the family that were swept, in their order, each with its runs."""
    designs = list(store.designs(info.id).values())
    elapsed_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    swept_designs = []
    for design, runs_of_design in zip(designs, _indices_by_design(runs, len(designs)), strict=True):
        outcomes = runs.outcome[runs_of_design]
        # Rejected runs do not count in any rate.
        is_rejected = outcomes == OUTCOMES.index(REJECTED)
        counted_runs, rejected_runs = runs_of_design[~is_rejected], runs_of_design[is_rejected]
        times_s = elapsed_s[counted_runs]
        times_s = times_s[~numpy.isnan(times_s)]
        swept_designs.append(
            DesignEvidence(
                info.vehicle_type,
                dict(design),
                design_label(info, info.vehicle_type, design),
                swept=True,
                samples=runs.sample[counted_runs],
                passed=runs.outcome[counted_runs] == OUTCOMES.index("passed"),
                outcomes=Counter(OUTCOMES[code] for code in outcomes.tolist()),
                mean_time_s=float(times_s.mean()) if len(times_s) else None,
                sequential=info.until is not None,
                rejected=frozenset(runs.sample[rejected_runs].tolist()),
            )
        )
    return swept_designs


def _indices_by_design(runs: RunArrays, designs: int) -> list[NDArray[Any]]:
    """Return the indices of the runs of each of so many ``designs``: an array for each design, in their order."""
    # Sort the runs by design, and divide them where the next design begins.
    run_indices = numpy.argsort(runs.design, kind="stable")
    starts = numpy.searchsorted(runs.design[run_indices], numpy.arange(1, designs))
    # Without designs, numpy.split returns one part.
    return numpy.split(run_indices, starts)[:designs]


def simulated_design(
    info: ExperimentInfo, trial: Trial, resimulation: Resimulation | None
) -> tuple[DesignEvidence, str | None]:
    """Simulate the design of a trial, which was not swept, in all environments of the sweep.

    Returns the design with its runs, and None. If it cannot be simulated, returns the design without any run, and the
    reason. If ``resimulation`` is None, it is not simulated, and there is no reason.
    """
    results: list[RunResult] = []
    reason = None
    if resimulation is not None:
        results, reason = resimulation.design(info, trial)
    outcomes = [outcome for outcome, _ in results]
    times_s = [time_s for _, time_s in results if time_s is not None]
    design = DesignEvidence(
        trial.vehicle_type,
        trial.design,
        design_label(info, trial.vehicle_type, trial.design),
        swept=False,
        samples=numpy.arange(len(results)),
        passed=numpy.array([outcome == "passed" for outcome in outcomes], dtype=bool),
        outcomes=Counter(outcomes),
        mean_time_s=float(numpy.mean(times_s)) if times_s else None,
    )
    return design, reason
