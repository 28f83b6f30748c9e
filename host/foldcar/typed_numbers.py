"""Numbers as people type them into options, answers and files: ASCII digits, point, exponent and sign.

Python's own `int` and `float` also take digits of every other script and underscores: 9_5 would be 95.
"""


def whole_number(text: str) -> int:
    """The whole number; ValueError if it is none."""
    return int(_plain(text))


def decimal_number(text: str) -> float:
    """The number, inf and nan included; ValueError if it is none."""
    return float(_plain(text))


def _plain(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number: it has letters or signs other than 0 to 9, e, . + and -")
    return text
