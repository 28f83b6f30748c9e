"""Copies the logs of trials into the folder of the store that gets the trials.

Input: rows of trials of another store. Output: the names of the copies; the copies, which are made all or none.
"""

import os
import shutil
from pathlib import Path

from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.rows import Row

# How many characters of a trial's UUID are added to the name of a log whose name is taken.
UUID_CHARACTERS = 8


class LogCopies:
    """Copies of logs into the folder of ``store``. They are planned one by one with :meth:`plan`, and then made."""

    def __init__(self, store: Path) -> None:
        self._store = store
        # The log to copy, by the path of its copy.
        self._planned: dict[Path, Path] = {}
        self._made: list[Path] = []

    def plan(self, other_store: Path, trial: Row) -> str:
        """Plan to copy the log of a trial of ``other_store``, and return the name of the copy.

        If another log has the same name, a part of the trial's UUID is added to the name. Raises StoreError if another
        log has this name, too.
        """
        name = Path(trial["log"])
        log = log_file(other_store, trial["log"])
        digest = sha256_of(log)
        if digest is None:
            # The log is missing, so there is nothing to copy.
            return str(trial["log"])
        name_with_uuid = name.with_stem(f"{name.stem}-{trial['uuid'][:UUID_CHARACTERS]}")
        for candidate in (name, name_with_uuid):
            copy = log_file(self._store, str(candidate))
            # The log that will have this name: one that is planned, or a file that exists already.
            log_of_this_name = self._planned.get(copy, copy)
            digest_of_this_name = sha256_of(log_of_this_name)
            is_free = digest_of_this_name is None
            if is_free or digest_of_this_name == digest:
                if not os.path.lexists(copy):
                    self._planned[copy] = log
                return str(candidate)
        raise StoreError(f"{copy}: already exists with other contents; move it away first")

    def make(self) -> None:
        """Copy the planned logs."""
        for copy, log in self._planned.items():
            copy.parent.mkdir(parents=True, exist_ok=True)
            self._made.append(copy)
            shutil.copyfile(log, copy)

    def delete(self) -> None:
        """Delete the copies that were made, because the store does not get their trials after all."""
        for copy in self._made:
            copy.unlink(missing_ok=True)
