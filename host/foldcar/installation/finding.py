"""One thing that foldcar uses, as it was found on this machine."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """``state``: ``ok``; ``missing``, without which studies do not run; ``absent``, which only ``text`` needs.

    ``text`` says what was found, ``advice`` what to do about it; "" where nothing is to do.
    """

    name: str
    state: Literal["ok", "missing", "absent"]
    text: str
    advice: str = ""
