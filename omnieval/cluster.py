"""Workers on this machine and others, by Dask: the only file that knows it.

What runs jobs is an executor as that of `processes.workers`, with three things more: what many jobs need can be shared,
workers that are not as they should be are refused, and it is known when nobody is left to work.
"""

from __future__ import annotations

import ctypes
import logging
import shutil
import sys
import time
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from omnieval.cores import allotted
from omnieval.errors import ConfigError, OmnievalError

_SCHEMES = ("tcp://", "tls://", "ws://", "wss://")
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
"""Parameters of the GNU C library's ``mallopt``."""
_WAIT_S = 60.0
"""Seconds without any worker after which nobody will come any more."""

SLURM = """\
# Workers as jobs of Slurm, for: omnieval ablate ... --cluster slurm.toml
# A line that is commented out has the default of the cluster.

workers = 4                 # how many jobs are submitted; each is a worker
cores = 1                   # processors of a job; it runs so many trees at a time, in as many processes
memory = "4GB"              # of a job, shared by its processes
walltime = "04:00:00"       # trees that a job leaves when its time is over are run again by others
# queue = "short"           # partition, sbatch -p
# account = "robots"        # sbatch -A
# directives = ["--constraint=avx2"]               # more of sbatch
# prologue = ["module load python/3.12"]           # lines of the job before its worker starts
# python = "/home/me/omnieval/.venv/bin/python"    # the interpreter of the workers; default that of this command
# interface = "ib0"         # network between workers and this command
# local_directory = "/scratch/me"                  # where workers keep what does not fit into memory
# log_directory = "slurm-logs"
wait = 600                  # seconds to wait for the first worker, and for another one when none is left
"""
"""A file of `Slurm`, with comments."""


class Slurm(BaseModel):
    """Workers as jobs of Slurm."""

    model_config = ConfigDict(extra="forbid")

    workers: int = Field(gt=0)
    cores: int = Field(1, gt=0)
    memory: str = "4GB"
    walltime: str = "04:00:00"
    queue: str | None = None
    account: str | None = None
    directives: list[str] = []
    prologue: list[str] = []
    python: str | None = None
    interface: str | None = None
    local_directory: str | None = None
    log_directory: str | None = None
    wait: float = Field(600, gt=0)


@dataclass(frozen=True)
class ClusterSpec:
    """Where the workers are.

    Attributes
    ----------
    text
        How it was asked for.
    local
        How many are started on this machine; None if they are elsewhere.
    slurm
        How they are submitted; None if they are not.
    """

    text: str
    local: int | None = None
    slurm: Slurm | None = None

    @staticmethod
    def parse(text: str) -> ClusterSpec:
        """Read ``local:4``, ``tcp://host:8786`` or ``slurm.toml``.

        Raises
        ------
        ConfigError
            If it is none of these, or the file is not understood.
        """
        head, _, count = text.partition(":")
        if head == "local":
            number = allotted() if count in {"", "auto"} else int(count) if count.isdigit() else 0
            if number < 1:
                raise ConfigError(f"--cluster {text!r}: expected local:N or local:auto, for example local:4")
            return ClusterSpec(text, local=number)
        if text.startswith(_SCHEMES):
            return ClusterSpec(text)
        if not text.endswith(".toml"):
            raise ConfigError(
                f"--cluster {text!r}: expected local:N, the address of a scheduler such as tcp://host:8786, or a TOML "
                "file (omnieval ablate --cluster-template slurm)"
            )
        try:
            slurm = Slurm.model_validate(tomllib.loads(Path(text).read_text("utf-8")))
        except ValidationError as error:
            faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
            raise ConfigError(f"{text}: {faults}; see omnieval ablate --cluster-template slurm") from error
        except (OSError, ValueError) as error:
            raise ConfigError(f"cannot read {text}: {error}") from error
        return ClusterSpec(text, slurm=slurm)

    @property
    def wait(self) -> float:
        """Seconds without a worker that are too many."""
        return self.slurm.wait if self.slurm else _WAIT_S


