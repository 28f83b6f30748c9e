"""What a reader must know of an experiment's numbers beside the numbers: what is missing, left out or of another kind."""

import shlex
from collections import Counter
from collections.abc import Sequence
from typing import Any

from foldcar.advice.evidence import elsewhere_remarks, run_remarks
from foldcar.analysis.stopping import LEAST_CHANCE
from foldcar.analysis.words import count
from foldcar.report.page_designs import Designs
from foldcar.simulation.engines import MULTIBODY, engine_title
from foldcar.simulation.results import OUTCOMES
from foldcar.store.calibrations import calibrations
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, left_out_text

# Different messages of failed runs, and skipped cars, that are shown.
SHOWN = 3


def remarks(designs: Designs, trials: Sequence[Trial], left_out: Counter[str]) -> list[str]:
    """The remarks on an experiment, of which ``trials`` are shown and ``left_out`` are not, by standing. StoreError."""
    store, info = designs.store, designs.info
    ends = dict(zip(OUTCOMES, designs.ends.sum(axis=0).tolist(), strict=True))
    found = run_remarks(store, info) + stopped_remarks(info)
    if ends["terminated"] and info.success_defined:
        found.append(
            f"The program itself ended {ends['terminated']:,} of {info.stored_runs:,} runs; they count as not passed."
        )
    if info.skipped:
        more = f"; and {len(info.skipped) - SHOWN} more" if len(info.skipped) > SHOWN else ""
        shown = "; ".join(info.skipped[:SHOWN]) + more
        found.append(f"{count(len(info.skipped), 'car')} of the family cannot be built: {shown}.")
    found += designs.contradicting.remark(designs.names)
    strange = sum(designs.index_of(trial) is None for trial in trials)
    if strange:
        found.append(f"{count(strange, 'trial')} of cars that do not belong to this family count in no rate here.")
    passed, number = designs.pretended.sum(axis=0).tolist()
    if number:
        found.append(f"SIMULATED trials, which count in no rate: {passed} of {number} of simulated cars passed.")
    left = left_out_text(left_out)
    found += [left] if left else []
    for one in calibrations(store):
        if one.experiment == info.id:
            found.append(f"Calibration {one.name} ({one.created_utc}, UTC): {' '.join(one.summary['findings'])}")
    found += designs.car_remarks() if info.success_defined else []
    elsewhere = [designs.elsewhere[trial.id] for trial in trials if trial.id in designs.elsewhere]
    return found + elsewhere_remarks(elsewhere, info) + _failures(store, info, ends["failed"])


def _failures(store: Store, info: ExperimentInfo, failed: int) -> list[str]:
    if not failed:
        return []
    messages = store.failures([info.id])
    shown = "; ".join(f"{number} x {message}" for message, number in messages[:SHOWN])
    more = f"; and {len(messages) - SHOWN} other messages" if len(messages) > SHOWN else ""
    command = shlex.join(["foldcar", "export", str(store.path), "--failed", "--csv", "-"])
    counted = ", and count as not passed" if info.success_defined else ""
    return [f"{failed:,} of {info.stored_runs:,} runs failed{counted}: {shown}{more}. List them: {command}"]


def stopped_remarks(info: ExperimentInfo) -> list[str]:
    """How many designs are decided, and how to read their rates; nothing after a sweep of all runs."""
    if info.searched:
        early = (
            " It left designs early that did worse than the best: of those that would have ended as good, at most 10 %."
        )
        return [
            "A search chose these designs, so rates of its best are too good as a rule: believe those in fresh "
            "environments." + (early if len(info.objectives) == 1 else "")
        ]
    if info.until is None:
        return []
    undecided = info.designs - info.decided
    rest = ""
    if undecided:
        left = f", or left before when those would decide with a chance below {100 * LEAST_CHANCE:g} %"
        why = left if info.until.thresholds else ""
        rest = f"; {undecided} are undecided, simulated in all {info.environments} environments{why}"
    if info.stored_runs < info.planned_runs:
        rest = f"; {undecided} are not yet" if undecided else ""
    away = "the thresholds" if info.until.thresholds else "50 %"
    most = info.designs * info.environments
    return [
        f"The sweep stopped simulating a design when {info.until.text}: {info.decided} of {info.designs} designs are "
        f"decided{rest}. {info.stored_runs} of at most {most} runs were made.",
        "Intervals are anytime-valid (Beta-binomial mixture): each holds for its design at whatever number of runs it "
        "stopped, by itself and not for all designs together. Rates of designs that stopped early lie on average "
        f"somewhat too far from {away}. Rates over several designs count each design alike.",
    ]


def other_engines(designs: Designs, experiments: Sequence[Designs]) -> list[dict[str, Any]]:
    """For each engine that simulated the same cars in the same samples, what page_data.py describes as ``engines``.

    Without runs that both engines judged there is no entry.
    """
    mine = _passed_runs(designs)
    found = []
    for other in experiments:
        if other.info.engine == designs.info.engine or _sampled_alike(other.info) != _sampled_alike(designs.info):
            continue
        places = {tuple(sorted(one.items())): at for at, one in enumerate(other.designs)}
        place = [places.get(tuple(sorted(one.items()))) for one in designs.designs]
        theirs = _passed_runs(other)
        pairs = [
            (passed, theirs[at, sample])
            for (design, sample), passed in mine.items()
            if (at := place[design]) is not None and (at, sample) in theirs
        ]
        if not pairs:
            continue
        counts = [(0, 0) if at is None else tuple(other.counted[at].tolist()) for at in place]
        alike = 100 * sum(a == b for a, b in pairs) / len(pairs)
        text = (
            f"{_engine(other.info)}: {sum(b for _, b in pairs):,} of the same {len(pairs):,} runs passed, in "
            f"{_engine(designs.info)} {sum(a for a, _ in pairs):,}; {alike:.1f} % of the runs have the same result "
            "in both."
        )
        passed, runs = ([count[k] for count in counts] for k in (0, 1))
        found.append({"id": other.info.id, "name": _engine(other.info), "passed": passed, "runs": runs, "text": text})
    return found


def _engine(info: ExperimentInfo) -> str:
    return engine_title(info.engine) or MULTIBODY


def _sampled_alike(info: ExperimentInfo) -> tuple[Any, ...]:
    """What two experiments have in common whose samples are the same."""
    what = (info.listed_id, info.under, info.vehicle_type, info.fixed, info.scenic_program, info.scenic_params, info.seed)
    return *what, info.condition, info.variation, info.variation_seed, info.success_defined and info.success_rule


def _passed_runs(designs: Designs) -> dict[tuple[int, int], bool]:
    """Whether each run that belongs in a rate passed, by its design and sample."""
    runs = designs.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    return dict(zip(zip(runs.design.tolist(), runs.sample.tolist(), strict=True), passed.tolist(), strict=True))
