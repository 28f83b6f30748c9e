"""Compare simulation with trials of built cars, design by design: rates, gaps, ranks, and a verdict in words.

A gap is the rate of trials minus that of simulation. If trials have a simulation of the same environment, the gap is of
these pairs, so that harder environments do not count as a difference. The intervals of one experiment's gaps and of their
mean hold together with 95 %, so each is wider than a single one would be.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from foldcar.inference.design_evidence import Design, DesignEvidence, by_car
from foldcar.inference.evidence import Evidence, read_evidence, simulated_text, swept_ids, unswept_trials
from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    RankAgreement,
    Rates,
    mean_gap,
    pair_correlation,
    rank_agreement,
)
from foldcar.statistics.rate import Rate
from foldcar.statistics.words import count, listed, points
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial

CONFIDENCE = 0.95
# Rates that differ by at most this (0 to 1) agree: they lead to the same choice of cars.
MARGIN = 0.15


@dataclass(frozen=True)
class DesignComparison:
    """One design with trials, compared with its runs.

    ``driven`` is the rate of the cars that drove; ``further_car`` that of a new car of the design, by its own trials.
    ``pooled`` also uses simulation and the other designs' trials; None for a design outside the family. ``simulated`` and
    ``gap`` are None without runs. If ``gap_is_paired``, the gap compares trials with runs in the same environments.
    ``verdict`` is one of :mod:`foldcar.statistics.gap`, None if there is nothing to compare.
    """

    evidence: DesignEvidence
    driven: Rate
    simulated: Rate | None = None
    further_car: Rate | None = None
    pooled: Rate | None = None
    gap: Gap | None = None
    gap_is_paired: bool = False
    verdict: str | None = None

    @property
    def label(self) -> str:
        """The design's name for readers."""
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
        """The number of paired trials that ended as simulated, passed or not passed."""
        return sum(trial.passed == bool(trial.simulated) for trial in self.evidence.paired)

    @property
    def driven_outcomes(self) -> Mapping[str, int]:
        """The number of trials of each outcome."""
        return Counter(trial.outcome for trial in self.evidence.trials)


@dataclass(frozen=True)
class ExperimentComparison:
    """The comparison of one swept experiment.

    ``mean_gap`` is over its designs with runs and trials, None if no design has both. ``verdict`` is one of
    :mod:`foldcar.statistics.gap`, "mixed" if designs contradict each other, or None; ``sentence`` says it in words.
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
    """A store's comparison; ``sentence`` is its answer, ``unswept`` are sentences on trials of experiments not swept."""

    experiments: tuple[ExperimentComparison, ...]
    unswept: tuple[str, ...]
    margin: float
    sentence: str


def compare(
    store: Store,
    experiment: str | None = None,
    margin: float = MARGIN,
    simulated_trials: bool = False,
) -> Comparison:
    """Compare a store's trials with its runs; rates that differ by at most ``margin`` (0 to 1) agree.

    ``experiment`` limits the comparison to one. With ``simulated_trials``, trials of simulated cars count as
    if built cars had driven them. Raises FoldcarError if the store cannot be read or has no such experiment.
    """
    unswept = {trial.experiment for trial in store.trials()} - swept_ids(store)
    evidence = [] if experiment in unswept else read_evidence(store, experiment, simulated_trials)
    return compare_evidence(evidence, unswept_trials(store, experiment, simulated_trials), margin)


def compare_evidence(evidence: Sequence[Evidence], unswept: Sequence[Trial] = (), margin: float = MARGIN) -> Comparison:
    """Compare as :func:`compare` does, given evidence; ``unswept`` are trials of experiments that were not swept."""
    experiments = tuple(compare_experiment(experiment, margin) for experiment in evidence)
    sentences = tuple(
        f"Experiment {name} was not swept: {count(number, 'trial')} without runs."
        for name, number in Counter(trial.experiment for trial in unswept).items()
    )
    simulated = next(filter(None, map(simulated_text, evidence)), "")
    return Comparison(experiments, sentences, margin, f"{simulated}{_overall(experiments)}")


def compare_experiment(evidence: Evidence, margin: float = MARGIN) -> ExperimentComparison:
    """Compare the trials of one experiment with its runs, as :func:`compare` does."""
    info, driven, remarks = evidence.info, evidence.driven, evidence.remarks
    if not info.success_defined:
        reason = "success is undefined in this environment, so that there is no rate to compare; only outcomes are shown."
        rows = tuple(DesignComparison(design, design.driven(CONFIDENCE)) for design in driven)
        return ExperimentComparison(info, rows, f"Nothing to compare: {reason}", remarks)
    with_runs = [design for design in driven if design.runs]
    # Bonferroni: the intervals of all gaps and of their mean hold together with CONFIDENCE. With one design the mean is
    # its gap.
    intervals = len(with_runs) + 1 if len(with_runs) > 1 else 1
    confidence = 1 - (1 - CONFIDENCE) / intervals
    belief = evidence.belief
    pooled = {} if belief is None else dict(zip(belief.labels, belief.built, strict=True))
    rates = {design.label: _rates(design, confidence) for design in with_runs}
    compared = tuple(
        _compare_design(design, pooled.get(design.label), rates.get(design.label), margin) for design in driven
    )
    if not with_runs:
        reason = (
            "no design has both runs and trials."
            if driven
            else "there are no trials of built cars yet. `foldcar select` says which cars to build."
        )
        return ExperimentComparison(info, compared, f"Nothing to compare: {reason}", remarks)
    mean = mean_gap(list(rates.values()))
    ranks = rank_agreement(
        [design.runs_passed / design.runs for design in with_runs],
        [design.trials_passed / len(design.trials) for design in with_runs],
    )
    verdict, sentence = _verdict(compared, mean, margin, info.simulation)
    return ExperimentComparison(info, compared, sentence, remarks, ranks, mean, verdict)


