"""`foldcar sweep`: simulates every design of a listing in every environment into a store."""

import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.failed_runs import say_failed
from foldcar.commands.options import (
    Components,
    Engine,
    Jobs,
    Json,
    Scheduler,
    check_scheduler_option,
    output_store,
    print_json,
    simulators,
)
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.analysis.stopping import StoppingRule
    from foldcar.study.experiment_runs import Progress
    from foldcar.study.experiments import Experiment
    from foldcar.study.stopping import DesignState


def sweep(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    store: Annotated[
        Path, typer.Option(metavar="FILE", callback=output_store, help="Store to write; made if it is missing.")
    ],
    environments: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MOST_ENVIRONMENTS,
            help="Sampled environments, instead of the listing's number; with --until the most of them.",
        ),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="RULE",
            help="Simulate each design only until its 95 % interval reaches 5 percentage points to each side (5pp), or "
            "lies on one side of the listing's thresholds (decided).",
        ),
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    calibration: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Simulate under this calibration of the store (see `foldcar calibrate`)."),
    ] = None,
    reality: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Simulate with the parameters of this JSON file, as `foldcar link` does."),
    ] = None,
    engine: Engine = "multibody",
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Simulate all runs that the store lacks.

    Every design of the listing in every sampled environment. It may be stopped at any time: the same command resumes it.
    Exit code 1 if runs have failed.

    \b
    Example: foldcar sweep scenarios/width_study.json --store study.db
    foldcar sweep scenarios/width_study.json --store study.db --until decided
    """
    check_scheduler_option(scheduler, jobs)
    from foldcar.commands.options import under_calibration
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.interrupts import said
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import mutation_notes
    from foldcar.study.experiments import engine_study, read_study
    from foldcar.study.stopping import stopping_rules
    from foldcar.study.sweep import Sweep

    study = read_study(listing, experiment, environments)
    carsim = Carsim(engine=engine)
    study, environment_of = under_calibration(engine_study(study, carsim), store, calibration, reality)
    rules = stopping_rules(until, study) if until is not None else {}
    asked = Sweep(study, store, carsim, shlex.join(["foldcar", *sys.argv[1:]]), environment_of, rules)
    designs = sum(map(len, asked.designs.values()))
    for note in mutation_notes(asked.environments):
        typer.echo(f"note: {note}", err=True)
    progress, most = asked.progress, asked.progress.total

    def stopped() -> str:
        total = f"at most {progress.total}" if rules else f"{progress.total}"
        return f"stopped: {progress.done} of {total} runs are stored in {store}; the same command resumes"

    with (
        said(stopped),
        ProgressBar(progress, designs if rules else None) as bar,
        simulators(scheduler, jobs, carsim, bar.say) as places,
    ):
        asked.run(places, bar.update, bar.say)
    if as_json:
        print_json(
            {
                "store": store,
                "runs": progress.total,
                "new": progress.new,
                "there": progress.there,
                "judged": progress.judged,
                "passed": progress.passed if progress.judged else None,
                "rejected": progress.rejected,
                "failed": progress.failed,
                "seconds": round(progress.seconds, 3),
                **({"most_runs": most, "designs": [asdict(state) for state in progress.states]} if rules else {}),
            }
        )
    else:
        # A share over designs of which some have more runs than others would say nothing.
        success = "" if rules else f", {_success(progress)}"
        told = {"rejected": progress.rejected, "failed": progress.failed}
        left_out = "".join(f", {count} {what}" for what, count in told.items() if count)
        rate = f", {progress.new / progress.seconds:.0f} runs/s" if progress.new else ""
        made = f"{progress.new} runs new, {progress.there} there already, {progress.seconds:.1f} s{rate}"
        typer.echo(f"{made}{success}{left_out}; store: {store}")
        for chosen in study.experiments if rules else ():
            for line in stopping_lines(chosen, rules[chosen.id], progress.states):
                typer.echo(line)
    if progress.failed:
        say_failed(store, [chosen.id for chosen in study.experiments], progress.failed, progress.total)
        raise typer.Exit(1)


def _success(progress: "Progress") -> str:
    if not progress.judged:
        return "no rate" if progress.rejected else "success undefined"
    share = f"{100 * progress.passed / progress.judged:.1f} %"
    if progress.judged == progress.total:
        return f"{share} passed"
    undefined = progress.total - progress.judged - progress.rejected
    return f"{share} of {progress.judged} passed{f', success undefined in {undefined}' if undefined else ''}"


# Undecided designs that are named.
SHOWN = 12


def stopping_lines(experiment: "Experiment", rule: "StoppingRule", states: "Sequence[DesignState]") -> Iterator[str]:
    """How many designs of the experiment are decided, what that means, and which are not."""
    # Here, because it imports numpy, which other commands do without.
    from foldcar.analysis.stopping import LEAST_CHANCE

    mine = [state for state in states if state.experiment == experiment.id]
    undecided = [state for state in mine if not state.decided]
    rest = f", {len(undecided)} undecided" if undecided else ""
    made, most = sum(state.runs for state in mine), len(mine) * experiment.environments
    head = f"experiment {experiment.id}: {len(mine) - len(undecided)} of {len(mine)} designs decided"
    rejected = sum(state.rejected for state in mine)
    yield f"{head}{rest}; {made} of at most {most} runs{f', {rejected} rejected' if rejected else ''}"
    yield f"  decided: {rule.text}; that holds for each design by itself, whenever its runs stop"
    if undecided:
        varied = experiment.family.varied
        names = [_name(state, list(varied)) for state in undecided[:SHOWN]]
        head = f"{next(iter(varied))} " if len(varied) == 1 else ""
        more = f" and {len(undecided) - SHOWN} more" if len(undecided) > SHOWN else ""
        yield f"  undecided: {head}{', '.join(names)}{more}; --environments N allows more runs"
        left = sum(state.runs < experiment.environments for state in undecided)
        if left:
            chance = f"with a chance below {100 * LEAST_CHANCE:g} %"
            yield f"  {left} of these were left early: {experiment.environments} environments would decide them {chance}"


def _name(state: "DesignState", varied: Sequence[str]) -> str:
    if len(varied) == 1:
        return f"{state.design[varied[0]]:g}"
    return " ".join(f"{name}={state.design[name]:g}" for name in varied) or "the only design"
