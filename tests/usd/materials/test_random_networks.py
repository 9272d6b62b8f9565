"""Networks of random MaterialX nodes with random inputs: whatever they are, a finite material comes out."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd.networks import USD_TYPES, text
from usd.pictures import write
from usd.stages import load

MaterialX = pytest.importorskip("MaterialX")
SURFACES = (
    *("ND_standard_surface_surfaceshader", "ND_open_pbr_surface_surfaceshader", "ND_gltf_pbr_surfaceshader"),
    *("ND_surface_unlit", "ND_surface", "ND_UsdPreviewSurface_surfaceshader"),
)
NUMBERS = (0.0, 1.0, 0.5, -1.0, 2.0, 1e-30, 1e30, float("nan"), float("inf"), 0.25)
SEEDS = 240


@cache
def library() -> Any:
    document = MaterialX.createDocument()
    folders, search = MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath()
    MaterialX.loadLibraries(folders, search, document)
    return document


@cache
def definitions() -> list[Any]:
    """All node definitions of the library."""
    return list(library().getNodeDefs())


def usd_type(kind: str) -> str:
    return {"filename": "asset", "string": "string", "boolean": "bool", **USD_TYPES}.get(kind, "token")


def value(kind: str, random: np.random.Generator, file: Path) -> str:
    """A value of a USD type."""
    width = {"color3f": 3, "float3": 3, "color4f": 4, "float4": 4, "float2": 2}.get(kind, 1)
    if kind == "asset":
        return f"@{file if random.random() < 0.8 else 'gone.png'}@"
    if kind in ("string", "token"):
        return f'"{random.choice(["", "st", "clamp", "constant", "rgb", "T", "RT", "gbr", "world"])}"'
    if kind in ("int", "bool"):
        return str(int(random.integers(0, 2 if kind == "bool" else 12)))
    numbers = [str(float(random.choice(NUMBERS))) for _ in range(width)]
    return numbers[0] if width == 1 else f"({', '.join(numbers)})"


def inputs(definition: Any, before: list[tuple[str, str]], random: np.random.Generator, file: Path) -> str:
    """Some inputs of a node: values of their type or another, or connections to outputs of nodes before it."""
    lines = []
    for each in definition.getActiveInputs():
        kind = usd_type(each.getType())
        if random.random() < 0.1:
            kind = str(random.choice(["float", "color3f", "float2", "color4f", "int", "token", "asset"]))
        if before and random.random() < 0.5:
            fitting = [output for output, of in before if of == kind] or [output for output, _ in before]
            lines.append(f"{kind} inputs:{each.getName()}.connect = <{fitting[int(random.integers(len(fitting)))]}>")
        elif random.random() < 0.6:
            lines.append(f"{kind} inputs:{each.getName()} = {value(kind, random, file)}")
    return "\n".join(lines)


def network(seed: int, file: Path) -> str:
    """A stage of one surface behind twelve nodes."""
    random = np.random.default_rng(seed)
    nodes, outputs = "", [("/M/N3.outputs:out", "float")]  # perhaps a circle
    for number in range(12):
        definition = definitions()[int(random.integers(len(definitions())))]
        lines = inputs(definition, outputs, random, file)
        found = [(each.getName(), usd_type(each.getType())) for each in definition.getActiveOutputs()]
        declared = "\n".join(f"{kind} outputs:{name}" for name, kind in found)
        nodes += (
            f'def Shader "N{number}"\n{{\nuniform token info:id = "{definition.getName()}"\n{lines}\n{declared}\n}}\n'
        )
        outputs += [(f"/M/N{number}.outputs:{name}", kind) for name, kind in found]
    kind = str(random.choice(SURFACES))
    (definition,) = [each for each in definitions() if each.getName() == kind]
    return text(kind, inputs(definition, outputs, random, file), nodes)


# Surfaces by name: their render context, and their inputs after their type.
BY_NAME = {
    "PxrSurface": ("ri", """float diffuseGain specularRoughness roughSpecularRoughness clearcoatRoughness glowGain
        float presence refractionGain glassIor glassRoughness
        color3f diffuseColor specularFaceColor specularEdgeColor specularIor specularExtinctionCoeff
        color3f roughSpecularFaceColor clearcoatFaceColor glowColor refractionColor bumpNormal
        int specularFresnelMode clearcoatFresnelMode thinGlass"""),
    "PxrDisneyBsdf": ("ri", """float metallic roughness ior specReflectScale specularTint clearcoat clearcoatGloss
        float specTrans transDistance presence
        color3f baseColor emitColor transColor bumpNormal
        int isThin"""),
    "PxrDisney": ("ri", """float metallic roughness specular specularTint clearcoat clearcoatGloss
        color3f baseColor emitColor"""),
    "arnold:standard_surface": ("arnold", """float base specular specular_roughness specular_IOR metalness
        float coat coat_IOR emission transmission transmission_depth subsurface sheen
        color3f base_color specular_color coat_color emission_color opacity transmission_color subsurface_color normal
        bool thin_walled"""),
    "OmniSurface": ("mdl", """float diffuse_reflection_weight metalness specular_reflection_weight coat_weight
        float specular_reflection_roughness specular_reflection_ior coat_ior emission_weight emission_intensity
        float emission_temperature geometry_opacity geometry_opacity_threshold specular_transmission_weight
        float uvw_s_scale uvw_t_offset
        color3f diffuse_reflection_color specular_reflection_color coat_color emission_color
        color3f specular_transmission_color
        asset diffuse_reflection_color_image metalness_image geometry_normal_image
        int emission_mode
        bool enable_opacity enable_specular_transmission enable_diffuse_transmission emission_use_temperature"""),
}  # fmt: skip
NODES = ("PxrTexture", "PxrNormalMap", "PxrPrimvar", "PxrInvert", "arnold:image", "arnold:normal_map", "UsdUVTexture")


def by_name(name: str, seed: int, file: Path) -> str:
    """A stage of one surface of another renderer, with some of its inputs, and some of them connected."""
    random = np.random.default_rng(seed)
    context, table = BY_NAME[name]
    lines, nodes = [], ""
    for kind, each in ((line.split()[0], each) for line in table.splitlines() for each in line.split()[1:]):
        choice = random.random()
        if choice < 0.15:
            output = str(random.choice(["out", "resultRGB", "rgb"]))
            nodes += f"""def Shader "N_{each}"
            {{
                uniform token info:id = "{random.choice(NODES)}"
                asset inputs:filename = @{file}@
                color3f outputs:{output}
            }}
