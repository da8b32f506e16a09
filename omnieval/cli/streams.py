"""The three standard streams as a command needs them, whatever the shell gave us."""

from __future__ import annotations

import io
import os
import sys


def ready_streams() -> None:
    r"""See that stdout and stderr exist, and take every text.

    A stream that the shell has closed (``2>&-``) is None in Python, where what is meant for stderr would go to stdout
    instead; what an encoding lacks (``PYTHONIOENCODING=ascii``) is shown as ``\xe4``.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115 (lives as long as we do)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
