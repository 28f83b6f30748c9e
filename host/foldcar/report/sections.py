"""An experiment's section of the report: its headline, counts, remarks, figures and replay."""

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from foldcar.advice.evidence import rejected_text
from foldcar.replay.outcome_grid import OutcomeGrid
from foldcar.replay.replay import Replay
from foldcar.report.advice_slots import Drawing, Slots
from foldcar.report.axis import parameter_label
from foldcar.report.feasibility_plot import draw_feasibility
from foldcar.report.figure_options import FigureOptions
from foldcar.report.file_names import file_name_part
from foldcar.report.headline import headline
from foldcar.report.limited_times import LimitedTime, limited_times
from foldcar.report.outcome_plot import draw_outcomes
from foldcar.report.replayer import Replayer
from foldcar.report.series import Summary, Value, summarise, summarise_runs
from foldcar.report.stopped_remarks import stopped_remarks
from foldcar.report.success_plot import draw_success
from foldcar.report.time_plot import draw_times
from foldcar.report.trial_series import TrialSummary, TrialTally, summarise_trials
from foldcar.store.frames import run_arrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, left_out_text, select_trials

# Different messages of failed runs, and skipped cars, that are shown.
SHOWN = 5
NO_SLOTS = Slots()
NO_OPTIONS = FigureOptions()


@dataclass(frozen=True)
class Section:
    """The section of one experiment; ``remarks`` are sentences for the reader, ``key`` tells its ids on the page apart.

    ``headline`` is its result in words; ``slots`` what other rooms say of it; ``times`` the mean times of all runs.
    """

    key: str
    info: ExperimentInfo
    summary: Summary
    trials: TrialSummary
    remarks: list[str]
    drawings: list[Drawing]
    replay: Replay
    slots: Slots
    headline: list[str]
    times: Mapping[str, Mapping[Value, LimitedTime]]

    @property
    def all_drawings(self) -> list[Drawing]:
        """Its own drawings and those of its parts."""
        return [*self.drawings, *(drawing for part in self.slots.parts for drawing in part.drawings)]


def read_section(
    store: Store,
    info: ExperimentInfo,
    simulated_trials: bool,
    replayer: Replayer,
    key: str = "e0",
    slots: Slots = NO_SLOTS,
    options: FigureOptions = NO_OPTIONS,
) -> Section:
    """Count the experiment's runs and plan its figures.

    ``simulated_trials``: show trials of simulated cars too, apart from those of built ones.
    """
    runs, designs = run_arrays(store, info.id), list(store.designs(info.id).values())
    grid = OutcomeGrid(designs, info.environments)
    grid.enter(runs)
    how = (info.varied, info.success_defined, info.until is not None, options.sample)
    recorded = store.holds_recorded()
    summary = summarise(store.results(info.id), *how) if recorded else summarise_runs(runs, designs, *how)
    trials = summarise_trials(store.trials(info.id), info, simulated_trials)
    shown, _ = select_trials(store.trials(info.id), simulated_trials)
    replay = replayer.replay(store, info, grid, shown)
    rejected = rejected_text(store.design_counts(info.id))
    remarks = _remarks(info, summary, trials, rejected) + _elsewhere(store, info, shown)
    remarks += _failures(store, info, summary)
    if options.sample >= info.environments:
        remarks.append(f"There is no environment {options.sample} here, so times to cross are not drawn.")
    return Section(
        key,
        info,
        summary,
        trials,
        remarks,
        _drawings(info, summary, trials, slots, options),
        replay,
        slots,
        headline(info, summary, trials, max(options.thresholds(info)), slots.sentences),
        limited_times(runs, designs, info),
    )


def _remarks(info: ExperimentInfo, summary: Summary, trials: TrialSummary, rejected: str | None) -> list[str]:
    remarks = [info.warning] if info.warning else []
    stored = summary.total.runs
    if stored < info.planned_runs:
        remarks.append(
            f"Unfinished: {stored} of {info.planned_runs} runs are stored; the command that started "
            "the sweep resumes it."
        )
    remarks += stopped_remarks(info)
    if rejected is not None:
        remarks.append(rejected)
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


def _elsewhere(store: Store, info: ExperimentInfo, shown: Sequence[Trial]) -> list[str]:
    """What is said of trials that were not driven in the environment of the runs they are shown beside."""
    elsewhere = store.trials_elsewhere(info)
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


def _drawings(
    info: ExperimentInfo, summary: Summary, trials: TrialSummary, slots: Slots, options: FigureOptions
) -> list[Drawing]:
    thresholds = options.thresholds(info)
    drawings = []
    start = "experiment_" + file_name_part(info.id)
    for series in summary.series:
        if not series.tallies:
            continue
        parameter, label = series.parameter, parameter_label(series.parameter)
        built, simulated = trials.built.series[parameter], trials.simulated.series[parameter]
        if info.success_defined:
            diamonds = _diamonds(built, simulated)
            caption = (
                f"Success by {label}: the curve is {info.simulation}, "
                f"its band the {series.interval_name} 95 % intervals; "
                f"tinted where more than {100 * max(thresholds):g} % pass.{diamonds}"
            )
            draw = partial(
                draw_feasibility, series, built, simulated, thresholds, slots.recommendations, info.simulation
            )
            drawings.append(Drawing(f"{start}_feasibility_by_{parameter}", caption, draw, "feasibility"))
            intervals = f"{series.interval_name} 95 % intervals"
            caption = f"Mean success by {label} over all environments, with {intervals}.{diamonds}"
            draw = partial(draw_success, series, built, simulated, thresholds)
            drawings.append(Drawing(f"{start}_success_by_{parameter}", caption, draw, "success"))
        if summary.timed:
            draw = partial(draw_times, summary.timed, parameter, info.timeout_s, options.sample)
            caption = f"Time to cross by {label} in environment {options.sample}. Runs that did not pass are red."
            drawings.append(Drawing(f"{start}_time_by_{parameter}", caption, draw, "success"))
        caption = f"Outcomes by {label}, as shares of the runs."
        drawings.append(Drawing(f"{start}_outcomes_by_{parameter}", caption, partial(draw_outcomes, series), "outcomes"))
    return drawings


def _diamonds(built: Mapping[float, TrialTally], simulated: Mapping[float, TrialTally]) -> str:
    text = ""
    if any(tally.counted for tally in built.values()):
        text += " Diamonds: trials of built cars, with their intervals."
    if any(tally.counted for tally in simulated.values()):
        text += " Hollow diamonds: trials of simulated cars."
    return text
