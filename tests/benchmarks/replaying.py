"""Whole replays through the command line, and what they spend their time on."""

from __future__ import annotations

import cProfile
import json
import os
import pstats
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from omnieval.loop import replay
from omnieval.recording import RecordingOptions
from tests.benchmarks.figures import Figure
from tests.benchmarks.sequences import building


def measure() -> list[Figure]:
    """Measure replays with a recording, cold and warm."""
    source = building().source
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"OMNIEVAL_CACHE": str(Path(folder) / "cache")}
        command = [sys.executable, "-m", "omnieval", "replay", source, "--json"]
        speeds = {}
        for name in ("cold", "warm", "warm without .rrd"):
            options = ["--out", str(Path(folder) / name), *(["--no-rrd"] if "without" in name else [])]
            done = subprocess.run([*command, *options], env=environment, capture_output=True, text=True, check=True)
            speeds[name] = float(json.loads(done.stdout)["timings"]["frames_per_second"])
    targets = {"cold": ">= 60", "warm": ">= 150"}
    return [Figure(f"replay, hog, {name}", "frames/s", speeds[name], target=targets.get(name, "")) for name in speeds]


def profile() -> list[dict[str, Any]]:
    """Return what the main thread of a warm replay with a recording spends most time in itself."""
    with tempfile.TemporaryDirectory() as folder:
        replay(building(), out=Path(folder) / "first")
        profiler = cProfile.Profile()
        profiler.enable()
        replay(building(), out=Path(folder) / "run", recording=RecordingOptions())
        profiler.disable()
    found = pstats.Stats(profiler).get_stats_profile().func_profiles
    slowest = sorted(found.items(), key=lambda item: -item[1].tottime)[:12]
    return [
        {
            "function": f"{Path(one.file_name).name}:{one.line_number} {name}",
            "calls": one.ncalls,
            "own_seconds": one.tottime,
            "seconds": one.cumtime,
        }
        for name, one in slowest
    ]
