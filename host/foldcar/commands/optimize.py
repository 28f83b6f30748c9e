"""`foldcar optimize` searches a family for its best designs and simulates only promising ones."""

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
    from foldcar.study.search.search import SearchResult

MAX_DESIGNS = 100_000


class ObjectiveName(str, Enum):
    """The values of `--objective`."""

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
            help="success (default), time (s; a failed run counts as the time limit), energy (J per pass) "
            "or sheet-area (cm²). May be repeated: the best designs are then the non-dominated ones.",
        ),
    ] = None,
    designs: Annotated[
        int, typer.Option(metavar="N", min=1, max=MAX_DESIGNS, help="Maximum number of designs to try.")
    ] = 50,
    runs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Maximum number of runs for trying designs; default: no limit.")
    ] = None,
    environments: Environments = None,
    best: Annotated[
        int, typer.Option(metavar="N", min=1, max=100, help="Number of best designs to test in new environments.")
    ] = 3,
    fresh: Annotated[
        int,
        typer.Option(
            metavar="N", min=1, max=MAX_ENVIRONMENTS, help="Number of new environments to test the best designs in."
        ),
    ] = 200,
    sampler: Annotated[
        Literal["tpe", "nsga2", "random", "grid"],
        typer.Option(metavar="NAME", help="Algorithm that proposes designs: tpe, nsga2, random or grid."),
    ] = "tpe",
    prune: Annotated[
        bool,
        typer.Option(
            "--prune/--no-prune", help="With one objective, give up designs early that are worse than the best."
        ),
    ] = True,
    seed: Annotated[int, typer.Option(metavar="S", min=0, max=2**31, help="Random seed of the sampler.")] = 0,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: OneExperiment = None,
    calibration: UnderCalibration = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Search a family of cars for the best designs.

    A search needs far fewer runs than a sweep. It tries designs in the listing's environments and then tests the best
    ones in new environments. Trust only the rates in the new environments. The first rates are biased upwards,
    because the search chose the designs by them. The store keeps the runs, as for a sweep. You may stop the search at
    any time; the same command resumes it.

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
    from foldcar.study.search.search import Plan, SearchResult, search, searched_study

    check_scheduler_option(scheduler, jobs)
    objective_names = [name.value for name in objective or [ObjectiveName.success]]
    if len(set(objective_names)) < len(objective_names):
        raise FoldcarError(f"--objective: {', '.join(objective_names)}: each objective may be named only once")
    study = searched_study(read_study(listing, experiment, environments), fresh)
    study, environment_of = under_calibration(study, store, calibration)
    plan = Plan(
        objectives=tuple(OBJECTIVES[name] for name in objective_names),
        sampler=sampler,
        seed=seed,
        designs=designs,
        runs=runs,
        fresh=fresh,
        best=best,
        prune=prune and len(objective_names) == 1,
    )
    progress = SearchResult(planned=designs)

    def stopped() -> str:
        return f"stopped: {progress.designs} of {designs} designs tried, runs in {store}; the same command resumes"

    carsim = Carsim()
    with (
        message_on_signal(stopped),
        SearchBar("designs", designs) as bar,
        simulators(scheduler, jobs, carsim, bar.print_line) as places,
    ):
        search(study, plan, store, carsim, places, command_line(), progress, bar.update, environment_of)
    experiment_entry = study.experiments[0]
    if as_json:
        print_result(
            as_json,
            {
                "store": store,
                "experiment": experiment_entry.id,
                "objectives": objective_names,
                **_search_object(objective_names, progress),
            },
        )
    else:
        print_search(plan, progress, store, list(experiment_entry.family.varied))


def _search_object(names: list[str], progress: "SearchResult") -> dict[str, Any]:
    """Return the result of a search as plain data; ``names`` are those of the objectives."""
    # A design's objectives have two values: those in the runs by which the search chose it, and those in fresh
    # environments, with 95 % intervals.
    counts = ("designs", "pruned", "unbuildable", "runs", "new", "exhausted")
    best = [
        {
            "design": design.design,
            "chosen_by": dict(zip(names, design.chosen_by, strict=True)),
            "fresh": {
                name: {"value": value, "interval": interval}
                for name, value, interval in zip(names, design.fresh, design.intervals, strict=True)
            },
        }
        for design in progress.best
    ]
    return {**{name: getattr(progress, name) for name in counts}, "seconds": round(progress.seconds, 3), "best": best}
