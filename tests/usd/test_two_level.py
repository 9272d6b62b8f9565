"""Instances that are traced through their transforms look as they do flattened."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd.pictures import write
from usd.stages import load, mentions

import warpmis.usd.placing as placing
from warpmis import render
from warpmis.scene import Scene
from warpmis.scene.features import detect
from warpmis.scene.geometry import bounds
from warpmis.usd.shapes.surfaces import Shading, flat_surface

EVERY_PLACE = """int[] protoIndices = [0, 1, 0, 1, 0, 1]
    point3f[] positions = [(-2, 0, 0), (0, 0, 0), (2, 0, 0), (-2, 2, 0), (0, 2, -1), (2, 2, 0)]
    quatf[] orientations = [(1, 0, 0, 0), (0.8, 0.6, 0, 0), (0.6, 0, 0.8, 0), (0.8, 0, 0, 0.6), (0, 0.6, 0, 0.8),
        (0.5, 0.5, 0.5, 0.5)]
    float3[] scales = [(1, 1, 1), (0.8, -0.8, 0.8), (1, 0.5, 1.5), (-0.7, -1.2, -0.7), (1.3, 1, -0.9), (1, 1, 0.2)]
"""

MATERIAL = """def Material "M"
{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/Color.outputs:rgb>
        normal3f inputs:normal.connect = </M/Bumps.outputs:rgb>
        OPACITY
        float inputs:roughness = 0.4
        token outputs:surface
    }
    def Shader "Color"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @COLOR@
        float2 inputs:st.connect = </M/R.outputs:result>
        float3 outputs:rgb
        float outputs:a
    }
    def Shader "Bumps"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @BUMPS@
        token inputs:sourceColorSpace = "raw"
        float4 inputs:scale = (2, 2, 2, 1)
        float4 inputs:bias = (-1, -1, -1, 0)
        float2 inputs:st.connect = </M/R.outputs:result>
        float3 outputs:rgb
    }
    def Shader "R"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""

# An octahedron with smooth normals, texture coordinates, and an own transform below an instance that is instanced.
STS = [(0, 0), (1, 0), (0.5, 1)] * 8
PROTOTYPES = """class Xform "Shape"
{
    def Mesh "Mesh" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3, 3, 3, 3, 3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5]
        point3f[] points = [(1, 0, 0), (-1, 0, 0), (0, 0.8, 0), (0, -0.8, 0), (0, 0, 0.7), (0, 0, -0.7)]
        normal3f[] normals = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)] (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st = {STS} ( interpolation = "faceVarying" )
        rel material:binding = </M>
    }
}
class Xform "Pair"
{
    def "Left" ( instanceable = true; inherits = </Shape> )
    {
        double3 xformOp:translate = (-0.4, 0, 0.3)
        double3 xformOp:scale = (0.6, 0.6, -0.6)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }
    def Sphere "Ball"
    {
        double radius = 0.4
        double3 xformOp:translate = (0.5, 0.2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
""".replace("{STS}", str(STS))


def garden(tmp_path: Path, cutouts: bool, lights: str, distance: float = 0.0) -> str:
    """Rotated, scaled, mirrored and nested instances of textured prototypes above a floor."""
    random = np.random.default_rng(5)
    color = np.concatenate([random.random((4, 4, 3)), random.random((4, 4, 1)) > 0.2], axis=-1)
    bumps = np.concatenate([0.5 + 0.3 * (random.random((8, 8, 2)) - 0.5), np.ones((8, 8, 1))], axis=-1)
    write(tmp_path / "color.exr", color)
    write(tmp_path / "bumps.exr", bumps)
    material = MATERIAL.replace("COLOR", str(tmp_path / "color.exr")).replace("BUMPS", str(tmp_path / "bumps.exr"))
    opacity = "float inputs:opacity.connect = </M/Color.outputs:a>" if cutouts else ""
    material = material.replace("OPACITY", opacity)
    return f"""{material}{PROTOTYPES}
def Xform "World"
{{
    double3 xformOp:translate = ({distance}, 0, {-distance})
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def PointInstancer "I"
    {{
        {EVERY_PLACE}
        rel prototypes = [</Shape>, </Pair>]
    }}
    def "Native" ( instanceable = true; inherits = </Pair> )
    {{
        double3 xformOp:translate = (0, 1, 1)
        float3 xformOp:rotateXYZ = (20, 50, 80)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }}
    def Cube "Floor"
    {{
        double3 xformOp:translate = (0, -2, 0)
        double3 xformOp:scale = (5, 1, 5)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }}
    def Camera "Eye"
    {{
        float focalLength = 30
        double3 xformOp:translate = (0, 1, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def SphereLight "Key"
    {{
        float inputs:intensity = 40
        double3 xformOp:translate = (4, 6, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def DomeLight "Sky"
    {{
        float inputs:intensity = 0.3
    }}
    {lights}
}}
"""


