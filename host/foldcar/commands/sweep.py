"""`foldcar sweep`: simulates every design of a listing in every environment into a store."""

import shlex
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.live import PORT, LivePort, served_beside
from foldcar.commands.options import (
    Components,
    Engine,
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
    print_note,
    print_result,
    simulators,
)
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule
    from foldcar.study.experiment_runs import Progress
    from foldcar.study.experiments import Experiment
    from foldcar.study.stopping import DesignState
    from foldcar.study.sweep import Sweep

# Undecided designs that are named, and different messages of failed runs that are shown.
SHOWN_UNDECIDED = 12
# Designs of a sweep from which on it says how long folding them takes.
MANY_DESIGNS = 2_000
SHOWN_MESSAGES = 3


def sweep(
    listing: Listing,
    store: OutputStore,
    environments: Environments = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="RULE",
            help="Simulate each design, in at most --environments, only until its 95 % interval reaches 5 percentage "
            "points to each side (5pp), or lies on one side of the listing's thresholds (decided).",
        ),
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: OneExperiment = None,
    calibration: UnderCalibration = None,
    reality: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Simulate with the parameters of this JSON file, as `foldcar link` does."),
    ] = None,
    engine: Engine = "multibody",
    components: Components = None,
    live: Annotated[
        bool, typer.Option("--live", help="Serve the report's page to this machine's browser; it follows the sweep.")
    ] = False,
    port: LivePort = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Estimate time and size, list what cannot be built; write nothing.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Simulate all runs that the store lacks.

    Every design of the listing in every sampled environment. It may be stopped at any time: the same command resumes it.
    Exit code 1 if runs have failed.

    \b
    Example: foldcar sweep scenarios/width_study.json --store study.db
    foldcar sweep scenarios/width_study.json --store study.db --until decided
    """
    if port is not None and not live:
        raise FoldcarError("--port: only --live serves the page")
    check_scheduler_option(scheduler, jobs)
    from foldcar.api.sweeping import planned_sweep

    asked = planned_sweep(
        listing, store, command_line(), experiment=experiment, environments=environments, until=until,
        calibration=calibration, reality=reality, engine=engine,
    )  # fmt: skip
    if dry_run:
        _print_estimates(asked, jobs or usable_processors(), as_json)
        return
    with served_beside(store, PORT if port is None else port) if live else nullcontext():
        _sweep(asked, scheduler, jobs, as_json)


def _print_estimates(asked: "Sweep", jobs: int, as_json: bool) -> None:
    """Print what the sweep would take."""
    from foldcar.commands.progress_bar import working
    from foldcar.statistics.words import count, duration_text
    from foldcar.study.dry_run import estimates

    with working("folding designs and simulating a few runs"):
        found = estimates(asked, jobs)
    seconds, size = sum(one.seconds for one in found), sum(one.bytes for one in found)
    lines = []
    for one in found:
        each = count(one.runs, "run")
        lines.append(f"experiment {one.experiment}: {count(one.designs, 'design')}, {each} of those that can be built")
        if one.folded < one.designs:
            whole = duration_text(one.folding_s)
            lines.append(f"  {one.folded:,} of them, spread over the family, were folded; all would take about {whole}")
        if one.refused:
            lines.append(f"  {len(one.refused):,} of {one.folded:,} cannot be built and would be skipped:")
            lines += [f"    {reason}" for reason in one.refused]
    lines.append(f"about {duration_text(seconds)} with {count(jobs, 'simulator')}; the store about {size / 1e6:.1f} MB")
    lines.append("This is an estimate from a few runs; nothing was written. Runs that the store has are not repeated.")
    print_result(
        as_json,
        {"store": asked.store, "seconds": seconds, "bytes": size, "experiments": [asdict(one) for one in found]},
        *lines,
    )


def _sweep(asked: "Sweep", scheduler: str | None, jobs: int | None, as_json: bool) -> None:
    """Simulate, print the result. Exit code 1 if runs have failed."""
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.interrupts import message_on_signal

    if not asked.store.exists():
        _announce_folding(asked)
    store, rules = asked.store, asked.until
    progress, most = asked.progress, asked.progress.total

    def stopped() -> str:
        total = f"at most {progress.total}" if rules else f"{progress.total}"
        return f"stopped: {progress.done} of {total} runs are stored in {store}; the same command resumes"

    to_decide = sum(map(len, asked.designs.values())) if rules else None
    with (
        message_on_signal(stopped),
        ProgressBar(progress, to_decide) as bar,
        simulators(scheduler, jobs, asked.carsim, bar.say) as places,
    ):
        asked.run(places, bar.update, bar.say)
    names = ("new", "there", "judged", "rejected", "failed")
    result = {
        "store": store,
        "runs": progress.total,
        **{name: getattr(progress, name) for name in names},
        "passed": progress.passed if progress.judged else None,
        "seconds": round(progress.seconds, 3),
        **({"most_runs": most, "designs": [asdict(state) for state in progress.states]} if rules else {}),
    }
    lines = [f"{_counts(progress, with_success=not rules)}; store: {store}"]
    for chosen in asked.study.experiments if rules else ():
        lines += stopping_lines(chosen, rules[chosen.id], progress.states)
    print_result(as_json, result, *lines)
    if progress.failed:
        _say_failed(store, [chosen.id for chosen in asked.study.experiments], progress.failed, progress.total)
        raise typer.Exit(1)


def _announce_folding(asked: "Sweep") -> None:
    """Say how long folding takes before the first run, if that is long."""
    if sum(experiment.family.combinations for experiment in asked.study.experiments) < MANY_DESIGNS:
        return
    from foldcar.statistics.words import duration_text
    from foldcar.study.dry_run import fold

    took = duration_text(sum(fold(experiment.family, 1.0)[1] for experiment in asked.study.experiments))
    print_note(
        f"folding and checking all designs comes first and takes about {took}; --dry-run estimates the whole sweep"
    )


def _counts(progress: "Progress", with_success: bool) -> str:
    made = f"{progress.new} runs new, {progress.there} there already, {progress.seconds:.1f} s"
    rate = f", {progress.new / progress.seconds:.0f} runs/s" if progress.new else ""
    # A share over designs of which some have more runs than others would say nothing.
    success = f", {_success(progress)}" if with_success else ""
    told = {"rejected": progress.rejected, "failed": progress.failed}
    return f"{made}{rate}{success}{''.join(f', {count} {what}' for what, count in told.items() if count)}"


def _success(progress: "Progress") -> str:
    if not progress.judged:
        return "no rate" if progress.rejected else "success undefined"
    share = f"{100 * progress.passed / progress.judged:.1f} %"
    if progress.judged == progress.total:
        return f"{share} passed"
    undefined = progress.total - progress.judged - progress.rejected
    return f"{share} of {progress.judged} passed{f', success undefined in {undefined}' if undefined else ''}"


def stopping_lines(experiment: "Experiment", rule: "StoppingRule", states: "Sequence[DesignState]") -> Iterator[str]:
    """How many designs of the experiment are decided, what that means, and which are not."""
    from foldcar.statistics.words import design_text, listed

    mine = [state for state in states if state.experiment == experiment.id]
    undecided = [state for state in mine if not state.decided]
    rest = f", {len(undecided)} undecided" if undecided else ""
    made, most = sum(state.runs for state in mine), len(mine) * experiment.environments
    rejected = sum(state.rejected for state in mine)
    head = f"experiment {experiment.id}: {len(mine) - len(undecided)} of {len(mine)} designs decided{rest}"
    yield f"{head}; {made} of at most {most} runs{f', {rejected} rejected' if rejected else ''}"
    yield f"  decided: {rule.text}; that holds for each design by itself, whenever its runs stop"
    if undecided:
        shown = undecided[:SHOWN_UNDECIDED]
        names = listed(design_text({name: state.design[name] for name in experiment.family.varied}) for state in shown)
        more = f" and {len(undecided) - len(shown)} more" if len(undecided) > len(shown) else ""
        yield f"  undecided: {names}{more}; --environments N allows more runs"


def _say_failed(store: Path, experiments: Sequence[str], failed: int, total: int) -> None:
    """Print on stderr what went wrong in the first ones of the failed runs, and the command that lists them all."""
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        messages = opened.failures(experiments)
    lines = [f"{failed} of {total} runs failed and count as not passed:"]
    lines += [f"  {count} x {message}" for message, count in messages[:SHOWN_MESSAGES]]
    if len(messages) > SHOWN_MESSAGES:
        lines.append(f"  and {len(messages) - SHOWN_MESSAGES} other messages")
    lines.append(f"list them: {shlex.join(['foldcar', 'export', str(store), '--failed', '--csv', '-'])}")
    typer.echo("\n".join(lines), err=True)
