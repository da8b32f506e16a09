"""Recording aside, in a thread that nobody has to wait for: a frozen viewer has Rerun wait for ever."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

import rerun as rr

_Call = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]


class Aside:
    """Makes calls one after another in a thread of its own.

    Unlike the threads of `concurrent.futures`, it does not keep the process from ending when a call never returns.
    """

    def __init__(self, name: str) -> None:
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a call made, after all that were submitted before."""
        future: Future[Any] = Future()
        self._calls.put((future, function, arguments))
        return future

    def end(self) -> None:
        """Let the thread end when it has made all calls, without waiting for that."""
        self._calls.put(None)

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            future, function, arguments = call
            try:
                future.set_result(function(*arguments))
            except BaseException as error:  # whoever waits for the call gets it
                future.set_exception(error)


def leave_behind() -> None:
    """Let this process end although a recording is not complete: Rerun would wait for it once more when Python ends."""
    rr.unregister_shutdown()
