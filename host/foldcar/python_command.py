"""The command that runs a module of foldcar in another Python process."""

import sys


def python_command(module: str, *arguments: str, flags: tuple[str, ...] = ()) -> list[str]:
    """The command of another Python, which calls ``main`` of a module of foldcar with ``arguments`` as sys.argv[1:].

    It imports what this process imports, wherever it is started: `python -m` looks in the working directory first,
    where a `json.py` may be.
    """
    path = [folder for folder in sys.path if folder]
    code = f"import sys; sys.path[:] = {path!r}; from {module} import main; main()"
    return [sys.executable, *flags, "-c", code, *arguments]