LINKED = """def SphereLight "Linked" (prepend apiSchemas = ["CollectionAPI:lightLink", "CollectionAPI:shadowLink"])
    {
        float inputs:intensity = 60
        double3 xformOp:translate = (-4, 6, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel collection:lightLink:excludes = </World/Native/Left/Mesh>
        rel collection:shadowLink:excludes = </Shape>
    }
"""


def loaded(text: str, max_copies: int, **options: Any) -> Scene:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(placing, "MAX_COPIES", max_copies)
        return load(text, **options)


@pytest.mark.parametrize(("cutouts", "lights"), [(False, ""), (True, LINKED)], ids=["opaque", "cutouts and links"])
def test_the_picture_is_that_of_the_flattened_scene(tmp_path: Path, cutouts: bool, lights: str) -> None:
    text = garden(tmp_path, cutouts, lights)
    flat, apart = (loaded(text, copies, width=64) for copies in (10**9, 0))
    assert (flat.instance_count, apart.instance_count) == (0, 3 + (3 + 1) + 3)
    assert apart.triangle_count == flat.triangle_count
    in_world = {apart.prims[number].path for number in np.unique(apart.geometry.prims)}
    assert in_world == {"/World/Native/Ball", "/World/Floor"}  # what stands in one place
    features = detect(apart)
    assert features.instances
    assert features.opacity == features.shadow_links == cutouts
    settings = {"method": "nee", "spp": 16, "max_depth": 4, "device": "cpu", "features": features}
    expected, found = render(flat, **settings), render(apart, **settings)
    apart_by = np.abs(found.image - expected.image).max(axis=-1) / (expected.image.max(axis=-1) + 1e-3)
    assert (apart_by < 1e-4).mean() >= 0.999
    for name in ("albedo", "normal", "depth"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-4, err_msg=name)


def test_far_from_the_origin_the_picture_is_that_of_the_flattened_scene(tmp_path: Path) -> None:
    text = garden(tmp_path, False, "", distance=3000.0)
    flat, apart = (loaded(text, copies, width=48) for copies in (10**9, 0))
    settings = {"method": "nee", "spp": 64, "max_depth": 4, "device": "cpu", "features": detect(apart)}
    expected, found = render(flat, **settings), render(apart, **settings)
    z = (found.image - expected.image).mean(axis=-1) / np.sqrt(found.variance + expected.variance + 1e-12)
    assert abs(found.image.mean() / expected.image.mean() - 1.0) < 2e-3
    assert (np.abs(z) > 4.0).mean() < 1e-3


COLORED = "".join(
    f'''def "{name}" ( instanceable = true; inherits = </Class> )
{{
    color3f[] primvars:displayColor = [({red}, 0, 0)] ( interpolation = "constant" )
}}
'''
    for name, red in (("A", 0.5), ("B", 1.0), ("C", 0.5))
)


def grid(count: int) -> str:
    """`count` spheres in a row by a PointInstancer, and two by native instances that differ in color."""
    return f"""def PointInstancer "I"
{{
    int[] protoIndices = {[0] * count}
    point3f[] positions = {[(3 * i, 0, 0) for i in range(count)]}
    rel prototypes = [</I/Ball>]
    def Sphere "Ball"
    {{
    }}
}}
class Xform "Class"
{{
    def Sphere "Ball"
    {{
    }}
}}
{COLORED}"""


