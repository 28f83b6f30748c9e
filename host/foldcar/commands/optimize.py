"""`foldcar optimize`: searches the best designs of a family, simulating those that are worth a look."""

import shlex
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    Components,
    Jobs,
    Json,
    Scheduler,
    check_scheduler_option,
    output_store,
    print_json,
    simulators,
)
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

MOST_DESIGNS = 100_000


class ObjectiveName(str, Enum):
    """What `--objective` takes."""

    success = "success"
    time = "time"
    energy = "energy"
    sheet_area = "sheet-area"


class SamplerName(str, Enum):
    """What `--sampler` takes."""

    tpe = "tpe"
    nsga2 = "nsga2"
    random = "random"
    grid = "grid"


def optimize(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    store: Annotated[
        Path, typer.Option(metavar="FILE", callback=output_store, help="Store to write; made if it is missing.")
    ],
    objective: Annotated[
        list[ObjectiveName] | None,
        typer.Option(
            metavar="NAME",
            help="success (default); time to pass (s), the limit if a run does not; energy per pass (J); sheet-area "
            "(cm²). May be repeated: then none of the best is beaten in all.",
        ),
    ] = None,
    designs: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_DESIGNS, help="Designs to try at most.")
    ] = 50,
    runs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Runs of tried designs at most; default: no limit.")
    ] = None,
    environments: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MOST_ENVIRONMENTS,
            help="Sampled environments of each design, instead of the listing's number.",
        ),
    ] = None,
    best: Annotated[
        int, typer.Option(metavar="N", min=1, max=100, help="How many of the best to judge in fresh environments.")
    ] = 3,
    fresh: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_ENVIRONMENTS, help="Fresh environments to judge them in.")
    ] = 200,
    sampler: Annotated[
        SamplerName, typer.Option(metavar="NAME", help="How designs are chosen: tpe, nsga2, random or grid.")
    ] = SamplerName.tpe,
    prune: Annotated[
        bool,
        typer.Option("--prune/--no-prune", help="With one objective, leave a design early that is worse than the best."),
    ] = True,
    seed: Annotated[int, typer.Option(metavar="S", min=0, max=2**31, help="Of the sampler.")] = 0,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="This experiment of the listing.")] = None,
    calibration: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Simulate under this calibration of the store (see `foldcar calibrate`)."),
    ] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Search a family of cars for the best ones.

    With far fewer runs than a sweep: tries designs in the listing's environments, then judges the best in fresh ones,
    whose rates are what to believe. Runs are kept as a sweep's. It may be stopped at any time: the same command resumes.

    \b
    Example: foldcar optimize examples/design_space.json --store space.db --designs 60 --environments 50
    """
    from foldcar.commands.options import under_calibration
    from foldcar.commands.progress_bar import SearchBar
    from foldcar.commands.search_text import print_search, search_object
    from foldcar.interrupts import said
    from foldcar.search.objectives import OBJECTIVES
    from foldcar.search.search import Found, Plan, search, searched_study
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.experiments import read_study

    check_scheduler_option(scheduler, jobs)
    names = [one.value for one in objective or [ObjectiveName.success]]
    if len(set(names)) < len(names):
        raise FoldcarError(f"--objective: {', '.join(names)}: one is named twice")
    study = searched_study(read_study(listing, experiment, environments), fresh)
    study, environment_of = under_calibration(study, store, calibration)
    plan = Plan(
        objectives=tuple(OBJECTIVES[name] for name in names),
        sampler=sampler.value,
        seed=seed,
        designs=designs,
        runs=runs,
        fresh=fresh,
        best=best,
        prune=prune and len(names) == 1,
    )
    found = Found(planned=designs)
    command = shlex.join(["foldcar", *sys.argv[1:]])

    def stopped() -> str:
        return f"stopped: {found.designs} of {designs} designs are tried, their runs in {store}; the same command resumes"

    carsim = Carsim()
    with said(stopped), SearchBar(found) as bar, simulators(scheduler, jobs, carsim, bar.say) as places:
        search(study, plan, store, carsim, places, command, found, bar.update, environment_of)
    if as_json:
        print_json(search_object(plan, found, store, study.experiments[0].id))
    else:
        print_search(plan, found, store, list(study.experiments[0].family.varied))
