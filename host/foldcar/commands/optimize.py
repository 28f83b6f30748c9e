"""`foldcar optimize` searches a family for its best designs and simulates only promising ones."""

from enum import Enum
from typing import Annotated

import typer

from foldcar.commands.options import (
    Components,
    Jobs,
    Listing,
    OneExperiment,
    OutputStore,
    Samples,
    Scheduler,
    check_scheduler_option,
    command_line,
    simulators,
)
from foldcar.errors import FoldcarError

MAX_DESIGNS = 100_000


class ObjectiveName(str, Enum):
    """The values of `--objective`."""

    built = "built"
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
            help="built (default: expected success of built cars), success (in nominal simulation), time (s; a failed "
            "run counts as the time limit), energy (J per pass) or sheet-area (cm²). May be repeated: the best designs "
            "are then the non-dominated ones. With built, all runs are in random realities, so time and energy are "
            "expected values of built cars; without it, they are those of nominal simulation.",
        ),
    ] = None,
    designs: Annotated[
        int, typer.Option(metavar="N", min=1, max=MAX_DESIGNS, help="Maximum number of designs to try.")
    ] = 50,
    samples: Samples = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: OneExperiment = None,
    components: Components = None,
) -> None:
    """Search a family of cars for the best designs.

    The search looks for the design whose built cars are expected to succeed most often. Nobody knows, for example, the
    friction of the floor, so each sample is simulated in a random reality: a set of values of what the simulator does
    not know. All designs drive in the same realities.

    A search needs far fewer runs than a sweep. It tries designs in the listing's environments and then tests the best
    ones in new environments and realities. Trust only the rates in the new ones. The first rates are biased upwards,
    because the search chose the designs by them. The store keeps the runs, as for a sweep. You may stop the search at
    any time; the same command resumes it.

    \b
    Example: foldcar optimize examples/design_space.json --store study.db --designs 60 --samples 50
    foldcar optimize examples/design_space.json --store study.db --objective built --objective sheet-area
    """
    from foldcar.commands.progress_bar import SearchBar
    from foldcar.commands.tables import print_search
    from foldcar.interrupts import message_on_signal
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.experiments import read_study
    from foldcar.study.search.objectives import OBJECTIVES
    from foldcar.study.search.search import Plan, SearchResult, search, searched_study

    check_scheduler_option(scheduler, jobs)
    objective_names = [name.value for name in objective or [ObjectiveName.built]]
    if len(set(objective_names)) < len(objective_names):
        raise FoldcarError(f"--objective: {', '.join(objective_names)}: each objective may be named only once")
    plan = Plan(tuple(OBJECTIVES[name] for name in objective_names), designs)
    study = searched_study(read_study(listing, experiment, samples), plan)
    progress = SearchResult(planned=designs)

    def stopped() -> str:
        return f"stopped: {progress.designs} of {designs} designs tried, runs in {store}; the same command resumes"

    carsim = Carsim()
    with (
        message_on_signal(stopped),
        SearchBar("designs", designs) as bar,
        simulators(scheduler, jobs, carsim, bar.print_line) as places,
    ):
        search(study, plan, store, carsim, places, command_line(), progress, bar.update)
    print_search(plan, progress, store, list(study.experiments[0].family.varied))
