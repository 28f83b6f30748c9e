"""Runs the host's tests with a mutant in place of one module.

The working tree is only read: Python started for the tests, and by them, imports the module from another file
(tools/planted). Libraries are imported once (test_server.py there), and of a test file the quick tests run first
(quick_first.py): most mutants fail one of them.
"""

import hashlib
import json
import math
import os
import subprocess
import threading
import time
from pathlib import Path

from mutants import Mutant
from mutation_build import BuildError, Processes, StoppedError, Verdict

PLANTED = Path(__file__).resolve().parent / "planted"
# Tests with a mutant may take three times their own time and this much longer: a machine may have become busy since.
SLACK_S = 60.0


class PythonWorkshop(Processes):
    """Judges mutants of the host's modules by what ``python`` tests. ``times_s`` are those of test files without any.

    What a test file says of a mutant is kept for as long as the host's sources and the file are the same.
    """

    def __init__(self, root: Path, work: Path, python: Path) -> None:
        super().__init__()
        self.root = root
        self.work = work
        self.python = python
        self.times_s: dict[str, float] = {}
        self._threads = threading.local()
        self.kept = work / "host_verdicts"
        self.kept.mkdir(parents=True, exist_ok=True)
        sources = sorted((root / "host").rglob("*.py"))
        self.sources = hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()

    def prepare(self, suite: str) -> None:
        """Measure a test file's times. BuildError if it fails without any mutant."""
        kept = self._kept(suite, "none", "")
        start = time.monotonic()
        if not kept.is_file():
            if not self._passes(suite, {"TEST_TIMES": str(self._times(suite))}, 600):
                raise BuildError(f"{suite} fails without a mutant: mend it first")
            kept.write_text(f"{time.monotonic() - start:.1f}", encoding="utf-8")
        self.times_s[suite] = float(kept.read_text(encoding="utf-8"))

    def judge(self, source: Path, mutant: Mutant, suites: list[str]) -> Verdict:
        """Run the test files with a mutant of ``source``, until one fails."""
        file = self.work / f"planted.{threading.get_ident()}.py"
        file.write_text(mutant.text, encoding="utf-8")
        module = ".".join(source.relative_to(self.root / "host").with_suffix("").parts)
        for suite in suites:
            kept = self._kept(suite, module, mutant.text)
            if not kept.is_file():
                times = str(self._times(suite))
                planted = {"PLANTED_MODULE": module, "PLANTED_FILE": str(file), "TEST_TIMES": times}
                passes = self._passes(suite, planted, 3 * self.times_s[suite] + SLACK_S)
                kept.write_text("survived" if passes else "killed", encoding="utf-8")
            if kept.read_text(encoding="utf-8") == "killed":
                return Verdict("killed", suite)
        return Verdict("survived")

    def _kept(self, suite: str, module: str, text: str) -> Path:
        """The file of what a test file says of a module with that text."""
        parts = (self.sources, module, text, (self.root / "test" / "host" / suite).read_text(encoding="utf-8"))
        return self.kept / hashlib.sha256("\0".join(parts).encode()).hexdigest()

    def _times(self, suite: str) -> Path:
        return self._kept(suite, "none", "").with_suffix(".json")

    def _passes(self, suite: str, planted: dict[str, str], limit_s: float) -> bool:
        request = {
            "words": ["-q", "-x", "-p", "no:cacheprovider", "-p", "quick_first", f"test/host/{suite}"],
            "environment": planted,
            "limit_s": math.ceil(limit_s),
        }
        server = self._server()
        assert server.stdin is not None and server.stdout is not None
        server.stdin.write(json.dumps(request).encode() + b"\n")
        server.stdin.flush()
        code = server.stdout.readline()
        if not code:
            raise StoppedError
        return int(code) == 0

    def _server(self) -> "subprocess.Popen[bytes]":
        """This thread's tools/planted/test_server.py."""
        if not hasattr(self._threads, "server"):
            if self._stopping.is_set():
                raise StoppedError
            command = [str(self.python), str(PLANTED / "test_server.py")]
            environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(PLANTED)}
            self._threads.server = subprocess.Popen(
                command, cwd=self.root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
            self._running.add(self._threads.server)
        server: subprocess.Popen[bytes] = self._threads.server
        return server
