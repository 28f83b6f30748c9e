"""Advise which designs to build next: before any trial, and again after each round of trials.

Before trials the advice is the middle, the edges and the outside of the feasible region, as in the publication of the
width study. After trials it is the designs with the greatest expected gain: which design is best, and which ones reach
the threshold. The report, `foldcar select`, `foldcar log` and the API print the same advice.
"""

from collections.abc import Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from foldcar.belief.priors import MEASURABLE
from foldcar.inference.adviser import Adviser, Selection
from foldcar.inference.evidence import Evidence, read_evidence, simulated_text
from foldcar.simulation.results import no_rate_text
from foldcar.statistics.words import count, listed
from foldcar.store.measured import measured_values
from foldcar.store.reader import Store
from foldcar.study.search.design_simulator import fresh_id

BUILD, THRESHOLD, PRECISION = 4, 0.75, 0.15


def select(
    store: Store,
    build: int = BUILD,
    threshold: float | None = None,
    precision: float = PRECISION,
    experiment: str | None = None,
    simulated_trials: bool = False,
) -> list[Selection]:
    """Recommend up to ``build`` designs for every swept experiment, or for ``experiment``; an empty list without a sweep.

    ``threshold`` (0 to 1) is the success that a good design reaches; None stands for the listing's highest, or THRESHOLD.
    ``precision`` is the half-width (0 to 0.5) to which trials narrow a rate. With ``simulated_trials``, trials
    of simulated cars count as if built cars had driven them. Raises FoldcarError if the store cannot be read or has no
    such experiment.
    """
    evidence = read_evidence(store, experiment, simulated_trials)
    selections = select_evidence(evidence, build, threshold, precision)
    return [
        replace(selection, remarks=(*measure_first(store, selection), *selection.remarks)) for selection in selections
    ]


def measure_first(store: Store, selection: Selection) -> list[str]:
    """Return a remark on what was not measured yet on built cars and obstacles, if further trials are advised."""
    missing = [name for name in MEASURABLE if name not in measured_values(store, selection.info.listed_id)]
    # There is no leader before trials.
    if not missing or selection.leader is None or not selection.recommendations:
        return []
    return [f"Measure first, before more trials: {listed(missing)} (`foldcar trials measure`)."]


def select_evidence(
    evidence: Sequence[Evidence],
    build: int = BUILD,
    threshold: float | None = None,
    precision: float = PRECISION,
) -> list[Selection]:
    """Advise as :func:`select` does, given evidence.

    A search chose its designs in the same environments, so its rates are biased. If its designs were also simulated in
    fresh environments, the advice is that of the fresh experiment.
    """
    by_id = {experiment.info.id: experiment for experiment in evidence}
    fresh_ids = {
        name: fresh_id(name) for name, searched in by_id.items() if searched.info.searched and fresh_id(name) in by_id
    }
    selections = [
        None if experiment.info.id in fresh_ids else _select_one(experiment, build, threshold, precision)
        for experiment in evidence
    ]
    advice = {
        experiment.info.id: selection for experiment, selection in zip(evidence, selections, strict=True) if selection
    }
    answers = []
    for experiment, selection in zip(evidence, selections, strict=True):
        if selection is None:
            fresh = by_id[fresh_ids[experiment.info.id]]
            judged = f"{len(fresh.designs):,} were judged in {fresh.info.environments:,} fresh environments"
            start = f"A search tried {count(experiment.swept, 'design')}; {judged}. "
            selection = advice[fresh.info.id]
            selection = replace(selection, info=experiment.info, headline=start + selection.headline)
        answers.append(selection)
    return answers


def _select_one(evidence: Evidence, build: int, threshold: float | None, precision: float) -> Selection:
    """Advise on one experiment."""
    info, belief = evidence.info, evidence.belief
    limit = threshold if threshold is not None else max(info.thresholds, default=THRESHOLD)
    if belief is None:
        text = f"{simulated_text(evidence)}{_no_advice_text(evidence)}"
        return Selection(info, limit, precision, text, remarks=evidence.remarks)
    # The matrices are so small that threads would only wait for each other.
    with threadpool_limits(1):
        selection = Adviser(evidence, belief, limit, precision).selection(build)
    return replace(selection, headline=f"{simulated_text(evidence)}{selection.headline}")


def _no_advice_text(evidence: Evidence) -> str:
    """Return a sentence on why there is no advice."""
    info = evidence.info
    passed, trials = evidence.trial_counts.sum(axis=0).tolist()
    if not info.success_defined:
        return f"No advice, because {info.success_rule}."
    if not info.stored_runs and trials:
        return f"{passed} of {count(trials, 'trial')} of built cars passed; nothing was simulated to compare with."
    if not info.stored_runs:
        return "No run is stored yet."
    return f"No advice: {no_rate_text(info.stored_runs)}."
