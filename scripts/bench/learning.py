"""How to share a budget between learning and rendering:

    python scripts/bench/learning.py [SCENE ...] [--width 40] [--seeds 16]

For total budgets of 64, 256 and 1024 samples per pixel and several numbers of learn rounds: variance of `murray20`'s
picture, learning samples included, over that of `balance` at equal samples (below 1 learning wins). The variance is
that between the seeds' pictures, relative to the squared brightness, mean over the pixels without the worst 2 % of
each; its error is that of the quotients of two halves of the seeds. The default number of rounds
(RenderConfig.learn_rounds) was chosen from this table.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.film.metrics import squared_scale

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
ROUNDS = (1, 2, 3, 4, 8)
TRUSTED = 0.98

FloatArray = NDArray[np.float64]


def pictures(scene: warpmis.Scene, seeds: int, **settings: Any) -> FloatArray:
    """Of all seeds, shape (seeds, H, W, 3)."""
    renders = (warpmis.render(scene, seed=seed, **settings) for seed in range(seeds))
    return np.array([result.image for result in renders], dtype=np.float64)


def variance(own: FloatArray, scale: FloatArray) -> float:
    relative = np.sort((own.var(axis=0, ddof=1).mean(axis=-1) / scale).ravel())
    return float(relative[: int(TRUSTED * len(relative))].mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell_box", "veach_plates", "open_terrace", "ajar_door"])
    parser.add_argument("--width", type=int, default=40)
    parser.add_argument("--seeds", type=int, default=16)
    arguments = parser.parse_args()
    print("| scene | samples | rounds | variance / balance |\n|---|---|---|---|")
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        for spp in (64, 256, 1024):
            plain = pictures(scene, arguments.seeds, method="balance", spp=spp)
            scale = np.maximum(squared_scale(plain.mean(axis=0)), 1e-12)
            for rounds in ROUNDS:
                learn = {"learn_rounds": rounds, "learn_spp": spp // 2 // rounds}
                learned = pictures(scene, arguments.seeds, method="murray20", spp=spp, **learn)
                halves = [variance(learned[i::2], scale) / variance(plain[i::2], scale) for i in range(2)]
                ratio = variance(learned, scale) / variance(plain, scale)
                error = abs(halves[0] - halves[1]) / 2.0
                print(f"| {name} | {spp} | {rounds} x {learn['learn_spp']} | {ratio:.2f} ± {error:.2f} |", flush=True)


if __name__ == "__main__":
    main()
