"""Options that are differences of success rates, written in percentage points: ``15pp``."""

import re

from foldcar.errors import FoldcarError


def parse_points(option: str, text: str, least: float = 1.0, most: float = 50.0) -> float:
    """``15pp`` as a share, 0.15; FoldcarError, naming the option, if it is not within ``least`` to ``most`` points."""
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*pp\s*", text)
    if found is None:
        raise FoldcarError(f'{option}: "{text}" is not a number of percentage points, as 15pp')
    value = float(found[1])
    if not least <= value <= most:
        raise FoldcarError(f"{option}: {text.strip()} is not within {least:g}pp to {most:g}pp")
    return value / 100
