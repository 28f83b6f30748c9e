"""`foldcar select` recommends designs to build. `foldcar compare` compares simulation with trials, design by design."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    CsvFile,
    Json,
    OneExperiment,
    SimulatedTrials,
    StudyStore,
    check_distinct,
    parse_points,
    print_result,
    thresholds_of_success,
)

MAX_BUILD = 50


def select(
    store: StudyStore,
    build: Annotated[int, typer.Option(metavar="N", min=1, max=MAX_BUILD, help="Number of designs to recommend.")] = 4,
    threshold: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            callback=thresholds_of_success,
            help="Success rate that a good design reaches, 0 to 1; default: the listing's threshold, or 0.75.",
        ),
    ] = None,
    precision: Annotated[
        str,
        typer.Option(metavar="POINTS", help="Plan enough trials that the rate's 95 % interval is at most ± POINTS."),
    ] = "15pp",
    experiment: OneExperiment = None,
    csv: CsvFile = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Recommend designs to build next, with reasons.

    Before the first trial, it considers the region of designs that reach the threshold in simulation. It recommends a
    design in the middle of this region, designs at its edges, and designs just outside. After trials, it recommends the
    designs whose trials would be most informative, or it says that the trials suffice. Informative trials help to find
    the best design and the designs that reach the threshold. The command also lists the trials needed, the sampled
    environments to set up, sheets and minutes. See docs/advice.md.

    \b
    Example: foldcar select study.db --build 4
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_selections
    from foldcar.inference.tables import selection_object, write_selection

    check_distinct([store], [csv])
    half_width = parse_points("--precision", precision, low=1, high=45)
    with working("weighing designs"):
        selections = Study(store).select(
            build=build, threshold=threshold, precision=half_width, experiment=experiment,
            simulated_trials=simulated_trials,
        )  # fmt: skip
    if csv is not None:
        write_selection(selections, csv)
    if as_json:
        print_result(as_json, {"store": store, "experiments": [selection_object(selection) for selection in selections]})
    else:
        print_selections(selections)
        _print_written(csv, sum(len(selection.recommendations) for selection in selections))


def compare(
    store: StudyStore,
    experiment: OneExperiment = None,
    margin: Annotated[
        str, typer.Option(metavar="POINTS", help="Largest difference, in percentage points, at which two rates agree.")
    ] = "15pp",
    csv: CsvFile = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Compare simulation with trials of built cars.

    For each driven design it shows the success rates in simulation and in trials, and their gap with an interval. The
    verdict says whether simulation agrees, is optimistic, is pessimistic, or whether there are too few trials to tell.
    See docs/advice.md.

    \b
    Example: foldcar compare study.db
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_comparison
    from foldcar.inference.tables import comparison_object, write_comparison

    check_distinct([store], [csv])
    largest_gap = parse_points("--margin", margin)
    with working("comparing; simulating runs that the sweep lacks"):
        comparison = Study(store).compare(experiment=experiment, margin=largest_gap, simulated_trials=simulated_trials)
    if csv is not None:
        write_comparison(comparison, csv)
    if as_json:
        print_result(as_json, {"store": store, **comparison_object(comparison)})
    else:
        print_comparison(comparison)
        _print_written(csv, sum(len(experiment_comparison.designs) for experiment_comparison in comparison.experiments))


def _print_written(csv: Path | None, designs: int) -> None:
    """Print the name of a written CSV file, if any, and its number of designs on stderr."""
    if csv is not None:
        typer.echo(f"{csv}: {designs} designs", err=True)
