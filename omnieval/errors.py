"""The errors omnieval raises on purpose, one tree.

A message is one line that says what is wrong, where, and what to do. The command line prints it and
exits with `exit_code`; every other exception is a bug and exits with 1.
"""

from typing import ClassVar


class OmnievalError(Exception):
    """Base of every error that omnieval raises on purpose."""

    exit_code: ClassVar[int] = 1


class ConfigError(OmnievalError):
    """A parameter, option or configuration file is wrong.

    Example: ``omega must be greater than 0, got -1 (--set omega=-1)``.
    """

    exit_code = 2


class DatasetError(OmnievalError):
    """A sequence is missing, unreadable or inconsistent.

    Example: ``no omni_cam folder in /data/seq1; name the sequence folder of a COLD download``.
    """

    exit_code = 3


class ResultError(OmnievalError):
    """A run folder or table cannot be written, read or trusted.

    Example: ``runs/synthetic-hog exists; choose another --out or pass --overwrite``.
    """

    exit_code = 2


class RegressionError(OmnievalError):
    """A guarded metric fell below its reference.

    Example: ``silhouette of synthetic-night fell from 0.31 to 0.22 (tolerance 0.02)``.
    """

    exit_code = 4
