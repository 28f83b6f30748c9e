"""Remarks on evidence, in sentences: what is missing, left out or assumed."""

from collections import Counter
from collections.abc import Iterable, Sequence

from foldcar.evidence.design_evidence import DesignEvidence
from foldcar.statistics.words import count
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED, Trial
from foldcar.study.reality_runs import missing_realities

# Number of designs that one remark names.
SHOWN = 5


def runs(store: Store, info: ExperimentInfo) -> list[str]:
    """Return remarks on runs: what their engine cannot simulate, how many are missing or rejected."""
    sentences = [info.warning] if info.warning else []
    if info.is_over_realities:
        sentences.append(
            "Rates are expected over realities, before any trial: each environment was simulated with random values of "
            "what the simulator does not know. They are not the rates of nominal simulation."
        )
    if info.stored_runs < info.planned_runs:
        # A stopping rule makes fewer runs if it decides designs early.
        planned = f"at most {info.planned_runs:,}" if info.until is not None else f"{info.planned_runs:,}"
        stored = f"{info.stored_runs:,} of {planned} planned runs are here"
        sentences.append(f"Unfinished: {stored}. If the sweep does not run any more, its command resumes it.")
    if info.realities and not info.searched:
        missing = missing_realities(store, info)
        if missing:
            stored = f"{info.realities - missing:,} of {info.realities:,} planned runs in other realities are here"
            sentences.append(f"Unfinished: {stored}. If the sweep does not run any more, its command resumes it.")
    counts = store.design_counts(info.id) if info.stored_runs else None
    rejected = 0 if counts is None else sum(counts.runs) - sum(counts.counted)
    if counts is not None and rejected:
        all_rejected = sum(runs > 0 and not counted for runs, counted in zip(counts.runs, counts.counted, strict=True))
        have = "has" if all_rejected == 1 else "have"
        no_rate = f" {count(all_rejected, 'design')} {have} no other run, and so no rate." if all_rejected else ""
        they_violated = "was rejected: it violated" if rejected == 1 else "were rejected: they violated"
        sentences.append(
            f"{rejected:,} of {count(sum(counts.runs), 'run')} {they_violated} a requirement of the program. Scenic "
            f"discards such runs, which count neither as passed nor as not passed.{no_rate}"
        )
    return sentences


def trials(info: ExperimentInfo, kept: Sequence[Trial]) -> list[str]:
    """Return remarks on trials that are compared with runs: what was simulated, how many were corrected."""
    sentences = []
    if info.under is not None and kept:
        sentences.append(f"The runs are of {info.under}: its parameters come from a file, not from trials.")
    simulated = sum(trial.standing == SIMULATED for trial in kept)
    if simulated:
        sentences.append(f"SIMULATED cars drove {simulated} of {count(len(kept), 'trial')}.")
    corrected = sum(trial.corrections > 0 for trial in kept)
    if corrected:
        sentences.append(f"{count(corrected, 'trial')} corrected afterwards: the latest correction counts.")
    return sentences


def trials_beside_realities(info: ExperimentInfo, number: int) -> list[str]:
    """Return a remark on trials of the listed experiment, which are not compared with rates over realities."""
    if not number:
        return []
    return [
        f"{count(number, 'trial')} left out, because these rates are those before any trial: sweep experiment "
        f"{info.listed_id} to compare."
    ]


def trials_in_other_environments(programs: Iterable[str | None], info: ExperimentInfo) -> list[str]:
    """Return a remark for each Scenic program of trials that were driven in another environment than the runs."""
    sentences = []
    for program, number in Counter(programs).items():
        left_out = f"{count(number, 'trial')} left out: driven"
        if program == info.scenic_program and info.under is not None:
            sentences.append(
                f"{left_out} in the nominal scenes of {program}, which the {info.under} changes. Experiment "
                f"{info.listed_id} compares them."
            )
        elif program == info.scenic_program:
            sentences.append(
                f"{left_out} in other samples of {program} than the runs: its text, files beside it, its parameters or "
                "seed, or foldcar have changed. Sweep the environment as it was then to compare them."
            )
        else:
            sentences.append(f"{left_out} in {program or 'an unknown program'}, not in {info.scenic_program}.")
    return sentences


