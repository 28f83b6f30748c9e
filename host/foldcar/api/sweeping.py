"""A sweep from Python: what `foldcar sweep` does, into a store that the commands read too."""

from pathlib import Path

from foldcar.api.study import Study
from foldcar.api.whole import whole
from foldcar.processors import usable_processors
from foldcar.simulation.carsim import Carsim
from foldcar.study.experiments import read_study
from foldcar.study.limits import MOST_ENVIRONMENTS, MOST_JOBS
from foldcar.study.sweep import sweep as run_sweep


def sweep(
    listing: str | Path,
    store: str | Path,
    *,
    experiment: str | None = None,
    environments: int | None = None,
    jobs: int | None = None,
) -> Study:
    """Simulate the runs of a listing, or of one experiment, that the store lacks; the study they are in.

    ``environments`` takes the place of the listing's number; ``jobs`` simulators run side by side (None: one per
    processor). It may be interrupted: the same call resumes. FoldcarError if the listing or an argument is invalid.
    """
    count = None if environments is None else whole("environments", environments, 1, MOST_ENVIRONMENTS)
    workers = usable_processors() if jobs is None else whole("jobs", jobs, 1, MOST_JOBS)
    study = read_study(Path(listing), experiment, count)
    run_sweep(study, Path(store), Carsim(), workers, f"foldcar.sweep({str(listing)!r}, {str(store)!r})")
    return Study(store)
