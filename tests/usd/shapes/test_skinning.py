"""UsdSkel: points in their pose at the time of the render."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import check_invariants, load, stage_of

from warpmis.usd import load_stage

IDENTITY = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
ELBOW = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 0, 1))"


def arm(rotations: str, more: str = "") -> str:
    """A bone from the origin to (0, 1, 0), one from there, and a rectangle 1 x 2 whose upper edge is the second's."""
    return f"""def SkelRoot "Arm" (
    prepend apiSchemas = ["SkelBindingAPI"]
)
{{
    rel skel:skeleton = </Arm/Skel>
    def Skeleton "Skel" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = ["A", "A/B"]
        uniform matrix4d[] bindTransforms = [{IDENTITY}, {ELBOW}]
        uniform matrix4d[] restTransforms = [{IDENTITY}, {ELBOW}]
        rel skel:animationSource = </Arm/Skel/Bend>
        def SkelAnimation "Bend"
        {{
            uniform token[] joints = ["A", "A/B"]
            float3[] translations = [(0, 0, 0), (0, 1, 0)]
            quatf[] rotations{rotations}
            half3[] scales = [(1, 1, 1), (1, 1, 1)]
            {more}
        }}
    }}
    def Mesh "Skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)]
        int[] primvars:skel:jointIndices = [0, 0, 1, 1] (
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
            interpolation = "vertex"
        )
    }}
}}
"""


BENDING = ".timeSamples = { 0: [(1, 0, 0, 0), (1, 0, 0, 0)], 10: [(1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678)] }"


def bent(degrees: float) -> np.ndarray:
    """The skin with the second bone turned about z at (0, 1, 0)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    upper = [[c * x - s, s * x + c + 1, 0] for x in (1, 0)]
    return np.array([[0, 0, 0], [1, 0, 0], *upper])


@pytest.mark.parametrize(("time", "degrees"), [(None, 0), (0, 0), (5, 45), (10, 90), (99, 90)])
def test_pose_is_that_of_the_time_also_between_samples(time, degrees):
    stage = stage_of(arm(BENDING))
    before = [stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()]
    scene = load_stage(stage, time=time)
    check_invariants(scene)
    np.testing.assert_allclose(scene.geometry.points, bent(degrees), atol=1e-5)
    assert scene.warnings == ()
    assert [stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()] == before


def test_pose_without_samples_is_taken():
    scene = load(arm(" = [(1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678)]"), time=3)
    np.testing.assert_allclose(scene.geometry.points, bent(90), atol=1e-5)


def test_instances_of_a_character_are_posed_where_they_stand():
    text = arm(BENDING).replace("</Arm/", "</Class/Arm/")
    text = f'class "Class"\n{{\n{text}}}\n'
    for k in range(2):
        text += (
            f'def "I{k}" (\n    instanceable = true\n    references = </Class>\n)\n'
            f"{{\n    double3 xformOp:translate = ({10 * k}, 0, 0)\n"
            f'    uniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        )
    text = text.replace('def "I', 'def Xform "I')
    scene = load(text, time=10)
    assert [prim.path for prim in scene.prims] == ["/I0/Arm/Skin", "/I1/Arm/Skin"]
    expected = np.concatenate([bent(90), bent(90) + np.array([10, 0, 0])])
    np.testing.assert_allclose(scene.geometry.points, expected, atol=1e-5)


def test_blend_shapes_move_points_by_their_weight():
    animation = """
            uniform token[] blendShapes = ["Out"]
            float[] blendShapeWeights.timeSamples = { 0: [0], 10: [1] }"""
    shape = """
    def Mesh "Skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token[] skel:blendShapes = ["Out"]
        rel skel:blendShapeTargets = </Arm/Skin/Out>
        def BlendShape "Out"
        {
            uniform vector3f[] offsets = [(0, 0, 3)]
            uniform int[] pointIndices = [1]
        }
"""
    text = arm(" = [(1, 0, 0, 0), (1, 0, 0, 0)]", animation)
    head = text.index('    def Mesh "Skin"')
    text = text[:head] + shape + text[text.index("        uniform token subdivisionScheme") :]
    scene = load(text, time=5)
    expected = bent(0)
    expected[1, 2] = 1.5
    np.testing.assert_allclose(scene.geometry.points, expected, atol=1e-5)


def test_character_without_a_skeleton_is_rendered_as_it_is():
    scene = load('def SkelRoot "S"\n{\n    def Cube "C"\n    {\n    }\n}\n')
    assert len(scene.geometry.triangles) == 12
    assert scene.warnings == ()
