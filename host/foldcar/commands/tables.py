"""Tables that commands print of results, and the lines around them: the answer first, then what it rests on.

Designs are written as everywhere, ``width 95 mm, radius 60 mm``, by what tells them apart; rates in per cent.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.shown_console import ResultTable, shown_console
from foldcar.statistics.words import design_text, points, rank_text
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Correction, Trial

if TYPE_CHECKING:
    from foldcar.inference.comparison import Comparison, DesignComparison, ExperimentComparison
    from foldcar.inference.selecting import Recommendation, Selection
    from foldcar.statistics.gap import Gap
    from foldcar.statistics.rate import Rate
    from foldcar.store.calibrations import Calibration
    from foldcar.study.search.objectives import Objective
    from foldcar.study.search.search import Found, Plan

PLAIN_WIDTH = 200
TRIAL_LABELS = {**OUTCOME_LABELS, "not_passed": "not passed"}
# Proposed cars that cannot be built, and are named.
SHOWN_UNBUILDABLE = 5


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f}"


def _span(low: float, high: float) -> str:
    return f"{_share(low)}–{_share(high)}"


def _rate(rate: "Rate | None") -> str:
    return "-" if rate is None else f"{_share(rate.value)} ({_span(rate.low, rate.high)})"


def print_comparison(found: "Comparison") -> None:
    """Print simulation against trials: the sentence, each experiment's tables, ranks and remarks."""
    console = shown_console(PLAIN_WIDTH)
    console.print(found.sentence, style="bold")
    for experiment in found.experiments:
        console.print(
            f"\nExperiment {experiment.info.id}: {experiment.info.vehicle_type} in {experiment.info.scenic_program}",
            style="bold",
        )
        if experiment.designs:
            _print_rates(console, experiment)
            _print_outcomes(console, experiment.designs)
            if experiment.mean_gap is not None:
                console.print("these: the cars that drove; further car, pooled: any car of the design, as in simulation")
                console.print(
                    "gap: further car minus simulation, points, in the same environments where most trials have a "
                    "simulation of theirs; gaps and their mean hold together with 95 %"
                )
        for line in (rank_text(experiment.ranks), *experiment.remarks):
            if line:
                console.print(line)
    for alone in found.alone:
        console.print(alone, style="bold")


def _print_rates(console: Console, one: "ExperimentComparison") -> None:
    designs = one.designs
    more = [what for what in ("further_car", "pooled") if any(getattr(design, what) is not None for design in designs)]
    shown = [f"{what.replace('_', ' ')} %" for what in more]
    paired = ["same outcome"] * any(design.paired for design in designs)
    heads = ("design", "runs", "simulated %", "cars", "passed", "these %", *shown, *paired, "gap")
    table = ResultTable(*heads, "verdict", left=("design", "verdict"))
    for design in designs:
        table.add_row(
            design.label,
            str(design.evidence.runs),
            _rate(design.simulated),
            str(design.cars),
            f"{design.evidence.trials_passed} of {len(design.evidence.trials)}",
            _rate(design.driven),
            *(_rate(getattr(design, what)) for what in more),
            *(f"{design.agreeing} of {design.paired}" if design.paired else "-" for _ in paired),
            _gap(design.gap),
            design.verdict or "-",
        )
    table.print_on(console)


def _gap(found: "Gap | None") -> str:
    return "-" if found is None else f"{points(found.value)} ({points(found.low)} to {points(found.high)})"


def _print_outcomes(console: Console, designs: "Sequence[DesignComparison]") -> None:
    kinds = {
        kind for design in designs for counts in (design.evidence.outcomes, design.driven_outcomes) for kind in counts
    }
    shown = [kind for kind in TRIAL_LABELS if kind in kinds]
    table = ResultTable("outcomes", "of", *(TRIAL_LABELS[kind] for kind in shown), "aborted", left=("outcomes", "of"))
    for design in designs:
        for what, counts, aborted in (
            ("runs", design.evidence.outcomes, ""),
            ("trials", design.driven_outcomes, str(design.evidence.aborted)),
        ):
            if counts:
                table.add_row(design.label, what, *(str(counts.get(kind, 0)) for kind in shown), aborted)
    table.print_on(console)


def print_selections(found: "Sequence[Selection]") -> None:
    """Print which designs to build, for each experiment."""
    console = shown_console(PLAIN_WIDTH)
    if not found:
        console.print("Nothing to select: the store has no runs yet; sweep the listing into it with `foldcar sweep`.")
    for number, one in enumerate(found):
        if number:
            console.print()
        if len(found) > 1:
            console.print(f"Experiment {one.info.id}", style="bold")
        console.print(one.sentence, style="bold")
        if one.recommendations:
            _print_recommended(console, one)
        for remark in one.remarks:
            console.print(remark)


