"""`foldcar select` recommends designs to build. `foldcar compare` compares simulation with trials, design by design."""

from typing import Annotated

import typer

from foldcar.commands.options import (
    DesignsFile,
    Json,
    OneExperiment,
    SimulatedTrials,
    StepsFile,
    StudyStore,
    check_distinct,
    parse_points,
    print_result,
    thresholds_of_success,
)


def select(
    store: StudyStore,
    threshold: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            callback=thresholds_of_success,
            help="Success rate that a good design reaches, 0 to 1; default: the listing's threshold, or 0.75.",
        ),
    ] = None,
    experiment: OneExperiment = None,
    csv: StepsFile = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Say which car to take, and what to do next.

    Two lines answer. *Want a car that works?* names the car with the highest expected success, with its 95 % interval.
    *Want to learn most?* names the next step: build a car, drive one again, or measure something; at most an afternoon of
    work. The table has the steps that were weighed: how much each is expected to raise the success of the design that is
    recommended afterwards. Do the step and ask again. See docs/advice.md.

    \b
    Example: foldcar select study.db
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_selections
    from foldcar.evidence.tables import selection_object, write_selection
    from foldcar.statistics.words import count

    check_distinct([store], [csv])
    with working("weighing realities"):
        selections = Study(store).select(threshold=threshold, experiment=experiment, simulated_trials=simulated_trials)
    if csv is not None:
        write_selection(selections, csv)
    if as_json:
        print_result(as_json, {"store": store, "experiments": [selection_object(selection) for selection in selections]})
    else:
        print_selections(selections)
        if csv is not None:
            step_count = sum(len(selection.steps) for selection in selections)
            typer.echo(f"{csv}: {count(step_count, 'step')}", err=True)


def compare(
    store: StudyStore,
    experiment: OneExperiment = None,
    margin: Annotated[
        str, typer.Option(metavar="POINTS", help="Largest difference, in percentage points, at which two rates agree.")
    ] = "15pp",
    csv: DesignsFile = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Compare simulation with trials of built cars.

    For each driven design it shows the success rates in simulation and in trials, and their gap with an interval. The
    verdict says whether simulation agrees, is optimistic, is pessimistic, or whether there are too few trials to tell.
    A second table says which realities fit: what the trials have taught about what the simulator does not know.
    See docs/advice.md.

    \b
    Example: foldcar compare study.db
    """
    from foldcar.api.study import Study
    from foldcar.commands.progress_bar import working
    from foldcar.commands.tables import print_comparison
    from foldcar.evidence.tables import comparison_object, write_comparison

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
        if csv is not None:
            design_count = sum(len(experiment.designs) for experiment in comparison.experiments)
            typer.echo(f"{csv}: {design_count} designs", err=True)
