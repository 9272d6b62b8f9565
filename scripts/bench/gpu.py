"""All that only a GPU can show, in one call of some minutes:

    python scripts/bench/gpu.py [--json gpu.json] [--table gpu.md] [--budget 420] [--device cuda:0]

agreement   the GPU's pictures against the CPU's. The four scenes by `nee` and `auto`: the mean luminance of each of
            8 x 8 blocks, by other seeds, is a z-test. The stages of tests/hard by `nee`: that of the whole picture.
            All samples are independent there, as a z-test asks. The least p-value counts after Sidak's correction,
            and 0.001 is the limit. `equal`: the share of pixels that agree to 1 % by the same seed, which has the
            same numbers, but for rounding.
speed       samples per second of tracing by scene and method, the median of the repeats (least to most), without
            compiling. `in kernels`: the share of that time in which the GPU ran a kernel, by CUDA's events; `gap`:
            the rest of it over the number of launches.
registers   of a thread of each trace kernel, and its frame of local memory (cuda_registers.py); `compile`: all of
            them, in as many threads as there are CPUs.

What the budget [s] has no time for is left out and listed. The JSON is written after each part, so that a call that is
cut off has left something. Any Python from 3.11 on will do, and no installation. Where packages are missing and nothing
can be fetched, make a folder `wheels` in the checkout beforehand, on a machine like it (or with --platform and
--python-version for another):

    pip download -d wheels --only-binary=:all: warp-lang==1.19.* usd-core OpenEXR OpenImageIO numpy rich

`--device cpu` tries the program itself where there is no GPU: it compares the CPU with itself, by fewer samples.
"""

from __future__ import annotations

import argparse
import atexit
import importlib.util
import json
import math
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import warp as wp

    import warpmis

ROOT = Path(__file__).parents[2]
PACKAGES = {"warp": "warp-lang", "pxr": "usd-core", "OpenEXR": "OpenEXR", "OpenImageIO": "OpenImageIO",
            "numpy": "numpy", "rich": "rich"}  # fmt: skip
SCENES = ("cornell_box", "veach_plates", "ajar_door", "open_terrace")
AGREEMENT_METHODS = ("nee", "auto")
SPEED_METHODS = ("nee", "balance", "murray20", "auto")
BLOCKS = 8
LIMIT = 1e-3  # of the least p-value of a family of tests
ROUNDING = 2e-5  # relative, of float32 sums in another order
INDEPENDENT = {"sampler": "independent", "strategy_choice": "random"}


def provide_packages() -> None:
    """Make what is missing importable from the folder `wheels`, or say in one line what to do."""
    missing = [package for module, package in PACKAGES.items() if importlib.util.find_spec(module) is None]
    if missing:
        wheels = ROOT / "wheels"
        if not wheels.is_dir():
            sys.exit(
                f"gpu.py: {', '.join(missing)} are missing: pip download -d wheels --only-binary=:all: ... (--help)"
            )
        target = tempfile.mkdtemp(prefix="gpu-packages-")
        atexit.register(shutil.rmtree, target, ignore_errors=True)
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--find-links", str(wheels)]
        if subprocess.run([*command, "--target", target, *missing], check=False).returncode != 0:
            sys.exit(f"gpu.py: {', '.join(missing)} cannot be installed from {wheels}: see what pip says above")
        sys.path.insert(0, target)
    sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(Path(__file__).parent)]


@dataclass
class Bench:
    """One call: what is asked, what was found so far, and how long it may go on."""

    device: str
    budget: float
    json: Path | None
    dry: bool
    report: dict[str, Any] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    def has_time(self, what: str) -> bool:
        """Whether the budget is not spent; else `what` is left out."""
        if time.perf_counter() - self.started < self.budget:
            return True
        self.report["left_out"].append(what)
        return False

    def save(self) -> None:
        if self.json is not None:
            self.json.write_text(json.dumps(self.report, indent=2), encoding="utf-8")

    def scene(self, name: str, width: int) -> warpmis.Scene:
        import warpmis

        return warpmis.load_stage(ROOT / "usd_scenes" / name / "scene.usda", width=width)


# ---- agreement -------------------------------------------------------------------------------------------------------


def p_of(z: float) -> float:
    """Of a two-sided test."""
    return math.erfc(abs(z) / math.sqrt(2.0))


