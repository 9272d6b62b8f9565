"""Primvars that materials read: texture coordinates, displayColor, and primvar readers."""

from __future__ import annotations

import numpy as np
import pytest
from usd.pictures import CENTRES, diffuse, grey, stage
from usd.points import seen_at
from usd.stages import load, mentions


def test_missing_primvar_is_the_readers_fallback_with_a_warning(tmp_path):
    text = stage(grey(tmp_path)).replace("primvars:st =", "primvars:uv =")
    text = text.replace(
        'string inputs:varname = "st"', 'string inputs:varname = "st"\nfloat2 inputs:fallback = (0.75, 0.25)'
    )
    scene = load(text)
    np.testing.assert_allclose(diffuse(scene, CENTRES)[:, 0], 0.8, atol=1e-6)
    assert mentions(scene, "/Q", "primvars:st", "lacks")
    assert len(scene.warnings) == 1


BROKEN_ST = {
    "too few": ("[(0, 0), (1, 0)]", "4 are needed"),
    "another type": ("[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]", "wrong type"),
}


@pytest.mark.parametrize("case", BROKEN_ST)
def test_broken_coordinates_are_left_out_with_a_warning(tmp_path, case):
    st, words = BROKEN_ST[case]
    text = stage(grey(tmp_path), st=st)
    if case == "another type":
        text = text.replace("texCoord2f[]", "float3[]")
    scene = load(text)
    assert mentions(scene, "/Q", words)
    assert np.isfinite(diffuse(scene, CENTRES)).all()


def test_coordinates_that_are_not_finite_and_huge_ones_give_no_nan(tmp_path):
    for wrap in ("black", "clamp", "repeat", "mirror"):
        modes = f'token inputs:wrapS = "{wrap}"\ntoken inputs:wrapT = "{wrap}"'
        scene = load(stage(grey(tmp_path), texture=modes, st="[(nan, inf), (1e30, -1e30), (1, 1), (0, 3e38)]"))
        found = diffuse(scene, [*CENTRES, (0.9, 0.1), (0.5, 0.5)])
        assert np.isfinite(found).all()
        assert (found >= 0).all()


def test_display_color_is_interpolated_over_the_triangles():
    for interpolation in ("vertex", "varying", "faceVarying"):
        colors = f'[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)] ( interpolation = "{interpolation}" )'
        opacities = f'[0, 1, 1, 0] ( interpolation = "{interpolation}" )'
        text = f"""def Mesh "Q"
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    color3f[] primvars:displayColor = {colors}
    float[] primvars:displayOpacity = {opacities}
}}
"""
        scene = load(text)
        assert scene.warnings == ()
        assert scene.materials[0].lambertian
        xy = np.random.default_rng(0).random((20, 2))
        seen = seen_at(scene, xy)
        np.testing.assert_allclose(seen["diffuse"], np.column_stack([xy, np.zeros(20)]), atol=1e-5)
        np.testing.assert_allclose(seen["opacity"], xy[:, 0], atol=1e-5)


def test_uniform_display_color_is_a_color_a_face():
    text = """def Mesh "Q"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 0.5, 1)] ( interpolation = "uniform" )
    int[] primvars:displayColor:indices = [1, 0]
}
"""
    found = diffuse(load(text), [(0.2, 0.7), (0.8, 0.1), (1.2, 0.7), (1.8, 0.1)])
    np.testing.assert_allclose(found, [[0, 0.5, 1], [0, 0.5, 1], [1, 0, 0], [1, 0, 0]], atol=1e-6)


def test_primvar_reader_gives_a_color_and_a_number(tmp_path):
    readers = """def Shader "C"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 outputs:result
    }
    def Shader "F"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "worn"
        float outputs:result
    }
"""
    inputs = """color3f inputs:diffuseColor.connect = </M/C.outputs:result>
    float inputs:roughness.connect = </M/F.outputs:result>
    """
    primvars = """color3f[] primvars:tint = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)] ( interpolation = "vertex" )
    float[] primvars:worn = [0.5] ( interpolation = "constant" )
    """
    scene = load(stage(grey(tmp_path), inputs=inputs, more=readers, mesh=primvars))
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.25, 0.5), (0.75, 0.125)])
    np.testing.assert_allclose(seen["diffuse"], [[0.25, 0.5, 1], [0.75, 0.125, 1]], atol=1e-6)
    np.testing.assert_allclose(seen["alpha"], 0.25, atol=1e-6)


def test_subsets_read_their_own_coordinates(tmp_path):
    """Two materials of one mesh read different primvars: each triangle carries those of its own."""
    text = """def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    texCoord2f[] primvars:st = [(0.25, 0.25)] ( interpolation = "constant" )
    texCoord2f[] primvars:uv = [(0.75, 0.75)] ( interpolation = "constant" )
    rel material:binding = </M>
    def GeomSubset "Right" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </N>
    }
}
"""
    own = stage(grey(tmp_path))
    own = own[own.index("def Material") :]
    other = own.replace("/M", "/N").replace('"M"', '"N"').replace('varname = "st"', 'varname = "uv"')
    found = diffuse(load(text + own + other), [(0.5, 0.5), (1.5, 0.5)])
    np.testing.assert_allclose(found[:, 0], [0.6, 0.4], atol=1e-6)


@pytest.mark.parametrize("interpolation", ["constant", "uniform", "vertex", "faceVarying"])
def test_a_single_value_holds_for_the_whole_prim(interpolation):
    color = f'color3f[] primvars:displayColor = [(0.25, 0.5, 1)] ( interpolation = "{interpolation}" )'
    scene = load(f'def Cube "C"\n{{\n{color}\n}}\n')
    assert scene.materials[0].diffuse_color == (0.25, 0.5, 1)
    assert scene.warnings == ()


def test_values_of_a_wrong_number_are_left_out_with_a_warning():
    colors = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)]"
    cube = load(f'def Cube "C"\n{{\n{colors} ( interpolation = "vertex" )\n}}\n')
    assert cube.materials[0].diffuse_color == (0.18, 0.18, 0.18)
    assert mentions(cube, "/C", "displayColor", "2 vertex values", "8 are needed")
    first = load(f'def Cube "C"\n{{\n{colors} ( interpolation = "constant" )\n}}\n')
    assert first.materials[0].diffuse_color == (1, 0, 0)
    assert mentions(first, "/C", "displayColor", "first")


def test_vertex_primvars_of_a_refined_mesh_follow_its_points():
    """Color is position at the cage's points, and by linearity at every point of the refined surface."""
    text = """def Mesh "Q"
{
    uniform token subdivisionScheme = "catmullClark"
    uniform token interpolateBoundary = "edgeOnly"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (0.4, 0, 0), (1, 0, 0), (0, 1, 0), (0.7, 1, 0), (1, 1, 0)]
    color3f[] primvars:displayColor = [(0, 0, 0), (0.4, 0, 0), (1, 0, 0), (0, 1, 0), (0.7, 1, 0), (1, 1, 0)] (
        interpolation = "vertex"
    )
}
"""
    xy = 0.2 + 0.6 * np.random.default_rng(0).random((20, 2))
    # The points move on to the limit surface, the colors stay at the last refinement.
    np.testing.assert_allclose(seen_at(load(text), xy)["diffuse"][:, :2], xy, atol=0.03)
