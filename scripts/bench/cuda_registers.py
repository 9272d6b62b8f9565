"""Registers and stack of the trace kernels as compiled for an NVIDIA GPU; neither a GPU nor a driver is needed:

    python scripts/bench/cuda_registers.py [SCENE ...] [--method NAME] [--arch 90] [--json FILE]

registers  of a thread; 65536 over these is how many threads a multiprocessor holds at a time, 2048 at most
frame      bytes of local memory of a thread: the traversal's stacks (bare mesh queries have these alone), other
           arrays that are indexed, and what registers do not hold; stack: the same with all calls

Both stand in the section .nv.info of the cubin, which is an ELF file: records of a format byte (4: with a payload), an
attribute byte, the payload's size, and for these attributes a payload of symbol and value.
"""

from __future__ import annotations

import argparse
import json
import struct
import tempfile
from pathlib import Path

import warp as wp
from recorded_rays import bare_queries

import warpmis
from warpmis.config import RenderConfig
from warpmis.kernels.trace import make_trace
from warpmis.rendering.specialise import features_of
from warpmis.scene.features import Features

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
WITH_PAYLOAD = 4
ATTRIBUTES = {0x2F: "registers", 0x11: "frame", 0x12: "stack"}


def sections(elf: bytes) -> dict[str, bytes]:
    """Contents of each section of a 64-bit little-endian ELF file, by name."""
    table, entry, count, names = *struct.unpack_from("<Q", elf, 40), *struct.unpack_from("<HHH", elf, 58)
    headers = [struct.unpack_from("<IIQQQQ", elf, table + entry * index) for index in range(count)]
    contents = [elf[offset : offset + size] for _, _, _, _, offset, size in headers]
    text = contents[names]
    return {
        text[header[0] : text.index(b"\0", header[0])].decode(): content
        for header, content in zip(headers, contents, strict=True)
    }


def resources(cubin: bytes) -> dict[str, int]:
    """Largest value of each attribute over the functions of a cubin; the kernel is the caller of them all."""
    info = sections(cubin)[".nv.info"]
    found = dict.fromkeys(ATTRIBUTES.values(), 0)
    at = 0
    while at < len(info):
        format_, attribute, size = struct.unpack_from("<BBH", info, at)
        at += 4
        if format_ != WITH_PAYLOAD:
            continue
        if attribute in ATTRIBUTES:
            _, value = struct.unpack_from("<II", info, at)
            found[ATTRIBUTES[attribute]] = max(found[ATTRIBUTES[attribute]], value)
        at += size
    return found


def compiled(kernel: wp.Kernel, arch: int) -> dict[str, int]:
    with tempfile.TemporaryDirectory() as folder:
        (path,) = wp.compile_aot_module(kernel.module, arch=[arch], module_dir=folder, use_ptx=False)
        return resources(path.read_bytes())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell_box"], help="names of folders in usd_scenes")
    parser.add_argument("--method", nargs="+", default=["nee", "balance", "auto"])
    parser.add_argument("--arch", type=int, default=90)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    kernels = {"bare mesh queries": bare_queries}
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=64)
        for method in arguments.method:
            config = RenderConfig(method=method)
            for kind, forced in (("", None), (" universal", Features.all())):
                kernels[f"{name} {method}{kind}"] = make_trace(features_of(scene, config, forced).with_tree("warp"))
    report = {}
    for label, kernel in kernels.items():
        report[label] = compiled(kernel, arguments.arch)
        print(f"{label:32}", ", ".join(f"{what} {n}" for what, n in report[label].items()), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