def _print_recommended(console: Console, one: "Selection") -> None:
    heads = ("design", "simulated %", "built cars %", "trials", "cars", "sheets", "minutes", "why")
    table = ResultTable(*heads, left=("design", "why"))
    for design in one.recommendations:
        table.add_row(
            design.label,
            _rate(design.simulated),
            _rate(design.expected),
            f"{design.trials} more" if design.trials_done else str(design.trials),
            str(design.cars),
            *_prices(design),
            design.reason,
        )
    table.print_on(console)
    half = points(one.precision, sign=False)
    console.print(f"Trials: until a rate is known to ±{half} points (95 %), averaged over what it may be.")
    if one.environments:
        samples = ", ".join(map(str, one.environments))
        telling = f"the first {one.telling} tell" if one.telling else "none tells"
        console.print(
            f"Environments to set up, the same for all (`foldcar log --sample K`): {samples}. They stand for all sampled "
            f"ones; {telling} these designs apart in {one.info.simulation}.",
        )
    if any(design.cost is not None for design in one.recommendations):
        console.print(one.basis)


def _prices(design: "Recommendation") -> tuple[str, str]:
    return ("-", "-") if design.cost is None else (str(design.cost.sheets), str(design.cost.minutes))


def print_calibration(calibration: "Calibration") -> None:
    """Print parameters with priors, designs with predictions, findings; intervals are of 90 %."""
    summary = calibration.summary
    console = shown_console(PLAIN_WIDTH)
    head = f"Experiment {summary['experiment']}, {summary['runs']} runs; ranges are 90 % intervals"
    console.print(head, style="bold")
    for line in summary["notes"]:
        typer.echo(line)
    table = ResultTable("parameter", "before the trials", "after", "told %", left=("parameter",))
    for one in summary["parameters"]:
        name = one["name"] if one["name"].endswith(f"_{one['unit']}") else f"{one['name']} ({one['unit']})"
        table.add_row(name, _median(one["prior"]), _median(one["posterior"]), _share(one["explained"]))
    table.print_on(console)
    table = ResultTable("design", "trials", "passed %", "nominal", "calibrated", "built cars", left=("design",))
    for one in summary["designs"]:
        simulated = f"{_share(one['simulated']['median'])} ({_percent(one['simulated'])})"
        built = f"{_share(one['built']['median'])} ({_percent(one['built'])})"
        table.add_row(*_counted(one), _share(one["nominal"]), simulated, built)
    table.print_on(console)
    if summary.get("leave_one_out"):
        table = ResultTable("left out", "trials", "passed %", "predicted", "log score", "nominal", left=("left out",))
        for one in summary["leave_one_out"]:
            nominal = "-" if one["nominal_log_score"] is None else f"{one['nominal_log_score']:.2f}"
            table.add_row(*_counted(one), _percent(one["predicted"]), f"{one['log_score']:.2f}", nominal)
        table.print_on(console)
    likelihood = summary["log_likelihood"]
    nominal = "" if likelihood["nominal"] is None else f", nominal {likelihood['nominal']:.1f}"
    typer.echo(
        f"log-likelihood {likelihood['draws']:.1f} by calibrated rates{nominal}, best possible {likelihood['best']:.1f}; "
        f"{likelihood['expected']:.1f} with the discrepancy integrated out"
    )
    for finding in summary["findings"]:
        typer.echo(finding)


def _counted(one: Mapping[str, Any]) -> tuple[str, str, str]:
    name = design_text(one["design"])
    return (
        (name, f"{one['passed']}/{one['counted']}", _share(one["passed"] / one["counted"]))
        if one["counted"]
        else (name, "-", "-")
    )


def _median(ends: Mapping[str, Any]) -> str:
    if math.isclose(ends["low"], ends["high"]):
        # A measured value has no interval.
        return f"{ends['median']:.4g}"
    # Millimetres and milliradians are the last digits that matter.
    middle, low, high = (f"{round(ends[name], 3):.2g}" for name in ("median", "low", "high"))
    return f"{middle} ({low}..{high})"


def _percent(ends: Mapping[str, Any]) -> str:
    return _span(ends["low"], ends["high"])


