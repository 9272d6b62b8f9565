"""GeomSubsets: which faces have the material of which subset, by the rules of UsdGeomSubset and UsdShade."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import corners, load, mentions

BOUND = 'prepend apiSchemas = ["MaterialBindingAPI"]'
LOOKS = "".join(
    f"""def Material "{name}"
{{
    token outputs:surface.connect = </{name}/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {color}
        token outputs:surface
    }}
}}
"""
    for name, color in {"Red": (1, 0, 0), "Green": (0, 1, 0), "Blue": (0, 0, 1)}.items()
)


def subset(name: str, indices: str, bound: str = "", element: str = "", family: str = "materialBind") -> str:
    element = f'uniform token elementType = "{element}"' if element else ""
    family = f'uniform token familyName = "{family}"' if family else ""
    binding = f"rel material:binding = </{bound}>" if bound else ""
    return f"""def GeomSubset "{name}" ( {BOUND} )
{{
    {element}
    {family}
    int[] indices = {indices}
    {binding}
}}
"""


def strip(*subsets: str, bound: str = "Red", more: str = "") -> str:
    """Four unit squares in a row along x, bound to a material, with these subsets."""
    binding = f"rel material:binding = </{bound}>" if bound else ""
    points = [(x, y, 0) for y in (0, 1) for x in range(5)]
    indices = [i for x in range(4) for i in (x, x + 1, x + 6, x + 5)]
    return f"""def Mesh "Strip" ( {BOUND} )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4, 4, 4]
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
    {binding}
    {more}
    {"".join(subsets)}
}}
"""


def looks(scene) -> list[str]:
    """The material of each square: its prim's name, "" for displayColor."""
    x = corners(scene)[..., 0].mean(axis=1)
    found = []
    for square in range(4):
        used = np.unique(scene.geometry.materials[(x > square) & (x < square + 1)])
        assert len(used) == 1
        found.append(scene.materials[used[0]].path.strip("/"))
    return found


def test_a_subset_without_a_binding_has_that_of_its_mesh():
    scene = load(strip(subset("A", "[0]", "Green"), subset("B", "[1, 2]")) + LOOKS)
    assert looks(scene) == ["Green", "Red", "Red", "Red"]
    assert scene.warnings == ()


def test_without_any_binding_it_has_the_display_color():
    scene = load(strip(subset("A", "[0]", "Green"), subset("B", "[1]"), bound="") + LOOKS)
    assert looks(scene) == ["Green", "", "", ""]
    assert scene.warnings == ()


def test_a_binding_above_the_mesh_reaches_its_subsets():
    group = f'def Xform "World" ( {BOUND} )\n{{\nrel material:binding = </Blue>\n'
    scene = load(group + strip(subset("A", "[3]", "Green"), subset("B", "[1]"), bound="") + "}\n" + LOOKS)
    assert looks(scene) == ["Blue", "Blue", "Blue", "Green"]


def test_a_binding_that_is_stronger_than_descendants_is_stronger_than_subsets():
    strong = 'rel material:binding = </Red> ( bindMaterialAs = "strongerThanDescendants" )'
    scene = load(strip(subset("A", "[3]", "Green"), bound="", more=strong) + LOOKS)
    assert looks(scene) == ["Red"] * 4


@pytest.mark.parametrize("element", ["point", "edge", "segment", "tetrahedron", "polygon"])
def test_elements_other_than_faces_bind_nothing_and_are_a_warning(element):
    scene = load(strip(subset("A", "[0, 1]", "Green", element=element), subset("B", "[2]", "Blue")) + LOOKS)
    assert looks(scene) == ["Red", "Red", "Blue", "Red"]
    assert mentions(scene, "/Strip/A", "faces", element)


@pytest.mark.parametrize("family", ["", "selection"])
def test_a_subset_of_another_family_binds_nothing_and_is_a_warning(family):
    scene = load(strip(subset("A", "[0]", "Green", family=family)) + LOOKS)
    assert looks(scene) == ["Red"] * 4
    assert mentions(scene, "/Strip/A", "familyName", "materialBind")
    assert load(strip(subset("A", "[0]", family=family)) + LOOKS).warnings == ()


def test_faces_in_two_subsets_have_the_material_of_the_later_one_with_a_warning():
    scene = load(strip(subset("A", "[0, 1, 2]", "Green"), subset("B", "[2, 1, 3]", "Blue")) + LOOKS)
    assert looks(scene) == ["Green", "Blue", "Blue", "Blue"]
    assert mentions(scene, "/Strip/B", "2 of its faces", "earlier subset")
    assert len(scene.warnings) == 1


def test_a_subset_without_a_binding_takes_no_faces_from_another():
    scene = load(strip(subset("A", "[0, 1]", "Green"), subset("B", "[1, 2]")) + LOOKS)
    assert looks(scene) == ["Green", "Green", "Red", "Red"]
    assert scene.warnings == ()


@pytest.mark.parametrize("indices", ["[1, 4]", "[1, -1]", "[99, 1]"])
def test_indices_outside_the_faces_are_left_out_with_a_warning(indices):
    scene = load(strip(subset("A", indices, "Green")) + LOOKS)
    assert looks(scene) == ["Red", "Green", "Red", "Red"]
    assert mentions(scene, "/Strip/A", "1 of its indices", "4 faces")


def test_a_subset_whose_material_does_not_exist_has_that_of_the_mesh():
    scene = load(strip(subset("A", "[1]", "Gone")) + LOOKS)
    assert looks(scene) == ["Red"] * 4
    assert mentions(scene, "/Strip/A", "/Gone does not exist", "the mesh's own material is used")


def test_subsets_of_what_is_no_mesh_are_a_warning():
    ball = f'def Sphere "Ball" ( {BOUND} )\n{{\nrel material:binding = </Red>\n{subset("A", "[0]", "Green")}\n}}\n'
    scene = load(ball + LOOKS)
    assert {scene.materials[i].path for i in scene.geometry.materials} == {"/Red"}
    assert mentions(scene, "/Ball/A", "Sphere")


def test_the_last_faces_may_be_left_out_and_still_be_named():
    """Face 3 uses a point that does not exist: an index of 3 is inside all the same."""
    broken = strip(subset("A", "[2, 3]", "Green")).replace("9, 8]", "99, 8]")
    scene = load(broken + LOOKS)
    x = corners(scene)[..., 0].mean(axis=1)
    assert {scene.materials[i].path for i in scene.geometry.materials[x > 2]} == {"/Green"}
    assert [line for line in scene.warnings if "indices left out" in line] == []
