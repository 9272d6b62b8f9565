"""What denoising gains, whether it ever loses, and whether the estimate of its error is right:

    python scripts/bench/denoise.py [SCENE ...] [--spp 4 16 64 256] [--seeds 3] [--json FILE]
    python scripts/bench/denoise.py --full-size      seconds and memory at 1920 x 1080 pixels, nothing else

A scene is a folder of usd_scenes or the path of a stage. All figures are relMSE (warpmis/film/metrics.py). The squared
error is (x - R0).(x - R1) with two independent references, so that their noise does not enter it.

plain     a render of all samples, not denoised: what a user has without --denoise
denoised  the denoised picture against the references; estimate: what the render says of it, and its standard error
gain      plain over denoised
worst     the same for the worst seed: below 1 somebody has lost
tiles     share of tiles of 8 x 8 pixels that are worse denoised, of those with over 2 % of the mean tile's plain error
covered   how often the true error is within two standard errors of the estimate
bound     how often the true relative error is below the one that the render promises
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.film.denoise import TILE, Half, denoise, dot, tile_means
from warpmis.film.metrics import OUTLIERS, squared_scale
from warpmis.film.oidn import filter_with_oidn

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "veach_plates", "open_terrace", "ajar_door")
Row = dict[str, float]
Array = NDArray[np.float64]


class Reference:
    """Two independent renders, and the errors of others against them."""

    def __init__(self, scene: warpmis.Scene, spp: int, method: str = "nee") -> None:
        pictures = [warpmis.render(scene, method=method, spp=spp, seed=seed).image for seed in (10_000, 20_000)]
        self.pair = [picture.astype(np.float64) for picture in pictures]
        mean = (self.pair[0] + self.pair[1]) / 2.0
        self.scale, self.mean = squared_scale(mean), mean

    def errors(self, image: NDArray[np.float32]) -> Array:
        """Relative squared error of each pixel, without bias from the references' noise, shape (H, W)."""
        return dot(image - self.pair[0], image - self.pair[1]) / self.scale

    def relative_mse(self, image: NDArray[np.float32]) -> float:
        """Without the worst pixels, ranked against the references' mean."""
        apart = dot(image - self.mean, image - self.mean) / self.scale
        kept = np.argsort(apart, axis=None)[: apart.size - int(OUTLIERS * apart.size)]
        return float(self.errors(image).ravel()[kept].mean())


def measure(scene: warpmis.Scene, reference: Reference, spp: int, seeds: int) -> Row:
    plain_errors, errors, gains, worse, covered, bounded, seconds = [], [], [], [], [], [], []
    estimates, standard_errors = [], []
    for seed in range(seeds):
        plain = warpmis.render(scene, method="nee", spp=spp, seed=seed).image
        result = warpmis.render(scene, method="nee", spp=spp, seed=seed, denoise=True)
        assert result.denoised is not None
        stats = result.stats["denoise"]
        plain_errors.append(reference.relative_mse(plain))
        errors.append(reference.relative_mse(result.denoised))
        gains.append(plain_errors[-1] / errors[-1])
        before, after = (tile_means(reference.errors(picture)) for picture in (plain, result.denoised))
        counts = before > 0.02 * before.mean()
        worse.append((after > before)[counts].mean())
        covered.append(abs(stats["relative_mse"] - errors[-1]) < 2.0 * stats["standard_error"])
        bounded.append(errors[-1] ** 0.5 < stats["relative_error_bound"])
        seconds.append(stats["seconds"])
        estimates.append(stats["relative_mse"])
        standard_errors.append(stats["standard_error"])
    return {
        "spp": spp,
        "plain": float(np.mean(plain_errors)),
        "denoised": float(np.mean(errors)),
        "estimate": float(np.mean(estimates)),
        "standard_error": float(np.mean(standard_errors)),
        "gain": float(np.mean(plain_errors) / np.mean(errors)),
        "worst": float(np.min(gains)),
        "tiles": float(np.mean(worse)),
        "covered": float(np.mean(covered)),
        "bound": float(np.mean(bounded)),
        "seconds": float(np.median(seconds)),
    }


def measure_full_size(width: int = 1920, height: int = 1080) -> None:
    """A ramp with noise: what OIDN takes does not depend on the picture."""
    rng = np.random.default_rng(0)
    ramp = np.broadcast_to(np.linspace(0.1, 1.0, width, dtype=np.float32)[None, :, None], (height, width, 3))
    flat = np.full((height, width, 3), 0.5, np.float32)
    halves = [Half(ramp * rng.gamma(16.0, 1.0 / 16.0, ramp.shape).astype(np.float32), flat, flat) for _ in range(2)]
    before = resource.getrusage(resource.RUSAGE_SELF)
    start = time.perf_counter()
    denoise(halves[0], halves[1], filter_with_oidn)
    seconds = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_SELF)
    busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{width} x {height}: {seconds:.1f} s, {busy:.1f} CPU s, peak {after.ru_maxrss / 2**20:.2f} GiB")
    print(f"(peak before: {before.ru_maxrss / 2**20:.2f} GiB)")


def stage_of(name: str) -> Path:
    return Path(name) if Path(name).exists() else USD_SCENES / name / "scene.usda"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="folders in usd_scenes, or paths of stages")
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16, 64, 256])
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--full-size", action="store_true", help="measure time and memory at 1920 x 1080 alone")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if arguments.full_size:
        measure_full_size()
        return
    report: dict[str, list[Row]] = {}
    print(f"tiles of {TILE} x {TILE} pixels, {arguments.width} pixels wide")
    for name in arguments.scenes:
        start = time.perf_counter()
        scene = warpmis.load_stage(stage_of(name), width=arguments.width)
        reference = Reference(scene, arguments.reference_spp)
        print(f"\n{name}")
        print("| spp | plain | denoised | estimate | gain | worst | tiles worse | covered | bound holds | s |")
        print("|---|---|---|---|---|---|---|---|---|---|")
        rows = report[name] = []
        for spp in arguments.spp:
            row = measure(scene, reference, spp, arguments.seeds)
            rows.append(row)
            estimate = f"{row['estimate']:.5f} ± {row['standard_error']:.5f}"
            figures = (
                f"{row['plain']:.4f} | {row['denoised']:.5f} | {estimate} | {row['gain']:.1f} | {row['worst']:.1f}"
            )
            shares = f"{row['tiles']:.1%} | {row['covered']:.0%} | {row['bound']:.0%} | {row['seconds']:.2f}"
            print(f"| {spp} | {figures} | {shares} |", flush=True)
        print(f"({time.perf_counter() - start:.0f} s)", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
