"""An experiment's section of the report: its summary, remarks and figures."""

import shlex
from collections import Counter
from dataclasses import dataclass

from matplotlib.figure import Figure

from foldcar.report.axis import parameter_label
from foldcar.report.file_names import file_name_part
from foldcar.report.outcome_plot import draw_outcomes
from foldcar.report.series import Summary, summarise
from foldcar.report.stopped_remarks import stopped_remarks
from foldcar.report.success_plot import draw_success
from foldcar.report.time_plot import draw_times
from foldcar.report.trial_series import TrialSummary, summarise_trials
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_selection import left_out_text, select_trials

# Different messages of failed runs, and skipped cars, that are shown.
SHOWN = 5


@dataclass(frozen=True)
class Drawing:
    """A figure, the name of its files without suffix, and its caption."""

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Section:
    """The section of one experiment; ``remarks`` are sentences for the reader."""

    info: ExperimentInfo
    summary: Summary
    trials: TrialSummary
    remarks: list[str]
    drawings: list[Drawing]


def read_section(store: Store, info: ExperimentInfo, simulated_trials: bool) -> Section:
    """Count the experiment's runs and draw its figures with matplotlib's current settings.

    ``simulated_trials``: show trials of simulated cars too, apart from those of built ones.
    """
    summary = summarise(store.results(info.id), info.varied, info.success_defined, info.until is not None)
    trials = summarise_trials(store.trials(info.id), info, simulated_trials)
    remarks = _remarks(info, summary, trials) + _elsewhere(store, info, simulated_trials)
    remarks += _failures(store, info, summary)
    return Section(info, summary, trials, remarks, _drawings(info, summary, trials))


def _remarks(info: ExperimentInfo, summary: Summary, trials: TrialSummary) -> list[str]:
    remarks = []
    stored = summary.total.runs
    if stored < info.planned_runs:
        remarks.append(
            f"Unfinished: {stored} of {info.planned_runs} runs are stored; the command that started "
            "the sweep resumes it."
        )
    remarks += stopped_remarks(info)
    terminated = summary.total.outcomes["terminated"]
    if terminated and info.success_defined:
        remarks.append(f"The program itself ended {terminated} of {stored} runs; they count as not passed.")
    if info.skipped:
        more = f"; and {len(info.skipped) - SHOWN} more" if len(info.skipped) > SHOWN else ""
        shown = "; ".join(info.skipped[:SHOWN]) + more
        remarks.append(f"{len(info.skipped)} cars of the family cannot be built and were skipped: {shown}.")
    names = [parameter_label(name) for name in info.varied]
    if not names:
        remarks.append("One design: no parameter varies, so success is not drawn.")
    if len(names) > 1:
        remarks.append(
            f"{len(names)} parameters vary ({', '.join(names)}): each is shown separately, over all values of "
            "the others; times in one environment are drawn only where a single parameter varies."
        )
    if trials.unknown_cars:
        remarks.append(f"{trials.unknown_cars} trials are of cars that do not belong to this family; they are not shown.")
    left_out = left_out_text(trials.left_out)
    if left_out is not None:
        remarks.append(left_out)
    return remarks


def _elsewhere(store: Store, info: ExperimentInfo, simulated_trials: bool) -> list[str]:
    """What is said of trials that were not driven in the environment of the runs they are shown beside."""
    elsewhere = store.trials_elsewhere(info.id)
    shown, _ = select_trials(store.trials(info.id), simulated_trials)
    programs = Counter(elsewhere[trial.id] or "an unknown program" for trial in shown if trial.id in elsewhere)
    remarks = []
    for program, count in programs.items():
        also = "other samples of it: its text, parameters or seed, or foldcar, have changed"
        how = also if program == info.scenic_program else f"that is {info.scenic_program}"
        remarks.append(f"{count} of the trials were driven in {program}, not in the environment of the runs ({how}).")
    return remarks


def _failures(store: Store, info: ExperimentInfo, summary: Summary) -> list[str]:
    failed = summary.total.outcomes["failed"]
    if not failed:
        return []
    messages = store.failures([info.id])
    shown = "; ".join(f"{count} x {message}" for message, count in messages[:SHOWN])
    more = f"; and {len(messages) - SHOWN} other messages" if len(messages) > SHOWN else ""
    listed = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    counted = ", and count as not passed" if info.success_defined else ""
    return [f"{failed} of {summary.total.runs} runs failed{counted}: {shown}{more}. List them: {listed}"]


def _drawings(info: ExperimentInfo, summary: Summary, trials: TrialSummary) -> list[Drawing]:
    drawings = []
    start = "experiment_" + file_name_part(info.id)
    for series in summary.series:
        if not series.tallies:
            continue
        parameter, label = series.parameter, parameter_label(series.parameter)
        if summary.timed:
            figure = draw_times(summary.timed, parameter, info.timeout_s)
            caption = f"Time to cross by {label} in one environment. Runs that did not pass are red."
            drawings.append(Drawing(f"{start}_time_by_{parameter}", caption, figure))
        caption = f"Outcomes by {label}, as shares of the runs."
        outcomes = Drawing(f"{start}_outcomes_by_{parameter}", caption, draw_outcomes(series))
        if not info.success_defined:
            drawings.append(outcomes)
            continue
        caption = f"Mean success by {label} over all environments, with {series.interval_name} 95 % intervals."
        built, simulated = trials.built.series[parameter], trials.simulated.series[parameter]
        if any(tally.counted for tally in built.values()):
            caption += " Diamonds: trials of built cars, with their intervals."
        if any(tally.counted for tally in simulated.values()):
            caption += " Hollow diamonds: trials of simulated cars."
        figure = draw_success(series, built, simulated)
        drawings.append(Drawing(f"{start}_success_by_{parameter}", caption, figure))
        drawings.append(outcomes)
    return drawings
