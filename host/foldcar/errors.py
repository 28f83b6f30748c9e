"""The one error root: whatever a user can cause is a FoldcarError with a message that says what to change."""


class FoldcarError(Exception):
    """A mistake in input or surroundings. The command prints it as one line and exits with code 2."""

    exit_code = 2
