"""What the spatial cache has learned, as pictures in a row for each scene:

    python scripts/figures/cache.py OUT.png [SCENE ...] [--height 200] [--spp 256]

From left to right: the picture; the cells in which its paths first scatter, in random colors; the share of the
directions that the BSDF draws; the probability that a path goes on; and that a light sample is taken. White is 1.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

import warpmis
from warpmis.output.tonemap import to_display

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("ajar_door", "cornell_box")
GAP = 4


def row(name: str, height: int, spp: int) -> np.ndarray:
    """The pictures of a scene side by side, sRGB, shape (height, W, 3) uint8."""
    scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=height)
    result = warpmis.render(scene, method="guided", spp=spp)
    cache = result.cache
    assert cache is not None
    colors = np.random.default_rng(1).integers(40, 255, (4096, 3), dtype=np.uint8)
    cells = np.where(cache.cells[..., None] >= 0, colors[np.maximum(cache.cells, 0)], 0).astype(np.uint8)
    grey = [(255.0 * picture).astype(np.uint8) for picture in (cache.bsdf_share, cache.survival, cache.shadow_rays)]
    pictures = [to_display(result.image), cells, *(np.repeat(one[..., None], 3, axis=-1) for one in grey)]
    return np.concatenate([np.pad(one, ((0, GAP), (0, GAP), (0, 0)), constant_values=255) for one in pictures], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--height", type=int, default=200)
    parser.add_argument("--spp", type=int, default=256)
    arguments = parser.parse_args()
    rows = [row(name, arguments.height, arguments.spp) for name in arguments.scenes]
    width = min(one.shape[1] for one in rows)
    oiio.ImageBuf(np.ascontiguousarray(np.concatenate([one[:, :width] for one in rows]))).write(str(arguments.out))


if __name__ == "__main__":
    main()
