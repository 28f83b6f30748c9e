"""What a session of trials has told: `foldcar log` prints it at its end, for the person beside the car."""

from collections.abc import Collection
from pathlib import Path

from foldcar.advice.comparison import compare_evidence
from foldcar.advice.evidence import read_evidence, swept_ids
from foldcar.advice.selecting import select_evidence
from foldcar.analysis.rate import rate_interval
from foldcar.analysis.words import count, design_text, rate_text
from foldcar.commands.progress_bar import working
from foldcar.shown_console import shown_console
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, SIMULATED, Trial


def print_session(store: Path, numbers: Collection[int]) -> None:
    """Print what the trials ``numbers`` of one experiment were, rates before and after them, and what to do next."""
    with Store.open(store) as opened, working("weighing the trials"):
        trials = list(opened.trials())
        mine = [trial for trial in trials if trial.id in numbers]
        experiment = mine[0].experiment
        # Trials of simulated cars are weighed, as such, where there are no others.
        counted = SIMULATED if all(trial.standing != BUILT for trial in mine) else BUILT
        swept = experiment in swept_ids(opened)
        evidence = read_evidence(opened, experiment, counted == SIMULATED) if swept else []
        compared, selections = compare_evidence(evidence), select_evidence(evidence, with_cost=False)
    lines = [f"This session: {count(len(mine), 'trial')} of experiment {experiment}"]
    if counted == SIMULATED:
        lines.append("SIMULATED trials: they count in no rate of built cars.")
    designs = {(one.vehicle_type, design_text(one.design)): one for one in mine}
    for (vehicle_type, text), design in designs.items():
        of_design = [one for one in trials if _same_design(one, design) and one.standing == counted and one.completed]
        before = [one for one in of_design if one.id not in numbers]
        now = [one for one in of_design if one.id in numbers]
        others = sum(_same_design(one, design) for one in mine) - len(now)
        more = f"; {count(others, 'more trial')} aborted or withdrawn" if others else ""
        named = [row for one in compared.experiments for row in one.designs if row.design == design.design]
        label = named[0].label if named else text if len(designs) > 1 else vehicle_type
        lines.append(f"{label}: {_passed(now)} of {len(now)} passed{more}")
        lines.append(f"  by {count(len(of_design), 'trial')} in all {_rate(of_design)}; before, {_rate(before)}")
        for one in compared.experiments:
            for row in one.designs:
                if row.design == design.design and row.simulated is not None:
                    rate = row.simulated
                    simulated = rate_text(rate.value, rate.low, rate.high)
                    lines.append(f"  in {one.info.simulation} {simulated}: {row.verdict or 'nothing to compare'}")
    if not swept:
        lines.append(f"Experiment {experiment} was not swept in {store}: there is no simulation to compare with.")
    lines += [one.sentence for one in selections]
    shown_console().print("\n".join(lines))


def _same_design(one: Trial, other: Trial) -> bool:
    return (one.experiment, one.vehicle_type, one.design) == (other.experiment, other.vehicle_type, other.design)


def _passed(trials: Collection[Trial]) -> int:
    return sum(trial.outcome == "passed" for trial in trials)


def _rate(trials: Collection[Trial]) -> str:
    if not trials:
        return "nothing known"
    passed = _passed(trials)
    return rate_text(passed / len(trials), *rate_interval(passed, len(trials)))
