"""Remarks on evidence, in sentences: what is missing, left out or assumed."""

from collections import Counter
from collections.abc import Iterable, Sequence

from foldcar.evidence.design_evidence import DesignEvidence
from foldcar.statistics.words import count
from foldcar.store.designs import DesignCounts
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED, Trial
from foldcar.study.reality_runs import missing_realities

# Number of designs that one remark names.
SHOWN = 5


def on_runs(store: Store, info: ExperimentInfo) -> list[str]:
    """Return remarks on the runs of an experiment.

    They say what the engine cannot simulate, what the rates mean, and how many runs are missing or were rejected.
    """
    sentences = [info.warning] if info.warning else []
    if info.is_over_realities:
        sentences.append(
            "Rates are averages over realities, before any trial: each environment was simulated with random values of "
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
    if info.stored_runs:
        sentences += _rejected_runs(store.design_counts(info.id))
    return sentences


def _rejected_runs(counts: DesignCounts) -> list[str]:
    """Return a remark on rejected runs, which violated a requirement of the Scenic program."""
    all_runs = sum(counts.runs)
    rejected_runs = all_runs - sum(counts.counted)
    if not rejected_runs:
        return []
    they_violated = "was rejected: it violated" if rejected_runs == 1 else "were rejected: they violated"
    sentence = (
        f"{rejected_runs:,} of {count(all_runs, 'run')} {they_violated} a requirement of the program. Scenic discards "
        "such runs, which count neither as passed nor as not passed."
    )
    runs_and_counted = zip(counts.runs, counts.counted, strict=True)
    designs_without_rate = sum(runs > 0 and counted == 0 for runs, counted in runs_and_counted)
    if designs_without_rate:
        have = "has" if designs_without_rate == 1 else "have"
        sentence += f" {count(designs_without_rate, 'design')} {have} no other run, and so no rate."
    return [sentence]


def on_trials(info: ExperimentInfo, selected_trials: Sequence[Trial]) -> list[str]:
    """Return remarks on the trials that are compared with runs.

    They say how many were driven by simulated cars, and how many were corrected afterwards. ``info.under`` describes the
    parameters of the simulator if a file has set them for the runs; otherwise it is None.
    """
    sentences = []
    if info.under is not None and selected_trials:
        sentences.append(f"The runs are of {info.under}: its parameters come from a file, not from trials.")
    by_simulated_cars = sum(trial.standing == SIMULATED for trial in selected_trials)
    if by_simulated_cars:
        sentences.append(f"SIMULATED cars drove {by_simulated_cars} of {count(len(selected_trials), 'trial')}.")
    corrected = sum(trial.corrections > 0 for trial in selected_trials)
    if corrected:
        sentences.append(f"{count(corrected, 'trial')} corrected afterwards: the latest correction counts.")
    return sentences


def trials_beside_realities(info: ExperimentInfo, number: int) -> list[str]:
    """Return a remark on trials that are left out because the runs are in random realities.

    ``number`` is the number of these trials, which belong to the listed experiment.
    """
    if not number:
        return []
    return [
        f"{count(number, 'trial')} left out, because the rates of runs in random realities do not take trials "
        f"into account. To compare the trials with simulation, sweep experiment {info.listed_id}."
    ]


def trials_in_other_environments(programs: Iterable[str | None], info: ExperimentInfo) -> list[str]:
    """Return remarks on the trials that are left out because they were driven in another environment than the runs.

    ``programs`` has the Scenic program of each of these trials, or None if it is unknown. Each program gets one remark.
    """
    sentences = []
    for program, number in Counter(programs).items():
        left_out = f"{count(number, 'trial')} left out: driven"
        # ``info.under`` names what the experiment changes in the program's scenes.
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
    """Return a remark on the trials that were driven otherwise than the runs, if there are any.

    ``differences`` has a text for each of these trials. The remark has their number, and each text once.
    """
    texts = list(differences)
    if not texts:
        return []
    return [f"{count(len(texts), 'trial')} left out, not driven as the runs: {'; '.join(dict.fromkeys(texts))}."]


def unswept_designs(designs_and_reasons: Sequence[tuple[DesignEvidence, str | None]]) -> list[str]:
    """Return remarks on the designs that have trials but no stored runs.

    The reason of a design says why it cannot be simulated. It is None if the design was simulated just now, to be
    compared. Each design has a remark, but more than SHOWN designs with the same reason share one.
    """
    designs_by_reason: dict[str | None, list[DesignEvidence]] = {}
    for design, reason in designs_and_reasons:
        designs_by_reason.setdefault(reason, []).append(design)
    sentences = []
    for reason, designs in designs_by_reason.items():
        labels = [design.label for design in designs]
        is_shared = len(designs) > SHOWN
        if reason is not None:
            explanation = f", and cannot be simulated now: {reason}."
        else:
            # Designs that are simulated now are all simulated in the same number of environments.
            environments = count(designs[0].runs, "environment")
            explanation = f": {'they were' if is_shared else 'it was'} simulated now, in {environments}."
        if is_shared:
            sentences.append(f"{_shown_names(labels)} are not in the sweep{explanation}")
        else:
            sentences += [f"{label} is not in the sweep{explanation}" for label in labels]
    return sentences


def cars_without_names(designs: Sequence[DesignEvidence]) -> list[str]:
    """Return a remark on designs that have several trials without a car's name; an empty list if there are none."""
    labels = []
    for design in designs:
        trials_without_name = sum(trial.car_name is None for trial in design.trials)
        if trials_without_name > 1:
            labels.append(design.label)
    if not labels:
        return []
    return [
        f"Some trials of {_shown_names(labels)} have no car's name. foldcar assumes that one car of each design drove "
        "them. If there were several, name them with `foldcar log --car` or `foldcar trials correct --car`."
    ]


def on_pairs(designs: Sequence[DesignEvidence]) -> list[str]:
    """Return remarks on the runs with which trials are compared, and on environments that were driven several times.

    Each trial should have a run in the same environment. Some of these runs had to be made now, and some trials have
    none.
    """
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
        they_count = "It counts" if unpaired == 1 else "They count"
        sentences.append(
            f"{of_trials} cannot be paired with a run: the environment is unknown or was not simulated, its run was "
            f"rejected, or it is not known how the obstacles stood. {they_count} by the rate alone."
        )
    repeated = 0
    for design in designs:
        samples = [trial.sample for trial in design.trials if trial.sample is not None]
        repeated += len(samples) - len(set(samples))
    if repeated:
        verb = "repeats" if repeated == 1 else "repeat"
        sentences.append(
            f"{count(repeated, 'trial')} {verb} an environment of the same design. Intervals assume independent "
            "environments, so they are too narrow."
        )
    return sentences


def _shown_names(names: Sequence[str]) -> str:
    """Join the names of designs; of more than SHOWN names, join the first SHOWN and say how many follow."""
    # The name of a design with several parameters contains commas.
    separator = "; " if any("," in name for name in names) else ", "
    shown_names = separator.join(names[:SHOWN])
    further = len(names) - SHOWN
    return shown_names if further <= 0 else f"{shown_names} and {count(further, 'further design')}"