def test_small_scenes_are_flattened_and_the_most_copied_surfaces_are_kept_apart_first() -> None:
    text = grid(20)
    ball = len(load('def Sphere "S"\n{\n}\n').geometry.triangles)
    assert load(text).prototypes == ()
    scene = loaded(text, ball)  # room for one copy: that of the two equal native instances
    assert [len(prototype.prims) for prototype in scene.prototypes] == [20]
    assert len(scene.geometry.triangles) == 3 * ball
    assert {scene.prims[number].path for number in scene.prototypes[0].prims} == {"/I/Ball"}


def test_native_instances_share_a_prototype_if_their_materials_are_equal() -> None:
    scene = loaded(grid(1), 0)
    (prototype,) = scene.prototypes
    assert [scene.prims[number].path for number in prototype.prims] == ["/A/Ball", "/C/Ball"]


def bolts(count: int, glow: str = "", names: str = "") -> str:
    """Native instances that hold their own material, and where there are `names`, one without an instance for each."""
    bolt = f"""{{
    def Material "Look"
    {{
        token outputs:surface.connect = <Look/S.outputs:surface>
        def Shader "S"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.8, 0.1, 0.1)
            {glow}
            token outputs:surface
        }}
    }}
    def Sphere "Head" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {{
        rel material:binding = <../Look>
    }}
}}
""".replace("<Look/S", "<S").replace("<../Look>", "</Bolt/Look>")
    text = f'class Xform "Bolt"\n{bolt}'
    for i in range(count):
        place = f'double3 xformOp:translate = ({3 * i}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
        text += f'def "B{i}" ( instanceable = true\ninherits = </Bolt> )\n{{\n{place}\n}}\n'
    return text + "".join(f'def Xform "{name}"\n{bolt.replace("/Bolt/", f"/{name}/")}' for name in names)


def test_native_instances_with_a_material_of_their_own_share_a_surface_and_the_material() -> None:
    scene = loaded(bolts(5), 0)
    (prototype,) = scene.prototypes
    assert [scene.prims[number].path for number in prototype.prims] == [f"/B{i}/Head" for i in range(5)]
    assert len(scene.materials) == 1
    assert not len(scene.geometry.triangles)


def test_native_instances_bound_to_equal_materials_outside_share_a_surface() -> None:
    scene = loaded(bound_outside("(0.8, 0.1, 0.1)", "(0.8, 0.1, 0.1)", "(0.8, 0.1, 0.2)"), 0)
    (prototype,) = scene.prototypes
    assert [scene.prims[number].path for number in prototype.prims] == ["/I0/Ball", "/I1/Ball"]
    assert [material.path for material in scene.materials] == ["/M0", "/M2"]


def bound_outside(*colors: str) -> str:
    """A native instance for each color, and a material for each instance beside it."""
    text = 'class Xform "Class"\n{\ndef Sphere "Ball"\n{\n}\n}\n'
    for i, color in enumerate(colors):
        text += f"""def "I{i}" ( instanceable = true
    inherits = </Class>
    prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    rel material:binding = </M{i}>
}}
def Material "M{i}"
{{
    token outputs:surface.connect = </M{i}/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {color}
        token outputs:surface
    }}
}}
"""
    return text


def test_materials_that_are_no_instances_keep_their_names() -> None:
    scene = loaded(bolts(2, names="XY"), 10**9)
    assert [material.path for material in scene.materials] == ["/B0/Look", "/X/Look", "/Y/Look"]


def test_instances_in_another_color_space_have_another_material() -> None:
    text = bolts(2)
    api = 'prepend apiSchemas = ["ColorSpaceAPI"]\ninherits = </Bolt> )\n{\nuniform token colorSpace:name = "acescg"\n'
    head, one, tail = text.partition('def "B1" ( instanceable = true\ninherits = </Bolt> )\n{\n')
    scene = loaded(head + one.replace("inherits = </Bolt> )\n{\n", api) + tail, 0)
    assert len(scene.materials) == 2
    assert scene.materials[0].diffuse_color != scene.materials[1].diffuse_color


