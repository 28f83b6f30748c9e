"""`foldcar sweep` simulates every design of a listing in every sampled environment and stores the runs."""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import (
    Components,
    Engine,
    Jobs,
    Json,
    Listing,
    OneExperiment,
    OutputStore,
    Samples,
    Scheduler,
    check_scheduler_option,
    command_line,
    print_note,
    print_result,
    simulators,
)
from foldcar.installation import usable_processors
from foldcar.study.limits import MAX_REALITIES

if TYPE_CHECKING:
    from foldcar.statistics.stopping import StoppingRule
    from foldcar.study.dry_run import SweepEstimate
    from foldcar.study.experiment_runs import Progress
    from foldcar.study.experiments import Experiment
    from foldcar.study.reality_runs import RealityCounts
    from foldcar.study.stopping import DesignState
    from foldcar.study.sweep import Sweep

# Numbers of undecided designs that are named, and of different messages of failed runs that are shown.
SHOWN_UNDECIDED, SHOWN_MESSAGES = 12, 3
# A sweep with at least this many designs first announces how long folding them takes.
MANY_DESIGNS = 2_000


def sweep(
    listing: Listing,
    store: OutputStore,
    samples: Samples = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="RULE",
            help="When to stop simulating a design. `5pp`, or another number: when the 95 % interval of its success rate "
            "is at most ± 5 percentage points. `decided`: when this interval contains none of the listing's thresholds.",
        ),
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    experiment: OneExperiment = None,
    reality: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Simulate with the parameters of car and ground in this JSON file."),
    ] = None,
    engine: Engine = "multibody",
    realities: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=0,
            max=MAX_REALITIES,
            help="Number of each experiment's runs in other realities, from which the success rate of built cars is "
            "learned; 0 leaves them out. Default: as many as the learning needs, 4000 or 8000.",
        ),
    ] = None,
    components: Components = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only estimate time and size, and list designs that cannot be built.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Simulate all designs in all environments, then random designs in other realities.

    A reality is a set of values of what the simulator does not know, such as friction. The runs are stored; runs that the
    store already has are not repeated. You may stop a sweep at any time; the same
    command resumes it. Exit code 1 if runs have failed.

    \b
    Example: foldcar sweep scenarios/width_study.json --store study.db
    foldcar sweep scenarios/width_study.json --store study.db --until decided
    """
    check_scheduler_option(scheduler, jobs)
    from foldcar.api.sweeping import planned_sweep

    planned = planned_sweep(
        listing, store, command_line(), experiment=experiment, environments=samples, until=until,
        reality=reality, engine=engine, realities=realities,
    )  # fmt: skip
    if dry_run:
        _print_estimates(planned, jobs or usable_processors(), as_json)
        return
    _sweep(planned, scheduler, jobs, as_json)


def _stopped_text(planned: "Sweep") -> str:
    """Return the message after Ctrl-C: how many of the planned runs are stored.

    Some runs may be planned in other *realities*: with other values of what the simulator does not know exactly, such as
    friction. They are counted separately.
    """
    progress = planned.progress
    # A stopping rule may make fewer runs.
    at_most = "at most " if planned.until else ""
    in_realities = list(progress.realities.values())
    planned_in_realities = sum(counts.total for counts in in_realities)
    realities_text = ""
    if planned_in_realities:
        stored_in_realities = sum(counts.done for counts in in_realities)
        realities_text = f", and {stored_in_realities:,} of {planned_in_realities:,} in other realities,"
    stored_text = f"{progress.done:,} of {at_most}{progress.total:,} runs{realities_text} are stored in {planned.store}"
    return f"stopped: {stored_text}; the same command resumes"


def _print_estimates(planned: "Sweep", jobs: int, as_json: bool) -> None:
    """Estimate the sweep with ``jobs`` simulators, and print its designs, runs, time and size."""
    from foldcar.commands.progress_bar import working
    from foldcar.statistics.words import count, duration_text
    from foldcar.study.dry_run import estimates

    with working("folding designs and simulating a few runs"):
        results = estimates(planned, jobs)
    seconds = sum(estimate.seconds for estimate in results)
    size = sum(estimate.bytes for estimate in results)
    lines = []
    for estimate in results:
        lines += _estimate_lines(estimate, up_to_realities=planned.realities is None)
    lines.append(f"about {duration_text(seconds)} with {count(jobs, 'simulator')}; the store about {size / 1e6:.1f} MB")
    lines.append("This is an estimate from a few runs; nothing was written. Runs that the store has are not repeated.")
    print_result(
        as_json,
        {
            "store": planned.store,
            "seconds": seconds,
            "bytes": size,
            "experiments": [asdict(estimate) for estimate in results],
        },
        *lines,
    )


def _estimate_lines(estimate: "SweepEstimate", up_to_realities: bool) -> list[str]:
    """Return the lines on an experiment: its designs and runs, the time to fold its cars, and cars that are refused.

    Runs in other realities use other values of the simulator's uncertain parameters, such as friction.
    ``up_to_realities`` is whether there may be fewer of them than estimated.
    """
    from foldcar.statistics.words import count, duration_text

    designs_text, runs_text = count(estimate.designs, "design"), count(estimate.runs, "run")
    lines = [f"experiment {estimate.experiment}: {designs_text}, {runs_text} if all can be built"]
    if estimate.realities:
        up_to = "up to " if up_to_realities else ""
        lines.append(f"  and {up_to}{count(estimate.realities, 'run')} in other realities")
    if estimate.folded < estimate.designs:
        folding_text = duration_text(estimate.folding_s)
        lines.append(f"  {estimate.folded:,} of them were folded as a sample; folding all takes about {folding_text}")
    if estimate.refused:
        lines.append(f"  {len(estimate.refused):,} of {estimate.folded:,} cannot be built and would be skipped:")
        lines += [f"    {reason}" for reason in estimate.refused]
    return lines


def _sweep(planned: "Sweep", scheduler: str | None, jobs: int | None, as_json: bool) -> None:
    """Simulate a planned sweep and print the result. Exits with code 1 if runs have failed."""
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.interrupts import message_on_signal

    if not planned.store.exists():
        _announce_folding(planned)
    store, rules = planned.store, planned.until
    progress, max_runs = planned.progress, planned.progress.total
    designs_to_decide = sum(len(designs) for designs in planned.designs.values()) if rules else None
    with (
        message_on_signal(lambda: _stopped_text(planned)),
        ProgressBar(progress, designs_to_decide) as bar,
        simulators(scheduler, jobs, planned.carsim, bar.print_line) as places,
    ):
        planned.run(places, bar.update, bar.print_line)
    # "there" are runs whose results the store had already; "most_runs" would be simulated without the stopping rule.
    result = {
        "store": store,
        "runs": progress.total,
        "new": progress.new,
        "there": progress.reused,
        "judged": progress.judged,
        "rejected": progress.rejected,
        "failed": progress.failed,
        "passed": progress.passed if progress.judged else None,
        "seconds": round(progress.seconds, 3),
        "realities": {name: asdict(counts) for name, counts in progress.realities.items()},
    }
    if rules:
        result["most_runs"] = max_runs
        result["designs"] = [asdict(state) for state in progress.states]
    lines = [f"{_counts(progress, with_success=not rules)}; store: {store}"]
    for experiment in planned.study.experiments if rules else ():
        lines += stopping_lines(experiment, rules[experiment.id], progress.states)
    for name, counts in progress.realities.items():
        lines += reality_lines(name, counts)
    print_result(as_json, result, *lines)
    if progress.failed:
        _print_failed(store, [experiment.id for experiment in planned.study.experiments], progress.failed, progress.total)
    if progress.failed or any(counts.too_many_failed for counts in progress.realities.values()):
        raise typer.Exit(1)


def _announce_folding(planned: "Sweep") -> None:
    """Print how long folding takes, if there are at least MANY_DESIGNS.

    Before a sweep simulates, it folds each design: it computes the folded car and checks whether it can be built.
    """
    if sum(experiment.family.combinations for experiment in planned.study.experiments) < MANY_DESIGNS:
        return
    from foldcar.statistics.words import duration_text
    from foldcar.study.dry_run import fold

    folding_s = 0.0
    for experiment in planned.study.experiments:
        # This folds designs for one second, and estimates the time for all.
        _, family_s = fold(experiment.family, limit_s=1.0)
        folding_s += family_s
    print_note(
        f"folding and checking all designs comes first and takes about {duration_text(folding_s)}; "
        "see --dry-run for the whole sweep"
    )


def _counts(progress: "Progress", with_success: bool) -> str:
    """Return the sweep's counts as text: ``6 new runs, 0 already stored, 1.2 s, 5 runs/s, 50.0 % passed``."""
    from foldcar.statistics.words import count

    texts = [count(progress.new, "new run"), f"{progress.reused:,} already stored", f"{progress.seconds:.1f} s"]
    if progress.new:
        texts.append(f"{progress.new / progress.seconds:.0f} runs/s")
    # With a stopping rule, designs have different numbers of runs, so that a rate over all runs means nothing.
    if with_success:
        texts.append(_success(progress))
    if progress.rejected:
        texts.append(f"{progress.rejected:,} rejected")
    if progress.failed:
        texts.append(f"{progress.failed:,} failed")
    return ", ".join(texts)


