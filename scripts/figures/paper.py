"""Figures 1 to 4 of Murray et al. (2020) from our scenes, and their numbers as a table:

    python scripts/figures/paper.py OUT [--figure 1 ...] [--height 120] [--spp 1280] [--learn-spp 64] [--zoom 1]

The paper has 32768 samples per pixel, 256 of them in each learn round (512 in figure 1): --spp 32768 --learn-spp 256.
Like there, samples are independent of each other, and the strategy of each is drawn at random.
A row is a scene. In figure 1 each picture has its allocation in the corner. In the others the first column is the
picture, and each further one a method's allocation above its efficiency, pixel by pixel: violet where it beats equal
shares, orange where it loses (full colour at factors of 8). OUT/figures.md has the efficiencies of whole pictures.

efficiency    1 / (variance x time) over that of equal shares of the same strategies (Veach 1997, equation 2.19): the
              variance of a sample's luminance relative to the pixel's, and the processor time of a sample with learning
              in it. Rounds of few samples learn nothing good.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.film.metrics import squared_scale, without_outliers
from warpmis.output.balance_map import balance_map
from warpmis.output.png import write_display_png
from warpmis.output.report.pixels import exposure_for, ratio_map
from warpmis.output.tonemap import to_display

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
TWO, THREE = ("bsdf", "light"), ("bsdf", "light", "uniform")
GAP = 4


@dataclass(frozen=True)
class Column:
    """A method of a figure: its strategies, and how many learn rounds it has."""

    method: str
    strategies: tuple[str, ...] = TWO
    rounds: int = 8

    @property
    def label(self) -> str:
        return f"{self.method}, {len(self.strategies)} strategies, {self.rounds} rounds"


@dataclass(frozen=True)
class Figure:
    """What a figure shows; rounds have `learn` times the samples that are asked for."""

    scenes: tuple[str, ...]
    columns: tuple[Column, ...]
    learn: int = 1


MURRAY = "murray20"
FIGURES = {
    1: Figure(("open_terrace",), (Column("sbert19"), Column(MURRAY), Column(MURRAY, THREE)), learn=2),
    2: Figure(("ajar_door", "open_terrace"), (Column("lpg13", rounds=1), Column("sbert19"))),
    3: Figure(("ajar_door", "open_terrace", "veach_plates"), (Column(MURRAY, rounds=1), Column(MURRAY))),
    4: Figure(
        ("cornell_box", "open_terrace"),
        (Column(MURRAY, rounds=1), Column(MURRAY), Column(MURRAY, THREE, rounds=1), Column(MURRAY, THREE)),
    ),
}


@dataclass(frozen=True, eq=False)
class Timed:
    """A render and the processor seconds of one of its samples, learning included."""

    result: warpmis.RenderResult
    cost: float


def timed(scene: warpmis.Scene, **settings: object) -> Timed:
    """Render, with a few pixels first so that no compilation is in the time."""
    warpmis.render(scene, **{**settings, "width": 4})
    start = time.process_time()
    result = warpmis.render(scene, **settings)
    return Timed(result, (time.process_time() - start) / result.stats["samples"])


def efficiency(ours: Timed, baseline: Timed) -> tuple[float, NDArray[np.float64]]:
    """Of the whole picture, and per pixel with both variances averaged over 5 x 5 pixels, shape (H, W)."""
    scale = squared_scale(baseline.result.image)
    variances = [np.asarray(one.result.variance / scale, np.float64) for one in (ours, baseline)]
    dearer = ours.cost / baseline.cost
    whole = [without_outliers(variance).mean() for variance in variances]
    pixels = [box_mean(np.minimum(variance, np.quantile(variance, 0.99))) + 1e-9 for variance in variances]
    return float(whole[1] / whole[0] / dearer), pixels[1] / pixels[0] / dearer


def box_mean(values: NDArray[np.float64], radius: int = 2) -> NDArray[np.float64]:
    side = 2 * radius + 1
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, radius, mode="edge"), (side, side)).mean(axis=(2, 3))


def row(number: int, name: str, arguments: argparse.Namespace) -> tuple[NDArray[np.uint8], list[str]]:
    """One scene of a figure, shape (h, w, 3), and its lines of the table."""
    figure = FIGURES[number]
    scene = warpmis.load_stage(USD_SCENES / name / "scene.usda")
    width = round(arguments.height * scene.resolution[0] / scene.resolution[1])
    settings = {"width": width, "spp": arguments.spp, "sampler": "independent", "strategy_choice": "random"}
    strategies = dict.fromkeys(column.strategies for column in figure.columns)
    equal = {some: timed(scene, method="balance", strategies=some, **settings) for some in strategies}
    image = equal[TWO].result.image
    picture = to_display(image, exposure_for(image))
    cells = [] if number == 1 else [np.concatenate([picture, np.full_like(picture, 255)])]
    lines = []
    for column in figure.columns:
        learn = {"learn_rounds": column.rounds, "learn_spp": figure.learn * arguments.learn_spp}
        ours = timed(scene, method=column.method, strategies=column.strategies, **settings, **learn)
        whole, pixels = efficiency(ours, equal[column.strategies])
        shares = balance_map(ours.result.allocation, column.strategies)
        cells.append(with_corner(picture, shares) if number == 1 else np.concatenate([shares, ratio_map(pixels)]))
        lines.append(f"| {number} | {name} | {column.label} | {whole:.2f} |")
        print(lines[-1], flush=True)
    return joined(cells, axis=1), lines


def with_corner(picture: NDArray[np.uint8], shares: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture with every third pixel of the allocation in its top left corner."""
    framed = picture.copy()
    small = shares[::3, ::3]
    framed[: len(small) + GAP, : small.shape[1] + GAP] = 255
    framed[: len(small), : small.shape[1]] = small
    return framed


def joined(pictures: list[NDArray[np.uint8]], axis: int) -> NDArray[np.uint8]:
    """Side by side (axis 1) or one above the other (axis 0), white between and where one is smaller."""
    size = max(picture.shape[1 - axis] for picture in pictures)
    parts = []
    for picture in pictures:
        room = [(0, 0), (0, 0), (0, 0)]
        room[1 - axis], room[axis] = (0, size - picture.shape[1 - axis]), (0, GAP)
        parts.append(np.pad(picture, room, constant_values=255))
    return np.concatenate(parts, axis=axis)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--figure", type=int, nargs="+", choices=FIGURES, default=list(FIGURES))
    parser.add_argument("--height", type=int, default=120)
    parser.add_argument("--spp", type=int, default=1280)
    parser.add_argument("--learn-spp", type=int, default=64)
    parser.add_argument("--zoom", type=int, default=1, help="how large a pixel is shown, for small pictures")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    table = ["| figure | scene | method | efficiency over equal shares |", "|---|---|---|---|"]
    for number in arguments.figure:
        rows = []
        for name in FIGURES[number].scenes:
            pictures, lines = row(number, name, arguments)
            rows.append(pictures)
            table += lines
        figure = joined(rows, axis=0).repeat(arguments.zoom, axis=0).repeat(arguments.zoom, axis=1)
        write_display_png(arguments.out / f"figure{number}.png", figure)
    (arguments.out / "figures.md").write_text("\n".join(table) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
