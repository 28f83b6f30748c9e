"""The environment for processes that `make check` shall not measure: coverage imports modules and writes files there."""

import os


def unmeasured() -> dict[str, str]:
    """This process's environment without coverage's part of it."""
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
