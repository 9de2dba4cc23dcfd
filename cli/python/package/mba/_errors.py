"""Exceptions of the package."""

from __future__ import annotations


class Error(Exception):
    """Something failed; ``hint`` says what may help."""

    hint: str

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint

    def __str__(self) -> str:
        message = super().__str__()
        return f"{message}\nhint: {self.hint}" if self.hint else message


class InputError(Error, ValueError):
    """What was given is wrong: a file, a folder, an option or an array. The message names it."""


class FrameError(InputError):
    """The tracker cannot use this frame; it is as it was before."""


class ConfigError(InputError):
    """No tracker has such settings."""


class DataWarning(UserWarning):
    """Something odd about the input that did not stop the work."""
