"""The headline of an experiment in words: where designs are feasible, what trials say of it, what is advised.

Input: counts, what advice says. Output: sentences that say no more than the counts support.
"""

from collections.abc import Mapping, Sequence

from foldcar.analysis.words import listed
from foldcar.report.axis import parameter_label, value_text
from foldcar.report.series import Series, Summary, Tally, Value
from foldcar.report.trial_series import TrialSummary, TrialTally
from foldcar.simulation.results import no_rate_text
from foldcar.store.info import ExperimentInfo


def headline(
    info: ExperimentInfo, summary: Summary, trials: TrialSummary, threshold: float, said: Sequence[str] = ()
) -> list[str]:
    """The sentences, the most important first: what is ``said`` of trials and of what to build, then the counts' own.

    A design is feasible above the ``threshold``, 0 to 1.
    """
    total = summary.total
    sentences = list(said)
    if not total.runs:
        return [*sentences, "No run is stored yet: nothing can be said."]
    if not info.success_defined:
        return [*sentences, "What counts as success is not defined here, so no design can be called feasible."]
    if not total.counted:
        return [*sentences, f"Nothing can be said: {no_rate_text(total.runs)}."]
    if len(summary.series) == 1:
        (series,) = summary.series
        sentences.append(_region(info.simulation, series, threshold))
        if not said:
            sentences += _trial_verdict(info.simulation, series, trials.built.series.get(series.parameter, {}))
    else:
        sentences.append(_over_all(info.simulation, total, len(summary.series)))
    if not trials.built.total.counted:
        sentences.append(f"No trial of a built car counts yet: whether {info.simulation} is right is open.")
    if total.runs < info.planned_runs:
        sentences.append(f"The sweep is unfinished: {total.runs} of {info.planned_runs} runs.")
    return sentences


def _over_all(simulation: str, total: Tally, parameters: int) -> str:
    what = "the design" if not parameters else "cars of all designs"
    return f"In {simulation}, {what} passed {total.passed} of {total.counted} runs ({100 * (total.success or 0):.0f} %)."


def _region(simulation: str, series: Series, threshold: float) -> str:
    """Which values pass in more than the threshold of the environments, and for which the interval says so too."""
    feasible = [value for value, tally in series.tallies.items() if (tally.success or 0) > threshold]
    name, _ = _name_and_unit(series.parameter)
    share = f"more than {100 * threshold:g} % of the environments"
    if not feasible:
        value, best = max(series.tallies.items(), key=lambda pair: pair[1].success or 0)
        if not best.passed:
            return f"In {simulation}, no {name} passes a single environment."
        most = f"the best, {_valued(series.parameter, [value])}, passes {100 * (best.success or 0):.0f} %"
        return f"In {simulation}, no {name} passes {share}; {most}."
    certain = [value for value in feasible if (series.tallies[value].interval or (0, 0))[0] > threshold]
    values = list(series.tallies)
    if len(feasible) == len(values):
        text = f"In {simulation}, every {name} tried passes {share}, so that no border of the region is among them"
    else:
        text = f"In {simulation}, cars with a {name} of {_valued(series.parameter, feasible, values)} pass {share}"
    if not certain:
        return f"{text}; with so few runs the 95 % intervals leave all of them open."
    if len(certain) == len(feasible):
        return f"{text}, and so do the lower ends of the 95 % intervals."
    return f"{text}; the lower ends of the 95 % intervals, too, for {_valued(series.parameter, certain, values)}."


def _name_and_unit(parameter: str) -> tuple[str, str]:
    """``wheel radius`` and `` mm`` of wheel_radius_mm."""
    name, _, unit = parameter_label(parameter).partition(" (")
    return name, f" {unit.removesuffix(')')}" if unit else ""


def _valued(parameter: str, chosen: Sequence[Value], values: Sequence[Value] = ()) -> str:
    """Values with their unit, neighbours among ``values`` as ranges."""
    return _ranges(chosen, values or chosen) + _name_and_unit(parameter)[1]


def _ranges(chosen: Sequence[Value], values: Sequence[Value]) -> str:
    """Values as ranges of neighbours: ``75 to 150, 160``."""
    runs: list[list[Value]] = []
    for value in values:
        if value not in chosen:
            continue
        place = values.index(value)
        if runs and values.index(runs[-1][-1]) == place - 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return listed(
        [value_text(run[0]) if len(run) == 1 else f"{value_text(run[0])} to {value_text(run[-1])}" for run in runs]
    )


def _trial_verdict(simulation: str, series: Series, trials: Mapping[float, TrialTally]) -> list[str]:
    """Where trials and simulation part beyond both of their 95 % intervals."""
    both = [
        (value, trial, series.tallies[value])
        for value, trial in trials.items()
        if trial.counted and value in series.tallies and series.tallies[value].interval is not None
    ]
    if not both:
        return []
    below: list[Value] = []
    above: list[Value] = []
    alike: list[Value] = []
    for value, trial, run in both:
        low, high = run.interval or (0.0, 1.0)
        kind = below if trial.interval[1] < low else above if trial.interval[0] > high else alike
        kind.append(value)
    values = list(series.tallies)

    def at(some: Sequence[Value]) -> str:
        return listed([value_text(value) for value in values if value in some]) + _name_and_unit(series.parameter)[1]

    said = []
    if below:
        said.append(f"optimistic at {at(below)}")
    if above:
        said.append(f"pessimistic at {at(above)}")
    if alike:
        said.append(f"not contradicted at {at(alike)}")
    count = sum(trial.counted for _, trial, _ in both)
    return [f"By {count} trials of built cars, {simulation} is {'; '.join(said)}."]
