"""What many lights cost, and how much noise they leave:

    python scripts/bench/many_lights.py cost [--counts 1 10 100 1000 10000] [--kinds lamps triangles] [--json FILE]
    python scripts/bench/many_lights.py noise [SCENE ...] [--json FILE]
    python scripts/bench/many_lights.py write FOLDER

cost    CPU time of a sample, of tracing alone, over that of the same hall under one lamp. The hall is 40 m long, with
        60 crates. lamps: spheres of 4 to 16 cm, smaller above 1,000; points: points in their places; triangles: panes
        that glow; mix: lamps, a sun and a dome. Kinds and counts take turns, a round each; medians with quartiles
noise   relMSE times CPU seconds of tracing, against a reference of many samples: 100 lamps in a hall whose walls hide
        most of them, 10,000 in a street, an inscription of 50,000 triangles that glow
write   the noise scenes as USD files, for other renderers and other versions of this one: `noise` takes files as well
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpmis

FloatArray = NDArray[np.float64]
HALL = (40.0, 6.0, 20.0)
RELATIVE = 1e-2


def prim(kind: str, name: str, *lines: str) -> str:
    return f'def {kind} "{name}"\n{{\n' + "\n".join(lines) + "\n}\n"


def numbers(values: FloatArray) -> str:
    return ", ".join(f"({', '.join(f'{v:.6g}' for v in row)})" for row in np.reshape(values, (-1, 3)))


def mesh(name: str, quads: FloatArray, glow: float = 0.0) -> str:
    """Quads, shape (n, 4, 3); they glow with that radiance."""
    lines = [
        f"int[] faceVertexCounts = [{', '.join(['4'] * len(quads))}]",
        f"int[] faceVertexIndices = [{', '.join(map(str, range(4 * len(quads))))}]",
        f"point3f[] points = [{numbers(quads)}]",
        'uniform token subdivisionScheme = "none"',
    ]
    if not glow:
        return prim("Mesh", name, *lines)
    lines += [f"float inputs:intensity = {glow:.6g}", 'uniform token light:materialSyncMode = "noMaterialResponse"']
    return prim("Mesh", name, *lines).replace("\n{", ' (\nprepend apiSchemas = ["MeshLightAPI"]\n)\n{', 1)


def box(low: FloatArray, high: FloatArray) -> FloatArray:
    """The six faces of a box, shape (6, 4, 3)."""
    corners = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
    return corners[[[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]]


def lamp(k: int, center: FloatArray, radius: float, intensity: float) -> str:
    return prim(
        "SphereLight",
        f"L{k}",
        f"float inputs:radius = {radius:.6g}",
        f"float inputs:intensity = {intensity:.6g}",
        f"double3 xformOp:translate = {numbers(center)}",
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    )


def point(k: int, center: FloatArray, intensity: float) -> str:
    text = lamp(k, center, 0.0, intensity)
    return text.replace("float inputs:radius = 0\n", "bool treatAsPoint = true\n")


def camera(place: tuple[float, ...], turn: tuple[float, ...] = (0.0, 0.0, 0.0)) -> str:
    return prim(
        "Camera",
        "main_cam",
        "float focalLength = 18",
        f"double3 xformOp:translate = {place}",
        f"float3 xformOp:rotateXYZ = {turn}",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]',
    )


def stage(*prims: str) -> str:
    return '#usda 1.0\n(\ndefaultPrim = "World"\nupAxis = "Y"\n)\n' + prim("Xform", "World", *prims)


def hall(kind: str, count: int) -> str:
    """A hall with crates under so many lights of a kind, whose power is the same in all."""
    random = np.random.default_rng(1)
    half = np.array([HALL[0] / 2, 0.0, HALL[2] / 2])
    low = np.column_stack([random.uniform(-19, 18, 60), np.zeros(60), random.uniform(-9, 7, 60)])
    sizes = random.uniform(0.4, 1.6, (60, 3))
    crates = np.concatenate([box(corner, corner + size) for corner, size in zip(low, sizes, strict=True)])
    walls = box(-half, half + np.array([0.0, HALL[1], 0.0]))
    places = random.uniform([-19.5, 2.5, -9.5], [19.5, 5.8, 9.5], (count, 3))
    parts = [camera((-18.0, 3.0, 0.0), (-8.0, -90.0, 0.0)), mesh("Hall", walls), mesh("Crates", crates)]
    if kind == "triangles":
        panes = places[:, None] + random.normal(size=(count, 4, 3)) * 0.05
        panes[:, 3] = panes[:, 2]  # triangles, as quads with a corner twice
        return stage(*parts, mesh("Panes", panes, 2e6 / count))
    if kind == "points":
        return stage(*parts, *(point(k, place, 4e3 / count) for k, place in enumerate(places)))
    # 100,000 of that size would fill the hall: a ray would pass through thirteen.
    size = min(1.0, (1000 / count) ** 0.5)
    intensity = 2e5 / (count * size**2)
    parts += [lamp(k, place, size * random.uniform(0.04, 0.16), intensity) for k, place in enumerate(places)]
    if kind == "mix":
        parts += [prim("DistantLight", "Sun", "float inputs:intensity = 100"), prim("DomeLight", "Sky")]
    return stage(*parts)


def hidden_hall() -> str:
    """25 rooms with narrow doors and four lamps each; the camera is in one of them."""
    random = np.random.default_rng(2)
    walls = [box(np.array([-15.0, 0.0, -15.0]), np.array([15.0, 3.0, 15.0]))]
    for k in range(1, 5):
        at = -15.0 + 6.0 * k
        for row in range(5):
            begin = -15.0 + 6.0 * row
            for start, end in ((begin, begin + 4.8), (begin + 5.6, begin + 6.0)):
                walls.append(box(np.array([at - 0.05, 0.0, start]), np.array([at + 0.05, 3.0, end])))
                walls.append(box(np.array([start, 0.0, at - 0.05]), np.array([end, 3.0, at + 0.05])))
    cells = np.array([(-12.0 + 6.0 * i, 0.0, -12.0 + 6.0 * j) for i in range(5) for j in range(5)]).repeat(4, axis=0)
    places = cells + random.uniform([-2.5, 2.2, -2.5], [2.5, 2.9, 2.5], (100, 3))
    lamps = [lamp(k, place, 0.05, random.uniform(100, 1000)) for k, place in enumerate(places)]
    return stage(camera((-2.0, 1.6, 2.5), (-5.0, -20.0, 0.0)), mesh("Walls", np.concatenate(walls)), *lamps)


def street() -> str:
    """10,000 lamps along 400 m of fronts, windows and lanterns, of very different brightness."""
    random = np.random.default_rng(3)
    fronts = [box(np.array([-200.0, -0.1, -12.0]), np.array([200.0, 0.0, 12.0]))]
    for k in range(40):
        for side in (-1.0, 1.0):
            height = random.uniform(8.0, 20.0)
            near, far = sorted((side * random.uniform(7.0, 9.0), side * 12.0))
            fronts.append(box(np.array([10.0 * k - 200.0, 0.0, near]), np.array([10.0 * k - 190.5, height, far])))
    places = np.column_stack(
        [random.uniform(-200, 200, 10000), random.uniform(0.5, 9.0, 10000), random.choice([-6.8, 6.8], 10000)]
    )
    bright = 10.0 ** random.uniform(1.0, 4.0, 10000)
    lamps = [lamp(k, place, 0.03, value) for k, (place, value) in enumerate(zip(places, bright, strict=True))]
    return stage(camera((-195.0, 2.0, 0.0), (0.0, -90.0, 0.0)), mesh("Street", np.concatenate(fronts)), *lamps)


# Five rows of three for each letter.
LETTERS = {"W": "#.##.##.#####.#", "A": ".#.#.#####.##.#", "R": "##.#.###.#.##.#", "P": "##.#.###.#..#.."}


def inscription() -> str:
    """Letters of glowing tiles before a wall: 50,000 triangles, of which some 15,000 can be seen from anywhere."""
    tiles = []
    for place, letter in enumerate("WARPWARP"):
        for cell, mark in enumerate(LETTERS[letter]):
            if mark == "#":
                x, y = 0.8 * place + 0.2 * (cell % 3) - 3.2, 2.0 - 0.2 * (cell // 3)
                tiles.append(finely_divided(box(np.array([x, y, -0.1]), np.array([x + 0.18, y + 0.18, 0.0])), 7))
    walls = box(np.array([-5.0, 0.0, -1.0]), np.array([5.0, 4.0, 5.0]))
    return stage(camera((0.0, 1.5, 4.5)), mesh("Walls", walls), mesh("Letters", np.concatenate(tiles), 6.0))


def finely_divided(quads: FloatArray, side: int) -> FloatArray:
    """Each quad as side x side quads."""
    s = np.linspace(0.0, 1.0, side + 1)

    def at(u: float, v: float) -> FloatArray:
        lower = (1.0 - u) * quads[:, 0] + u * quads[:, 1]
        return np.asarray((1.0 - v) * lower + v * ((1.0 - u) * quads[:, 3] + u * quads[:, 2]))

    spans = [(s[a], s[a + 1], s[b], s[b + 1]) for a in range(side) for b in range(side)]
    return np.concatenate([np.stack([at(a, c), at(b, c), at(b, d), at(a, d)], axis=1) for a, b, c, d in spans])


NOISE: dict[str, Callable[[], str]] = {"hall": hidden_hall, "street": street, "inscription": inscription}


def loaded(text: str, width: int) -> warpmis.Scene:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.usda"
        path.write_text(text)
        return warpmis.load_stage(path, width=width)


def cpu_seconds(scene: warpmis.Scene, method: str, spp: int, seed: int) -> tuple[float, NDArray[Any]]:
    """CPU time of a render on one thread, and its picture."""
    start = time.process_time()
    image = warpmis.render(scene, method=method, spp=spp, seed=seed, threads=1).image
    return time.process_time() - start, image


def traced(scene: warpmis.Scene, method: str, spp: int, seed: int) -> tuple[float, NDArray[Any]]:
    """CPU seconds of tracing `spp` samples, and the picture: what comes before the first sample is taken off."""
    before, _ = cpu_seconds(scene, method, 1, seed)
    whole, image = cpu_seconds(scene, method, spp + 1, seed)
    return whole - before, image


def cost(arguments: argparse.Namespace) -> dict[str, Any]:
    """Microseconds of a sample by kind and count, and over those of one lamp."""
    cases = [(kind, count) for kind in arguments.kinds for count in arguments.counts]
    cases = [("lamps", 1), *(case for case in cases if case != ("lamps", 1))]
    scenes = {case: loaded(hall(*case), arguments.width) for case in cases}
    for scene in scenes.values():
        cpu_seconds(scene, arguments.method, 1, 0)
    times: dict[Any, list[float]] = {case: [] for case in cases}
    for seed in range(arguments.rounds):
        for case, scene in scenes.items():
            seconds, image = traced(scene, arguments.method, arguments.spp, seed)
            times[case].append(1e6 * seconds / (arguments.spp * image.shape[0] * image.shape[1]))
    report: dict[str, Any] = {}
    for kind, count in cases:
        ratios = [own / one for own, one in zip(times[kind, count], times["lamps", 1], strict=True)]
        low, median, high = statistics.quantiles(ratios, n=4)
        microseconds = statistics.median(times[kind, count])
        report[f"{kind} {count}"] = {"microseconds": microseconds, "over one": [low, median, high]}
        print(f"{kind:10} {count:>7}: {microseconds:7.2f} us, {median:6.2f} ({low:.2f} to {high:.2f})", flush=True)
    return report


def relative_mse(image: NDArray[Any], reference: NDArray[Any]) -> float:
    error = (image.astype(float) - reference) ** 2
    return float((error / (reference**2 + RELATIVE * (reference**2).mean())).mean())


def noise(arguments: argparse.Namespace) -> dict[str, Any]:
    """relMSE, CPU seconds and their product, medians over the rounds' seeds."""
    report: dict[str, Any] = {}
    for name in arguments.scenes:
        width = arguments.width
        scene = loaded(NOISE[name](), width) if name in NOISE else warpmis.load_stage(name, width=width)
        if arguments.reference_picture:
            reference = np.load(arguments.reference_picture)
        else:
            reference = cpu_seconds(scene, "nee", arguments.reference, 12345)[1].astype(float)
            if arguments.json:
                np.save(arguments.json.with_suffix(".reference.npy"), reference)
        runs = [traced(scene, arguments.method, arguments.spp, seed) for seed in range(arguments.rounds)]
        errors = [relative_mse(image, reference) for _, image in runs]
        seconds = [seconds for seconds, _ in runs]
        error, second = statistics.median(errors), statistics.median(seconds)
        report[name] = {"relmse": error, "seconds": second, "product": error * second}
        print(f"{name}: relMSE {error:.4g}, {second:.3f} s, product {error * second:.4g}", flush=True)
    return report


