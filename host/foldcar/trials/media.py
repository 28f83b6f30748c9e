"""Photos and films that appear in a folder, as a phone or a camera puts them there, and the trial that each belongs to.

Input: a folder, when trials begin. Output: files that have stopped growing, with their trials.
"""

import time
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.read_files import FileState, file_state
from foldcar.store.trial_records import MEDIA_ENDINGS

# A file that was not changed for so long is whole; a network's pauses are shorter.
SETTLED_S = 2.0


def media_kind(file: Path) -> str:
    """The kind of a photo or film by the ending of its name; FoldcarError if it is neither."""
    for kind, endings in MEDIA_ENDINGS.items():
        if file.suffix.lower() in endings:
            return kind
    known = ", ".join(ending for endings in MEDIA_ENDINGS.values() for ending in endings)
    raise FoldcarError(f"{file}: is neither a photo nor a film by its name, which ends with none of {known}")


def _changed_s(file: Path) -> float:
    try:
        return file.stat().st_mtime
    except OSError:
        return 0.0


class Arrivals:
    """A folder, or none. What is there at the beginning belongs to no trial.

    A file that appears during a session belongs to the trial that was set up, driven or judged when it was last changed,
    so that the end of a long film may arrive late; if its time is from before the session, to the last one.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._begun: list[tuple[float, int]] = []
        # By files whose times are in the future: their states, and since when these are known.
        self._states: dict[Path, tuple[FileState | None, float]] = {}
        self._known: set[Path] = set()
        self._known |= set(self._new())

    def begin(self, trial: int) -> None:
        """A trial is being set up."""
        self._begun.append((time.time(), trial))

    def is_growing(self, file: Path) -> bool:
        """Whether the file was changed a moment ago; if its time is in the future, whether it was seen to change."""
        age_s = time.time() - _changed_s(file)
        if age_s >= 0:
            return age_s < SETTLED_S
        state, now_s = file_state(file), time.monotonic()
        if self._states.get(file, (None, 0.0))[0] != state:
            self._states[file] = state, now_s
        return now_s - self._states[file][1] < SETTLED_S

    def growing(self) -> list[Path]:
        """What has come and may still grow."""
        return [file for file in self._new() if self.is_growing(file)]

    def take(self) -> list[tuple[int, Path]]:
        """The files that are whole, each once, with the numbers of their trials."""
        taken = []
        for file in self._new() if self._begun else []:
            if not self.is_growing(file):
                self._known.add(file)
                trials = [trial for begun_s, trial in self._begun if begun_s <= _changed_s(file)]
                taken.append(((trials or [self._begun[-1][1]])[-1], file))
        return taken

    def _new(self) -> list[Path]:
        """Photos and films that came since; hidden ones are the beginnings of copies."""
        endings = [ending for some in MEDIA_ENDINGS.values() for ending in some]
        try:
            files = sorted(self._folder.iterdir()) if self._folder else []
        except OSError:
            # An unplugged folder may come back.
            return []
        seen = (file for file in files if file.suffix.lower() in endings and not file.name.startswith("."))
        return [file for file in seen if file not in self._known]
