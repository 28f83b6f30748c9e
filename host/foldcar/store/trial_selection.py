"""Which trials count: those of built cars. Trials of simulated cars are an extra, and never counted with them.

Input: trials. Output: the kept ones, and how many of which standing are left out, as a text for the reader.
"""

from collections import Counter
from collections.abc import Iterable

from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Trial

OPTION = "--simulated-trials"

_REASONS = {
    SIMULATED: f"of a simulated car ({OPTION} shows them)",
    UNKNOWN: "of a car that may be built or simulated (tell with `foldcar trials correct` and --car)",
    WITHDRAWN: "withdrawn (`foldcar trials list` shows why)",
}


def select_trials(trials: Iterable[Trial], with_simulated: bool) -> tuple[list[Trial], Counter[str]]:
    """The trials of built cars, ``with_simulated`` also those of simulated ones; the numbers of others by standing."""
    kept, left_out = [], Counter[str]()
    for trial in trials:
        if trial.standing == BUILT or (with_simulated and trial.standing == SIMULATED):
            kept.append(trial)
        else:
            left_out[trial.standing] += 1
    return kept, left_out


def left_out_text(left_out: Counter[str]) -> str | None:
    """A sentence that says what is left out and why; None if nothing is."""
    parts = [f"{left_out[standing]} {why}" for standing, why in _REASONS.items() if left_out[standing]]
    return f"Trials left out: {'; '.join(parts)}." if parts else None
