"""How to share a budget between learning and rendering:

    python scripts/bench/learning.py [SCENE ...]

For total budgets of 64, 256 and 1024 samples per pixel and several numbers of learn rounds: relMSE of the picture,
learning samples included, over that of method `balance` at equal samples (below 1 learning wins), medians over seeds.
The default number of rounds (RenderConfig.learn_rounds) was chosen from this table.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

import numpy as np

import warpmis
from warpmis.metrics import relative_mse

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCHEDULES = ((1, 0.25), (1, 0.5), (2, 0.5), (4, 0.5), (8, 0.5))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell_box", "veach_plates"])
    parser.add_argument("--width", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        reference = warpmis.render(scene, method="balance", spp=32768, seed=99).image

        def error(seed: int, scene: warpmis.Scene = scene, reference: np.ndarray = reference, **settings) -> float:
            return relative_mse(warpmis.render(scene, seed=seed, **settings).image, reference)

        for spp in (64, 256, 1024):
            plain = [error(seed, method="balance", spp=spp) for seed in range(arguments.seeds)]
            for rounds, share in SCHEDULES:
                learn = {"learn_rounds": rounds, "learn_spp": max(1, int(spp * share / rounds))}
                learned = [error(seed, method="murray20", spp=spp, **learn) for seed in range(arguments.seeds)]
                ratios = [mine / theirs for mine, theirs in zip(learned, plain, strict=True)]
                spread = f"({min(ratios):.2f} to {max(ratios):.2f})"
                print(f"{name:14} {spp:5} spp  {rounds} x {learn['learn_spp']:4}", end="  ")
                print(f"{statistics.median(ratios):.2f}  {spread}", flush=True)


if __name__ == "__main__":
    main()
