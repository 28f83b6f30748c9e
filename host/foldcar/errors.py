"""The base of all errors that a user can cause; their messages say what to change."""


class FoldcarError(Exception):
    """An error of input or environment. The command prints it as one line and exits with code 2."""

    exit_code = 2
