"""A film in which the shares of a scene's pixels converge, from three starts side by side:

    python scripts/figures/convergence.py OUT.gif [--scene cornell_box] [--height 240] [--rounds 24] [--learn-spp 32]

The starts give the BSDF 0.1, 0.5 and 0.9 of all samples (blue to red); frame 0 is before the first round. All three go
the same way in the end, as in the video of Murray et al. (2020). Below each frame is the legend: all light to all BSDF.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

import warpmis
from warpmis.output.balance_map import balance_map
from warpmis.output.legend import with_legend

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
STARTS = (0.1, 0.5, 0.9)
GAP = 6
FRAMES_PER_SECOND = 4.0


def maps(scene: warpmis.Scene, start: float, rounds: int, learn_spp: int, width: int) -> list[np.ndarray]:
    """The allocation before the first round and after each, shape (H, W, 2)."""
    result = warpmis.render(
        scene,
        method="murray20",
        width=width,
        spp=rounds * learn_spp,
        learn_rounds=rounds,
        learn_spp=learn_spp,
        initial_allocation=(start, 1.0 - start),
        keep_maps=True,
    )
    first = np.broadcast_to(np.array([start, 1.0 - start]), result.allocation.shape)
    return [first, *result.round_allocations]


def write_gif(path: Path, frames: list[np.ndarray]) -> None:
    """An animation of frames, shape (H, W, 3) uint8 each."""
    output = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(frames[0].shape[1], frames[0].shape[0], 3, "uint8")
    spec.attribute("oiio:Movie", 1)
    spec.attribute("FramesPerSecond", FRAMES_PER_SECOND)
    for number, frame in enumerate(frames):
        mode = "AppendSubimage" if number else "Create"
        if not (output.open(str(path), spec, mode) and output.write_image(np.ascontiguousarray(frame))):
            raise SystemExit(f"{path}: {output.geterror()}")
    output.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scene", default="cornell_box")
    parser.add_argument("--height", type=int, default=240)
    parser.add_argument("--rounds", type=int, default=24)
    parser.add_argument("--learn-spp", type=int, default=32)
    arguments = parser.parse_args()
    scene = warpmis.load_stage(USD_SCENES / arguments.scene / "scene.usda")
    width = round(arguments.height * scene.resolution[0] / scene.resolution[1])
    films = [maps(scene, start, arguments.rounds, arguments.learn_spp, width) for start in STARTS]
    frames = []
    for shares in zip(*films, strict=True):
        pictures = [np.pad(balance_map(one, ("bsdf", "light")), ((0, 0), (0, GAP), (0, 0))) for one in shares]
        frames.append(with_legend(np.concatenate(pictures, axis=1)[:, :-GAP], ("light", "bsdf")))
    write_gif(arguments.out, frames)


if __name__ == "__main__":
    main()
