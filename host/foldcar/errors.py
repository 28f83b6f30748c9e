"""The base of all errors that a user can cause; their messages say what to change."""


class FoldcarError(Exception):
    """An error of input or environment. The command prints its lines and exits with code 2."""

    exit_code = 2

    def lines(self) -> list[str]:
        """The lines that the command prints: one, but for an error that lists several mistakes."""
        return [" ".join(str(self).split())]
