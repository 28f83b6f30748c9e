"""The report's sections of experiments with trials that were not swept: summaries, figures, the trials one by one."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from foldcar.report.advice_slots import Drawing
from foldcar.report.axis import parameter_label
from foldcar.report.figure_options import THRESHOLDS
from foldcar.report.success_plot import draw_trial_success
from foldcar.report.trial_series import TrialGroup, by_car
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, left_out_text, select_trials


@dataclass(frozen=True)
class TrialSection:
    """The trials of one type of car in one experiment; ``listed`` are those that ``built`` and ``simulated`` count.

    ``varied`` are the design parameters in which they differ, ``fixed`` the others with their values.
    """

    experiment: str
    vehicle_type: str
    programs: Sequence[str]
    built: TrialGroup
    simulated: TrialGroup
    varied: Sequence[str]
    fixed: dict[str, float]
    listed: Sequence[Trial]
    remarks: list[str]
    drawings: list[Drawing]

    @property
    def all_drawings(self) -> list[Drawing]:
        """Its drawings."""
        return self.drawings


def read_trial_sections(
    store: Store, swept: Sequence[str], simulated_trials: bool, thresholds: Sequence[float] = THRESHOLDS
) -> list[TrialSection]:
    """A section for each type of car of each experiment that is not in ``swept``, in the order of their trials."""
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in store.trials():
        if trial.experiment not in swept:
            groups.setdefault((trial.experiment, trial.vehicle_type), []).append(trial)
    return [
        _section(number, *key, trials, simulated_trials, thresholds)
        for number, (key, trials) in enumerate(groups.items(), 1)
    ]


def _section(
    number: int,
    experiment: str,
    vehicle_type: str,
    trials: Sequence[Trial],
    simulated_trials: bool,
    thresholds: Sequence[float],
) -> TrialSection:
    listed, left_out = select_trials(trials, simulated_trials)
    values: dict[str, set[float | None]] = {}
    for name in dict.fromkeys(name for trial in listed for name in trial.design):
        values[name] = {trial.design.get(name) for trial in listed}
    varied = [name for name, found in values.items() if len(found) > 1]
    fixed = {name: listed[0].design[name] for name in values if name not in varied}
    built, simulated = by_car(listed, varied)
    remark = left_out_text(left_out)
    return TrialSection(
        experiment,
        vehicle_type,
        list(dict.fromkeys(trial.scenic_program for trial in trials if trial.scenic_program)),
        built,
        simulated,
        varied,
        fixed,
        listed,
        [remark] if remark else [],
        list(_drawings(f"trials_{number}_{experiment}_{vehicle_type}", varied, built, simulated, thresholds)),
    )


def _drawings(
    name: str, varied: Sequence[str], built: TrialGroup, simulated: TrialGroup, thresholds: Sequence[float]
) -> Iterator[Drawing]:
    # The number keeps the names apart: different experiments may become the same text.
    start = re.sub(r"[^A-Za-z0-9-]+", "_", name)
    for parameter in varied:
        counted = [tally for group in (built, simulated) for tally in group.series[parameter].values() if tally.counted]
        if not counted:
            continue
        caption = f"Success of trials by {parameter_label(parameter)}, with Wilson 95 % intervals."
        if simulated.total.counted:
            caption += " Hollow diamonds: trials of simulated cars."
        draw = partial(draw_trial_success, parameter, built.series[parameter], simulated.series[parameter], thresholds)
        yield Drawing(f"{start}_success_by_{parameter}", caption, draw)
