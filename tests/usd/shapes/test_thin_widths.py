"""Curves and points without widths are thin: a small share of the scene, and of the prim itself."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import check_invariants, load

STICK = """def BasisCurves "Stick"
{{
    uniform token type = "linear"
    int[] curveVertexCounts = [2]
    point3f[] points = [(0, 0, 0), (0, {length}, 0)]
    {more}
}}
"""


def moved(text: str, scale: float, name: str = "Set") -> str:
    op = f"double3 xformOp:scale = ({scale}, {scale}, {scale})"
    return f'def Xform "{name}"\n{{\n{op}\nuniform token[] xformOpOrder = ["xformOp:scale"]\n{text}\n}}\n'


def cube(size: float) -> str:
    return f'def Cube "Block"\n{{\n    double size = {size}\n}}\n'


def thickness(scene) -> float:
    """How far the stick reaches about its axis, in the scene [scene units]."""
    which = [prim.path.endswith("Stick") for prim in scene.prims].index(True)
    used = scene.geometry.triangles[scene.geometry.prims == which]
    return 2.0 * float(np.linalg.norm(scene.geometry.points[used.ravel()][:, [0, 2]], axis=1).max())


@pytest.mark.parametrize("more", ["", "float[] widths = [1, 2, 3]", 'string[] widths = ["thick"]'])
def test_hair_is_a_hundredth_of_its_own_length_in_a_large_scene(more):
    scene = load(STICK.format(length=2, more=more) + cube(100))
    check_invariants(scene)
    assert thickness(scene) == pytest.approx(0.02, rel=1e-5)
    (note,) = [line for line in scene.notes if "widths" in line]
    assert note.startswith("/Stick: it has no widths: 0.02 is used")


def test_a_long_cable_is_a_two_hundredth_of_the_scene():
    scene = load(STICK.format(length=100, more=""))
    assert thickness(scene) == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("scale", [0.01, 30.0])
def test_the_width_is_of_the_scene_at_any_scale_of_the_prim(scale):
    scene = load(moved(STICK.format(length=100 / scale, more=""), scale))
    assert thickness(scene) == pytest.approx(0.5, rel=1e-4)


def test_many_prims_without_widths_are_one_note():
    sticks = [STICK.format(length=1, more="").replace("Stick", f"S{i}") for i in range(12)]
    notes = [line for line in load("".join(sticks)).notes if "widths" in line]
    assert len(notes) == 1
    assert notes[0].endswith("(and 11 more like it)")


def test_points_without_widths_are_small_and_a_point_alone_has_width_1():
    cloud = 'def Points "Dust"\n{\n    point3f[] points = [(0, 0, 0), (8, 0, 0), (0, 6, 0)]\n}\n'
    scene = load(cloud)
    check_invariants(scene)
    away = np.linalg.norm(scene.geometry.points, axis=1)
    np.testing.assert_allclose(away[away < 1.0], 0.5 * 10.0 / 200.0, rtol=1e-5)
    alone = load('def Points "Dust"\n{\n    point3f[] points = [(0, 0, 0)]\n}\n')
    np.testing.assert_allclose(alone.geometry.points.max(axis=0)[2], 0.5)


def test_instances_are_as_thin_as_what_they_stand_for():
    text = f"""def PointInstancer "Many"
{{
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (100, 0, 0)]
    rel prototypes = [</Many/Stick>]
    {STICK.format(length=2, more="")}
}}
"""
    scene = load(text)
    first = scene.geometry.points[scene.geometry.points[:, 0] < 50]
    assert 2.0 * np.abs(first[:, 0]).max() == pytest.approx(0.02, rel=1e-5)


@pytest.mark.parametrize(
    ("scheme", "normals", "noted"),
    [
        ("", "normal3f[] normals = [(0, 0, 1)]", True),
        ("", "normal3f[] primvars:normals = [(0, 0, 1)]", True),
        ("", "", False),
        ('uniform token subdivisionScheme = "catmullClark"', "normal3f[] normals = [(0, 0, 1)]", False),
        ('uniform token subdivisionScheme = "none"', "normal3f[] normals = [(0, 0, 1)]", False),
    ],
)
def test_normals_without_a_scheme_are_a_note_that_the_mesh_is_refined(scheme, normals, noted):
    scene = load(f"""def Mesh "M"
{{
    {scheme}
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    {normals}
}}
""")
    assert any("catmullClark" in line and "/M" in line for line in scene.notes) is noted
