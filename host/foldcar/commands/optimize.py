"""`foldcar optimize`: searches the best designs of a family, simulating those that are worth a look."""

from enum import Enum
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from foldcar.commands.options import (
    Components,
    Environments,
    Jobs,
    Json,
    Listing,
    OneExperiment,
    OutputStore,
    Scheduler,
    UnderCalibration,
    check_scheduler_option,
    command_line,
    print_result,
    simulators,
)
from foldcar.errors import FoldcarError
from foldcar.study.limits import MAX_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.study.search.search import Found

MAX_DESIGNS = 100_000


class ObjectiveName(str, Enum):
    """What `--objective` takes."""

    success = "success"
    time = "time"
    energy = "energy"
    sheet_area = "sheet-area"


def optimize(
    listing: Listing,
    store: OutputStore,
    objective: Annotated[
        list[ObjectiveName] | None,
        typer.Option(
            metavar="NAME",
            help="success (default); time (s), failures at the limit; energy per pass (J); sheet-area "
            "(cm²). May be repeated: then none of the best is beaten in all.",
        ),
    ] = None,
    designs: Annotated[int, typer.Option(metavar="N", min=1, max=MAX_DESIGNS, help="Designs to try at most.")] = 50,
    runs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Runs of tried designs at most; default: no limit.")
    ] = None,
    environments: Environments = None,
    best: Annotated[
        int, typer.Option(metavar="N", min=1, max=100, help="How many of the best to judge in fresh environments.")
    ] = 3,
    fresh: Annotated[
        int, typer.Option(metavar="N", min=1, max=MAX_ENVIRONMENTS, help="Fresh environments to judge them in.")
    ] = 200,
    sampler: Annotated[
        Literal["tpe", "nsga2", "random", "grid"],
        typer.Option(metavar="NAME", help="How designs are chosen: tpe, nsga2, random or grid."),
    ] = "tpe",
    prune: Annotated[
        bool,
        typer.Option("--prune/--no-prune", help="With one objective, leave a design early that is worse than the best."),
    ] = True,
    seed: Annotated[int, typer.Option(metavar="S", min=0, max=2**31, help="Of the sampler.")] = 0,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: OneExperiment = None,
    calibration: UnderCalibration = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Search a family of cars for the best ones.

    With far fewer runs than a sweep: tries designs in the listing's environments, then judges the best in fresh ones,
    whose rates are what to believe. Runs are kept as a sweep's. It may be stopped at any time: the same command resumes.

    \b
    Example: foldcar optimize examples/design_space.json --store space.db --designs 60 --environments 50
    """
    from foldcar.api.sweeping import under_calibration
    from foldcar.commands.progress_bar import SearchBar
    from foldcar.commands.tables import print_search
    from foldcar.interrupts import message_on_signal
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.experiments import read_study
    from foldcar.study.search.objectives import OBJECTIVES
    from foldcar.study.search.search import Found, Plan, search, searched_study

    check_scheduler_option(scheduler, jobs)
    names = [one.value for one in objective or [ObjectiveName.success]]
    if len(set(names)) < len(names):
        raise FoldcarError(f"--objective: {', '.join(names)}: one is named twice")
    study = searched_study(read_study(listing, experiment, environments), fresh)
    study, environment_of = under_calibration(study, store, calibration)
    plan = Plan(
        objectives=tuple(OBJECTIVES[name] for name in names),
        sampler=sampler,
        seed=seed,
        designs=designs,
        runs=runs,
        fresh=fresh,
        best=best,
        prune=prune and len(names) == 1,
    )
    found = Found(planned=designs)

    def stopped() -> str:
        return f"stopped: {found.designs} of {designs} designs are tried, their runs in {store}; the same command resumes"

    carsim = Carsim()
    with (
        message_on_signal(stopped),
        SearchBar("designs", designs) as bar,
        simulators(scheduler, jobs, carsim, bar.say) as places,
    ):
        search(study, plan, store, carsim, places, command_line(), found, bar.update, environment_of)
    chosen = study.experiments[0]
    if as_json:
        print_result(
            as_json, {"store": store, "experiment": chosen.id, "objectives": names, **_search_object(names, found)}
        )
    else:
        print_search(plan, found, store, list(chosen.family.varied))


def _search_object(names: list[str], found: "Found") -> dict[str, Any]:
    """What was found, by the objectives' names."""
    counts = ("designs", "pruned", "unbuildable", "runs", "new", "exhausted")
    best = [
        {
            "design": one.design,
            "chosen_by": dict(zip(names, one.chosen_by, strict=True)),
            "fresh": {
                name: {"value": value, "interval": interval}
                for name, value, interval in zip(names, one.fresh, one.intervals, strict=True)
            },
        }
        for one in found.best
    ]
    return {**{name: getattr(found, name) for name in counts}, "seconds": round(found.seconds, 3), "best": best}