def _is_paired(design: DesignEvidence) -> bool:
    """Return whether at least half of a design's trials have a simulation of their environment."""
    return 2 * len(design.paired) >= len(design.trials)


def _rates(design: DesignEvidence, confidence: float) -> Rates:
    """Return the two rates whose difference is a design's gap: in simulation, and of a new car by its trials.

    If the gap is paired, both rates are those in the environments of the trials.
    """
    if not _is_paired(design):
        # A design with trials has cars.
        assert design.cars is not None
        return Rates(design.simulated(confidence), design.cars.rate(confidence))
    # In paired environments trials need no correction for difficulty, which ``expected`` would cause.
    pairs = [replace(trial, expected=None) for trial in design.paired]
    passed, simulated = [trial.passed for trial in pairs], [bool(trial.simulated) for trial in pairs]
    in_simulation = Rate.from_counts(
        sum(simulated), len(pairs), f"in the environments of {count(len(pairs), 'trial')}", confidence=confidence
    )
    cars = by_car(pairs, design.spread, design.runs_passed, design.runs)
    return Rates(in_simulation, cars.rate(confidence), pair_correlation(passed, simulated))


def _compare_design(design: DesignEvidence, pooled: Rate | None, rates: Rates | None, margin: float) -> DesignComparison:
    """Compare a design's trials with its runs; ``rates`` are None without runs.

    ``pooled`` is the rate of a new car by simulation and all designs' trials.
    """
    driven = design.driven(CONFIDENCE)
    further = None if design.cars is None else design.cars.rate(CONFIDENCE)
    if rates is None:
        return DesignComparison(design, driven, further_car=further)
    # The gap of this one design.
    gap = mean_gap([rates])
    return DesignComparison(
        design,
        driven,
        simulated=design.simulated(CONFIDENCE),
        further_car=further,
        pooled=pooled,
        gap=gap,
        gap_is_paired=_is_paired(design),
        verdict=gap.verdict(margin),
    )


def _verdict(compared: Sequence[DesignComparison], mean: Gap, margin: float, simulation: str) -> tuple[str, str]:
    """Return the experiment's verdict and a sentence that explains it.

    Designs whose gap excludes 0 decide first, then the mean gap, then designs that agree.
    """
    start = simulation[0].upper() + simulation[1:]
    # The labels of designs by verdict.
    labels: dict[str, list[str]] = {}
    for design in compared:
        if design.verdict is not None:
            labels.setdefault(design.verdict, []).append(design.label)
    direction = "less" if mean.value < 0 else "more"
    difference = f"trials pass {points(mean.value, sign=False)} points {direction} often than {simulation}"
    interval = f"{points(mean.low)} to {points(mean.high)}"
    paired = [design.gap_is_paired for design in compared if design.gap is not None]
    where = "in the same environments, " if all(paired) else ""
    average = f"{where}on average over {count(len(paired), 'design')}, {difference} (95 %: {interval})"
    pairs = sum(design.paired for design in compared)
    agreeing = sum(design.agreeing for design in compared)
    if pairs:
        average += f"; {agreeing} of {pairs} trials ended as simulated in the same environment"
    unsure = f"; {TOO_FEW} to say at {listed(labels[TOO_FEW])}" if TOO_FEW in labels else ""
    contradictions = [verdict for verdict in (OPTIMISTIC, PESSIMISTIC) if verdict in labels]
    if contradictions:
        text = " and ".join(f"{verdict} at {listed(labels[verdict])}" for verdict in contradictions)
        return contradictions[0] if len(contradictions) == 1 else "mixed", f"{start} is {text}{unsure}; {average}."
    verdict = mean.verdict(margin)
    if verdict in (OPTIMISTIC, PESSIMISTIC):
        return verdict, f"{start} is {verdict} {average}; no single design shows it."
    within = f"within {points(margin, sign=False)} points"
    if AGREES in labels:
        agrees = AGREES if verdict == AGREES and TOO_FEW not in labels else TOO_FEW
        return agrees, f"{start} and trials agree {within} at {listed(labels[AGREES])}{unsure}; {average}."
    return TOO_FEW, f"{TOO_FEW.capitalize()} to say whether {simulation} and trials agree {within}; {average}."


def _overall(experiments: Sequence[ExperimentComparison]) -> str:
    """Return the sentences of all experiments, with a warning if several builds of carsim simulated them."""
    if not experiments:
        return "Nothing to compare: the store has no runs yet; sweep the listing into it with `foldcar sweep`."
    several = len(experiments) > 1
    sentences = [
        f"Experiment {experiment.info.id}: {experiment.sentence}" if several else experiment.sentence
        for experiment in experiments
    ]
    builds = {experiment.info.carsim_build for experiment in experiments}
    if len(builds) > 1:
        sentences.append(f"The experiments were simulated by {len(builds)} builds of carsim: do not compare them.")
    return " ".join(sentences)
