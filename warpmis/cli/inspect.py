"""`warpmis inspect`: what a stage holds and what of it would be rendered, without rendering."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import warpmis
from warpmis.cli.console import SUPPLIED, byte_text, plain
from warpmis.cli.stage_options import add_stage_options, stage_options
from warpmis.cli.streams import print_result

if TYPE_CHECKING:
    from rich.console import Console

    from warpmis.inspection import Effect, Inspection, LightReport

DESCRIPTION = """Read a stage as `render` does and report its contents: counts, bounds, camera, the output of each
light, materials and memory. Also lists the effects of its kernel, each with the prim that calls for it, and everything
in the stage that is not supported."""


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    parser = commands.add_parser(
        "inspect", help="report what a stage contains", description=DESCRIPTION, allow_abbrev=False
    )
    parser.add_argument("stage", metavar="STAGE", help="the USD file to read")
    add_stage_options(parser)
    group = parser.add_argument_group("what to print")
    group.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    from warpmis.inspection import inspect_scene

    scene = warpmis.load_stage(arguments.stage, width=arguments.image_width, **stage_options(arguments))
    inspection = inspect_scene(scene)
    if arguments.json:
        print_result(json.dumps(plain({"version": warpmis.__version__, **inspection.to_dict()}), allow_nan=False))
    else:
        _print(inspection)


def _print(inspection: Inspection) -> None:
    from rich.console import Console

    from warpmis.inspection import POWER_UNIT

    console = Console(highlight=False, markup=False, soft_wrap=True)
    width, height = inspection.resolution
    camera = inspection.camera["path"] or "a made-up camera"
    console.print(f"{inspection.name}: {width} x {height} pixels through {camera}")
    for name in ("position", "forward", "window"):
        console.print(f"  {name} {_numbers(inspection.camera[name])}")
    for name in ("orthographic", "lens_radius", "focus_distance", "exposure"):
        console.print(f"  {name} {_value(inspection.camera[name])}")
    if inspection.bounds is not None:
        console.print(f"bounds [scene units]  {_numbers(inspection.bounds[0])} to {_numbers(inspection.bounds[1])}")
    console.print("memory  " + ", ".join(f"{name} {byte_text(size)}" for name, size in inspection.memory.items()))
    console.print("counts  " + ", ".join(f"{name} {count}" for name, count in inspection.counts.items()))
    lights = [(light.kind, light.path or SUPPLIED, _emitted(light), _power(light)) for light in inspection.lights]
    _table(console, ("light", "prim", "emits (red green blue)", f"power [{POWER_UNIT}]"), lights)
    materials = [
        (one.path or "(displayColor)", str(one.triangles), _inputs(one.inputs, one.lambertian))
        for one in inspection.materials
    ]
    _table(console, ("material", "triangles", "inputs"), materials)
    effects = [(one.name, "on" if one.on else "off", _caller(one)) for one in inspection.effects]
    _table(console, ("effect", "", "called for by"), effects)
    _table(console, ("not supported", "what"), inspection.not_honoured)
    for note in inspection.notes:
        console.print(f"note: {note}")


def _table(console: Console, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table under a blank line; nothing at all without rows. Names from a file are text, never markup."""
    from rich.table import Table
    from rich.text import Text

    if not rows:
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        table.add_column(Text(heading), overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    console.print()
    console.print(table)


def _caller(effect: Effect) -> str:
    return "" if effect.prim is None else effect.prim or SUPPLIED


def _emitted(light: LightReport) -> str:
    return f"{_numbers(light.emitted)} {light.unit}"


def _power(light: LightReport) -> str:
    if light.power is not None:
        return f"{light.power:.4g}"
    return "at infinity" if light.irradiance is None else f"gives {light.irradiance:.4g} lux"


def _inputs(inputs: dict[str, Any], lambertian: bool) -> str:
    """What differs from the defaults of the specification, or a Lambertian surface's colour."""
    from warpmis.scene import Material

    default = Material()
    told = {"diffuse_color": inputs["diffuse_color"]} if lambertian else inputs
    texts = []
    for name, value in told.items():
        if lambertian or value != getattr(default, name):
            texts.append(f"{name} {_value(value)}")
    return ", ".join(texts)


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return _numbers(value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value + 0.0:.4g}" for value in values)  # -0.0 + 0.0 is 0.0
