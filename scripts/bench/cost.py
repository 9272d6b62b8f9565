"""What a shadow ray costs, over a ray of a path with the vertex at its end (kernels/moments.py: SHADOW_RAY_COST):

    python scripts/bench/cost.py [SCENE ...]

Least squares over renders that have different numbers of both.
Times are CPU times of one thread, medians of repeated rounds of the same samples.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

import numpy as np

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.upload import upload
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.scene.features import detect

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
SHARES = (0.1, 0.5, 0.9)
SPP = 16
REPEATS = 7


def cost(scene: warpmis.Scene, **settings: object) -> tuple[float, float, float]:
    """Seconds, path rays and shadow rays of one sample."""
    config = RenderConfig(threads=1, **settings)
    features = detect(scene).with_strategies(config.strategies if config.method != "nee" else ())
    run = Integrator(upload(scene, "cpu"), features, config, allocation_of(config, *scene.resolution))
    run.trace(Round(0, SPP, learn=False), lambda samples: None)
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        run.trace(Round(0, SPP, learn=False), lambda samples: None)
        spent.append(time.process_time() - start)
    samples = run.pixels * SPP
    rounds = REPEATS + 1
    rays, shadow_rays = run.film.rays.numpy().sum(), run.film.shadow_rays.numpy().sum()
    return statistics.median(spent) / samples, float(rays / rounds / samples), float(shadow_rays / rounds / samples)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--width", type=int, default=64)
    arguments = parser.parse_args()
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        shared = [cost(scene, method="fixed", allocation=(share, 1.0 - share)) for share in SHARES]
        plain = [cost(scene, method="nee", max_depth=depth) for depth in (1, 3, 8)]
        short = [cost(scene, method="balance", max_depth=depth) for depth in (0, 1)]
        rows = np.array([*shared, *plain, *short])
        # Relative residuals: a cheap render counts as much as a dear one.
        design = np.column_stack([np.ones(len(rows)), rows[:, 1:]]) / rows[:, :1]
        _, ray, shadow = np.linalg.lstsq(design, np.ones(len(rows)), rcond=None)[0]
        print(f"{name:14} shadow ray {shadow / ray:.2f}", flush=True)


if __name__ == "__main__":
    main()