def print_search(plan: "Plan", found: "Found", store: Path, varied: Sequence[str]) -> None:
    """Print counts, what cannot be built, and the best designs by their ``varied`` parameters (columns)."""
    pruned = f", {found.pruned} left early" if found.pruned else ""
    ended = "; no other design was found to try" if found.exhausted else ""
    typer.echo(
        f"{found.designs} designs tried in {found.runs} runs{pruned}{ended}; "
        f"{found.new} runs new, {found.seconds:.1f} s; store: {store}"
    )
    reasons = list(found.unbuildable.items())
    if reasons:
        typer.echo(f"proposed cars that cannot be built, or have no rate: {len(reasons)}")
        for name, reason in reasons[:SHOWN_UNBUILDABLE]:
            typer.echo(f"  {name}: {reason}")
        if len(reasons) > SHOWN_UNBUILDABLE:
            typer.echo(f"  and {len(reasons) - SHOWN_UNBUILDABLE} more")
    if not found.best:
        typer.echo("no design was tried in all environments: nothing to judge")
        return
    few = "of one objective" if len(plan.objectives) == 1 else "that none beats in all objectives"
    typer.echo(f"\nThe best {few}, judged in {plan.fresh} fresh environments (95 % intervals):")
    heads = ["design"]
    for objective in plan.objectives:
        heads += [f"{objective.name}, fresh", *["when chosen"] * (objective.value is not None)]
    table = ResultTable(*heads, left=heads)
    for one in found.best:
        cells = [design_text({name: one.design[name] for name in varied})]
        for objective, fresh, interval, before in zip(
            plan.objectives, one.fresh, one.intervals, one.chosen_by, strict=True
        ):
            cells.append(_objective(objective, fresh, interval))
            if objective.value is not None:
                cells.append(_objective(objective, before, None))
        table.add_row(*cells)
    table.print_on(shown_console(2 * PLAIN_WIDTH))
    typer.echo("Values when chosen are those in the environments that the designs were chosen by: too good, as a rule.")


def _objective(objective: "Objective", value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None:
        return "all rejected"
    texts = [
        "∞" if not math.isfinite(one) else f"{one:.4g}" if objective.unit else f"{100 * one:.1f}"
        for one in (value, *(interval or ()))
    ]
    span = f" ({texts[1]} to {texts[2]})" if interval else ""
    return f"{texts[0]}{span} {objective.unit or '%'}"


STANDING_TEXTS = {
    BUILT: "of built cars",
    SIMULATED: "of a simulated car",
    UNKNOWN: "of a car that may be built or simulated",
    WITHDRAWN: "withdrawn",
}


def print_trials(found: Sequence[Trial]) -> None:
    """Print a row for each trial, and how many of each standing passed."""
    console = shown_console(PLAIN_WIDTH)
    named = ["name"] * any(trial.car_name for trial in found)
    heads = ("trial", "experiment", "design", "sample", "car", *named, "outcome", "time (s)", "ending", "started (UTC)")
    table = ResultTable(*heads, "note", left=("design", "car", "name", "outcome", "ending", "note"))
    varied = _varied(found)
    for trial in found:
        table.add_row(
            f"{trial.id}{'*' if trial.corrections else ''}",
            trial.experiment,
            design_text({name: value for name, value in trial.design.items() if name in varied}),
            "-" if trial.sample is None else str(trial.sample),
            trial.car or UNKNOWN,
            *(trial.car_name or "-" for _ in named),
            f"{trial.outcome}, {WITHDRAWN}" if trial.withdrawn else trial.outcome,
            seconds_text(trial.elapsed_time_s),
            trial.ending,
            (trial.started_utc or "-").removesuffix("+00:00").replace("T", " "),
            trial.note or (trial.source or ""),
        )
    table.print_on(console)
    console.print(f"{len(found)} trials")
    for standing, text in STANDING_TEXTS.items():
        some = [trial for trial in found if trial.standing == standing]
        completed = [trial for trial in some if trial.completed]
        if some:
            passed = sum(trial.outcome == "passed" for trial in completed)
            tail = "" if standing == BUILT else "; they do not count"
            aborted = len(some) - len(completed)
            console.print(f"{text}: {passed} of {len(completed)} passed, {aborted} aborted{tail}")


def _varied(found: Sequence[Trial]) -> list[str]:
    """The design parameters in which the trials differ; the first one if they do not."""
    names = dict.fromkeys(name for trial in found for name in trial.design)
    return [name for name in names if len({trial.design.get(name) for trial in found}) > 1] or list(names)[:1]


def correction_text(one: Correction) -> str:
    """A line that says what was changed of a trial, when, by whom and why."""
    by = f" by {one.operator}" if one.operator else ""
    change = f"{one.field} {_quoted(one.before)} -> {_quoted(one.after)}"
    if one.field == "withdrawn":
        change = "withdrawn" if one.after else "restored"
    return f"* trial {one.trial}: {change} on {one.corrected_utc[:10]}{by}: {one.reason}"


def seconds_text(value: float | None) -> str:
    """A time (s) with two decimals; a dash for none."""
    return "-" if value is None else f"{value:.2f}"


def _quoted(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else "none"
