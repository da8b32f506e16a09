"""The processes that jobs run in: they end when their parent ends, and ignore Ctrl-C, which the parent handles."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process

from omnieval.cores import allotted, take_share
from omnieval.errors import ConfigError


def job_count(jobs: int | str) -> int:
    """Return how many jobs run at a time: a number, or for ``auto`` as many as processors are allotted.

    Raises
    ------
    ConfigError
        If it is neither.
    """
    if jobs == "auto":
        return allotted()
    try:
        count = int(jobs)
    except ValueError:
        count = 0
    if count < 1:
        raise ConfigError(f"--jobs must be 1 or more, or auto, got {jobs}")
    return count


@contextmanager
def workers(count: int) -> Iterator[Executor]:
    """Give an executor of `count` new processes, or for 1 of a thread of this one.

    When the block is left by an exception, jobs that wait are dropped, and those in hand are ended.
    """
    if count == 1:
        with _dropping(ThreadPoolExecutor(1)) as pool:
            yield pool
        return
    others = set(active_children())
    context = get_context("spawn")
    with _dropping(ProcessPoolExecutor(count, mp_context=context, initializer=_start, initargs=(count,))) as pool:
        well = False
        try:
            yield pool
            well = True
        finally:
            if not well:
                for child in set(active_children()) - others:
                    child.terminate()


@contextmanager
def _dropping(pool: Executor) -> Iterator[Executor]:
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _start(count: int) -> None:
    """Prepare a worker: the parent alone decides about an interrupt, and a worker does not outlive a killed one.

    What it computes it computes on its share of the processors.
    """
    take_share(count)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
