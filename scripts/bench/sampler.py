"""Samples on a lattice against independent ones, at equal samples:

    python scripts/bench/sampler.py [SCENE ...] [--spp 16 64 256] [--seeds 24] [--json FILE]

All figures are those of `lattice` over those of `independent` in the same run, method by method:

error^2     relMSE of the picture (warpmis/metrics.py), means over the seeds, the reference's own noise taken off
time        CPU seconds of tracing and learning on one thread; the lower quartile, for others only ever add to it
efficiency  1 / (error^2 x time), with its standard error: that of error^2, whose noise is by far the greater

The samplers take turns seed by seed, so that a change of the machine's speed falls on both.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from methods import CpuClock, lower_quartile

import warpmis
from warpmis.config import SAMPLERS
from warpmis.film.metrics import estimated_relative_error, relative_mse

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "veach_plates")
METHODS = ("nee", "balance", "auto")
Row = dict[str, float | str]


def measure(scene: warpmis.Scene, method: str, spp: int, seeds: int, reference: warpmis.RenderResult) -> Row:
    noise = estimated_relative_error(reference.image, reference.variance / reference.samples) ** 2
    errors: dict[str, list[float]] = {sampler: [] for sampler in SAMPLERS}
    seconds: dict[str, list[float]] = {sampler: [] for sampler in SAMPLERS}
    for sampler in SAMPLERS:  # compiles
        warpmis.render(scene, method=method, spp=spp, sampler=sampler)
    for seed in range(seeds):
        for sampler in SAMPLERS:
            clock = CpuClock()
            result = warpmis.render(
                scene, method=method, spp=spp, sampler=sampler, seed=seed, threads=1, progress=clock
            )
            seconds[sampler].append(clock.seconds())
            errors[sampler].append(relative_mse(result.image, reference.image) - noise)
    lattice, independent = (np.array(errors[sampler]) for sampler in SAMPLERS)
    error = lattice.mean() / independent.mean()
    cost = lower_quartile(seconds["lattice"]) / lower_quartile(seconds["independent"])
    spread = np.hypot(*(values.std(ddof=1) / values.mean() for values in (lattice, independent))) / seeds**0.5
    efficiency = 1.0 / (error * cost)
    figures = {"error^2": error, "time": cost, "efficiency": efficiency, "standard error": efficiency * spread}
    return {"method": method, "spp": spp, **{name: float(value) for name, value in figures.items()}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="names of folders in usd_scenes")
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64, 256])
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--reference-spp", type=int, default=16384)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report: dict[str, list[Row]] = {}
    for name in arguments.scenes:
        start = time.perf_counter()
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        # Whose variance tells its noise.
        reference = warpmis.render(
            scene, method="auto", spp=arguments.reference_spp, seed=10_000, sampler="independent"
        )
        runs = [(method, spp) for method in METHODS for spp in arguments.spp]
        rows = report[name] = [measure(scene, method, spp, arguments.seeds, reference) for method, spp in runs]
        print(f"\n{name} ({time.perf_counter() - start:.0f} s)")
        print("| method, samples per pixel | error^2 | time | efficiency |\n|---|---|---|---|")
        for row in rows:
            figures = f"{row['error^2']:.2f} | {row['time']:.2f} | {row['efficiency']:.2f}"
            print(f"| {row['method']}, {row['spp']} | {figures} ± {row['standard error']:.2f} |", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
