"""A disk that fails at the n-th operation: whatever creates, writes, syncs, renames or makes folders below a place."""

import builtins
import errno
import io
import os
from contextlib import contextmanager
from pathlib import Path

import pytest

WRITING = frozenset("wax+")


class FailingDisk:
    """Counts operations on files below a folder and lets one of them, or all from one on, fail.

    Parameters
    ----------
    folder
        Other places never fail.
    at
        The first operation to fail, from 1; 0 lets all pass.
    code
        The error number, e.g. ``errno.ENOSPC``.
    lasting
        Whether everything fails from there on, as on a full disk, or that one operation only.
    """

    def __init__(self, folder, at, code, *, lasting):
        self._folder = folder.resolve()
        self._at, self._code, self._lasting = at, code, lasting
        self._paths = {}
        self.operations = 0
        self.failed = False

    @contextmanager
    def mounted(self):
        """Put the disk under everything that Python does with files."""
        with pytest.MonkeyPatch.context() as patch:
            opened, opened_low = io.open, os.open
            for module in (io, builtins):
                patch.setattr(module, "open", self._open(opened))
            patch.setattr(os, "open", self._open_low(opened_low))
            for name in ("replace", "rename", "mkdir"):
                patch.setattr(os, name, self._by_path(getattr(os, name)))
            for name in ("fsync", "write"):
                patch.setattr(os, name, self._by_descriptor(getattr(os, name)))
            yield self

    def check(self, path):
        """Count an operation on a path, and fail if it is its turn."""
        if not self._ours(path):
            return
        self.operations += 1
        if self.operations == self._at or (self._lasting and 0 < self._at < self.operations):
            self.failed = True
            raise OSError(self._code, os.strerror(self._code), str(path))

    def _ours(self, path):
        return Path(path).absolute().is_relative_to(self._folder)

    def _open(self, opened):
        def call(file, mode="r", *rest, **options):
            if isinstance(file, int) or not self._ours(file) or not WRITING & set(mode):
                return opened(file, mode, *rest, **options)
            self.check(file)
            stream = opened(file, mode, *rest, **options)
            self._paths[stream.fileno()] = file
            return _Stream(stream, file, self)

        return call

    def _open_low(self, opened):
        def call(path, flags, *rest, **options):
            writing = flags & (os.O_WRONLY | os.O_RDWR)
            if writing:
                self.check(path)
            descriptor = opened(path, flags, *rest, **options)
            self._paths.pop(descriptor, None)
            if writing and self._ours(path):
                self._paths[descriptor] = path
            return descriptor

        return call

    def _by_path(self, operation):
        def call(path, *rest, **options):
            self.check(path)
            return operation(path, *rest, **options)

        return call

    def _by_descriptor(self, operation):
        def call(descriptor, *rest):
            if descriptor in self._paths:
                self.check(self._paths[descriptor])
            return operation(descriptor, *rest)

        return call


class _Stream:
    """A file open for writing; what fails is its writing, half of which is done before."""

    def __init__(self, stream, path, disk):
        self._stream, self._path, self._disk = stream, path, disk

    def write(self, content):
        try:
            self._disk.check(self._path)
        except OSError:
            self._stream.write(content[: len(content) // 2])
            raise
        return self._stream.write(content)

    def __enter__(self):
        self._stream.__enter__()
        return self

    def __exit__(self, *error):
        self._disk._paths.pop(self._stream.fileno(), None)
        return self._stream.__exit__(*error)

    def __getattr__(self, name):
        return getattr(self._stream, name)


FAULTS = [
    pytest.param(errno.EIO, False, id="one-error"),
    pytest.param(errno.ENOSPC, True, id="full-from-there-on"),
]


def every_fault(folder: Path, code, *, lasting, stride=1):
    """Yield a disk for every (or every n-th) operation of what is done on it, until one has not failed."""
    at = 1
    while True:
        disk = FailingDisk(folder, at, code, lasting=lasting)
        yield disk
        if not disk.failed:
            return
        at += stride
