"""Counts of a sweep as it goes on, for progress bars and results."""

import time
from dataclasses import dataclass, field

from foldcar.simulation.results import REJECTED
from foldcar.study.stopping import DesignState


@dataclass
class Progress:
    """Counts of a sweep's runs: ``new`` were simulated, ``there`` before; ``passed``, ``rejected``, ``failed`` of both.

    ``judged`` of the ``total`` are in environments that define success; rejected ones leave them as experiments end. A
    sweep that stops when it knows lowers the total as designs are ``decided``, and fills ``states`` as experiments end.
    """

    total: int
    judged: int = 0
    new: int = 0
    there: int = 0
    passed: int = 0
    rejected: int = 0
    failed: int = 0
    decided: int = 0
    states: list[DesignState] = field(default_factory=list)
    started_s: float = field(default_factory=time.perf_counter)

    @property
    def done(self) -> int:
        """Runs that are in the store or share the result of a run in progress."""
        return self.new + self.there

    @property
    def seconds(self) -> float:
        """Time since the start of the sweep (s)."""
        return time.perf_counter() - self.started_s

    def count(self, outcome: str | None, runs: int = 1) -> None:
        """Count ``runs`` runs of the study with that outcome."""
        self.passed += runs * (outcome == "passed")
        self.rejected += runs * (outcome == REJECTED)
        self.failed += runs * (outcome == "failed")