class ClusterExecutor(Executor):
    """Submits to the workers of a cluster.

    Attributes
    ----------
    count
        How many jobs run at a time, as far as is known by now.
    dashboard
        Address of the page that shows what they do; None if there is none.
    """

    def __init__(self, client: Any, spec: ClusterSpec) -> None:
        self._client, self._spec = client, spec
        self._inner = client.get_executor(pure=False)
        self._missed_since: float | None = None
        self.count = self._threads()
        self.dashboard: str | None = client.dashboard_link if _has_dashboard() else None

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See `concurrent.futures.Executor`; what `share` returned may be among the arguments."""
        future: Future[Any] = self._inner.submit(_keeping_memory, fn, *args, **kwargs)
        return future

    def share(self, value: Any) -> Any:
        """Return what stands for a value in `submit`, so that it is sent to each worker once.

        It is a task and not scattered data: that would be lost with the worker that has it.
        """
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")
            return self._client.submit(_itself, value, pure=False)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See `concurrent.futures.Executor`."""
        if self._client.status == "running":  # where the scheduler is gone, so is all that waited
            self._inner.shutdown(wait=wait and not cancel_futures)

    def everywhere(self, function: str, *args: Any) -> dict[str, Any]:
        """Call a function, named as ``package.module:function``, in all workers that there are; return what each said.

        What it raised, or that it is not there, is said in words.
        """
        answers: dict[str, Any] = self._client.run(_asked(function, args), on_error="return")
        return {worker: _word(answer) for worker, answer in answers.items()}

    def killed(self, error: BaseException | None) -> bool:
        """Whether an error says that the workers died which had a job."""
        return isinstance(error, import_module("distributed").KilledWorker)

    def check(self) -> None:
        """See that somebody is there to work; to be asked again and again, as it counts from when it first saw nobody.

        Raises
        ------
        LostClusterError
            If the scheduler is gone, or has had no worker for too long.
        """
        try:
            threads = self._threads()
        except (OSError, TimeoutError) as error:
            raise LostClusterError(f"the scheduler of {self._spec.text} is lost") from error
        now = time.monotonic()
        if threads:
            self._missed_since = None
        elif self._missed_since is None:
            self._missed_since = now
        elif now - self._missed_since > self._spec.wait:
            raise LostClusterError(f"no worker of {self._spec.text} is left, for {self._spec.wait:.0f} seconds")

    def _threads(self) -> int:
        if self._client.status not in ("running", "newly-created"):
            raise LostClusterError(f"the scheduler of {self._spec.text} is lost")
        return sum(self._client.nthreads().values())


class LostClusterError(OmnievalError):
    """Nobody is there to work any more.

    Example: ``the scheduler of tcp://host:8786 is lost; what is done is kept, go on with --resume``.
    """

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}; what is done is kept, go on with --resume")


@contextmanager
def cluster(spec: ClusterSpec) -> Iterator[ClusterExecutor]:
    """Give an executor of the workers of a cluster; those that were started for it end with the block.

    Raises
    ------
    ConfigError
        If Dask is not installed, the scheduler is not reached, or no worker comes.
    """
    distributed = _dask("distributed", spec)
    with ExitStack() as stack:
        for logs in _loggers():
            stack.callback(logs.setLevel, logs.level)
            logs.setLevel(logging.CRITICAL)  # what matters is said by whoever called
        client = stack.enter_context(_client(distributed, spec, stack))
        try:
            client.wait_for_workers(spec.local or 1, timeout=spec.wait)
        except TimeoutError as error:
            raise ConfigError(f"--cluster {spec.text}: no worker came within {spec.wait:.0f} seconds") from error
        if spec.local:
            client.register_plugin(_deaf_plugin(distributed))
        executor = ClusterExecutor(client, spec)
        stack.callback(executor.shutdown, cancel_futures=True)
        yield executor


def _loggers() -> list[logging.Logger]:
    """Return what Dask tells of itself by; each of its modules has a level of its own."""
    named = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    return [logging.getLogger(name) for name in ("tornado", "asyncio", *named)]


