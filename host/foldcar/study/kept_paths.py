"""Which paths a sweep keeps beside its results, so that a page can show the runs without simulating them again.

Input: how runs ended, in the order in which they are simulated. Output: whether to keep a run's path. A bounded number:
each shown design's first of each ending, and as many of the others as fit, which are those of the first samples.
"""

from collections.abc import Iterable

from foldcar.simulation.results import OUTCOMES

# Failed runs have no path, and those of a program's own ending are not the simulator's alone.
REPLAYED = tuple(name for name in OUTCOMES if name in ("passed", "tipped", "stuck", "off_course", "timeout", "fault"))
# Before compression; a third of it is left in the page. 160 bytes are a second of a run, the width study has 2.7 million.
MAX_BYTES = 3_000_000
MAX_RUNS = 5_000
# More cannot be told apart on a screen.
MAX_DESIGNS = 400


def shown_designs(count: int) -> list[int]:
    """The places of the designs that a page shows: all, or as many as fit, evenly spread over the family."""
    if count <= MAX_DESIGNS:
        return list(range(count))
    return [place * (count - 1) // (MAX_DESIGNS - 1) for place in range(MAX_DESIGNS)]


class KeptPaths:
    """The paths kept of one experiment; ``designs`` is how many it has, None if that is not known yet.

    ``known`` are those in the store: design, outcome and characters of each.
    """

    def __init__(self, designs: int | None, known: Iterable[tuple[int, str, int]] = ()) -> None:
        self._shown = None if designs is None else set(shown_designs(designs))
        self._endings: set[tuple[int, str]] = set()
        self._runs, self._bytes = 0, 0.0
        for one in known:
            self._count(*one)

    def wants(self, design: int) -> bool:
        """Whether a path of the design could be kept."""
        return self._shown is None or design in self._shown

    def keeps(self, design: int, outcome: str, characters: int) -> bool:
        """Whether to keep the path of a run that has ended so, of so many characters in base64; if so it is counted."""
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
