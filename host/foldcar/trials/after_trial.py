"""Changes that a person makes to a trial directly after it: another outcome, a note, or that the trial does not count.

Input: the stored trial, answers. Output: corrections of the trial in the store.
"""

from dataclasses import replace

from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import TrialWriter
from foldcar.trials.person import PersonAnswers, print_line
from foldcar.trials.recording import OUTCOME_KEYS, OUTCOME_QUESTION

KEPT_KEYS = {"k": "kept", "w": "withdrawn"}
# The reasons that are stored with corrections.
CORRECTED_AT_ONCE, REPEATED_AT_ONCE = "said at once after the trial", "driven again at once"


class StoredTrial:
    """The trial that was driven last; ``ending`` is how it was stored. Its methods raise StoreError."""

    def __init__(self, writer: TrialWriter, number: int, ending: Ending, operator: str, answers: PersonAnswers) -> None:
        self._writer = writer
        self._number = number
        self._ending = ending
        self._operator = operator
        self._answers = answers

    def ask_outcome(self) -> None:
        """Ask for the outcome. A different one is stored as a correction, so that the store keeps the first one, too."""
        old = self._ending.outcome
        outcome = self._answers.choice(f"{OUTCOME_QUESTION} [{old}]: ", OUTCOME_KEYS, old)
        if outcome != old:
            self._writer.correct(self._number, {"outcome": outcome}, CORRECTED_AT_ONCE, self._operator)
            self._ending = replace(self._ending, outcome=outcome)
        print_line(f"Trial {self._number}: {outcome}")

    def add_note(self, text: str) -> None:
        """Add a text to the note of the trial."""
        note = f"{self._ending.note}; {text}" if self._ending.note else text
        self._ending = replace(self._ending, note=note)
        self._writer.complete(self._number, self._ending)
        print_line(f"Trial {self._number}: {note}")

    def ask_whether_kept(self) -> None:
        """Ask whether the trial, which is driven again, is kept or withdrawn. A withdrawn one counts in no rate."""
        question = f"Trial {self._number} is (k)ept or (w)ithdrawn [kept]: "
        if self._answers.choice(question, KEPT_KEYS, "kept") == "withdrawn":
            self._writer.withdraw([self._number], withdrawn=True, reason=REPEATED_AT_ONCE, operator=self._operator)