def _client(distributed: Any, spec: ClusterSpec, stack: ExitStack) -> Any:
    where: Any = spec.text
    if spec.local or spec.slurm:
        import dask

        # A worker takes the next tree when it is free, so that one that dies takes no other with it; what has killed
        # two would kill the others too.
        careful = {"worker-saturation": 1.0, "allowed-failures": 1}
        stack.enter_context(dask.config.set({f"distributed.scheduler.{name}": at for name, at in careful.items()}))
    if spec.local:
        where = stack.enter_context(
            distributed.LocalCluster(
                n_workers=spec.local,
                threads_per_worker=1,
                processes=True,
                dashboard_address=":0" if _has_dashboard() else None,
                silence_logs=logging.CRITICAL,
            )
        )
    elif spec.slurm:
        where = stack.enter_context(_slurm(spec.slurm, spec))
    try:
        return distributed.Client(where, timeout=_WAIT_S if spec.slurm or spec.local else 10)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigError(f"--cluster {spec.text}: no scheduler answers there; start it, or name another") from error


def _slurm(slurm: Slurm, spec: ClusterSpec) -> Any:
    jobqueue = _dask("dask_jobqueue", spec)
    if shutil.which("sbatch") is None:
        raise ConfigError(f"--cluster {spec.text}: there is no sbatch here; run the command where jobs are submitted")
    given = {
        "queue": slurm.queue,
        "account": slurm.account,
        "python": slurm.python,
        "interface": slurm.interface,
        "local_directory": slurm.local_directory,
        "log_directory": slurm.log_directory,
    }
    found = jobqueue.SLURMCluster(
        cores=slurm.cores,
        processes=slurm.cores,
        memory=slurm.memory,
        walltime=slurm.walltime,
        job_extra_directives=slurm.directives,
        job_script_prologue=slurm.prologue,
        scheduler_options={"dashboard_address": ":0"} if _has_dashboard() else {"dashboard": False},
        silence_logs=logging.CRITICAL,
        **{name: value for name, value in given.items() if value is not None},
    )
    found.scale(jobs=slurm.workers)
    return found


def _dask(module: str, spec: ClusterSpec) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise ConfigError(f"--cluster {spec.text} needs Dask: pip install 'omnieval[dask]' ({error})") from error


def _has_dashboard() -> bool:
    """Whether there is what the dashboard is drawn with."""
    try:
        import_module("bokeh")
    except ImportError:
        return False
    return True


def _deaf_plugin(distributed: Any) -> Any:
    """Return what makes a worker deaf to Ctrl-C: who started it decides about an interrupt."""

    class Deaf(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "omnieval-deaf"

        def setup(self, worker: Any) -> None:
            import signal

            del worker
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return Deaf()


def _asked(function: str, args: tuple[Any, ...]) -> Callable[[], Any]:
    """Return a function that is sent by value, so that a worker that does not know this package can tell."""

    def ask() -> Any:
        import importlib

        module, _, name = function.partition(":")
        try:
            return getattr(importlib.import_module(module), name)(*args)
        except Exception as error:
            return f"{type(error).__name__}: {error}"

    return ask


def _word(answer: Any) -> Any:
    return f"{type(answer).__name__}: {answer}" if isinstance(answer, BaseException) else answer


def _keeping_memory(fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Call a function in a worker, which keeps the memory of arrays that come and go."""
    _keep_freed_memory()
    return fn(*args, **kwargs)


@cache
def _keep_freed_memory() -> None:
    """Let this process keep memory that is freed, up to 256 MB, for what is allocated next.

    Workers of Dask give it back at once, and have to ask for it again: that took half of the time of a tree.
    Where the C library is not GNU's, nothing is done.
    """
    allocator = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if allocator is not None:
        allocator(_M_MMAP_THRESHOLD, 32 << 20)
        allocator(_M_TRIM_THRESHOLD, 256 << 20)


def _itself(value: Any) -> Any:
    return value


def differing_workers(answers: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """Return a line for every worker that is not as this process is.

    Parameters
    ----------
    answers
        What each worker said it is, by its address; words if it could not.
    here
        What this process is, by the same names.
    """
    found = []
    for worker, answer in sorted(answers.items()):
        if not isinstance(answer, Mapping):
            found.append(f"{worker}: {answer}")
            continue
        names = [name for name in {**here, **answer} if answer.get(name) != here.get(name)]
        words = [f"{name} is {answer.get(name, 'absent')}, here {here.get(name, 'absent')}" for name in names]
        if words:
            found.append(f"{worker}: {', '.join(words)}")
    return found
