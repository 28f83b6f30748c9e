"""A step of the guide, and lists of numbers and names as text."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from foldcar.fabrication.assembly.drawing import Drawing
from foldcar.fabrication.assembly.operations import Operations

NOTHING = Operations()


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing and its caption."""

    drawing: Drawing
    caption: str

    @property
    def svg(self) -> Markup:
        """The drawing's SVG element, which a template does not escape."""
        return Markup(self.drawing.svg)


@dataclass(frozen=True, slots=True)
class Step:
    """One step: a title, instructions line by line, pictures, and what is done in it."""

    title: str
    lines: tuple[str, ...]
    pictures: tuple[Picture, ...] = ()
    done: Operations = NOTHING

    @property
    def effort(self) -> str:
        """What is done in it and how long that takes, as text; "" for nothing to do."""
        return effort(self.done)


# Kind of operation: singular and plural.
KINDS = {
    "piece": ("piece out of the sheet", "pieces out of the sheets"),
    "fold": ("fold", "folds"),
    "wind": ("strip wound", "strips wound"),
    "tape": ("join taped", "joins taped"),
    "turn": ("disc turned onto its hooks", "discs turned onto their hooks"),
    "tongue": ("tongue or hook pushed in", "tongues and hooks pushed in"),
    "part": ("part put in", "parts put in"),
    "screw": ("screw", "screws"),
    "nut": ("nut", "nuts"),
    "plug": ("plug or lead", "plugs and leads"),
    "weed": ("opening weeded", "openings weeded"),
}


def work_table(done: Operations) -> str:
    """A section of Markdown: all operations by kind, weeding apart, and the minutes."""
    low, high = done.minutes_between
    hands = {kind: count for kind, count in done.counts.items() if count and kind != "weed"}
    return "\n".join([
        "## Work by hand",
        f"{done.total} operations, and {done.weed} openings weeded: about {minutes(done.minutes)} (an estimate: between "
        f"{low:.0f} and {high:.0f} min; assembly.html has its basis).",
        "",
        "| operation | count |",
        "|---|---:|",
        *(f"| {KINDS[kind][count != 1]} | {count} |" for kind, count in hands.items()),
        f"| **together** | **{done.total}** |",
        f"| {KINDS['weed'][1]}, not counted above | {done.weed} |",
        "",
    ])  # fmt: skip


def effort(done: Operations) -> str:
    """Operations and minutes as text."""
    if not any(done.counts.values()):
        return ""
    counts = ", ".join(f"{count} {KINDS[kind][count > 1]}" for kind, count in done.counts.items() if count)
    return f"{counts}: about {minutes(done.minutes)}"


def minutes(value: float) -> str:
    """Minutes as text."""
    return f"{value:.0f} min" if value >= 1 else "1 min"


def numbers(joins: Iterable[int]) -> str:
    """Numbers as text, ranges shortened: ``2 to 5, 11``."""
    runs: list[list[int]] = []
    for number in sorted(joins):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def listed(names: Sequence[str]) -> str:
    """Names as text: ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
