"""Simulation against trials of built cars, design by design: rates, gaps, ranks, and what follows from them in words.

Input: a store, or its evidence. Output: a Comparison of each experiment. A gap is trials minus simulation. The gaps of
one experiment and their mean hold together with 95 %: each is wider than a single one would be.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from foldcar.advice.evidence import Design, DesignEvidence, Evidence, read_evidence, swept_ids, unswept_trials
from foldcar.advice.outlook import outlook
from foldcar.analysis.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    RankAgreement,
    mean_gap,
    rank_agreement,
)
from foldcar.analysis.pooled_bias import MOST_POOLED
from foldcar.analysis.rate import Rate
from foldcar.analysis.words import count, listed, points
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial

CONFIDENCE = 0.95
# Rates that differ by less agree, as far as a choice of cars goes.
MARGIN = 0.15


@dataclass(frozen=True)
class DesignComparison:
    """One design with trials. ``simulated`` and ``gap`` are None without runs; ``driven`` is of the cars that drove.

    ``further_car`` is what these say of a further car of the design, as simulation's rate is; ``gap`` goes by it.
    ``pooled`` is that with the help of simulation and of the other designs' trials; None if no other design of the family
    was driven. ``agreeing`` of the ``paired`` trials ended as simulation says there, passed or not.
    ``verdict`` is one of those of :mod:`foldcar.analysis.gap`, None where there is nothing to compare.
    """

    evidence: DesignEvidence
    driven: Rate
    simulated: Rate | None = None
    further_car: Rate | None = None
    pooled: Rate | None = None
    gap: Gap | None = None
    verdict: str | None = None

    @property
    def label(self) -> str:
        """The design for the reader."""
        return self.evidence.label

    @property
    def design(self) -> Design:
        """The design's parameters."""
        return self.evidence.design

    @property
    def cars(self) -> int:
        """The number of cars that drove."""
        return 0 if self.evidence.cars is None else len(self.evidence.cars.passed)

    @property
    def paired(self) -> int:
        """The number of trials with a simulation of their environment."""
        return len(self.evidence.paired)

    @property
    def agreeing(self) -> int:
        """How many paired trials passed where simulation passes, or did not where it does not."""
        return sum(trial.passed == bool(trial.simulated) for trial in self.evidence.paired)

    @property
    def driven_outcomes(self) -> Mapping[str, int]:
        """The trials by outcome."""
        return Counter(trial.outcome for trial in self.evidence.trials)


@dataclass(frozen=True)
class ExperimentComparison:
    """One swept experiment; ``mean_gap`` is over its designs with runs and trials, None if there are none.

    ``verdict`` is one of a design's, "mixed", or None; ``sentence`` says it. ``info`` is the experiment.
    """

    info: ExperimentInfo
    designs: tuple[DesignComparison, ...]
    sentence: str
    remarks: tuple[str, ...]
    ranks: RankAgreement | None = None
    mean_gap: Gap | None = None
    verdict: str | None = None


@dataclass(frozen=True)
class Comparison:
    """A store's comparison; ``sentence`` is its answer in short, ``alone`` tells of trials that no sweep goes with."""

    experiments: tuple[ExperimentComparison, ...]
    alone: tuple[str, ...]
    margin: float
    sentence: str


def compare(
    store: Store,
    experiment: str | None = None,
    margin: float = MARGIN,
    simulated_trials: bool = False,
) -> Comparison:
    """Compare a store's trials with its runs; rates that differ by at most ``margin`` (0 to 1) agree.

    ``simulated_trials``: trials of simulated cars instead of those of built ones. FoldcarError.
    """
    known = {trial.experiment for trial in store.trials()} - swept_ids(store)
    evidence = [] if experiment in known else read_evidence(store, experiment, simulated_trials)
    found = compare_evidence(evidence, unswept_trials(store, experiment, simulated_trials), margin)
    return replace(found, sentence=f"SIMULATED trials. {found.sentence}") if simulated_trials else found


def compare_evidence(evidence: Sequence[Evidence], alone: Sequence[Trial] = (), margin: float = MARGIN) -> Comparison:
    """As :func:`compare`, from evidence that was read; ``alone`` are trials of experiments that were not swept."""
    experiments = tuple(_experiment(one, margin) for one in evidence)
    apart = tuple(
        f"Experiment {name} was not swept: {count(number, 'trial')} without runs."
        for name, number in Counter(trial.experiment for trial in alone).items()
    )
    return Comparison(experiments, apart, margin, _overall(experiments))


