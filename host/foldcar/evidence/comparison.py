"""Compare simulation with trials of built cars, design by design: rates, gaps, ranks, and a verdict in words.

A gap is the rate of a further built car by all trials, minus the rate of the design's runs. It is read from the belief
(:mod:`foldcar.belief`), as are the realities that fit. Without a belief only counts are compared.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy

from foldcar.belief.answers import Unknown, estimates
from foldcar.evidence.belief import Belief, why_no_belief
from foldcar.evidence.design_evidence import Design, DesignEvidence
from foldcar.evidence.evidence import (
    Evidence,
    no_trial_text,
    read_evidence,
    simulated_text,
    swept_ids,
    unswept_trials,
)
from foldcar.notebook_html import lines_html, table_html
from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    RankAgreement,
    rank_agreement,
)
from foldcar.statistics.rate import Rate
from foldcar.statistics.words import count, listed, points, points_text, rate_text
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial

CONFIDENCE = 0.95
# Rates that differ by at most this (0 to 1) agree: they lead to the same choice of cars.
MARGIN = 0.15


@dataclass(frozen=True)
class DesignComparison:
    """One design with trials, compared with its runs.

    ``driven`` is the rate of the cars that drove. ``built`` is the rate of a further car of the design by all trials and
    simulation; None without a belief about the design. ``simulated`` and ``gap`` are None without runs. ``verdict`` is
    one of :mod:`foldcar.statistics.gap`, None if there is nothing to compare.
    """

    evidence: DesignEvidence
    driven: Rate
    simulated: Rate | None = None
    built: Rate | None = None
    gap: Gap | None = None
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
        return self.evidence.cars

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

    ``mean_gap`` is over its designs with gaps, None if no design has one. ``verdict`` is one of
    :mod:`foldcar.statistics.gap`, "mixed" if designs contradict each other, or None; ``sentence`` says it in words.
    ``unknowns`` are what the trials have taught about the simulator's parameters; empty without a belief.
    """

    info: ExperimentInfo
    designs: tuple[DesignComparison, ...]
    sentence: str
    remarks: tuple[str, ...]
    ranks: RankAgreement | None = None
    mean_gap: Gap | None = None
    verdict: str | None = None
    unknowns: tuple[Unknown, ...] = ()


@dataclass(frozen=True, repr=False)
class Comparison:
    """A store's comparison; print it to read it.

    ``sentence`` is its answer, ``unswept`` are sentences on trials of experiments that were not swept. ``picture`` draws
    what a notebook shows below the words, as HTML.
    """

    experiments: tuple[ExperimentComparison, ...]
    unswept: tuple[str, ...]
    margin: float
    sentence: str
    picture: Callable[[], str] | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        lines = [
            f"  experiment {experiment}, {design}: {simulated} in simulation, {driven} in trials; {verdict}"
            for experiment, design, simulated, driven, verdict in self._rows()
        ]
        return "\n".join([self.sentence, *lines, *self.unswept])

    def _repr_html_(self) -> str:
        rows = list(self._rows())
        table = table_html(("experiment", "design", "simulation", "trials", "verdict"), rows) if rows else ""
        return lines_html([self.sentence, *self.unswept]) + table + (self.picture() if self.picture else "")

    def _rows(self) -> Iterator[tuple[str, str, str, str, str]]:
        """Yield experiment, name, rate in simulation, rate of trials and verdict of each design with trials."""
        for experiment in self.experiments:
            for design in experiment.designs:
                simulated, driven = (
                    "no rate" if rate is None else rate_text(rate.value, rate.low, rate.high)
                    for rate in (design.simulated, design.driven)
                )
                yield experiment.info.id, design.label, simulated, driven, design.verdict or "nothing to compare"


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
    info, driven, remarks, belief = evidence.info, evidence.driven, evidence.remarks, evidence.belief
    if not info.success_defined:
        reason = "success is undefined in this environment, so that there is no rate to compare; only outcomes are shown."
        rows = tuple(DesignComparison(design, design.driven(CONFIDENCE)) for design in driven)
        return ExperimentComparison(info, rows, f"Nothing to compare: {reason}", remarks)
    compared = tuple(_compare_design(design, belief, margin) for design in driven)
    with_runs = [design for design in driven if design.runs]
    if info.is_over_realities:
        reason = f"rates are expected over realities, before any trial. Sweep experiment {info.listed_id} to compare."
        return ExperimentComparison(info, compared, f"Nothing to compare: {reason}", remarks)
    if not with_runs:
        reason = (
            "no design has both runs and trials."
            if driven
            else f"{no_trial_text(evidence, 'there are no trials of built cars yet')}. `foldcar select` says which cars "
            "to build."
        )
        return ExperimentComparison(info, compared, f"Nothing to compare: {reason}", remarks)
    ranks = rank_agreement(
        [design.runs_passed / design.runs for design in with_runs],
        [design.trials_passed / len(design.trials) for design in with_runs],
    )
    gaps = [design for design in compared if design.gap is not None]
    if belief is None or not gaps:
        sentence = f"{_counts(compared)} {why_no_belief(info)}"
        return ExperimentComparison(info, compared, sentence, remarks, ranks)
    mean = _gap(belief, [design.evidence for design in gaps])
    verdict, sentence = _verdict(compared, mean, margin, info.simulation)
    return ExperimentComparison(info, compared, sentence, remarks, ranks, mean, verdict, tuple(belief.answers.unknowns))


