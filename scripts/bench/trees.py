"""What the CPU's own tree gains: the time of renders through Warp's mesh over that through eight boxes a node.

    python scripts/bench/trees.py [SCENE ...] [--repeats 7]

The same kernel by next-event estimation, which differs in its tree alone, one thread, in turn; medians, with the
smallest and the largest. SCENE is a folder in usd_scenes or a stage without instances.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

from recorded_rays import warp_mesh_of

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.upload import upload
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
SPP = 32


def gains(scene: warpmis.Scene, repeats: int) -> list[float]:
    config = RenderConfig(method="nee", threads=1)
    uploaded = upload(scene, "cpu")
    mesh = warp_mesh_of(uploaded.view)
    uploaded.view.mesh = mesh.id
    allocation = allocation_of(config, *scene.resolution)
    features = features_of(scene, config)
    runs = [Integrator(uploaded, features.with_tree(tree), config, allocation) for tree in ("warp", "wide")]

    def seconds(run: Integrator) -> float:
        start = time.process_time()
        run.trace(Round(0, SPP, learn=False), lambda samples: None)
        return time.process_time() - start

    return [seconds(runs[0]) / seconds(runs[1]) for _ in range(repeats + 1)][1:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=7)
    arguments = parser.parse_args()
    for name in arguments.scenes:
        stage = USD_SCENES / name / "scene.usda"
        found = gains(warpmis.load_stage(stage if stage.exists() else name, width=arguments.width), arguments.repeats)
        print(f"{name}: {statistics.median(found):.2f} ({min(found):.2f} to {max(found):.2f})", flush=True)


if __name__ == "__main__":
    main()
