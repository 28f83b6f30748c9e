"""`foldcar trials`: a store's trials - listed, simulated again as pairs, changed, imported, exported."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, Number, SimulatedTrials, StoreFile, output_file, print_json
from foldcar.commands.trial_changes import correct, restore, withdraw
from foldcar.commands.trial_files import dialect, export, import_file
from foldcar.errors import FoldcarError

trials = typer.Typer(
    name="trials", help="List, correct and replay trials of cars.", no_args_is_help=True, rich_markup_mode=None
)


@trials.command("list")
def list_trials(
    store: StoreFile,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    as_json: Json = False,
) -> None:
    """Show trials, one a line, and their corrections.

    \b
    Example: foldcar trials list study.db --experiment 1
    """
    from foldcar.commands.trial_table import correction_text, print_trials
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        found = list(opened.trials(experiment))
        if experiment is not None and not found:
            known = ", ".join(dict.fromkeys(trial.experiment for trial in opened.trials())) or "none"
            raise FoldcarError(f'{store}: has no trials of experiment "{experiment}"; experiments with trials: {known}')
        corrected = {trial.id for trial in found if trial.corrections}
        trail = [one for one in opened.corrections() if one.trial in corrected]
    if as_json:
        print_json({"trials": [asdict(one) for one in found], "corrections": [asdict(one) for one in trail]})
        return
    print_trials(found)
    for one in trail:
        typer.echo(correction_text(one))


@trials.command()
def replay(
    store: StoreFile,
    number: Number,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="Picture of the scene as it stood (.png, .svg, .pdf)."),
    ] = None,
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Simulate a trial again as it was placed.

    Trial and simulation are compared; the picture shows the simulated run.

    \b
    Example: foldcar trials replay study.db 7 --plot pair.png
    """
    from foldcar.commands.trial_table import STANDING_TEXTS, seconds_text
    from foldcar.figures.output import check_format
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.results import outcome_of
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import BUILT, SIMULATED
    from foldcar.trials.replay import agree, simulate_pair

    if plot is not None:
        check_format(plot)
    carsim = Carsim()
    with Store.open(store) as opened:
        trial = opened.trial(number)
        pair = simulate_pair(opened, number, carsim)
    answer = pair.answer
    outcome = outcome_of(answer)
    simulated_s = answer.get("elapsed_time_s")
    compared = trial.completed and (trial.standing == BUILT or (simulated_trials and trial.standing == SIMULATED))
    agrees = agree(trial.outcome, outcome) if compared else None
    if not as_json:
        mark = "" if trial.standing == BUILT else f"  ({STANDING_TEXTS[trial.standing]})"
        typer.echo(f"{'':<10}{'outcome':<12}{'time (s)':>9}")
        typer.echo(f"{'trial':<10}{trial.outcome:<12}{seconds_text(trial.elapsed_time_s):>9}{mark}")
        typer.echo(f"{'simulated':<10}{outcome:<12}{seconds_text(simulated_s):>9}")
        if agrees is not None:
            typer.echo("both agree" if agrees else "they disagree")
        elif not trial.completed:
            typer.echo("the trial was aborted: nothing to compare")
        else:
            typer.echo(f"not compared: {STANDING_TEXTS[trial.standing]}")
    if plot is not None:
        from foldcar.figures.run import draw_run
        from foldcar.simulation.heights import carsim_heights

        if "path" not in answer:
            raise FoldcarError(f"{plot}: a failed run has no picture")
        draw_run(pair.body, pair.scene, answer, answer["path"], carsim_heights(carsim), plot)
        if not as_json:
            typer.echo(f"picture: {plot}")
    if as_json:
        simulated = {"outcome": outcome, "elapsed_time_s": simulated_s, "message": answer.get("error")}
        print_json({"trial": asdict(trial), "simulated": simulated, "agrees": agrees, "picture": plot})


for command in (correct, withdraw, restore, export, dialect):
    trials.command()(command)
trials.command("import")(import_file)