def write(arguments: argparse.Namespace) -> dict[str, Any]:
    for name, make in NOISE.items():
        (arguments.folder / f"{name}.usda").write_text(make())
    return {}


def options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    of_cost, of_noise = commands.add_parser("cost"), commands.add_parser("noise")
    of_cost.add_argument("--counts", type=int, nargs="+", default=[1, 10, 100, 1000, 10000])
    of_cost.add_argument("--kinds", nargs="+", default=["lamps", "points", "triangles", "mix"])
    of_noise.add_argument("scenes", nargs="*", default=list(NOISE), help=f"{', '.join(NOISE)}, or files")
    of_noise.add_argument("--reference", type=int, default=4096, help="samples per pixel of the reference")
    of_noise.add_argument("--reference-picture", type=Path, help="a reference that another run has written")
    for command, spp in ((of_cost, 64), (of_noise, 16)):
        command.add_argument("--spp", type=int, default=spp)
        command.add_argument("--method", default="nee")
        command.add_argument("--width", type=int, default=64)
        command.add_argument("--rounds", type=int, default=7)
        command.add_argument("--json", type=Path)
    commands.add_parser("write").add_argument("folder", type=Path)
    return parser


def main() -> None:
    arguments = options().parse_args()
    report = {"cost": cost, "noise": noise, "write": write}[arguments.command](arguments)
    if getattr(arguments, "json", None):
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
