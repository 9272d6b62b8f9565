"""How well a render that stops at one error tells how long a better one takes:

    python scripts/bench/prediction.py [SCENE ...] [--from 5] [--to 1] [--width 32] [--seeds 1] [--spp N]

predicted     samples per pixel to the better error, from a run that stopped at the worse one: relMSE falls as they grow
measured      what a run with another seed takes to get there, to the digit: the samples at which it stopped, times the
              square of its error over the one that was asked for
ratio         predicted over measured

Both in samples, not in seconds, and so free of whatever else the machine does: a sample costs the same from first to
last. The last column is the processor time of both runs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import warpmis

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")


def samples_to(result: warpmis.RenderResult, error: float) -> float:
    """Samples per pixel at which a watched render's error is `error`, by the law relMSE ~ 1 / samples."""
    told = result.stats["stopping"]
    return float(told["spp"] * (told["relative_error"] / error) ** 2)


def prediction(scene: warpmis.Scene, worse: float, better: float, seed: int, **settings: object) -> tuple[float, float]:
    """Samples per pixel to the better error: predicted from a run to the worse one, and measured with another seed."""
    predicted = samples_to(warpmis.render(scene, target_error=worse, seed=seed, **settings), better)
    measured = samples_to(warpmis.render(scene, target_error=better, seed=seed + 1_000_000, **settings), better)
    return predicted, measured


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--from", dest="worse", type=float, default=5.0, help="percent (%(default)s)")
    parser.add_argument("--to", dest="better", type=float, default=1.0, help="percent (%(default)s)")
    parser.add_argument("--width", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--spp", type=int, default=None, help="most samples per pixel of a run")
    arguments = parser.parse_args()
    print(f"{'scene':14} {'predicted':>10} {'measured':>10} {'ratio':>6} {'seconds':>8}")
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        for seed in range(arguments.seeds):
            start = time.process_time()
            errors = 0.01 * arguments.worse, 0.01 * arguments.better
            predicted, measured = prediction(scene, *errors, seed, spp=arguments.spp)
            spent = time.process_time() - start
            print(f"{name:14} {predicted:10.0f} {measured:10.0f} {predicted / measured:6.2f} {spent:8.0f}", flush=True)


if __name__ == "__main__":
    main()
