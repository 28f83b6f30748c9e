"""Assigns photos and films that a phone or camera puts into a folder to the trials that they belong to.

Input: a folder, the times when trials begin. Output: files that have stopped growing, with their trials.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from foldcar.errors import FoldcarError
from foldcar.read_files import FileState, file_state
from foldcar.shown_text import shown_line
from foldcar.store.trial_records import MEDIA_ENDINGS
from foldcar.trials.person import IDLE_S, print_line

# A file that was not changed for this long is complete; pauses of a network are shorter.
SETTLED_S = 2.0


def media_kind(file: Path) -> str:
    """Return the kind of a photo or film by its name's suffix. Raises FoldcarError if it is neither."""
    for kind, suffixes in MEDIA_ENDINGS.items():
        if file.suffix.lower() in suffixes:
            return kind
    suffix_list = ", ".join(ending for suffixes in MEDIA_ENDINGS.values() for ending in suffixes)
    raise FoldcarError(f"{file}: is neither a photo nor a film; its name must end with one of {suffix_list}")


def _changed_s(file: Path) -> float:
    """Return when a file was last changed (s since 1970); 0 if it is missing."""
    try:
        return file.stat().st_mtime
    except OSError:
        return 0.0


class _Observation(NamedTuple):
    """The state of a file, and when the file was first seen in this state (s, monotonic)."""

    state: FileState | None
    first_seen_s: float


class Arrivals:
    """A folder to watch, or None. Files that are in it at the beginning belong to no trial.

    A file that appears during a session belongs to the trial that was in progress when the file was last changed, so
    that a long film may arrive late. If the file is older than the session, it belongs to the last trial.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        # When each trial began to be set up (s since 1970), and the trial's number.
        self._begun: list[tuple[float, int]] = []
        # What was seen of files whose times are in the future.
        self._observations: dict[Path, _Observation] = {}
        # The files that are not new: those that were returned, and all that are in the folder now.
        self._known: set[Path] = set()
        self._known.update(self._new())

    def begin(self, trial: int) -> None:
        """Record that ``trial`` begins to be set up now."""
        self._begun.append((time.time(), trial))

    def is_growing(self, file: Path) -> bool:
        """Return whether the file was changed in the last SETTLED_S.

        A camera with a wrong clock may give a file a time in the future. Such a file is observed instead: it is growing
        until its size and time have stayed the same for SETTLED_S.
        """
        age_s = time.time() - _changed_s(file)
        if age_s >= 0:
            return age_s < SETTLED_S
        now_s = time.monotonic()
        state = file_state(file)
        observation = self._observations.get(file)
        if observation is None or observation.state != state:
            observation = self._observations[file] = _Observation(state, first_seen_s=now_s)
        return now_s - observation.first_seen_s < SETTLED_S

    def wait_until_complete(self, file: Path, idle: Callable[[], None]) -> None:
        """Wait until a file has stopped growing; ``idle`` is called again and again meanwhile."""
        while self.is_growing(file):
            idle()
            time.sleep(IDLE_S)

    def wait_for_growing(self, idle: Callable[[], None]) -> None:
        """Wait until no new file grows, and print which files do; ``idle`` is called again and again meanwhile."""
        while growing := self.growing():
            print_line(f"waiting until {', '.join(shown_line(file.name) for file in growing)} stops growing")
            while self.growing() == growing:
                idle()
                time.sleep(IDLE_S)

    def growing(self) -> list[Path]:
        """Return the new files that may still grow."""
        return [file for file in self._new() if self.is_growing(file)]

    def take(self) -> list[tuple[int, Path]]:
        """Return (trial number, file) of the new complete files; each file is returned once."""
        if not self._begun:
            return []
        trial_files = []
        for file in self._new():
            if self.is_growing(file):
                continue
            self._known.add(file)
            # A file belongs to the last trial that had begun when the file was changed. ``_begun`` has pairs: the time
            # at which a trial began, and its number.
            trials_before = [trial for begun_s, trial in self._begun if begun_s <= _changed_s(file)]
            # A file may be older than the session: a camera has set its time when it recorded it, and the person has
            # copied it into the folder now. So it belongs to the last trial.
            _, last_trial = self._begun[-1]
            trial_files.append((trials_before[-1] if trials_before else last_trial, file))
        return trial_files

    def _new(self) -> list[Path]:
        """Return the new photos and films, without hidden files, which are unfinished copies."""
        suffixes = [ending for kind_endings in MEDIA_ENDINGS.values() for ending in kind_endings]
        try:
            files = sorted(self._folder.iterdir()) if self._folder else []
        except OSError:
            # An unplugged folder may come back.
            return []
        media_files = (file for file in files if file.suffix.lower() in suffixes and not file.name.startswith("."))
        return [file for file in media_files if file not in self._known]
