"""Processors allotted: affinity, quotas of control groups in a tree of files, the share of a worker."""

import os

import pytest

from omnieval import cores, processes
from omnieval.errors import ConfigError

MINE = 64


@pytest.fixture(autouse=True)
def machine(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(MINE)), raising=False)
    monkeypatch.delenv(cores.SHARE, raising=False)


def tree(root, files):
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, MINE),
        ({"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "max 100000\n"}, MINE),
        ({"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "350000 100000\n"}, 3),
        ({"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "50000 100000\n"}, 1),
        (
            {
                "proc/self/cgroup": "0::/job/step\n",
                "sys/fs/cgroup/job/cpu.max": "400000 100000\n",
                "sys/fs/cgroup/job/step/cpu.max": "max 100000\n",
            },
            4,
        ),
        ({"proc/self/cgroup": "0::/not/seen/here\n", "sys/fs/cgroup/cpu.max": "200000 100000\n"}, 2),
        (
            {
                "proc/self/cgroup": "5:memory:/a\n4:cpu,cpuacct:/slurm/job7\n",
                "sys/fs/cgroup/cpu,cpuacct/slurm/job7/cpu.cfs_quota_us": "600000\n",
                "sys/fs/cgroup/cpu,cpuacct/slurm/job7/cpu.cfs_period_us": "100000\n",
            },
            6,
        ),
        (
            {
                "proc/self/cgroup": "4:cpu:/\n",
                "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1\n",
                "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000\n",
            },
            MINE,
        ),
        ({"proc/self/cgroup": "nonsense\n", "sys/fs/cgroup/cpu.max": "a lot\n"}, MINE),
    ],
)
def test_the_least_quota_counts(tmp_path, files, expected):
    assert cores.allotted(tree(tmp_path, files)) == expected


def test_affinity_is_less_than_a_large_quota(tmp_path, monkeypatch):
    tree(tmp_path, {"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "800000 100000\n"})
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 5}, raising=False)
    assert cores.allotted(tmp_path) == 2


def test_a_worker_has_its_share_and_so_have_its_libraries(tmp_path, monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.setenv("OMP_NUM_THREADS", "7")  # somebody knows better
    monkeypatch.setenv(cores.SHARE, "9")
    cores.take_share(4)
    assert cores.allotted(tmp_path) == 2
    assert (os.environ["OMP_NUM_THREADS"], os.environ["OPENBLAS_NUM_THREADS"]) == ("7", "2")


def test_jobs_are_a_number_or_auto(monkeypatch):
    monkeypatch.setenv(cores.SHARE, "3")
    assert [processes.job_count(jobs) for jobs in ("auto", "2", 5)] == [3, 2, 5]
    for jobs in ("many", "", "0", 0, -1, "1.5"):
        with pytest.raises(ConfigError, match="--jobs must be 1 or more, or auto"):
            processes.job_count(jobs)
