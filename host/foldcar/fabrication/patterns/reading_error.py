"""The error of the readers of written sheets."""

from foldcar.errors import FoldcarError


class ReadingError(FoldcarError):
    """A file that is not a valid cutting sheet; the message says why."""