def _compare_design(design: DesignEvidence, belief: Belief | None, margin: float) -> DesignComparison:
    """Compare a design's trials with its runs."""
    driven = design.driven(CONFIDENCE)
    simulated = design.simulated(CONFIDENCE) if design.runs else None
    row = None if belief is None else belief.row_of(design)
    if belief is None or row is None:
        return DesignComparison(design, driven, simulated)
    built = built_rate(belief, row)
    gap = _gap(belief, [design]) if design.runs else None
    return DesignComparison(design, driven, simulated, built, gap, None if gap is None else gap.verdict(margin))


def built_rate(belief: Belief, row: int) -> Rate:
    """Return the rate of a further car of the design in a row of the belief."""
    estimate = belief.answers.built[row]
    return Rate(estimate.value, estimate.low, estimate.high, CONFIDENCE, "realities weighed by all trials")


def _gap(belief: Belief, designs: Sequence[DesignEvidence]) -> Gap:
    """Return the mean gap over designs of the belief with runs: further cars minus simulation."""
    rows = [row for design in designs if (row := belief.row_of(design)) is not None]
    passed = numpy.array([belief.designs[row].runs_passed for row in rows])
    failed = numpy.array([belief.designs[row].runs for row in rows]) - passed
    # Simulated rates are counted, too: draws of their posterior under Jeffreys' prior.
    shape = len(belief.answers.rates), len(rows)
    simulated = numpy.random.default_rng(17).beta(passed + 0.5, failed + 0.5, shape)
    gaps = (belief.answers.rates[:, rows] - simulated).mean(axis=1)
    (estimate,) = estimates(gaps[:, None], belief.answers.draws.weights)
    return Gap(estimate.value, estimate.low, estimate.high, CONFIDENCE)


def _counts(compared: Sequence[DesignComparison]) -> str:
    """Return a sentence on how many trials and runs passed at each design."""
    texts = [
        f"{design.evidence.trials_passed} of {count(len(design.evidence.trials), 'trial')} at {design.label}"
        + (f" ({design.evidence.runs_passed} of {count(design.evidence.runs, 'run')})" if design.evidence.runs else "")
        for design in compared
    ]
    return f"Passed: {listed(texts)}."


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
    difference = f"built cars pass {points_text(mean.value)} {direction} often than {simulation}"
    if not round(100 * mean.value):
        difference = f"built cars pass as often as {simulation}"
    interval = f"{points(mean.low)} to {points(mean.high)}"
    designs = sum(design.gap is not None for design in compared)
    average = f"on average over {count(designs, 'design')}, {difference} (95 %: {interval})"
    pairs = sum(design.paired for design in compared)
    agreeing = sum(design.agreeing for design in compared)
    if pairs:
        average += f"; {agreeing} of {count(pairs, 'trial')} ended as simulated in the same environment"
    unsure = f"; {TOO_FEW} to say at {listed(labels[TOO_FEW])}" if TOO_FEW in labels else ""
    contradictions = [verdict for verdict in (OPTIMISTIC, PESSIMISTIC) if verdict in labels]
    if contradictions:
        text = " and ".join(f"{verdict} at {listed(labels[verdict])}" for verdict in contradictions)
        return contradictions[0] if len(contradictions) == 1 else "mixed", f"{start} is {text}{unsure}; {average}."
    verdict = mean.verdict(margin)
    if verdict in (OPTIMISTIC, PESSIMISTIC):
        return verdict, f"{start} is {verdict} {average}; no single design shows it."
    within = f"within {points_text(margin)}"
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
