"""Ctrl-C waits for native code, and is answered then."""

import signal
import threading

import pytest

from omnieval.results.atomic import interrupts_wait


def test_an_interrupt_in_the_block_is_answered_at_its_end():
    done = []

    @interrupts_wait()
    def block():
        signal.raise_signal(signal.SIGINT)
        done.append("the rest of the block")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == ["the rest of the block"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_in_the_block_is_what_is_told():
    @interrupts_wait()
    def block():
        signal.raise_signal(signal.SIGINT)
        raise ValueError("first")

    with pytest.raises(ValueError, match="first"):
        block()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_whoever_ignores_interrupts_goes_on_ignoring_them():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts_wait():
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_are_never_interrupted():
    done = []

    def work():
        with interrupts_wait():
            done.append("worked")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == ["worked"]
