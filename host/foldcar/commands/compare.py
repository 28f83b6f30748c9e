"""`foldcar compare`: simulation against trials of built cars, design by design."""

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
    tell,
)


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
    from foldcar.advice.tables import comparison_object, write_comparison
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_comparison

    check_distinct([store], [csv])
    share = parse_points("--margin", margin)
    with working("comparing; what the sweep lacks is simulated"):
        found = Study(store).compare(experiment=experiment, margin=share, simulated_trials=simulated_trials)
    if csv is not None:
        write_comparison(found, csv)
    if as_json:
        tell(as_json, {"store": store, **comparison_object(found)})
        return
    print_comparison(found)
    if csv is not None:
        typer.echo(f"{csv}: {sum(len(one.designs) for one in found.experiments)} designs", err=True)
