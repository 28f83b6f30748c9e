"""The base class of all errors that a user can cause and correct."""


class FoldcarError(Exception):
    """An error of input or environment. The command prints its lines and exits with code 2."""

    exit_code = 2

    def lines(self) -> list[str]:
        """Return the lines to print: one, unless the error lists several mistakes."""
        return [" ".join(str(self).split())]
