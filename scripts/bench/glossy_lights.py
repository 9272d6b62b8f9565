"""What it gains that lights are chosen with regard to the receiver's glossy lobes:

    python scripts/bench/glossy_lights.py [CASE ...] [--spp 32] [--seeds 8] [--json FILE]

A case is kind:count:metallic:roughness, such as lamps:1000:1:0.3, of the hall of many_lights.py with walls of that
material (diffuse color 0.5); or a folder of usd_scenes, or a stage. The picture is rendered by `--method` with the
choice by lobes and without. Variance is that between the seeds, relative to the squared brightness, without the worst
0.1 % of the pixels. Time is CPU time on one thread. Both are without over with: above 1 the choice by lobes gains.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from many_lights import hall, loaded

import warpmis
from warpmis.film.metrics import LUMINANCE, squared_scale, without_outliers
from warpmis.scene.features import Features, detect

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
CASES = [
    f"{kind}:{count}:{metallic}:0.3"
    for kind, count in (("lamps", 5), ("lamps", 100), ("lamps", 1000), ("points", 1000), ("triangles", 1000))
    for metallic in (1, 0)
]
MATERIAL = """def Material "Polished"
{{
    token outputs:surface.connect = </World/Polished/Surface.outputs:surface>
    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
        float inputs:metallic = {metallic}
        float inputs:roughness = {roughness}
        token outputs:surface
    }}
}}
"""


def polished_hall(kind: str, count: int, metallic: str, roughness: str) -> str:
    text = hall(kind, count).replace(
        'def Mesh "Hall"\n{\n',
        'def Mesh "Hall" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\nrel material:binding = </World/Polished>\n',
    )
    return text.replace("def Camera", MATERIAL.format(metallic=metallic, roughness=roughness) + "def Camera", 1)


def scene_of(case: str, width: int) -> warpmis.Scene:
    if ":" in case:
        kind, count, metallic, roughness = case.split(":")
        return loaded(polished_hall(kind, int(count), metallic, roughness), width)
    path = USD_SCENES / case / "scene.usda"
    return warpmis.load_stage(path if path.is_file() else case, width=width)


def measure(scene: warpmis.Scene, effects: Features, method: str, spp: int, seeds: int) -> tuple[np.ndarray, float]:
    """Luminance of each seed's picture, and seconds of one."""
    warpmis.render(scene, method=method, spp=2, seed=seeds, features=effects)  # compiles
    pictures, seconds = [], []
    for seed in range(seeds):
        start = time.process_time()
        image = warpmis.render(scene, method=method, spp=spp, seed=seed, features=effects, threads=1).image
        seconds.append(time.process_time() - start)
        pictures.append(image)
    return np.array(pictures, np.float64), statistics.median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=CASES)
    parser.add_argument("--method", default="nee")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report = {}
    print("| case | variance | time | efficiency |\n|---|---|---|---|")
    for case in arguments.cases:
        scene = scene_of(case, arguments.width)
        effects = detect(scene)
        settings = arguments.method, arguments.spp, arguments.seeds
        runs = [measure(scene, replace(effects, glossy_choice=on), *settings) for on in (False, True)]
        scale = squared_scale(np.mean([pictures.mean(axis=0) for pictures, _ in runs], axis=0))
        of_pixels = [pictures.var(axis=0, ddof=1) @ LUMINANCE / scale for pictures, _ in runs]
        before, after = (float(without_outliers(variance).mean()) for variance in of_pixels)
        seconds = runs[0][1] / runs[1][1]
        report[case] = {"variance": before / after, "time": seconds, "efficiency": before / after * seconds}
        print(f"| {case} | {before / after:.2f} | {seconds:.2f} | **{before / after * seconds:.2f}** |", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