def sidak(p: float, tests: int) -> float:
    """How likely so many independent tests without an effect give a p-value as low as this. Reference: Sidak (1967)."""
    return -math.expm1(tests * math.log1p(-p)) if p < 1.0 else 1.0


def luminance(image: np.ndarray) -> np.ndarray:
    import numpy as np

    return image.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def block_scores(a: warpmis.RenderResult, b: warpmis.RenderResult, blocks: int) -> list[float]:
    """z of the difference of the mean luminances in each of blocks x blocks; rounding counts as a standard error."""
    import numpy as np

    scores = []
    pictures = [luminance(result.image) for result in (a, b)]
    variances = [result.variance.astype(np.float64) / np.maximum(result.samples, 1) for result in (a, b)]
    height, width = pictures[0].shape
    for rows in np.array_split(np.arange(height), blocks):
        for columns in np.array_split(np.arange(width), blocks):
            at = np.ix_(rows, columns)
            means = [float(picture[at].mean()) for picture in pictures]
            square = sum(float(variance[at].sum()) for variance in variances) / (len(rows) * len(columns)) ** 2
            error = math.hypot(math.sqrt(square), ROUNDING * max(means))
            scores.append((means[0] - means[1]) / error if error > 0.0 else 0.0)
    return scores


def equal_share(a: np.ndarray, b: np.ndarray) -> float:
    import numpy as np

    return float(np.isclose(a, b, rtol=1e-2, atol=1e-6 * float(np.abs(b).max())).all(axis=-1).mean())


def agreement(bench: Bench) -> None:
    """The four scenes, block by block."""
    import warpmis

    settings = {"spp": 16 if bench.dry else 256, **INDEPENDENT}
    for name in SCENES[:: 4 if bench.dry else 1]:
        scene = bench.scene(name, 64)
        for method in AGREEMENT_METHODS[:: 2 if bench.dry else 1]:
            if not bench.has_time(f"agreement, {name}, {method}"):
                continue
            cpu = warpmis.render(scene, method=method, seed=1, **settings)
            same, other = (
                warpmis.render(scene, method=method, seed=seed, device=bench.device, **settings) for seed in (1, 2)
            )
            scores = block_scores(cpu, other, BLOCKS)
            row = {"scene": name, "method": method, "tests": len(scores), "worst_z": max(scores, key=abs),
                   "p": sidak(p_of(max(scores, key=abs)), len(scores)), "equal": equal_share(same.image, cpu.image),
                   "rejected": other.stats["rejected_samples"]}  # fmt: skip
            bench.report["agreement"].append(row)
            print(f"agreement {name} {method}: worst z {row['worst_z']:.2f}, p {row['p']:.3f}, "
                  f"{100.0 * row['equal']:.1f} % equal", flush=True)  # fmt: skip
            bench.save()


def hard_agreement(bench: Bench) -> None:
    """The stages of tests/hard, with the effects of all of them in one kernel."""
    from hard.every import cases, effects_of

    import warpmis

    scenes = {}
    for case in cases()[:: 20 if bench.dry else 1]:
        built = case.build()
        scenes[case.name] = built if isinstance(built, warpmis.Scene) else warpmis.load_stage(built)
    features = effects_of(scenes.values())
    settings = {"method": "nee", "max_depth": 2, "spp": 64, "features": features, **INDEPENDENT}
    rows: list[dict[str, Any]] = []
    for name, scene in scenes.items():
        if not bench.has_time(f"agreement, {name}"):
            continue
        cpu = warpmis.render(scene, seed=1, **settings)
        gpu = warpmis.render(scene, seed=2, device=bench.device, **settings)
        (score,) = block_scores(cpu, gpu, 1)
        rows.append({"case": name, "z": score, "rejected": gpu.stats["rejected_samples"]})
    if rows:
        worst = max(rows, key=lambda row: abs(row["z"]))
        p = sidak(p_of(worst["z"]), len(rows))
        bench.report["hard"] = {"cases": rows, "worst": worst["case"], "worst_z": worst["z"], "p": p}
        print(
            f"agreement of {len(rows)} hard stages: worst z {worst['z']:.2f} ({worst['case']}), p {p:.3f}", flush=True
        )
    bench.save()


# ---- speed and registers ---------------------------------------------------------------------------------------------


