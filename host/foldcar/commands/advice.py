"""`foldcar select`: which designs to build next, and why. `foldcar compare`: simulation against trials, by design."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    CsvFile,
    Json,
    OneExperiment,
    SimulatedTrialsInstead,
    StudyStore,
    check_distinct,
    parse_points,
    print_result,
    thresholds_of_success,
)

MAX_BUILD = 50


def select(
    store: StudyStore,
    build: Annotated[int, typer.Option(metavar="N", min=1, max=MAX_BUILD, help="How many designs to name.")] = 4,
    threshold: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            callback=thresholds_of_success,
            help="Success of a good design, 0 to 1; default: the listing's, or 0.75.",
        ),
    ] = None,
    precision: Annotated[
        str, typer.Option(metavar="POINTS", help="Half-width that trials are to bring a rate's interval to.")
    ] = "15pp",
    experiment: OneExperiment = None,
    csv: CsvFile = None,
    simulated_trials: SimulatedTrialsInstead = False,
    as_json: Json = False,
) -> None:
    """Say which designs to build next, and why.

    Before trials: the middle, the edges and the outside of the region that reaches the threshold in simulation. After
    trials: the designs whose trials would tell most about which one is best and which ones reach the threshold; or that
    it is enough. With trials needed, sampled environments to set up, sheets and minutes. docs/advice.md explains it.

    \b
    Example: foldcar select study.db --build 4
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_selections
    from foldcar.inference.tables import selection_object, write_selection

    check_distinct([store], [csv])
    half_width = parse_points("--precision", precision, least=1, most=45)
    with working("weighing designs"):
        found = Study(store).select(
            build=build, threshold=threshold, precision=half_width, experiment=experiment, with_cost=True,
            simulated_trials=simulated_trials,
        )  # fmt: skip
    if csv is not None:
        write_selection(found, csv)
    if as_json:
        print_result(as_json, {"store": store, "experiments": [selection_object(one) for one in found]})
    else:
        print_selections(found)
        _say_written(csv, sum(len(one.recommendations) for one in found))


def compare(
    store: StudyStore,
    experiment: OneExperiment = None,
    margin: Annotated[
        str, typer.Option(metavar="POINTS", help="Rates that differ by no more agree, in percentage points.")
    ] = "15pp",
    csv: CsvFile = None,
    simulated_trials: SimulatedTrialsInstead = False,
    as_json: Json = False,
) -> None:
    """Compare simulation with trials of built cars.

    For each design that was driven: success in simulation and in trials, their gap with its interval, and whether
    simulation agrees, is optimistic or pessimistic, or the trials are too few to say. docs/advice.md explains it.

    \b
    Example: foldcar compare study.db
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_comparison
    from foldcar.inference.tables import comparison_object, write_comparison

    check_distinct([store], [csv])
    share = parse_points("--margin", margin)
    with working("comparing; what the sweep lacks is simulated"):
        found = Study(store).compare(experiment=experiment, margin=share, simulated_trials=simulated_trials)
    if csv is not None:
        write_comparison(found, csv)
    if as_json:
        print_result(as_json, {"store": store, **comparison_object(found)})
    else:
        print_comparison(found)
        _say_written(csv, sum(len(one.designs) for one in found.experiments))


def _say_written(csv: Path | None, designs: int) -> None:
    if csv is not None:
        typer.echo(f"{csv}: {designs} designs", err=True)