def _success(progress: "Progress") -> str:
    """Return a text with the success rate of the judged runs: those that either passed or did not pass.

    Not judged are rejected runs, and runs in environments that do not define success. The text also has the number of
    the latter.
    """
    from foldcar.statistics.words import percent

    if not progress.judged:
        return "no rate" if progress.rejected else "success undefined"
    rate = percent(progress.passed / progress.judged, 1)
    if progress.judged == progress.total:
        return f"{rate} passed"
    undefined_count = progress.total - progress.judged - progress.rejected
    undefined_text = f", success undefined in {undefined_count}" if undefined_count else ""
    return f"{rate} of {progress.judged} passed{undefined_text}"


def stopping_lines(experiment: "Experiment", rule: "StoppingRule", states: "Sequence[DesignState]") -> Iterator[str]:
    """Yield lines on a sweep with a stopping rule: how many designs are decided, the rule, and the undecided designs.

    A design is decided if its runs satisfy the rule. A design that is undecided needs more runs.
    """
    from foldcar.statistics.words import count, design_text, listed

    own_states = [state for state in states if state.experiment == experiment.id]
    undecided = [state for state in own_states if not state.decided]
    decided_text = f"{len(own_states) - len(undecided)} of {count(len(own_states), 'design')} decided"
    if undecided:
        decided_text += f", {len(undecided)} undecided"
    run_count = sum(state.runs for state in own_states)
    max_runs = len(own_states) * experiment.environments
    runs_text = f"{run_count:,} of at most {count(max_runs, 'run')}"
    rejected_count = sum(state.rejected for state in own_states)
    if rejected_count:
        runs_text += f", {rejected_count} rejected"
    yield f"experiment {experiment.id}: {decided_text}; {runs_text}"
    yield f"  decided: {rule.text}; this holds for each design separately, whenever its runs stop"
    if undecided:
        design_names = []
        for state in undecided[:SHOWN_UNDECIDED]:
            design_names.append(design_text({name: state.design[name] for name in experiment.family.varied}))
        more_count = len(undecided) - len(design_names)
        more_text = f" and {more_count} more" if more_count else ""
        yield f"  undecided: {listed(design_names)}{more_text}; --samples N allows more runs"


