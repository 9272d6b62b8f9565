"""Whether more than one light sample pays at a vertex, counted by the cells of the spatial cache:

    python scripts/bench/cell_counts.py [SCENE ...] [--most 1 2 4] [--spp 256] [--width 64] [--seeds 5]

`guided` takes a light sample with the probability that the vertex' cell learned, at most 1 (kernels/path/guided.py).
Here the same number may be larger, up to MOST: it is then how many light samples the vertex takes in the mean. All of
them and the path share the direct light by the balance heuristic. A scene is a folder of usd_scenes or the path of a
stage.

variance, rays, time  over those of MOST = 1, CPU time of one thread, learning included
efficiency            1 / (variance x time), the variance as in scripts/bench/guided.py
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import warp as wp
from denoise import stage_of

import warpmis
from warpmis.device.views import SceneView
from warpmis.film.metrics import LUMINANCE, squared_scale, without_outliers
from warpmis.kernels.path import estimator
from warpmis.kernels.path.guided import MIN_RATE
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import luminance

SCENES = ("cornell_box", "veach_plates", "ajar_door")
# Further samples of a vertex are the first one, moved on by multiples of this in each number.
GOLDEN = wp.constant(0.618034)


@wp.func
def moved(u: float, count: int) -> float:
    there = u + GOLDEN * float(count)
    return wp.min(there - wp.floor(there), ONE_MINUS_EPSILON)


def with_counts(guided: SimpleNamespace, lights: SimpleNamespace, most: float) -> SimpleNamespace:
    """The estimator of `guided` with up to `most` light samples at a vertex, or one more by chance."""
    PathState, record = guided.PathState, guided.record

    @wp.func
    def choose_another(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], first: wp.vec4, k: int):
        r = path.receiver
        u = moved(first[0], k)
        path.receiver = lights.receiver(scene, r.x, r.n, r.prim, u, r.u_fine, r.response)
        path.receiver.absorption = r.absorption
        vertex.u_light[0] = u
        vertex.u_light[1] = wp.where(path.is_first, path.receiver.choice.u_remapped, moved(first[1], k))
        vertex.u_light[2] = moved(first[2], 2 * k)
        vertex.u_light[3] = moved(first[3], 3 * k)

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        cell = guided.look_up(scene, path, vertex)
        worth = luminance(path.beta) * path.estimate.pixel_worth * scene.cache[0].cells[cell].shadow_ray_worth
        path.estimate.light_rate = wp.clamp(worth, MIN_RATE, wp.static(most))
        first = vertex.u_light
        squares = float(0.0)  # noqa: UP018  Warp's word for what changes in a loop
        for k in range(int(path.estimate.light_rate + 1.0 - vertex.u_cache[1])):
            if k > 0:
                choose_another(scene, path, vertex, first, k)
            brought = guided.take_light_sample(scene, path, vertex, cell)
            squares += brought * brought
        guided.draw_direction(scene, path, vertex, cell)
        record.vertex(scene, path, vertex.frame.n, squares * path.estimate.light_rate)

    guided.scatter = scatter
    return guided


def work(stage: str, most: float, width: int, spp: int, seeds: int, out: str) -> None:
    """In a process of its own, whose kernels have this `most`."""
    plain = estimator._guided
    estimator._guided = lambda parts: with_counts(plain(parts), parts.lights, most)  # before any kernel is made
    scene = warpmis.load_stage(stage, width=width)
    warpmis.render(scene, method="guided", spp=16)  # compiles
    pictures, seconds, rays = [], [], []
    for seed in range(seeds):
        begun = time.process_time()
        result = warpmis.render(scene, method="guided", spp=spp, seed=seed, threads=1)
        seconds.append(time.process_time() - begun)
        pictures.append(result.image @ LUMINANCE)
        rays.append(result.stats["rays"])
    np.savez(out, pictures=pictures, seconds=seconds, rays=rays)


def compare(stage: str, arguments: argparse.Namespace) -> None:
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        for most in arguments.most:
            out = Path(folder) / f"{most}.npz"
            command = [
                "--work",
                stage,
                str(most),
                str(arguments.width),
                str(arguments.spp),
                str(arguments.seeds),
                str(out),
            ]
            subprocess.run([sys.executable, __file__, *command], check=True)
            runs.append(dict(np.load(out)))
    mean = np.mean([run["pictures"].mean(axis=0) for run in runs], axis=0)
    scale = squared_scale(np.repeat(mean[..., np.newaxis], 3, axis=2))
    base: list[float] = []
    for most, run in zip(arguments.most, runs, strict=True):
        variance = float(without_outliers(run["pictures"].var(axis=0, ddof=1) / scale).mean())
        found = [variance, float(np.median(run["rays"])), float(np.median(run["seconds"]))]
        base = base or found
        variance, rays, seconds = (one / first for one, first in zip(found, base, strict=True))
        name = Path(stage).parent.name
        print(
            f"{name:14} {most:4g}  variance {variance:.2f}  rays {rays:.2f}  time {seconds:.2f}  "
            f"efficiency {1.0 / (variance * seconds):.2f}",
            flush=True,
        )


def main() -> None:
    if sys.argv[1:2] == ["--work"]:
        stage, most, width, spp, seeds, out = sys.argv[2:]
        work(stage, float(most), int(width), int(spp), int(seeds), out)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--most", nargs="+", type=float, default=[1.0, 2.0, 4.0])
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    for name in arguments.scenes:
        compare(str(stage_of(name)), arguments)


if __name__ == "__main__":
    main()
