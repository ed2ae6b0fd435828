"""Which errors does motionary raise?

Each is also the built-in error that people catch.
"""

#: Words in the error of a file that can be read and holds something else.
NO_MOTION = "holds no motion"


class MotionaryError(Exception):
    """Parent of all errors that motionary raises on purpose."""


class InvalidInput(MotionaryError, ValueError):
    """An argument or a file's content is not what the call needs."""


class UnreadableFile(MotionaryError, OSError):
    """A file cannot be read: missing, broken, or of an unknown format."""


class UnwritableFile(MotionaryError, OSError):
    """A result cannot be written where it was asked for."""
