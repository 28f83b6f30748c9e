"""A step of the guide, and lists of numbers and names as text."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Picture:
    """An SVG element and its caption."""

    svg: str
    caption: str


@dataclass(frozen=True, slots=True)
class Step:
    """One step: a title, instructions line by line, pictures."""

    title: str
    lines: tuple[str, ...]
    pictures: tuple[Picture, ...] = ()


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
