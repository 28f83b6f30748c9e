"""The error of readers of written sheets."""

from foldcar.errors import FoldcarError


class ReadingError(FoldcarError):
    """A file that is no cutting sheet; the message says what is wrong in it."""