def trace_kernels_of(bench: Bench) -> dict[str, wp.Kernel]:
    """The trace kernels of all scenes and methods, by the first scene and method that launches each."""
    from warpmis.config import RenderConfig
    from warpmis.rendering.specialise import features_of, kernels_of

    kernels: dict[str, wp.Kernel] = {}
    for name in SCENES[:: 4 if bench.dry else 1]:
        scene = bench.scene(name, 64)
        for method in SPEED_METHODS:
            config = RenderConfig(method=method, device=bench.device)
            for kernel in kernels_of(features_of(scene, config).with_tree("warp"), config).all:
                if "trace" in kernel.key and kernel not in kernels.values():
                    kernels[f"{name} {method}{' (2)' * (f'{name} {method}' in kernels)}"] = kernel
    return dict(list(kernels.items())[: 1 if bench.dry else None])  # each takes seconds


def compile_all(bench: Bench) -> None:
    """Every trace kernel on the device, in parallel."""
    import warp as wp

    kernels = trace_kernels_of(bench)
    start = time.perf_counter()
    modules = [kernel.module for kernel in kernels.values()]
    wp.force_load(device=bench.device, modules=modules, max_workers=len(os.sched_getaffinity(0)))
    bench.report["compile"] = {"kernels": len(modules), "seconds": time.perf_counter() - start}
    print(f"compile: {len(modules)} trace kernels in {bench.report['compile']['seconds']:.1f} s", flush=True)
    bench.save()


def registers(bench: Bench) -> None:
    import warp as wp
    from cuda_registers import compiled, resources

    from warpmis.device.kernel_cache import binaries, folder_of

    device = wp.get_device(bench.device)
    for label, kernel in trace_kernels_of(bench).items():
        if not bench.has_time(f"registers, {label}"):
            continue
        found = [] if device.is_cpu else binaries(folder_of(kernel.module, is_cpu=False), is_cpu=False)
        cubins = [path for path in found if path.suffix == ".cubin"]
        arch = 90 if device.is_cpu else device.arch
        row = {"kernel": label, **(resources(cubins[0].read_bytes()) if cubins else compiled(kernel, arch))}
        bench.report["registers"].append(row)
    bench.save()


def speed(bench: Bench) -> None:
    import warpmis

    width, spp, repeats = (64, 4, 2) if bench.dry else (1024, 64, 5)
    for name in SCENES[:: 4 if bench.dry else 1]:
        scene = bench.scene(name, width)
        for method in SPEED_METHODS[:: 4 if bench.dry else 1]:
            if not bench.has_time(f"speed, {name}, {method}"):
                continue
            settings = {"method": method, "spp": spp, "device": bench.device}
            warpmis.render(scene, **settings)  # compiles what is missing, and warms up
            rates = []
            for seed in range(repeats):
                stats = warpmis.render(scene, seed=seed, **settings).stats
                rates.append(stats["samples"] / (stats["seconds"]["learn"] + stats["seconds"]["render"]))
            row = {
                "scene": name,
                "method": method,
                "rate": statistics.median(rates),
                "least": min(rates),
                "most": max(rates),
                **launch_gaps(scene, settings),
            }
            bench.report["speed"].append(row)
            print(f"speed {name} {method}: {row['rate'] / 1e6:.1f} Msamples/s", flush=True)
            bench.save()


def launch_gaps(scene: warpmis.Scene, settings: dict[str, Any]) -> dict[str, Any]:
    """What of a render's tracing the GPU spent in kernels, and the rest over the launches; nothing on a CPU."""
    import warp as wp

    import warpmis

    if wp.get_device(settings["device"]).is_cpu:
        return {"launches": None, "in_kernels": None, "gap": None}
    wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
    try:
        result = warpmis.render(scene, **settings)
    finally:
        events = wp.timing_end()
    seconds = result.stats["seconds"]["learn"] + result.stats["seconds"]["render"]
    busy = sum(event.elapsed for event in events) / 1e3
    gap = (seconds - busy) / max(len(events), 1)
    return {"launches": len(events), "in_kernels": min(busy / seconds, 1.0), "gap": max(gap, 0.0)}


# ---- what is said ----------------------------------------------------------------------------------------------------


