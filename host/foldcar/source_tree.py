"""What this package finds beside itself: programs that a wheel brings, or the checkout that it is part of."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def packaged_program(name: str) -> Path | None:
    """The program of that name that the wheel has brought; None in a checkout."""
    program = PACKAGE / name
    return program if program.is_file() else None


def source_tree() -> Path | None:
    """The checkout, with firmware, simulator and PlatformIO's project file; None where the package is installed."""
    root = PACKAGE.parents[1]
    return root if (root / "platformio.ini").is_file() and PACKAGE.parent == root / "host" else None