def reality_lines(experiment: str, counts: "RealityCounts") -> Iterator[str]:
    """Yield lines on an experiment's runs in other realities: how many there are, and whether more are needed."""
    if not counts.total:
        return
    from foldcar.statistics.words import count
    from foldcar.store.reality_runs import BLOCK
    from foldcar.study.reality_runs import MIN_LEARNED, STAGES, offered_runs

    failed = f", {counts.failed:,} failed" if counts.failed else ""
    runs = f"{count(counts.total, 'run')} in other realities, {counts.new:,} of them new{failed}"
    if counts.total < MIN_LEARNED:
        yield f"experiment {experiment}: {runs}; too few to learn the success rate of built cars"
        yield f"  at least {MIN_LEARNED} are needed: --realities {STAGES[0]}"
        return
    if counts.error is None:
        error = "an unknown error"
    elif round(100 * counts.error, 1) > 0:
        error = f"an error of {100 * counts.error:.1f} points"
    else:
        # The error is measured by comparing the learned rate with groups of runs. They differ, but only by chance.
        error = f"an error that is too small to be measured by {count(counts.total // BLOCK, 'group')} of runs"
    yield f"experiment {experiment}: {runs}; the success rate of built cars is learned from them with {error}"
    more = offered_runs(counts.total, counts.error)
    if more is not None:
        yield f"  more runs make the error smaller: --realities {more}"


def _print_failed(store: Path, experiments: Sequence[str], failed: int, total: int) -> None:
    """Print the most frequent messages of failed runs on stderr, and the command that lists all of them."""
    from foldcar.statistics.words import count
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        messages = opened.failures(experiments)
    verb = "counts" if failed == 1 else "count"
    lines = [f"{failed} of {count(total, 'run')} failed and {verb} as not passed:"]
    lines += [f"  {number} x {message}" for message, number in messages[:SHOWN_MESSAGES]]
    if len(messages) > SHOWN_MESSAGES:
        lines.append(f"  and {len(messages) - SHOWN_MESSAGES} other messages")
    export_command = shlex.join(["foldcar", "export", str(store), "--failed", "--csv", "-"])
    lines.append(f"list them: {export_command}")
    typer.echo("\n".join(lines), err=True)