def machine(bench: Bench) -> dict[str, Any]:
    import warp as wp

    device = wp.get_device(bench.device)
    facts = {"device": device.name, "python": platform.python_version(), "warp": wp.config.version}
    if device.is_cuda:
        facts |= {"arch": device.arch, "memory_bytes": device.total_memory,
                  "driver": ".".join(map(str, wp.get_cuda_driver_version())),
                  "toolkit": ".".join(map(str, wp.get_cuda_toolkit_version()))}  # fmt: skip
    return facts


def tables(report: dict[str, Any]) -> Iterator[str]:
    """The report in Markdown."""
    yield ", ".join(f"{name}: {value}" for name, value in report["machine"].items())
    yield "\n| scene | method | worst z of 64 | p | equal pixels | rejected |\n|---|---|---|---|---|---|"
    for row in report["agreement"]:
        yield (f"| {row['scene']} | {row['method']} | {row['worst_z']:.2f} | {row['p']:.3f} | "
               f"{100.0 * row['equal']:.1f} % | {row['rejected']} |")  # fmt: skip
    if "hard" in report:
        hard = report["hard"]
        yield f"\n{len(hard['cases'])} hard stages: worst z {hard['worst_z']:.2f} ({hard['worst']}), p {hard['p']:.3f}."
    yield "\n| scene | method | Msamples/s | in kernels | launches | gap [us] |\n|---|---|---|---|---|---|"
    for row in report["speed"]:
        gaps = "— | — | —"
        if row["launches"] is not None:
            gaps = f"{100.0 * row['in_kernels']:.1f} % | {row['launches']} | {1e6 * row['gap']:.1f}"
        rates = f"{row['rate'] / 1e6:.1f} ({row['least'] / 1e6:.1f} to {row['most'] / 1e6:.1f})"
        yield f"| {row['scene']} | {row['method']} | {rates} | {gaps} |"
    yield "\n| trace kernel | registers | frame [B] |\n|---|---|---|"
    yield from (f"| {row['kernel']} | {row['registers']} | {row['frame']} |" for row in report["registers"])
    yield from (f"\nFailed: {line}" for line in report["failed"])
    if report["left_out"]:
        yield f"\nNo time for: {'; '.join(report['left_out'])}."


def disagreements(report: dict[str, Any]) -> list[str]:
    """The families of tests beyond the limit, and what had samples that were not finite."""
    rows = [(f"{row['scene']} {row['method']}", row) for row in report["agreement"]]
    rows += [("hard stages", {**report["hard"], "rejected": sum(row["rejected"] for row in report["hard"]["cases"])})
             ] if "hard" in report else []  # fmt: skip
    return [name for name, row in rows if row["p"] < LIMIT or row["rejected"]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument(
        "--budget", type=float, default=420.0, metavar="SECONDS", help="begin nothing after so long (420)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--table", type=Path, metavar="FILE", help="the tables in Markdown (standard output)")
    arguments = parser.parse_args()
    provide_packages()
    from warpmis.device.upload import check_device
    from warpmis.errors import ConfigError

    try:
        check_device(arguments.device)
    except ConfigError as error:
        sys.exit(f"gpu.py: {error}; --device cpu tries the program itself")
    bench = Bench(arguments.device, arguments.budget, arguments.json, dry=arguments.device == "cpu")
    bench.report |= {
        "machine": machine(bench),
        "agreement": [],
        "speed": [],
        "registers": [],
        "left_out": [],
        "failed": [],
    }
    for part in (compile_all, agreement, hard_agreement, speed, registers):
        try:
            part(bench)
        except Exception as error:  # the other parts are worth having
            traceback.print_exc()
            bench.report["failed"].append(f"{part.__name__}: {type(error).__name__}: {' '.join(str(error).split())}")
    bench.report["seconds"] = time.perf_counter() - bench.started
    bench.save()
    text = "\n".join(tables(bench.report)) + "\n"
    print(text, end="") if arguments.table is None else arguments.table.write_text(text, encoding="utf-8")
    if bench.report["failed"]:
        sys.exit(f"gpu.py: failed: {'; '.join(bench.report['failed'])}")
    if wrong := disagreements(bench.report):
        sys.exit(f"gpu.py: the devices disagree, or samples were not finite: {', '.join(wrong)}")


if __name__ == "__main__":
    main()
