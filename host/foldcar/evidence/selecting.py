"""What should a person do next? `foldcar select`, `foldcar log`, the report and the API ask this for each experiment."""

from collections.abc import Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from foldcar.evidence.adviser import Adviser, Selection
from foldcar.evidence.belief import why_no_belief
from foldcar.evidence.evidence import Evidence, read_evidence, simulated_text
from foldcar.evidence.sentences import grounds
from foldcar.simulation.results import no_rate_text
from foldcar.statistics.words import count
from foldcar.store.reader import Store
from foldcar.study.search.design_simulator import fresh_id

THRESHOLD = 0.75


def select(
    store: Store, threshold: float | None = None, experiment: str | None = None, simulated_trials: bool = False
) -> list[Selection]:
    """Advise on every swept experiment, or on ``experiment``; an empty list without a sweep.

    ``threshold`` (0 to 1) is the success rate that a good design reaches. If it is None, the highest threshold that the
    experiment's listing names is used, or THRESHOLD if it names none.
    With ``simulated_trials``, trials of simulated cars count as if built cars had driven them. Raises FoldcarError if the
    store cannot be read or has no such experiment.
    """
    return select_evidence(read_evidence(store, experiment, simulated_trials), threshold)


def select_evidence(evidence: Sequence[Evidence], threshold: float | None = None) -> list[Selection]:
    """Return the advice for each experiment of ``evidence``, as :func:`select` does for the experiments of a store.

    A search chooses designs by their runs, so the rates of these runs are biased. It simulates the best designs again in
    fresh environments, which are another experiment of the store. If there are such runs, the advice for the search comes
    from them.
    """
    experiment_by_id = {experiment.info.id: experiment for experiment in evidence}
    # The advice by the id of the experiment. That for a search with fresh runs is made afterwards.
    selection_by_id: dict[str, Selection] = {}
    fresh_by_search_id: dict[str, Evidence] = {}
    for experiment in evidence:
        fresh = experiment_by_id.get(fresh_id(experiment.info.id)) if experiment.info.searched else None
        if fresh is None:
            selection_by_id[experiment.info.id] = _select_one(experiment, threshold)
        else:
            fresh_by_search_id[experiment.info.id] = fresh
    for search_id, fresh in fresh_by_search_id.items():
        fresh_selection = selection_by_id[fresh.info.id]
        selection_by_id[search_id] = _selection_of_search(experiment_by_id[search_id], fresh, fresh_selection)
    return [selection_by_id[experiment.info.id] for experiment in evidence]


def _selection_of_search(search: Evidence, fresh: Evidence, fresh_selection: Selection) -> Selection:
    """Return the advice for a search: that for its runs in fresh environments, after a sentence that says so."""
    # An earlier sweep may have simulated designs that the search has not tried.
    simulated = f"{count(search.swept, 'design')} {'was' if search.swept == 1 else 'were'} simulated"
    environments = count(fresh.info.environments, "fresh environment")
    search_text = f"{simulated}; a search judged {len(fresh.designs):,} in {environments}, which count here."
    return replace(fresh_selection, info=search.info, works=f"{search_text} {fresh_selection.works}")


def _select_one(evidence: Evidence, threshold: float | None) -> Selection:
    """Return the advice for one experiment: which car to take, and which trials to make next.

    The advice on trials needs a *belief*, the probability distribution of the success rates of built cars, given all runs
    and trials. Without a belief, the result says why there is none. ``threshold`` is the success rate that a good car
    reaches. If it is None, it is the highest threshold of the listing, or THRESHOLD if the listing has none.
    """
    info, belief = evidence.info, evidence.belief
    if threshold is None:
        threshold = max(info.thresholds, default=THRESHOLD)
    if belief is not None:
        # The matrices are so small that threads would only wait for each other.
        with threadpool_limits(1):
            selection = Adviser(evidence, belief, threshold).selection()
    elif info.success_defined and any(design.runs for design in evidence.family):
        # Only the success rates in simulation are known.
        selection = Selection(
            info, threshold, works=grounds(evidence, threshold), learn=why_no_belief(info), remarks=evidence.remarks
        )
    else:
        selection = Selection(info, threshold, works=_no_advice_text(evidence), remarks=evidence.remarks)
    # If trials of simulated cars count, the text begins with a warning.
    return replace(selection, works=f"{simulated_text(evidence)}{selection.works}")


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