def test_emissive_instances_share_a_surface_and_a_material_where_they_are_many() -> None:
    glow = "color3f inputs:emissiveColor = (2, 1, 0)"
    ball = len(load('def Sphere "S"\n{\n}\n').geometry.triangles)
    scene = loaded(bolts(4, glow), 0)
    (prototype,) = scene.prototypes
    assert len(scene.materials) == 1
    assert (len(prototype.prims), len(prototype.geometry.triangles)) == (4, ball)
    assert not len(scene.geometry.triangles)
    assert detect(scene).mesh_light and detect(scene).emissive_instances
    few = load(bolts(4, glow))
    assert len(few.geometry.triangles) == 4 * ball
    assert detect(few).mesh_light and not detect(few).emissive_instances
    assert scene.notes == few.notes  # no dome is added to what has a light


def test_few_that_emit_among_many_that_do_not_are_flattened() -> None:
    def part(emission: tuple[float, float, float], copies: int) -> placing.Places:
        index = 1 if max(emission) > 0.0 else 0
        surface = flat_surface(np.eye(3), np.array([[0, 1, 2]]), np.zeros(1, np.int64))
        shading = Shading(np.array([index]), np.zeros((1, 3, 0), np.float32))
        found = placing.Places(surface, shading)
        found.add(np.tile(np.eye(4), (copies + 1, 1, 1)), 0, shading.places)
        return found

    dark, bright = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    parts = [part(dark, 50_000), part(bright, 10_000), part(bright, 20_000), part(dark, 2_000_000)]
    apart = placing.traced_through(parts, np.array([False, True]))
    assert apart == {parts[2], parts[3]}


def test_a_thousand_instances_with_their_own_material_take_the_memory_of_one() -> None:
    one, many = (sum(part.nbytes for part in load(bolts(count)).parts) for count in (1, 1000))
    assert many < 1.2 * one


def test_bounds_hold_every_place() -> None:
    scene = loaded(grid(20), 0)
    low, high = bounds(scene.geometry, scene.prototypes)
    np.testing.assert_allclose(low, [-1, -1, -1], atol=1e-6)
    np.testing.assert_allclose(high, [58, 1, 1], atol=1e-6)


GLOW = """def Material "Glow"
{
    token outputs:surface.connect = </Glow/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize("glows", [False, True])
def test_what_is_flat_as_a_sheet_is_flattened(glows: bool) -> None:
    more = """int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]
    float3[] scales = [(1, 1, 1), (1, 1, 0), (1, 1, 0.0001)]
    rel prototypes = [</I/Ball>]
"""
    text = f'def PointInstancer "I"\n{{\n{more}\ndef Sphere "Ball"\n{{\nBINDING\n}}\n}}\n'
    if glows:
        text = text.replace('def Sphere "Ball"', 'def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"])')
        text += GLOW
    scene = loaded(text.replace("BINDING", "rel material:binding = </Glow>" if glows else ""), 0)
    (prototype,) = scene.prototypes
    np.testing.assert_allclose(prototype.translation, [[0, 0, 0]])
    assert len(scene.geometry.triangles) > len(prototype.geometry.triangles)
    assert detect(scene).emissive_instances == glows


def test_instances_too_far_away_are_left_out_with_a_warning() -> None:
    text = grid(3).replace("(6, 0, 0)", "(1e30, 0, 0)")
    scene = loaded(text, 0)
    assert [len(prototype.prims) for prototype in scene.prototypes] == [2, 2]
    assert mentions(scene, "/I/Ball", "1 of its instances", "far")


def test_memory_grows_by_the_places_not_by_their_triangles() -> None:
    text = grid(10_000)
    tracemalloc.start()
    scene = load(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert scene.instance_count == 10_000
    flattened = 60 * scene.triangle_count  # bytes: what a Geometry has of each triangle, at least
    assert flattened > 1e9
    assert peak < 0.1 * flattened
    assert sum(part.nbytes for part in scene.parts) < 1e6
