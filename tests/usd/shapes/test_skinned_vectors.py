"""Normals and tangents turn with the points that skinning moves."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import load, shading_normals

IDENTITY = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
ABOVE = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 3, 0, 1))"
# A quarter turn about y carries (x, y, z) to (z, y, -x).
QUARTER = "(0.70710678, 0, 0.70710678, 0)"

AUTHORED = {  # interpolation: values of the four corners of one square, indices
    "constant": ("[(0.8, 0, 0.6)]", ""),
    "uniform": ("[(0.8, 0, 0.6)]", ""),
    "vertex": ("[(0.8, 0, 0.6), (0.8, 0, 0.6), (0, 0.6, 0.8), (0, 0.6, 0.8)]", ""),
    "varying": ("[(0.8, 0, 0.6), (0.8, 0, 0.6), (0, 0.6, 0.8), (0, 0.6, 0.8)]", ""),
    "faceVarying": ("[(0, 0.6, 0.8), (0.8, 0, 0.6)]", "[1, 1, 0, 0]"),
}
TILTED, RAISED = np.array([0.8, 0, 0.6]), np.array([0, 0.6, 0.8])


def character(
    body: str, *, bind: str = IDENTITY, ops: str = "", method: str = "classicLinear", turn: str = QUARTER
) -> str:
    """A square in the xy plane on two joints; its lower edge follows the first, which turns, as does the second."""
    return f"""def SkelRoot "Root" ( prepend apiSchemas = ["SkelBindingAPI"] )
{{
    def Skeleton "Skel" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {{
        uniform token[] joints = ["A", "B"]
        uniform matrix4d[] bindTransforms = [{IDENTITY}, {ABOVE}]
        uniform matrix4d[] restTransforms = [{IDENTITY}, {ABOVE}]
        rel skel:animationSource = </Root/Skel/Move>
        def SkelAnimation "Move"
        {{
            uniform token[] joints = ["B", "A"]
            float3[] translations = [(0, 3, 0), (0, 0, 0)]
            quatf[] rotations = [{turn}, {QUARTER}]
            half3[] scales = [(1, 1, 1), (1, 1, 1)]
        }}
    }}
    def Mesh "Skin" ( prepend apiSchemas = ["SkelBindingAPI", "MaterialBindingAPI"] )
    {{
        uniform token subdivisionScheme = "none"
        uniform bool doubleSided = 1
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        rel skel:skeleton = </Root/Skel>
        uniform token primvars:skel:skinningMethod = "{method}"
        matrix4d primvars:skel:geomBindTransform = {bind}
        int[] primvars:skel:jointIndices = [0, 0, 1, 1] ( interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] ( interpolation = "vertex" )
        {body}
        {ops}
    }}
}}
"""


def directions(name: str, interpolation: str, kind: str = "normal3f") -> str:
    values, indices = AUTHORED[interpolation]
    lines = f'{kind}[] {name} = {values} ( interpolation = "{interpolation}" )'
    if indices and name.startswith("primvars:"):
        lines += f"\nint[] {name}:indices = {indices}"
    elif indices:
        lines = lines.replace(values, "[(0.8, 0, 0.6), (0.8, 0, 0.6), (0, 0.6, 0.8), (0, 0.6, 0.8)]")
    return lines


def turned(vector: np.ndarray) -> np.ndarray:
    x, y, z = vector
    return np.array([z, y, -x])


def expected(interpolation: str) -> np.ndarray:
    """Of the corners of the triangles (0, 1, 2) and (0, 2, 3), after the quarter turn."""
    varies = interpolation not in ("constant", "uniform")
    square = [TILTED, TILTED, RAISED, RAISED] if varies else [TILTED] * 4
    return np.array([[turned(square[i]) for i in triangle] for triangle in ((0, 1, 2), (0, 2, 3))])


@pytest.mark.parametrize("interpolation", AUTHORED)
@pytest.mark.parametrize("name", ["normals", "primvars:normals"])
@pytest.mark.parametrize("method", ["classicLinear", "dualQuaternion"])
def test_normals_turn_with_their_points(name, interpolation, method):
    scene = load(character(directions(name, interpolation), method=method))
    assert scene.warnings == ()
    found = shading_normals(scene)
    front = np.sign(np.einsum("fci,fci->fc", found, expected(interpolation)))  # seen from behind they are turned over
    np.testing.assert_allclose(found * front[..., None], expected(interpolation), atol=1e-5)


def test_primvars_normals_go_before_normals_when_skinned():
    both = (
        directions("primvars:normals", "vertex")
        + "\n"
        + directions("normals", "constant").replace("0.8, 0, 0.6", "1, 0, 0")
    )
    found = shading_normals(load(character(both)))
    np.testing.assert_allclose(np.abs(found), np.abs(expected("vertex")), atol=1e-5)


TANGENT_LOOK = """rel material:binding = </Look>
"""
LOOK = """def Material "Look"
{
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor.connect = </Look/R.outputs:result>
        token outputs:surface
    }
    def Shader "R"
    {
        uniform token info:id = "UsdPrimvarReader_vector"
        string inputs:varname = "tangents"
        vector3f inputs:fallback = (9, 9, 9)
        vector3f outputs:result
    }
}
"""


@pytest.mark.parametrize("interpolation", AUTHORED)
@pytest.mark.parametrize(
    "place",
    [
        {},
        {"bind": "((0, 0, -1, 0), (0, 1, 0, 0), (1, 0, 0, 0), (5, 6, 7, 1))"},
        {"ops": 'float xformOp:rotateY = 90\nuniform token[] xformOpOrder = ["xformOp:rotateY"]'},
        {"method": "dualQuaternion"},
    ],
    ids=["plain", "bound turned", "mesh turned", "dual quaternions"],
)
def test_tangents_turn_with_their_points(interpolation, place):
    """As a shader reads them, in the mesh's own space."""
    body = TANGENT_LOOK + directions("primvars:tangents", interpolation, "vector3f")
    scene = load(character(body, **place) + LOOK)
    assert scene.warnings == ()
    found = scene.geometry.primvars
    want = expected(interpolation)
    if "bind" in place:  # a quarter turn before the skinning
        want = np.stack([want[..., 2], want[..., 1], -want[..., 0]], axis=-1)
    if "ops" in place:  # skinned in the skeleton's space, and carried back into the mesh's
        want = np.stack([-want[..., 2], want[..., 1], want[..., 0]], axis=-1)
    np.testing.assert_allclose(found, want, atol=1e-5)


def test_blended_weights_blend_the_turns():
    body = TANGENT_LOOK + directions("primvars:tangents", "constant", "vector3f")
    text = character(body, turn="(1, 0, 0, 0)").replace("[1, 1, 1, 1]", "[0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]")
    text = text.replace("jointIndices = [0, 0, 1, 1] (", "jointIndices = [0, 1, 0, 1, 0, 1, 0, 1] ( elementSize = 2\n")
    text = text.replace("0.5, 0.5] (", "0.5, 0.5] ( elementSize = 2\n")
    found = load(text + LOOK).geometry.primvars
    np.testing.assert_allclose(found, np.broadcast_to((TILTED + turned(TILTED)) / 2, found.shape), atol=1e-5)


@pytest.mark.parametrize("values", ["[(0, 0, 1)]", "[(0, 0, 1), (0, 0, 1), (0, 0, 1)]"])
def test_normals_of_a_wrong_number_do_not_end_the_skinning(values):
    scene = load(character(f'normal3f[] primvars:normals = {values} ( interpolation = "vertex" )'))
    assert len(scene.geometry.triangles) == 2
    assert np.abs(scene.geometry.points[:, 2]).max() > 0.9  # turned
