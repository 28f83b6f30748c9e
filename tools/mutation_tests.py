"""Runs the host's tests with a mutant in place of one module.

The working tree is only read: Python started for the tests, and by them, imports the module from another file
(tools/planted).
"""

import os
import subprocess
import threading
import time
from pathlib import Path

from mutants import Mutant
from mutation_build import SLACK_S, BuildError, Processes, Verdict

PLANTED = Path(__file__).resolve().parent / "planted"


class PythonWorkshop(Processes):
    """Judges mutants of the host's modules by what ``python`` tests. ``times_s`` are those of test files without any."""

    def __init__(self, root: Path, work: Path, python: Path) -> None:
        super().__init__()
        self.root = root
        self.work = work
        self.python = python
        self.times_s: dict[str, float] = {}
        work.mkdir(parents=True, exist_ok=True)

    def prepare(self, suite: str) -> None:
        """Measure a test file's time. BuildError if it fails without any mutant."""
        start = time.monotonic()
        if not self._passes([suite], None, 600):
            raise BuildError(f"{suite} fails without a mutant: mend it first")
        self.times_s[suite] = time.monotonic() - start

    def judge(self, source: Path, mutant: Mutant, suites: list[str]) -> Verdict:
        """Run the test files with a mutant of ``source``."""
        file = self.work / f"planted.{threading.get_ident()}.py"
        file.write_text(mutant.text, encoding="utf-8")
        module = ".".join(source.relative_to(self.root / "host").with_suffix("").parts)
        limit_s = 3 * sum(self.times_s[suite] for suite in suites) + SLACK_S
        passes = self._passes(suites, {"PLANTED_MODULE": module, "PLANTED_FILE": str(file)}, limit_s)
        return Verdict("survived" if passes else "killed")

    def _passes(self, suites: list[str], planted: dict[str, str] | None, limit_s: float) -> bool:
        files = [f"test/host/{suite}" for suite in suites]
        command = [str(self.python), "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        if planted is not None:
            environment |= {**planted, "PYTHONPATH": str(PLANTED)}
        try:
            code, _ = self.process([*command, *files], self.root, limit_s, environment)
        except subprocess.TimeoutExpired:
            return False
        return code == 0
