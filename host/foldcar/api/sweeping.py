"""Plans and runs sweeps: a listing's experiments with an engine, a reality and a stopping rule."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from foldcar.api.arguments import checked_experiment, checked_int, checked_path
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.store.reader import Store
from foldcar.store.tables import STUDY
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, ListedStudy, engine_study, read_study
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_JOBS, MAX_REALITIES
from foldcar.study.stopping import stopping_rules
from foldcar.study.sweep import Sweep

if TYPE_CHECKING:
    from foldcar.api.study import Study


def sweep(
    listing: str | Path,
    store: str | Path,
    *,
    experiment: str | None = None,
    samples: int | None = None,
    jobs: int | None = None,
    realities: int | None = None,
) -> "Study":
    """Simulate the runs of a listing, or of one experiment, that the store lacks, and return the study.

    ``samples`` replaces the listing's number of environments; ``jobs`` simulators run in parallel (None: one per
    processor). ``realities`` is the number of further runs of each experiment in which the simulator's uncertain
    parameters, such as friction, have other values. From these the success rate of built cars is learned: 0 leaves them
    out, None simulates as many as the learning needs. If the sweep is interrupted, the same call resumes it. Raises
    FoldcarError if the listing or an argument is invalid.

    >>> study = foldcar.sweep("scenarios/width_study.json", "w.db", samples=1, jobs=1)
    >>> study.experiments["1"].environments
    1
    """
    from foldcar.api.study import Study
    from foldcar.installation import usable_processors

    count = None if samples is None else checked_int("samples", samples, 1, MAX_ENVIRONMENTS)
    workers = usable_processors() if jobs is None else checked_int("jobs", jobs, 1, MAX_JOBS)
    reality_runs = None if realities is None else checked_int("realities", realities, 0, MAX_REALITIES)
    checked_experiment(experiment)
    listing_file, store_file = checked_path("listing", listing, "a listing"), checked_path("store", store, "a store")
    command = f"foldcar.sweep({str(listing)!r}, {str(store)!r})"
    planned = planned_sweep(
        listing_file, store_file, command, experiment=experiment, environments=count, realities=reality_runs
    )
    planned.run(workers)
    return Study(store)


def planned_sweep(
    listing: Path,
    store: Path,
    command: str,
    *,
    experiment: str | None = None,
    environments: int | None = None,
    until: str | None = None,
    reality: Path | None = None,
    engine: str = "multibody",
    realities: int | None = None,
) -> Sweep:
    """Plan the sweep that `foldcar sweep` simulates with these options, and return it.

    ``command`` is the user's command, which the store will keep. Raises FoldcarError if the listing or an option is
    invalid.
    """
    if reality is not None and realities:
        raise FoldcarError("--realities: the runs of --reality are all in that reality; use only one of these options")
    carsim = Carsim(engine=engine)
    study = read_study(listing, experiment, environments)
    _check_same_study(study, store)
    study = engine_study(study, carsim)
    # Makes the environment of an experiment. In another reality, its scenes and cars differ.
    environment_of: Callable[[Experiment], ExperimentEnvironment] = ExperimentEnvironment
    if reality is not None:
        from foldcar.study.reality_environment import RealityEnvironment, read_reality, study_in_reality

        real_values = read_reality(reality, engine)
        study = study_in_reality(study, real_values)
        environment_of = partial(RealityEnvironment, reality=real_values)
    rules = stopping_rules(until, study) if until else {}
    return Sweep(study, store, carsim, command, environment_of, rules, realities)


def _check_same_study(study: ListedStudy, store: Path) -> None:
    """Raise FoldcarError if the store has the study of another listing, because a sweep would replace its experiments.

    A listing with another name may be the same listing, renamed. It is another one if none of its experiments has both
    the id and the Scenic program of an experiment in the store.
    """
    if not store.is_file() or not store.stat().st_size:
        return
    with Store.open(store) as reader:
        name_row = next(reader.rows(STUDY, "WHERE key = 'listing_name'"), None)
        # The names are compared first, because reading the experiments takes long if the store is large.
        if name_row is None or Path(name_row["value"]).name == Path(study.listing_name).name:
            return
        stored = reader.info()
    own_experiments = {(experiment.id, Path(experiment.program_name).name) for experiment in study.experiments}
    stored_experiments = {
        (experiment.listed_id, Path(experiment.scenic_program).name) for experiment in stored.experiments.values()
    }
    if not own_experiments & stored_experiments:
        stem = Path(study.listing_name).stem
        new_store = f"{stem}.db" if store.name != f"{stem}.db" else f"{stem}_2.db"
        raise FoldcarError(
            f"{store}: holds the study of another listing, {stored.listing_name}; sweep {study.listing_name} into "
            f"another store (--store {new_store}), which `foldcar merge` can join with {store}"
        )
