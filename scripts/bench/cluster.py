"""What a cluster of processes gains on one machine, and what it costs:

    python scripts/bench/cluster.py [SCENE] [--seconds S] [--workers 1,2] [--json FILE]

One picture of about S seconds with one worker, each worker with one thread: seconds with each number of workers, how
many times as fast that is as one worker, and the seconds of a plain render with as many threads, which shows what the
machine has to give. The pictures must have the same bits. A sequence of frames over the workers, each a task, likewise.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

import warpmis
from warpmis.config import RenderConfig
from warpmis.rendering.cluster import farm_of
from warpmis.rendering.cluster_pictures import PictureQueue

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
FRAMES = 8


def timed(stage: Path, config: RenderConfig, **more: Any) -> tuple[warpmis.RenderResult, float]:
    """A render, and how long its rounds took [s]."""
    result = warpmis.render(stage, config=config, **more)
    seconds = result.stats["seconds"]
    return result, seconds["learn"] + seconds["render"]


def config_of(method: str, width: int, spp: int) -> RenderConfig:
    return RenderConfig(method=method, width=width, spp=spp, threads=1, max_depth=8)


def spp_of(stage: Path, method: str, width: int, seconds: float) -> int:
    """Samples per pixel that take about so long with one thread."""
    timed(stage, config_of(method, width, 16))  # compiles
    _, taken = timed(stage, config_of(method, width, 64))
    return max(64, int(64 * seconds / taken))


def frames_by(farm: Any, stage: Path, config: RenderConfig) -> float:
    """Seconds of a sequence, each frame with a seed of its own."""
    queue = PictureQueue(farm, str(stage))
    start = time.perf_counter()
    for frame in range(FRAMES):
        queue.add(str(frame), {"config": RenderConfig(**{**vars(config), "seed": frame})})
    for frame in range(FRAMES):
        queue.result(str(frame))
    return time.perf_counter() - start


def measured(stage: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    spp = spp_of(stage, arguments.method, arguments.width, arguments.seconds)
    config = config_of(arguments.method, arguments.width, spp)
    plain, seconds = timed(stage, config)
    report: dict[str, Any] = {"spp": spp, "plain": seconds, "workers": {}}
    print(f"{stage.parent.name}, {arguments.method}, {spp} spp: plain render {seconds:.1f} s", flush=True)
    for workers in arguments.workers:
        whole = RenderConfig(**{**vars(config), "threads": workers})  # one thread a worker
        with farm_of(f"local:{workers}", whole) as farm:
            timed(stage, config_of(arguments.method, arguments.width, 16), cluster=farm)  # they load kernels
            found, seconds = timed(stage, config, cluster=farm)
            short = config_of(arguments.method, arguments.width, max(16, spp // 16))
            frames_by(farm, stage, config_of(arguments.method, arguments.width, 1))
            sequence = frames_by(farm, stage, short)
        _, threads = timed(stage, RenderConfig(**{**vars(config), "threads": workers}))
        same = bool(np.array_equal(found.image, plain.image) and np.array_equal(found.variance, plain.variance))
        report["workers"][workers] = {"seconds": seconds, "threads": threads, "frames": sequence, "same": same}
        first = report["workers"][arguments.workers[0]]
        print(
            f"{workers} workers: {seconds:.1f} s, {first['seconds'] / seconds:.2f} of one; a plain render with "
            f"{workers} threads {threads:.1f} s, {first['threads'] / threads:.2f}; {FRAMES} frames "
            f"{sequence:.1f} s, {first['frames'] / sequence:.2f}; {'same bits' if same else 'OTHER BITS'}",
            flush=True,
        )
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="cornell_box", help="folder in usd_scenes")
    parser.add_argument("--method", default="auto")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--workers", type=lambda text: [int(one) for one in text.split(",")], default=[1, 2])
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report = measured(USD_SCENES / arguments.scene / "scene.usda", arguments)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
