"""Prints a comparison of simulation and trials: the answer first, then a table for each experiment."""

from collections.abc import Sequence

from rich.console import Console

from foldcar.advice.comparison import Comparison, DesignComparison, ExperimentComparison
from foldcar.analysis.gap import Gap
from foldcar.analysis.rate import Rate
from foldcar.analysis.words import percent, points, rank_text
from foldcar.figures.style import OUTCOME_LABELS
from foldcar.shown_console import ResultTable, shown_console

PLAIN_WIDTH = 180
TRIAL_LABELS = {**OUTCOME_LABELS, "not_passed": "not passed"}


def print_comparison(found: Comparison) -> None:
    """Print it: the sentence, each experiment's tables, ranks and remarks, trials without a sweep."""
    console = shown_console(PLAIN_WIDTH)
    console.print(found.sentence, style="bold")
    for one in found.experiments:
        _print_experiment(console, one)
    for alone in found.alone:
        console.print(alone, style="bold")


def _print_experiment(console: Console, one: ExperimentComparison) -> None:
    console.print()
    title = f"Experiment {one.info.id}: {one.info.vehicle_type} in {one.info.scenic_program}"
    console.print(title, style="bold")
    if one.designs:
        _print_rates(console, one.designs)
        _print_outcomes(console, one.designs)
        if one.mean_gap is not None:
            console.print(
                f"gap: trials minus simulation, points; all gaps hold together with {percent(one.mean_gap.confidence)}",
            )
    ranks = rank_text(one.ranks)
    if ranks:
        console.print(ranks)
    for remark in one.remarks:
        console.print(remark)


def _print_rates(console: Console, designs: Sequence[DesignComparison]) -> None:
    table = ResultTable()
    rectified = any(one.rectified is not None for one in designs)
    paired = any(one.paired for one in designs)
    heads = ["design", "runs", "simulated %", "passed", "trials %"]
    pooled = any(one.pooled is not None for one in designs)
    heads += ["rectified %"] * rectified + ["pooled %"] * pooled + ["same outcome"] * paired + ["gap", "verdict"]
    for head in heads:
        table.add_column(head, right=head not in ("design", "verdict"))
    for one in designs:
        passed = f"{one.evidence.trials_passed} of {len(one.evidence.trials)}"
        cells = [one.label, str(one.evidence.runs), _rate(one.simulated), passed, _rate(one.driven)]
        cells += [_rate(one.rectified)] * rectified + [_rate(one.pooled)] * pooled
        cells += [f"{one.agreeing} of {one.paired}" if one.paired else "-"] * paired
        table.add_row(*cells, _gap(one.gap), one.verdict or "-")
    table.print_on(console)


def _print_outcomes(console: Console, designs: Sequence[DesignComparison]) -> None:
    kinds = dict.fromkeys(
        kind for one in designs for counts in (one.evidence.outcomes, one.driven_outcomes) for kind in counts
    )
    shown = [kind for kind in TRIAL_LABELS if kind in kinds]
    table = ResultTable()
    table.add_column("outcomes")
    for head in ("of", *(TRIAL_LABELS[kind] for kind in shown), "aborted"):
        table.add_column(head, right=head != "of")
    for one in designs:
        for what, counts, aborted in (
            ("runs", one.evidence.outcomes, None),
            ("trials", one.driven_outcomes, one.evidence.aborted),
        ):
            if counts:
                cells = [str(counts.get(kind, 0)) for kind in shown]
                table.add_row(one.label, what, *cells, "" if aborted is None else str(aborted))
    table.print_on(console)


def _rate(rate: Rate | None) -> str:
    if rate is None:
        return "-"
    return f"{100 * rate.value:.0f} ({100 * rate.low:.0f}–{100 * rate.high:.0f})"


def _gap(found: Gap | None) -> str:
    return "-" if found is None else f"{points(found.value)} ({points(found.low)} to {points(found.high)})"
