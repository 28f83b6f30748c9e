"""Prints results as tables, with the answer before them and remarks after them.

Designs are named by the parameters that vary, as in ``width 95 mm, radius 60 mm``; rates are in per cent.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.console import Console

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.shown_console import ResultTable, shown_console
from foldcar.shown_text import shown_line
from foldcar.statistics.words import count, design_text, estimate_text, percent_number, points, rank_text
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Correction, Trial

if TYPE_CHECKING:
    from foldcar.belief.answers import Unknown
    from foldcar.evidence.adviser import Selection
    from foldcar.evidence.comparison import Comparison, DesignComparison, ExperimentComparison
    from foldcar.statistics.gap import Gap
    from foldcar.statistics.rate import Rate
    from foldcar.study.search.objectives import Objective
    from foldcar.study.search.search import Plan, SearchResult

# Width of tables in characters, if they are not printed on a terminal.
PLAIN_WIDTH = 200
TRIAL_LABELS = {**OUTCOME_LABELS, "not_passed": "not passed"}
# Number of unbuildable designs that a search names.
SHOWN_UNBUILDABLE = 5


def _percent(fraction: float | None) -> str:
    """Return a fraction in whole per cent, without the sign %; "-" for None."""
    return "-" if fraction is None else percent_number(fraction)


def _percent_range(low: float, high: float) -> str:
    """Return two fractions as a range of whole per cent: ``40–89``."""
    return f"{percent_number(low)}–{percent_number(high)}"


def _rate(rate: "Rate | None") -> str:
    """Return a rate with its interval in whole per cent, ``70 (40–89)``; "-" for None."""
    return "-" if rate is None else f"{_percent(rate.value)} ({_percent_range(rate.low, rate.high)})"


def print_comparison(comparison: "Comparison") -> None:
    """Print the comparison of simulation with trials.

    First comes a sentence. Then follow, for each experiment, its tables, how well simulation ranks the designs, and
    remarks. Last come sentences on *unswept* experiments, which have trials but no simulated runs.
    """
    console = shown_console(PLAIN_WIDTH)
    console.print(comparison.sentence, style="bold")
    for experiment in comparison.experiments:
        console.print(
            f"\nExperiment {experiment.info.id}: {experiment.info.vehicle_type} in {experiment.info.scenic_program}",
            style="bold",
        )
        if experiment.designs:
            _print_rates(console, experiment)
            _print_outcomes(console, experiment.designs)
            if experiment.mean_gap is not None:
                console.print(
                    "these: the cars that drove; further car: any car of the design, by simulation and all trials; gap: "
                    "further car minus simulation, in percentage points (95 %)"
                )
        if experiment.unknowns:
            _print_unknowns(console, experiment.unknowns)
        for line in (rank_text(experiment.ranks), *experiment.remarks):
            if line:
                console.print(line)
    for line in comparison.unswept:
        console.print(line, style="bold")


def _print_rates(console: Console, comparison: "ExperimentComparison") -> None:
    """Print a row for each design with its success rates, and how they differ: their gap and a verdict.

    There is the rate in simulation, the rate of the cars that drove the trials, headed "these %", and if it is known the
    rate that a car would have that is built next, headed "further car %".
    """
    designs = comparison.designs
    heads = ["design", "runs", "simulated %", "cars", "passed", "these %"]
    has_built_rates = any(design.built is not None for design in designs)
    if has_built_rates:
        heads.append("further car %")
    # Some trials may have a run in their own environment, so that both outcomes can be compared.
    has_pairs = any(design.paired for design in designs)
    if has_pairs:
        heads.append("same outcome")
    table = ResultTable(*heads, "gap", "verdict", left=("design", "verdict"))
    for design in designs:
        cells = [
            design.label,
            str(design.evidence.runs),
            _rate(design.simulated),
            str(design.cars),
            f"{design.evidence.trials_passed} of {len(design.evidence.trials)}",
            _rate(design.driven),
        ]
        if has_built_rates:
            cells.append(_rate(design.built))
        if has_pairs:
            cells.append(f"{design.agreeing} of {design.paired}" if design.paired else "-")
        table.add_row(*cells, _gap(design.gap), design.verdict or "-")
    table.print_on(console)


def _gap(gap: "Gap | None") -> str:
    """Return a gap with its interval in percentage points, ``-20 (-30 to -5)``; "-" for None."""
    return "-" if gap is None else f"{points(gap.value)} ({points(gap.low)} to {points(gap.high)})"


def _print_unknowns(console: Console, unknowns: "Sequence[Unknown]") -> None:
    """Print what the simulator does not know, before the trials and after them: which realities fit."""
    table = ResultTable("unknown", "before", "by the trials", "narrowed %", left=("unknown",))
    for unknown in unknowns:
        name, unit = unknown.parameter.name, unknown.parameter.unit
        label = name if name.endswith(f"_{unit}") else f"{name} ({unit})"
        measured = "" if unknown.measured is None else " measured"
        before, after = (estimate_text(part.value, part.low, part.high) for part in (unknown.before, unknown.after))
        table.add_row(f"{label}{measured}", before, after, _percent(max(0.0, unknown.narrowed)))
    table.print_on(console)


def _print_outcomes(console: Console, designs: "Sequence[DesignComparison]") -> None:
    """Print how many runs and trials of each design had each outcome."""
    occurring_outcomes: set[str] = set()
    for design in designs:
        occurring_outcomes.update(design.evidence.outcomes, design.driven_outcomes)
    outcomes = [outcome for outcome in TRIAL_LABELS if outcome in occurring_outcomes]
    titles = [TRIAL_LABELS[outcome] for outcome in outcomes]
    table = ResultTable("outcomes", "of", *titles, "aborted", left=("outcomes", "of"))
    for design in designs:
        # Runs are never aborted.
        for source, counts, aborted in (
            ("runs", design.evidence.outcomes, ""),
            ("trials", design.driven_outcomes, str(design.evidence.aborted)),
        ):
            if counts:
                table.add_row(design.label, source, *(str(counts.get(outcome, 0)) for outcome in outcomes), aborted)
    table.print_on(console)


def print_selections(selections: "Sequence[Selection]") -> None:
    """Print the designs to build, experiment by experiment."""
    console = shown_console(PLAIN_WIDTH)
    if not selections:
        console.print("Nothing to select: the store has no runs yet; sweep the listing into it with `foldcar sweep`.")
    for number, selection in enumerate(selections):
        if number:
            console.print()
        if len(selections) > 1:
            console.print(f"Experiment {selection.info.id}", style="bold")
        for line in filter(None, (selection.works, selection.learn)):
            console.print(line, style="bold")
        if selection.grounds:
            console.print(selection.grounds)
        if selection.steps:
            _print_steps(console, selection)
        for remark in selection.remarks:
            console.print(remark)


def _print_steps(console: Console, selection: "Selection") -> None:
    """Print the steps that were weighed, the environments to set up, and what the costs assume."""
    heads = ("step", "simulated %", "further car %", "minutes", "sheets", "gain", "gain an hour")
    table = ResultTable(*heads, left=("step",))
    for step in selection.steps:
        hourly = 60 * step.gain / step.minutes
        table.add_row(
            step.text,
            _rate(step.simulated),
            _rate(step.built),
            str(step.minutes),
            "-" if step.sheets is None else str(step.sheets),
            f"{100 * step.gain:.1f}",
            f"{100 * hourly:.1f}",
        )
    table.print_on(console)
    console.print("gain: by how many points the rate of the recommended design is expected to rise by this step")
    if selection.environments:
        samples = ", ".join(map(str, selection.environments))
        console.print(f"Environments to set up for the trials (`foldcar log --sample K`): {samples}.")
    console.print(selection.basis)


def print_search(plan: "Plan", result: "SearchResult", store: Path, varied: Sequence[str]) -> None:
    """Print counts, designs that cannot be built, and the best designs named by their ``varied`` columns."""
    pruned_text = f", {result.pruned} stopped early" if result.pruned else ""
    exhausted_text = "; these are all designs that can be tried" if result.exhausted else ""
    typer.echo(
        f"{count(result.designs, 'design')} tried in {count(result.runs, 'run')}{pruned_text}{exhausted_text}; "
        f"{count(result.new, 'new run')}, {result.seconds:.1f} s; store: {store}"
    )
    reasons = list(result.unbuildable.items())
    if reasons:
        typer.echo(f"proposed cars that cannot be built, or have no rate: {len(reasons)}")
        for name, reason in reasons[:SHOWN_UNBUILDABLE]:
            typer.echo(f"  {name}: {reason}")
        if len(reasons) > SHOWN_UNBUILDABLE:
            typer.echo(f"  and {len(reasons) - SHOWN_UNBUILDABLE} more")
    if not result.best:
        typer.echo("No design was tried in all environments, so no design was tested in new ones.")
        return
    which_best = "best" if len(plan.objectives) == 1 else "non-dominated"
    designs = "design" if len(result.best) == 1 else "designs"
    realities = ", each in a new reality" if plan.over_realities else ""
    new_environments = count(plan.fresh, "new environment")
    typer.echo(f"\nThe {which_best} {designs}, tested in {new_environments}{realities} (95 % intervals):")
    heads = ["design"]
    for objective in plan.objectives:
        heads.append(f"{objective.heading}, new")
        # An objective without `value` depends on the design only, so it is the same in all environments.
        if objective.value is not None:
            heads.append("when chosen")
    table = ResultTable(*heads, left=heads)
    for design in result.best:
        cells = [design_text({name: design.design[name] for name in varied})]
        for objective, fresh, interval, before in zip(
            plan.objectives, design.fresh, design.intervals, design.chosen_by, strict=True
        ):
            cells.append(_objective(objective, fresh, interval))
            if objective.value is not None:
                cells.append(_objective(objective, before, None))
        table.add_row(*cells)
    # Twice as wide as other tables, because each objective may have two columns with intervals.
    table.print_on(shown_console(2 * PLAIN_WIDTH))
    typer.echo("Values when chosen come from the environments by which the designs were chosen: they are biased upwards.")
    if plan.over_realities:
        typer.echo(
            "Expected success is over realities: random values of what the simulator does not know, before any trial."
        )


def _objective(objective: "Objective", value: float | None, interval: tuple[float, float] | None) -> str:
    """Return the value of an objective with its interval and unit; "all rejected" if the value is unknown.

    An objective without a unit is a rate, 0 to 1, and shown in percent.
    """

    def number_text(number: float) -> str:
        """Return a value of the objective as text, without its unit."""
        if not math.isfinite(number):
            return "∞"
        return f"{number:.4g}" if objective.unit else percent_number(number, 1)

    if value is None:
        return "all rejected"
    text = number_text(value)
    if interval is not None:
        low, high = interval
        text += f" ({number_text(low)} to {number_text(high)})"
    return f"{text} {objective.unit or '%'}"


STANDING_TEXTS = {
    BUILT: "of built cars",
    SIMULATED: "of a simulated car",
    UNKNOWN: "of a car that may be built or simulated",
    WITHDRAWN: "withdrawn",
}


def print_trials(trials: Sequence[Trial], varied_of: Mapping[str, Sequence[str]]) -> None:
    """Print a row for each trial, and then how many trials of each standing passed.

    The standing of a trial says whether it counts, for example "built" or "withdrawn". ``varied_of`` has the parameters
    that vary in each swept experiment: designs are named by these. If the cars have different types, which means other
    modules or parts, the type is named, too.
    """
    console = shown_console(PLAIN_WIDTH)
    has_names = any(trial.car_name for trial in trials)
    name_heads = ["name"] if has_names else []
    heads = ["trial", "experiment", "design", "sample", "car", *name_heads, "outcome", "time (s)", "ending"]
    left = ("design", "car", "name", "outcome", "ending", "note")
    table = ResultTable(*heads, "started (UTC)", "note", left=left)
    differing = _varied(trials)
    several_types = len({trial.vehicle_type for trial in trials}) > 1
    for trial in trials:
        varied = {*differing, *varied_of.get(trial.experiment, ())}
        design = design_text({name: value for name, value in trial.design.items() if name in varied})
        table.add_row(
            f"{trial.id}{'*' if trial.corrections else ''}",
            trial.experiment,
            f"{trial.vehicle_type} of {design}" if several_types else design,
            "-" if trial.sample is None else str(trial.sample),
            trial.car or UNKNOWN,
            *([trial.car_name or "-"] if has_names else []),
            f"{trial.outcome}, {WITHDRAWN}" if trial.withdrawn else trial.outcome,
            seconds_text(trial.elapsed_time_s),
            trial.ending,
            (trial.started_utc or "-").removesuffix("+00:00").replace("T", " "),
            trial.note or (trial.source or ""),
        )
    table.print_on(console)
    console.print(count(len(trials), "trial"))
    for standing, text in STANDING_TEXTS.items():
        group = [trial for trial in trials if trial.standing == standing]
        completed = [trial for trial in group if trial.completed]
        if group:
            passed = sum(trial.outcome == "passed" for trial in completed)
            do_not_count = "" if standing == BUILT else "; these do not count"
            aborted = len(group) - len(completed)
            console.print(f"{text}: {passed} of {len(completed)} passed, {aborted} aborted{do_not_count}")


def _varied(trials: Sequence[Trial]) -> list[str]:
    """Return the design parameters in which the trials differ, or the first parameter if they do not differ."""
    names = list(dict.fromkeys(name for trial in trials for name in trial.design))
    varied = []
    for name in names:
        values = {trial.design.get(name) for trial in trials}
        if len(values) > 1:
            varied.append(name)
    return varied or names[:1]


def correction_text(correction: Correction) -> str:
    """Return a line that says what was changed in a trial, when, by whom and why."""
    by = f" by {correction.operator}" if correction.operator else ""
    change = f"{correction.field} {_quoted(correction.before)} -> {_quoted(correction.after)}"
    if correction.field == "withdrawn":
        change = "withdrawn" if correction.after else "restored"
    return shown_line(f"* trial {correction.trial}: {change} on {correction.corrected_utc[:10]}{by}: {correction.reason}")


def seconds_text(value: float | None) -> str:
    """Return a time (s) with two decimals; "-" for None."""
    return "-" if value is None else f"{value:.2f}"


def _quoted(value: object) -> str:
    """Return a corrected field's value as text; ``none`` if it was empty."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return "none"