def _experiment(evidence: Evidence, margin: float) -> ExperimentComparison:
    info, driven, remarks = evidence.info, evidence.driven, evidence.remarks
    if not info.success_defined:
        why = "success is undefined in this environment, so that there is no rate to compare; only outcomes are shown."
        rows = tuple(DesignComparison(one, _driven(one)) for one in driven)
        return ExperimentComparison(info, rows, f"Nothing to compare: {why}", remarks)
    both = [one for one in driven if one.runs]
    # Bonferroni: all gaps of the experiment and their mean hold together; of one design the mean is its gap.
    together = 1 - (1 - CONFIDENCE) / (len(both) + 1 if len(both) > 1 else 1)
    cars = [one.cars for one in both if one.cars is not None]
    seen = outlook(evidence) if evidence.parameters else None
    rates = () if seen is None or seen.pooled is None else seen.pooled
    pooled = {} if seen is None else {one.label: rate for one, rate in zip(seen.designs, rates, strict=False)}
    compared = tuple(_design(one, pooled.get(one.label), together, margin) for one in driven)
    if not both:
        why = (
            "no design has both runs and trials."
            if driven
            else "there are no trials of built cars yet. `foldcar select` says which cars to build."
        )
        return ExperimentComparison(info, compared, f"Nothing to compare: {why}", remarks)
    mean = mean_gap([one.simulated(together) for one in both], [one.rate(together) for one in cars])
    ranks = rank_agreement(
        [one.runs_passed / one.runs for one in both], [one.trials_passed / len(one.trials) for one in both]
    )
    verdict, sentence = _verdict(compared, mean, margin, info.simulation)
    if seen is not None:
        remarks = (*remarks, *seen.contradicting.remark([one.label for one in seen.designs]))
        if sum(bool(one.trials) for one in seen.designs) < sum(evidence.in_family(one) for one in both):
            remarks = (*remarks, f"Of the driven designs the {MOST_POOLED} with most trials are pooled.")
    return ExperimentComparison(info, compared, sentence, remarks, ranks, mean, verdict)


def _design(one: DesignEvidence, pooled: Rate | None, together: float, margin: float) -> DesignComparison:
    further = None if one.cars is None else one.cars.rate(CONFIDENCE)
    if not one.runs or one.cars is None:
        return DesignComparison(one, _driven(one), further_car=further)
    found = mean_gap([one.simulated(together)], [one.cars.rate(together)])
    return DesignComparison(one, _driven(one), one.simulated(CONFIDENCE), further, pooled, found, found.verdict(margin))


def _driven(one: DesignEvidence) -> Rate:
    what = "" if one.cars is None else one.cars.text
    return Rate.counted(one.trials_passed, len(one.trials), what, confidence=CONFIDENCE)


def _verdict(compared: Sequence[DesignComparison], mean: Gap, margin: float, simulation: str) -> tuple[str, str]:
    """The experiment's verdict and its sentence."""
    start = simulation[0].upper() + simulation[1:]
    labels: dict[str, list[str]] = {}
    for one in compared:
        if one.verdict is not None:
            labels.setdefault(one.verdict, []).append(one.label)
    more = "less" if mean.value < 0 else "more"
    apart = f"trials pass {points(mean.value, sign=False)} points {more} often than {simulation}"
    interval = f"{points(mean.low)} to {points(mean.high)}"
    average = f"on average over {count(sum(map(len, labels.values())), 'design')}, {apart} (95 %: {interval})"
    unsure = f"; {TOO_FEW} to say at {listed(labels[TOO_FEW])}" if TOO_FEW in labels else ""
    said = [verdict for verdict in (OPTIMISTIC, PESSIMISTIC) if verdict in labels]
    if said:
        text = " and ".join(f"{verdict} at {listed(labels[verdict])}" for verdict in said)
        return said[0] if len(said) == 1 else "mixed", f"{start} is {text}{unsure}; {average}."
    verdict = mean.verdict(margin)
    if verdict in (OPTIMISTIC, PESSIMISTIC):
        return verdict, f"{start} is {verdict} {average}; no single design shows it."
    within = f"within {points(margin, sign=False)} points"
    if AGREES in labels:
        agrees = AGREES if verdict == AGREES and TOO_FEW not in labels else TOO_FEW
        return agrees, f"{start} and trials agree {within} at {listed(labels[AGREES])}{unsure}; {average}."
    return TOO_FEW, f"{TOO_FEW.capitalize()} to say whether {simulation} and trials agree {within}; {average}."


def _overall(experiments: Sequence[ExperimentComparison]) -> str:
    if not experiments:
        return "Nothing to compare: the store has no runs yet; sweep the listing into it with `foldcar sweep`."
    several = len(experiments) > 1
    sentences = [f"Experiment {one.info.id}: {one.sentence}" if several else one.sentence for one in experiments]
    builds = {one.info.carsim_build for one in experiments}
    if len(builds) > 1:
        sentences.append(f"The experiments were simulated by {len(builds)} builds of carsim: do not compare them.")
    return " ".join(sentences)
