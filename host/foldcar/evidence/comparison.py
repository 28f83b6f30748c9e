"""Compare simulation with trials of built cars, design by design: rates, gaps, ranks, and a verdict in words.

A gap is the rate of a further built car by all trials, minus the rate of the design's runs. It is read from the belief
(:mod:`foldcar.belief`), as are the realities that fit. Without a belief only counts are compared.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

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
# Both parameters of the beta distribution that is Jeffreys' prior of a success rate.
JEFFREYS = 0.5
# The draws of simulated rates are the same each time.
GAP_SEED = 17


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


class ComparisonRow(NamedTuple):
    """A row of the printed comparison: a design with its rates in simulation and in trials, all as texts."""

    experiment: str
    design: str
    simulation: str
    trials: str
    verdict: str


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
        lines = [self.sentence]
        for row in self._rows():
            rates = f"{row.simulation} in simulation, {row.trials} in trials"
            lines.append(f"  experiment {row.experiment}, {row.design}: {rates}; {row.verdict}")
        return "\n".join([*lines, *self.unswept])

    def _repr_html_(self) -> str:
        html = lines_html([self.sentence, *self.unswept])
        rows = self._rows()
        if rows:
            html += table_html(ComparisonRow._fields, rows)
        if self.picture is not None:
            html += self.picture()
        return html

    def _rows(self) -> list[ComparisonRow]:
        """Return a row for each design with trials."""
        rows = []
        for experiment in self.experiments:
            for design in experiment.designs:
                rows.append(
                    ComparisonRow(
                        experiment=experiment.info.id,
                        design=design.label,
                        simulation=_rate_or_none_text(design.simulated),
                        trials=_rate_or_none_text(design.driven),
                        verdict=design.verdict or "nothing to compare",
                    )
                )
        return rows


def _rate_or_none_text(rate: Rate | None) -> str:
    """Return a success rate with its interval in words, or "no rate"."""
    return "no rate" if rate is None else rate_text(rate.value, rate.low, rate.high)


def compare(
    store: Store,
    experiment: str | None = None,
    margin: float = MARGIN,
    simulated_trials: bool = False,
) -> Comparison:
    """Compare the success rates of a store's trials, with built cars, with those of its simulated runs.

    Rates that differ by at most ``margin`` (0 to 1) agree. If ``experiment`` is given, only this experiment is compared.
    If ``simulated_trials`` is True, trials of simulated cars count as if built cars had driven them. Raises FoldcarError
    if the store cannot be read or has no such experiment.
    """
    # Such experiments have trials, but were not swept, so there are no runs to compare the trials with.
    without_runs = {trial.experiment for trial in store.trials()} - swept_ids(store)
    evidence = [] if experiment in without_runs else read_evidence(store, experiment, simulated_trials)
    trials_without_runs = unswept_trials(store, experiment, simulated_trials)
    return compare_evidence(evidence, trials_without_runs, margin)


def compare_evidence(evidence: Sequence[Evidence], unswept: Sequence[Trial] = (), margin: float = MARGIN) -> Comparison:
    """Compare simulated runs with trials of built cars, for each experiment in ``evidence``, which has both.

    ``unswept`` are trials of experiments that were not swept, so there are no runs to compare them with. The result has a
    sentence for each such experiment. ``margin`` is the largest difference (0 to 1) at which two success rates agree.
    """
    experiments = tuple(compare_experiment(experiment, margin) for experiment in evidence)
    unswept_counts = Counter(trial.experiment for trial in unswept)
    unswept_sentences = tuple(
        f"Experiment {name} was not swept: {count(trials, 'trial')} without runs."
        for name, trials in unswept_counts.items()
    )
    sentence = _overall(experiments)
    # The warning is the same for all experiments, and is shown once.
    warnings = [simulated_text(experiment) for experiment in evidence if experiment.simulated_trials]
    if warnings:
        sentence = f"{warnings[0]}{sentence}"
    return Comparison(experiments, unswept_sentences, margin, sentence)


def compare_experiment(evidence: Evidence, margin: float = MARGIN) -> ExperimentComparison:
    """Compare the trials of one experiment with its runs, as :func:`compare` does for all experiments of a store."""
    info, belief = evidence.info, evidence.belief
    if info.success_defined:
        compared = tuple(_compare_design(design, belief, margin) for design in evidence.driven)
    else:
        # Without a definition of success, runs have no rate. Only the rates of the trials are shown.
        compared = tuple(DesignComparison(design, design.driven(CONFIDENCE)) for design in evidence.driven)
    comparison = ExperimentComparison(info, compared, sentence="", remarks=evidence.remarks)
    reason = _why_not_comparable(evidence)
    if reason is not None:
        return replace(comparison, sentence=f"Nothing to compare: {reason}")
    with_runs = [design for design in evidence.driven if design.runs]
    comparison = replace(
        comparison,
        ranks=rank_agreement(
            simulated=[design.runs_passed / design.runs for design in with_runs],
            driven=[design.trials_passed / len(design.trials) for design in with_runs],
        ),
    )
    designs_with_gap = [design.evidence for design in compared if design.gap is not None]
    if belief is None or not designs_with_gap:
        # Without a belief about built cars, only the numbers of trials and runs that passed are stated.
        return replace(comparison, sentence=f"{_counts_text(compared)} {why_no_belief(info)}")
    mean_gap = _gap(belief, designs_with_gap)
    verdict, sentence = _verdict(compared, mean_gap, margin, info.simulation)
    return replace(
        comparison,
        sentence=sentence,
        mean_gap=mean_gap,
        verdict=verdict,
        unknowns=tuple(belief.answers.unknowns),
    )


def _why_not_comparable(evidence: Evidence) -> str | None:
    """Return why an experiment's trials cannot be compared with its runs; None if they can.

    Some experiments are *over realities*: each run has other random values of what the simulator does not know, such as
    friction. Their rates are averages, which no trial can test.
    """
    info = evidence.info
    if not info.success_defined:
        return "success is undefined in this environment, so that there is no rate to compare; only outcomes are shown."
    if info.is_over_realities:
        return f"rates are averages over realities, before any trial. Sweep experiment {info.listed_id} to compare."
    if not evidence.driven:
        no_trial = no_trial_text(evidence, "there are no trials of built cars yet")
        return f"{no_trial}. `foldcar select` says which cars to build."
    if not any(design.runs for design in evidence.driven):
        return "no design has both runs and trials."
    return None


def _compare_design(design: DesignEvidence, belief: Belief | None, margin: float) -> DesignComparison:
    """Compare the success rates of a design in trials, in simulation, and of cars of the design that are built next.

    The last of these rates is known if there is a ``belief`` about the design, which combines all runs and trials. Then
    the result has a verdict on the gap between this rate and the one in simulation. Rates that differ by at most
    ``margin`` (0 to 1) agree.
    """
    # The rate of the cars that drove.
    driven = design.driven(CONFIDENCE)
    simulated = design.simulated(CONFIDENCE) if design.runs else None
    row = None if belief is None else belief.row_of(design)
    if belief is None or row is None:
        return DesignComparison(design, driven, simulated)
    # The rate expected of a further car.
    built = built_rate(belief, row)
    if not design.runs:
        return DesignComparison(design, driven, simulated, built)
    gap = _gap(belief, [design])
    return DesignComparison(design, driven, simulated, built, gap, gap.verdict(margin))


def built_rate(belief: Belief, row: int) -> Rate:
    """Return the success rate expected of a further built car; ``row`` is the index of its design in the belief."""
    estimate = belief.answers.built[row]
    return Rate(estimate.value, estimate.low, estimate.high, CONFIDENCE, "realities weighed by all trials")


def _gap(belief: Belief, designs: Sequence[DesignEvidence]) -> Gap:
    """Return the mean gap between simulation and reality over the designs, with its interval.

    A design's gap is the success rate of a further car that is built, minus the design's success rate in simulation. The
    ``belief`` is a probability distribution, learned from runs and trials. Its ``answers.rates`` (draws, designs) are
    samples of the built cars' rates. The designs must have runs. Designs that are not part of the belief are left out.
    """
    rows = [row for row in map(belief.row_of, designs) if row is not None]
    passed_runs = numpy.array([belief.designs[row].runs_passed for row in rows])
    failed_runs = numpy.array([belief.designs[row].runs for row in rows]) - passed_runs
    built_rates = belief.answers.rates[:, rows]
    # The simulated rates are known from a number of runs only. So they are drawn from their posterior distribution, a
    # beta distribution under Jeffreys' prior.
    random = numpy.random.default_rng(GAP_SEED)
    simulated_rates = random.beta(passed_runs + JEFFREYS, failed_runs + JEFFREYS, built_rates.shape)
    mean_gaps = (built_rates - simulated_rates).mean(axis=1)
    # The function takes a table with a column for each quantity. Here there is one.
    (estimate,) = estimates(mean_gaps[:, None], belief.answers.draws.weights)
    return Gap(estimate.value, estimate.low, estimate.high, CONFIDENCE)


def _counts_text(compared: Sequence[DesignComparison]) -> str:
    """Return a sentence on how many trials and runs passed at each design."""
    texts = []
    for design in compared:
        evidence = design.evidence
        text = f"{evidence.trials_passed} of {count(len(evidence.trials), 'trial')} at {design.label}"
        if evidence.runs:
            text += f" ({evidence.runs_passed} of {count(evidence.runs, 'run')})"
        texts.append(text)
    return f"Passed: {listed(texts)}."


def _verdict(compared: Sequence[DesignComparison], mean_gap: Gap, margin: float, simulation: str) -> tuple[str, str]:
    """Return the experiment's verdict and a sentence that explains it.

    Three things are asked, in this order. Is simulation optimistic or pessimistic at single designs? Is it so on average?
    Do simulation and trials agree at some designs? ``simulation`` names the simulation in the sentence.
    """
    labels_by_verdict: dict[str, list[str]] = {}
    for design in compared:
        if design.verdict is not None:
            labels_by_verdict.setdefault(design.verdict, []).append(design.label)
    subject = simulation[0].upper() + simulation[1:]
    average = _average_text(compared, mean_gap, simulation)
    # The verdict TOO_FEW is also the words "too few cars or trials".
    undecided_designs = ""
    if TOO_FEW in labels_by_verdict:
        undecided_designs = f"; {TOO_FEW} to say at {listed(labels_by_verdict[TOO_FEW])}"
    contradictions = [verdict for verdict in (OPTIMISTIC, PESSIMISTIC) if verdict in labels_by_verdict]
    if contradictions:
        text = " and ".join(f"{verdict} at {listed(labels_by_verdict[verdict])}" for verdict in contradictions)
        verdict = contradictions[0] if len(contradictions) == 1 else "mixed"
        return verdict, f"{subject} is {text}{undecided_designs}; {average}."
    mean_verdict = mean_gap.verdict(margin)
    if mean_verdict in (OPTIMISTIC, PESSIMISTIC):
        return mean_verdict, f"{subject} is {mean_verdict} {average}; no single design shows it."
    within = f"within {points_text(margin)}"
    if AGREES not in labels_by_verdict:
        return TOO_FEW, f"{TOO_FEW.capitalize()} to say whether {simulation} and trials agree {within}; {average}."
    all_agree = mean_verdict == AGREES and TOO_FEW not in labels_by_verdict
    agreeing_designs = listed(labels_by_verdict[AGREES])
    sentence = f"{subject} and trials agree {within} at {agreeing_designs}{undecided_designs}; {average}."
    return AGREES if all_agree else TOO_FEW, sentence


def _average_text(compared: Sequence[DesignComparison], mean_gap: Gap, simulation: str) -> str:
    """Return the mean gap in words, and how many trials ended as simulated in their environment."""
    difference = f"built cars pass as often as {simulation}"
    if round(100 * mean_gap.value):
        direction = "less" if mean_gap.value < 0 else "more"
        difference = f"built cars pass {points_text(mean_gap.value)} {direction} often than {simulation}"
    designs = sum(design.gap is not None for design in compared)
    interval = f"{points(mean_gap.low)} to {points(mean_gap.high)}"
    text = f"on average over {count(designs, 'design')}, {difference} (95 %: {interval})"
    paired_trials = sum(design.paired for design in compared)
    if paired_trials:
        agreeing_trials = sum(design.agreeing for design in compared)
        text += f"; {agreeing_trials} of {count(paired_trials, 'trial')} ended as simulated in the same environment"
    return text


def _overall(experiments: Sequence[ExperimentComparison]) -> str:
    """Return the sentences of all experiments, with a warning if several builds of one engine simulated them."""
    if not experiments:
        return "Nothing to compare: the store has no runs yet; sweep the listing into it with `foldcar sweep`."
    if len(experiments) == 1:
        return experiments[0].sentence
    sentences = [f"Experiment {experiment.info.id}: {experiment.sentence}" for experiment in experiments]
    builds_by_engine: dict[str, set[str]] = {}
    for experiment in experiments:
        builds_by_engine.setdefault(experiment.info.engine, set()).add(experiment.info.carsim_build)
    # Each engine has its own build, so two engines may be compared.
    most_builds = max(len(builds) for builds in builds_by_engine.values())
    if most_builds > 1:
        sentences.append(f"The experiments were simulated by {most_builds} builds of carsim: do not compare them.")
    return " ".join(sentences)