"""
            lines.append(f"{kind} inputs:{each}.connect = </M/N_{each}.outputs:{output}>")
        elif choice < 0.6:
            lines.append(f"{kind} inputs:{each} = {value(kind, random, file)}")
    head = f"""uniform token info:implementationSource = "sourceAsset"
        uniform token info:mdl:sourceAsset:subIdentifier = "{name}" """
    return text(head if context == "mdl" else name, "\n".join(lines), nodes, context)


@pytest.mark.parametrize("name", BY_NAME)
def test_any_inputs_of_a_surface_by_name(tmp_path: Path, name: str) -> None:
    file = write(tmp_path / "c.png", np.random.default_rng(0).uniform(0.0, 1.0, (3, 2, 4)), "uint8")
    for seed in range(30):
        scene = load(by_name(name, seed, file))
        assert any(material.path == "/M" for material in scene.materials), f"seed {seed}"
        for field, each in ((field, each) for material in scene.materials for field, each in vars(material).items()):
            assert is_finite(each), f"seed {seed}: {field} is {each}"


def is_finite(one: Any) -> bool:
    """Whether a material's input has finite numbers, those of a lookup and of its texels included."""
    if isinstance(one, str | bool) or one is None:
        return True
    if isinstance(one, float | int | tuple):
        return bool(np.isfinite(np.asarray(one, np.float64)).all())
    if not hasattr(one, "texture"):
        return True
    numbers = [one.scale, one.bias, one.transform, one.fallback, *one.texture.tiles.values()]
    return all(np.isfinite(np.asarray(each, np.float64)).all() for each in numbers)


@pytest.mark.parametrize("part", range(4))
def test_any_network_is_read(tmp_path: Path, part: int) -> None:
    file = write(tmp_path / "c.png", np.random.default_rng(0).uniform(0.0, 1.0, (3, 2, 4)), "uint8")
    for seed in range(part, SEEDS, 4):
        scene = load(network(seed, file))
        for name, each in ((name, each) for material in scene.materials for name, each in vars(material).items()):
            assert is_finite(each), f"seed {seed}: {name} is {each}"
