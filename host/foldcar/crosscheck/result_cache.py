"""Results kept as JSON Lines, one a run, by a hash of all they depend on: what is there is not run again.

A line is written whole as soon as its run is done; one that an interrupt has torn is passed over.
"""

import hashlib
import json
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from foldcar.errors import FoldcarError


def result_key(*parts: Any) -> str:
    """The hash of JSON values."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


class ResultCache:
    """``with ResultCache(file) as cache``: look up with ``get``, keep with ``put``."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._results: dict[str, dict[str, Any]] = {}
        self._open: BinaryIO | None = None

    def __enter__(self) -> "ResultCache":
        torn = False
        try:
            if self._file.exists():
                text = self._file.read_text(encoding="utf-8")
                torn = bool(text) and not text.endswith("\n")
                for line in text.splitlines():
                    self._read(line)
            # Without a buffer, so that nothing is left to write after a write that failed.
            self._open = self._file.open("ab", buffering=0)
        except (OSError, UnicodeDecodeError) as error:
            raise FoldcarError(f"{self._file}: cannot be used: {error}") from error
        if torn:
            self._append("\n")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._open is not None:
            self._open.close()

    def get(self, key: str) -> dict[str, Any] | None:
        """The result of that key, if there is one."""
        return self._results.get(key)

    def put(self, key: str, engine: str, result: dict[str, Any]) -> None:
        """Keep a result; ``engine`` is for readers of the file."""
        self._results[key] = result
        self._append(json.dumps({"key": key, "engine": engine, "result": result}) + "\n")

    def _append(self, text: str) -> None:
        assert self._open is not None
        line = text.encode()
        try:
            written = self._open.write(line)
        except OSError as error:
            raise FoldcarError(f"{self._file}: cannot be written: {error.strerror}") from error
        if written != len(line):
            raise FoldcarError(f"{self._file}: cannot be written: the disk is full")

    def _read(self, line: str) -> None:
        try:
            entry = json.loads(line)
            self._results[entry["key"]] = entry["result"]
        except (ValueError, TypeError, KeyError):
            return
