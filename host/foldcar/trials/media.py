"""Photos and films that appear in a folder, as a phone or a camera puts them there, and the trial that each belongs to.

Input: a folder that is looked at a few times a second. Output: files that have stopped growing, with their trials.
"""

import time
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.store.trial_records import MEDIA_ENDINGS

PERIOD_S = 0.5
# A file whose size and time have not changed for so long is whole; a network's pauses are shorter.
SETTLED_S = 2.0


def media_kind(file: Path) -> str:
    """The kind of a photo or film by the ending of its name; FoldcarError if it is neither."""
    for kind, endings in MEDIA_ENDINGS.items():
        if file.suffix.lower() in endings:
            return kind
    known = ", ".join(ending for endings in MEDIA_ENDINGS.values() for ending in endings)
    raise FoldcarError(f"{file}: is neither a photo nor a film by its name, which ends with none of {known}")


def is_growing(file: Path) -> bool:
    """Whether it was changed a moment ago."""
    try:
        return 0 <= time.time() - file.stat().st_mtime < SETTLED_S
    except OSError:
        return False


class Arrivals:
    """A folder, or none. What is there at the beginning belongs to no trial.

    A file that appears during a session belongs to the trial that was set up, driven or judged when it was last changed,
    so that the end of a long film may arrive late; to that of its arrival if its time is from before the session.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._begun: list[tuple[float, int]] = []
        self._known = {file for file, _ in self._files()}
        # Of those that came since: what they were like, and when they were last seen to change.
        self._growing: dict[Path, tuple[tuple[int, int], float, int]] = {}
        self._next_s = 0.0

    def begin(self, trial: int) -> None:
        """A trial is being set up."""
        self._begun.append((time.time(), trial))

    def look(self, at_once: bool = False) -> None:
        """See what has come or grown, each PERIOD_S or ``at_once``."""
        now_s = time.monotonic()
        if self._folder is None or not self._begun or (now_s < self._next_s and not at_once):
            return
        self._next_s = now_s + PERIOD_S
        found = dict(self._files())
        for file, like in found.items():
            if file not in self._known:
                before = self._growing.get(file)
                if before is None or before[0] != like:
                    trial = self._begun[-1][1] if before is None else before[2]
                    self._growing[file] = like, now_s, trial
        self._growing = {file: one for file, one in self._growing.items() if file in found}

    def waiting(self) -> list[Path]:
        """What has come and may still grow."""
        return [file for file, (_, since_s, _) in self._growing.items() if time.monotonic() - since_s < SETTLED_S]

    def take(self) -> list[tuple[int, Path]]:
        """The files that are whole, each once, with the numbers of their trials."""
        taken = []
        growing = self.waiting()
        for file in [file for file in self._growing if file not in growing]:
            (changed_ns, _), _, arrived = self._growing.pop(file)
            self._known.add(file)
            trials = [trial for begun_s, trial in self._begun if begun_s <= changed_ns / 1e9]
            taken.append((trials[-1] if trials else arrived, file))
        return taken

    def _files(self) -> list[tuple[Path, tuple[int, int]]]:
        """Photos and films there, with the last changes (ns) and sizes; hidden ones are a copy's beginning."""
        if self._folder is None:
            return []
        found = []
        try:
            for file in sorted(self._folder.iterdir()):
                endings = (ending for some in MEDIA_ENDINGS.values() for ending in some)
                if file.suffix.lower() in endings and not file.name.startswith("."):
                    status = file.stat()
                    found.append((file, (status.st_mtime_ns, status.st_size)))
        except OSError:
            # Renamed, or the folder is unplugged: what comes back is looked at again.
            return found
        return found