def trials_driven_otherwise(differences: Iterable[str]) -> list[str]:
    """Return a remark for each way in which trials were driven otherwise than the runs, with the number of trials."""
    return [
        f"{count(number, 'trial')} left out, not driven as the runs: {difference}."
        for difference, number in Counter(differences).items()
    ]


def unswept_designs(designs_and_reasons: Sequence[tuple[DesignEvidence, str | None]]) -> list[str]:
    """Return remarks on the designs that have trials but no stored runs.

    The reason says why a design cannot be simulated; it is None if the design was simulated now. More than SHOWN designs
    with the same reason share a remark.
    """
    by_reason: dict[str | None, list[DesignEvidence]] = {}
    for design, reason in designs_and_reasons:
        by_reason.setdefault(reason, []).append(design)
    sentences = []
    for reason, designs in by_reason.items():
        # The beginnings of both halves of a sentence.
        subjects = [(f"{design.label} is", "it was") for design in designs]
        if len(designs) > SHOWN:
            subjects = [(f"{_shown_names([design.label for design in designs])} are", "they were")]
        for name_is, they_were in subjects:
            if reason is None:
                sentences.append(
                    f"{name_is} not in the sweep: {they_were} simulated now, in {count(designs[0].runs, 'environment')}."
                )
            else:
                sentences.append(f"{name_is} not in the sweep, and cannot be simulated now: {reason}.")
    return sentences


def cars_of_designs(designs: Sequence[DesignEvidence]) -> list[str]:
    """Return a remark on trials without a car's name."""
    sentences = []
    nameless = [design.label for design in designs if [trial.car_name for trial in design.trials].count(None) > 1]
    if nameless:
        sentences.append(
            f"Trials without a car's name are taken for those of one car of their design, at {_shown_names(nameless)}: "
            "`foldcar log --car` and `foldcar trials correct --car` tell cars apart."
        )
    return sentences


def pairs(designs: Sequence[DesignEvidence]) -> list[str]:
    """Return remarks on trials with a new run or none in their environment, and on repeated environments."""
    sentences = []
    all_trials = [trial for design in designs for trial in design.trials]
    resimulated = sum(trial.resimulated for trial in all_trials)
    if resimulated:
        was_placed = "was placed otherwise than planned, or has no stored run"
        were_placed = "were placed otherwise than planned, or have no stored run"
        reason = was_placed if resimulated == 1 else were_placed
        sentences.append(f"{count(resimulated, 'trial')} {reason}: simulated again as placed.")
    unpaired = sum(trial.simulated is None for trial in all_trials)
    if unpaired:
        of_trials = f"{unpaired} of {count(len(all_trials), 'trial')}"
        sentences.append(
            f"{of_trials} cannot be paired with a run: the environment is unknown or was not simulated, its run was "
            f"rejected, or it is not known how the obstacles stood. {'It counts' if unpaired == 1 else 'They count'} by "
            "the rate alone."
        )
    samples_of_designs = [[trial.sample for trial in design.trials if trial.sample is not None] for design in designs]
    repeated = sum(len(samples) - len(set(samples)) for samples in samples_of_designs)
    if repeated:
        verb = "repeats" if repeated == 1 else "repeat"
        sentences.append(
            f"{count(repeated, 'trial')} {verb} an environment of the same design. Intervals assume independent "
            "environments, so they are too narrow."
        )
    return sentences


def _shown_names(names: Sequence[str]) -> str:
    # Names of several parameters have commas themselves.
    shown = ("; " if any("," in name for name in names) else ", ").join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {count(len(names) - SHOWN, 'further design')}"
