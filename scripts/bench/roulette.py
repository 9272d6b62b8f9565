"""What Russian roulette costs and saves, next-event estimation at equal samples:

    python scripts/bench/roulette.py SAFETY [SCENE ...] [--spp 256] [--width 64] [--seeds 3]

SAFETY is the factor of the throughput in a path's probability to survive (kernels/roulette.py); 1e9 is next to none at
all. A scene is a folder of usd_scenes or the path of a stage. The squared error is as in scripts/bench/guided.py.

relMSE  mean over the seeds, with its standard error
rays    of a path, shadow rays among them
work    relMSE x rays: the lower, the better
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import warp as wp
from denoise import Reference, stage_of

import warpmis
from warpmis.kernels import roulette

SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("safety", type=float)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=4096)
    arguments = parser.parse_args()
    roulette.SAFETY = wp.constant(arguments.safety)  # before any kernel is made
    for name in arguments.scenes:
        scene = warpmis.load_stage(stage_of(name), width=arguments.width)
        reference = Reference(scene, arguments.reference_spp, "guided")
        results = [warpmis.render(scene, method="nee", spp=arguments.spp, seed=seed) for seed in range(arguments.seeds)]
        errors = np.array([reference.relative_mse(result.image) for result in results])
        rays = np.mean([result.stats["rays"] / result.stats["samples"] for result in results])
        spread = errors.std(ddof=1) / len(errors) ** 0.5
        label = Path(name).parent.name if Path(name).exists() else name
        print(f"{label:14} {errors.mean():.5f} ± {spread:.5f} {rays:6.2f} {errors.mean() * rays:.4f}", flush=True)


if __name__ == "__main__":
    main()
