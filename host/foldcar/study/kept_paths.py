"""Decides which paths a sweep stores, so that a page can show the runs without simulating them again.

Input: the outcomes of runs, in the order of simulation. Output: whether to store a run's path. For each shown design the
first path of each outcome is stored, and further paths until a limit is reached.
"""

from collections.abc import Iterable

from foldcar.simulation.results import OUTCOMES

# Outcomes whose paths are stored. Failed runs have none; a run that its program ends cannot be repeated by carsim alone.
REPLAYED = tuple(name for name in OUTCOMES if name in ("passed", "tipped", "stuck", "off_course", "timeout", "fault"))
# Before compression to a third in the page. A second of a run takes 160 bytes, the width study 2.7 million.
MAX_BYTES = 3_000_000
MAX_RUNS = 5_000
# More designs cannot be distinguished on a screen.
MAX_DESIGNS = 400


def shown_designs(count: int) -> list[int]:
    """Return the positions of the designs that a page shows: all, or MAX_DESIGNS, evenly spread over the family."""
    if count <= MAX_DESIGNS:
        return list(range(count))
    return [place * (count - 1) // (MAX_DESIGNS - 1) for place in range(MAX_DESIGNS)]


class KeptPaths:
    """The stored paths of one experiment; ``designs`` is its number of designs, None if it is not known yet.

    ``stored`` are the paths in the store: design, outcome and number of characters of each.
    """

    def __init__(self, designs: int | None, stored: Iterable[tuple[int, str, int]] = ()) -> None:
        self._shown = None if designs is None else set(shown_designs(designs))
        self._endings: set[tuple[int, str]] = set()
        self._runs, self._bytes = 0, 0.0
        for path in stored:
            self._count(*path)

    def wants(self, design: int) -> bool:
        """Return whether a path of the design could be stored."""
        return self._shown is None or design in self._shown

    def keeps(self, design: int, outcome: str, characters: int) -> bool:
        """Return whether to store the path of a run with this outcome and ``characters`` in base64; if so, count it."""
        if outcome not in REPLAYED or not self.wants(design):
            return False
        fits = self._runs < MAX_RUNS and self._bytes < MAX_BYTES
        if not fits and (design, outcome) in self._endings:
            return False
        self._count(design, outcome, characters)
        return True

    def _count(self, design: int, outcome: str, characters: int) -> None:
        self._endings.add((design, outcome))
        self._runs += 1
        self._bytes += characters * 3 / 4
