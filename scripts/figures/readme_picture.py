"""The README's picture: each of our scenes as sampled, denoised, and the allocation that its pixels learned.

python scripts/figures/readme_picture.py [--height 180] [--spp 96] [--out docs/pictures/scenes.png]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import warpmis
from warpmis.output.balance_map import balance_map
from warpmis.output.legend import with_legend
from warpmis.output.png import write_display_png
from warpmis.output.tonemap import to_display

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
# Exposure in stops.
SCENES = {"cornell_box": 0.5, "ajar_door": 0.5, "veach_plates": 0.7, "open_terrace": 0.5}
GAP = 6


def column(name: str, height: int, spp: int) -> np.ndarray:
    """Picture, denoised picture and balance map, shape (3 height + 2 GAP, width, 3) uint8."""
    scene = warpmis.load_stage(USD_SCENES / name / "scene.usda")
    width = round(height * scene.resolution[0] / scene.resolution[1])
    result = warpmis.render(scene, width=width, spp=spp, method="pooled", denoise=True)
    picture, denoised = (to_display(image, SCENES[name])[:height] for image in (result.image, result.shown))
    learned = balance_map(result.allocation, result.strategies)[:height]
    gap = np.full((GAP, width, 3), 255, dtype=np.uint8)
    return np.concatenate([picture, gap, denoised, gap, learned])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--height", type=int, default=180)
    parser.add_argument("--spp", type=int, default=96)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[2] / "docs" / "pictures" / "scenes.png")
    arguments = parser.parse_args()
    columns = [column(name, arguments.height, arguments.spp) for name in SCENES]
    rows = min(len(part) for part in columns)
    gap = np.full((rows, GAP, 3), 255, dtype=np.uint8)
    sheet = np.concatenate([piece for part in columns for piece in (part[:rows], gap)][:-1], axis=1)
    write_display_png(arguments.out, with_legend(sheet, ("light", "bsdf")))


if __name__ == "__main__":
    main()
