"""`foldcar report` writes a page with figures of a store's study and prints a summary."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import OutputFolder, SimulatedTrials, StudyStore, thresholds_of_success
from foldcar.installation import usable_processors
from foldcar.statistics.words import percent_number

if TYPE_CHECKING:
    from foldcar.shown_console import ResultTable
    from foldcar.simulation.carsim import Carsim

# Width of the printed summary in characters, if it is not printed on a terminal.
PIPED_WIDTH = 160
# Number of designs in the printed table; `foldcar export` lists all.
MAX_DESIGNS = 60
# Number of causes in the printed summary.
MAX_CAUSES = 3


def report(
    store: StudyStore,
    output: OutputFolder,
    simulated_trials: SimulatedTrials = False,
    threshold: Annotated[
        list[float] | None,
        typer.Option(
            metavar="RATE",
            callback=thresholds_of_success,
            help="Success rate of good designs, 0 to 1; may be repeated. Default: the listing's, or 0.5 and 0.75.",
        ),
    ] = None,
) -> None:
    """Write a report of a study, or of trials alone.

    The report is DIR/index.html, one file that needs no network. Each figure is also written as SVG, PNG and PDF, and a
    summary is printed. The page contains the simulator: it simulates every run, checks it against the stored one, and
    shows what changes if car or ground differ from what was simulated.

    You may write a report while a sweep, a search or trials go on. It shows what the store contains by then, and how many
    of the planned runs these are.

    \b
    Example: foldcar report study.db -o report --threshold 0.6 --threshold 0.8
    """
    command = ["foldcar", "report", str(store), "-o", str(output)]
    if simulated_trials:
        command.append("--simulated-trials")
    thresholds = sorted(set(threshold or []))
    command += [word for rate in thresholds for word in ("--threshold", f"{rate:g}")]
    from foldcar.commands.progress_bar import TerminalBar
    from foldcar.report.drives import PageDrives
    from foldcar.report.write import PAGE, other_figures, write_report
    from foldcar.store.reader import Store

    with Store.open(store) as reader, TerminalBar("report", 0) as bar:
        drives = PageDrives(_carsim, usable_processors(), bar.plan, bar.done)
        data = write_report(reader, output, command, simulated_trials, drives, thresholds)
    _print_summary(data)
    if others := other_figures(output, data):
        typer.echo(f"{output}: not of this report: {', '.join(others)}", err=True)
    typer.echo(f"report: {output / PAGE}")


def _carsim(engine: str) -> "Carsim | str":
    """Return the simulator with that engine, or the reason why it cannot be started."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import engine_of
    from foldcar.simulation.runner import CarsimError

    try:
        return Carsim(engine=engine_of(engine))
    except CarsimError as error:
        return str(error)


def _print_summary(data: Mapping[str, Any]) -> None:
    """Print each experiment's headline, advice, remarks and table of designs; plain text if not on a terminal."""
    from foldcar.shown_console import shown_console

    console = shown_console(PIPED_WIDTH)
    for experiment in data["experiments"]:
        console.print(f"Experiment {experiment['id']}", style="bold")
        for line in _lines(experiment):
            console.print(line)
        if experiment["designs"]["name"]:
            _table(experiment).print_on(console)


def _lines(experiment: Mapping[str, Any]) -> Iterator[str]:
    """Yield the sentences that the command prints on an experiment, given the page's data."""
    from foldcar.statistics.words import rate_text

    sentences = [experiment["headline"], experiment["grounds"], experiment["next"]["text"], *experiment["ranges"]]
    # A sentence that does not apply is empty or None.
    yield from (sentence for sentence in sentences if sentence)
    importances = []
    for row in experiment["importance"]:
        label = experiment["parameters"][row["parameter"]]["label"]
        importances.append(f"{label} {rate_text(row['share'], row['low'], row['high'])}")
    if importances:
        yield f"Importance (fraction of the variance of success): {', '.join(importances)}."
    # A separation of 0 would mean that the cause does not separate the runs.
    separating_causes = [row for row in experiment["causes"] if row["low"] > 0]
    if separating_causes:
        texts = [f"{row['label']} ({row['separation']:.2f})" for row in separating_causes[:MAX_CAUSES]]
        yield f"What separates passed from failed runs of a design (0 to 1): {', '.join(texts)}."
    yield from experiment["remarks"]
    number = len(experiment["designs"]["name"])
    if number > MAX_DESIGNS:
        which = "best" if experiment["judged"] else "first"
        yield f"The table has the {which} {MAX_DESIGNS} of {number:,} designs; `foldcar export` writes all runs."


def _table(experiment: Mapping[str, Any]) -> "ResultTable":
    """Return the table that the command prints: a row for each of the MAX_DESIGNS best designs, best first."""
    from foldcar.shown_console import ResultTable

    designs = experiment["designs"]
    has_trials = any(designs["trials"])
    # The numbers of runs of each design, by the outcome's label.
    runs_by_label = {}
    for code, label in enumerate(experiment["outcome_labels"]):
        runs_of_designs = designs["outcomes"][code]
        # The first outcome is "passed", which has a column of its own.
        if code > 0 and any(runs_of_designs):
            runs_by_label[label] = runs_of_designs
    trial_titles = ["trials", "cars"] if has_trials else []
    titles = ["runs", "passed %", "95 % interval", *trial_titles, "built cars %"]
    table = ResultTable("design", *titles, *runs_by_label, left=("design",))
    for index in _best_first(experiment)[:MAX_DESIGNS]:
        cells = [designs["name"][index], str(designs["runs"][index]), *_rate(experiment, index)]
        if has_trials:
            trials = designs["trials"][index]
            cells.append(f"{designs['trials_passed'][index]} of {trials}" if trials else "-")
            cells.append(str(designs["cars"][index] or "-"))
        cells.append(_built_rate(designs, index))
        cells += [str(runs_of_designs[index]) for runs_of_designs in runs_by_label.values()]
        table.add_row(*cells)
    return table


def _built_rate(designs: Mapping[str, Any], index: int) -> str:
    """Return the rate (%) of built cars of the design with this index, and its interval, as text; "-" if unknown."""
    if designs["belief"][index] is None:
        return "-"
    rate, low, high = (percent_number(designs[key][index]) for key in ("belief", "belief_low", "belief_high"))
    return f"{rate} ({low}–{high})"


def _best_first(experiment: Mapping[str, Any]) -> list[int]:
    """Return the indices of the designs, best first: by the expected success of built cars, then by that in simulation.

    Designs whose rate is unknown come last. An experiment without a rule for success is not judged: its runs neither pass
    nor fail, so there are no rates in simulation.
    """
    designs = experiment["designs"]
    rates_of_designs = [designs["belief"]]
    if experiment["judged"]:
        rates_of_designs.append(designs["rate"])

    def rates(index: int) -> list[float]:
        """Return the rates (0 to 1) of the design with this index; -1 for each that is unknown."""
        return [-1 if rate_by_design[index] is None else rate_by_design[index] for rate_by_design in rates_of_designs]

    return sorted(range(len(designs["name"])), key=rates, reverse=True)


def _rate(experiment: Mapping[str, Any], index: int) -> tuple[str, str]:
    """Return the simulated rate (%) of the design with this index, and its interval, as text; "-" if unknown."""
    designs = experiment["designs"]
    if not experiment["judged"]:
        return "undefined", "-"
    low, high = designs["low"][index], designs["high"][index]
    if low is None:
        return "-", "-"
    return percent_number(designs["rate"][index], 1), f"{percent_number(low, 1)}–{percent_number(high, 1)}"
