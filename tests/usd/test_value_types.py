"""Values of a wrong type and targets that are not there: a warning with the path, and the rest is rendered."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Sdf
from usd.pictures import grey
from usd.pictures import stage as textured
from usd.stages import load, mentions, stage_of

from warpmis.usd import load_stage

# Every schema that is read, with what makes it render: prim type, applied schemas, and what is authored soundly.
SQUARE = """int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
"""
CURVE = "int[] curveVertexCounts = [4]\npoint3f[] points = [(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 0, 0)]\n"
INSTANCES = "int[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\nrel prototypes = </Other>\n"
SCHEMAS = {
    **dict.fromkeys(("Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"), ("", "")),
    "Plane": ("", ""),
    "Mesh": ("", SQUARE),
    "Mesh polygons": ("", 'uniform token subdivisionScheme = "none"\n' + SQUARE),
    "BasisCurves": ("", CURVE),
    "Points": ("", "point3f[] points = [(0, 0, 0)]\n"),
    "PointInstancer": ("", INSTANCES),
    "Camera": ("", ""),
    **dict.fromkeys(("RectLight", "DiskLight", "SphereLight", "CylinderLight"), ("ShapingAPI ShadowAPI", "")),
    **dict.fromkeys(("DistantLight", "DomeLight", "DomeLight_1"), ("", "")),
    "RenderSettings": ("", ""),
    "Xform": ("VisibilityAPI", ""),
}
# A value of each kind that no attribute of another kind takes for its own.
WRONG = {"text": ("string", "nonsense"), "number": ("double", 0.5), "matrix": ("matrix4d", np.eye(4).tolist())}

# What is never read, or not of a light without a temperature, an IES profile or geometry.
UNREAD = {
    *("extent", "stereoRole", "instantaneousShutter", "renderingColorSpace", "treatAsLine", "guideRadius"),
    *("light:shaderId", "light:materialSyncMode", "inputs:colorTemperature", "inputs:shaping:ies:normalize"),
    *(f"collection:{name}" for name in ("lightLink", "shadowLink")),
    *(f"collection:{name}:{part}" for name in ("lightLink", "shadowLink") for part in ("membershipExpression", "mode")),
}
MOVING = {"velocities", "accelerations"}
UNREAD_OF = {
    "Mesh": {*MOVING, "normals"},  # of a subdivision surface
    "Mesh polygons": {
        *MOVING, "interpolateBoundary", "faceVaryingLinearInterpolation", "triangleSubdivisionRule",
        *("cornerIndices", "cornerSharpnesses", "creaseIndices", "creaseLengths", "creaseSharpnesses"),
    },
    "BasisCurves": MOVING,
    "Points": {*MOVING, "ids", "normals", "orientation"},
}  # fmt: skip


def with_schemas(applied: str) -> str:
    names = ", ".join(f'"{name}"' for name in applied.split())
    return f"( prepend apiSchemas = [{names}] )" if names else ""


def builtin_attributes(type_name: str, applied: str) -> list[str]:
    stage = stage_of(f'def {type_name} "P" {with_schemas(applied)}\n{{\n}}\n')
    return [str(attribute.GetName()) for attribute in stage.GetPrimAtPath("/P").GetAttributes()]


def stage_with(type_name: str, name: str, kind: str):
    """A stage with one attribute of the wrong type; it holds another cube and light, so that it is never empty."""
    applied, body = SCHEMAS[type_name]
    type_name = type_name.split()[0]
    head = with_schemas(applied)
    metadata = '(\nrenderSettingsPrimPath = "/P"\n)\n' if type_name == "RenderSettings" else ""
    stage = stage_of(
        f'{metadata}def {type_name} "P" {head}\n{{\n{body}\n'
        'def Cube "Below"\n{\n}\n}\ndef Cube "Other"\n{\n}\ndef SphereLight "Key"\n{\n}\n'
    )
    type_of_value, value = WRONG[kind]
    spec = stage.GetRootLayer().GetPrimAtPath("/P")
    existing = stage.GetRootLayer().GetAttributeAtPath(f"/P.{name}")
    if existing:
        spec.RemoveProperty(existing)
    attribute = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.Find(type_of_value))
    attribute.default = Sdf.ValueTypeNames.Find(type_of_value).type.pythonClass(value) if kind == "matrix" else value
    return stage


def is_of_this_kind(stage, name: str, kind: str) -> bool:
    """Whether the schema's own type takes the value."""
    expected = stage.GetPrimAtPath("/P").GetAttribute(name).GetTypeName()
    text = str(expected) in ("string", "token")
    number = str(expected) in ("float", "double", "half") or name == "primvars:displayOpacity"  # one for all
    return (
        (kind == "text" and text) or (kind == "number" and number) or (kind == "matrix" and "matrix4d" in str(expected))
    )


@pytest.mark.parametrize("type_name", SCHEMAS)
def test_any_attribute_of_a_wrong_type_is_a_warning_with_its_path(type_name):
    unread = UNREAD | UNREAD_OF.get(type_name, set())
    tried = 0
    for name in builtin_attributes(type_name.split()[0], SCHEMAS[type_name][0]):
        for kind in WRONG:
            stage = stage_with(type_name, name, kind)
            if is_of_this_kind(stage, name, kind):
                continue
            scene = load_stage(stage, width=8, purposes=("render", "proxy", "guide"))
            assert any(prim.path == "/Other" for prim in scene.prims), (name, kind)
            warned = [line for line in scene.warnings if line.startswith(f"/P.{name}: ")]
            assert len(warned) == (name not in unread), (name, kind, scene.warnings)
            tried += name not in unread
    assert tried >= 10


SHADERS = {
    "S": "UsdPreviewSurface",
    "T": "UsdUVTexture",
    "R": "UsdPrimvarReader_float2",
    "Move": "UsdTransform2d",
}
INPUTS = {
    "S": ("emissiveColor", "useSpecularWorkflow", "specularColor", "metallic", "roughness", "clearcoat", "normal"),
    "T": ("file", "wrapS", "wrapT", "fallback", "scale", "bias", "sourceColorSpace"),
    "R": ("varname", "fallback"),
    "Move": ("rotation", "scale", "translation"),
}
VALUES = {
    "string": "nonsense",
    "token": "nonsense",
    "asset[]": Sdf.AssetPathArray([Sdf.AssetPath("a.png")]),
    "double": 0.5,
    "matrix4d": None,
    "float[]": None,
    "timecode": None,
    "quatf": None,
    "bool[]": None,
}
TAKES = {  # types that an input takes, of those in VALUES
    **{key: {"string", "token"} for key in ("wrapS", "wrapT", "sourceColorSpace", "varname")},
    **{key: {"double"} for key in ("useSpecularWorkflow", "metallic", "roughness", "clearcoat", "rotation")},
    # One number stands for all components.
    **{
        key: {"double"}
        for key in ("emissiveColor", "specularColor", "normal", "fallback", "scale", "bias", "translation")
    },
}


@pytest.mark.parametrize(("shader", "name"), [(shader, name) for shader in INPUTS for name in INPUTS[shader]])
def test_a_shader_input_of_a_wrong_type_is_a_warning_with_its_path(shader, name, tmp_path):
    """No schema fixes the types of a shader's inputs: the file does."""
    picture = grey(tmp_path)
    text = textured(
        picture,
        st_source="</M/Move.outputs:result>",
        more="""def Shader "Move"
        {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </M/R.outputs:result>
            float2 outputs:result
        }""",
    )
    for kind in VALUES:
        if kind in TAKES.get(name, ()):
            continue
        stage = stage_of(text)
        prim = stage.GetRootLayer().GetPrimAtPath(f"/M/{shader}")
        if f"inputs:{name}" in prim.properties:
            prim.RemoveProperty(prim.properties[f"inputs:{name}"])
        wanted = Sdf.ValueTypeNames.Find(kind)
        value = VALUES[kind]
        attribute = Sdf.AttributeSpec(prim, f"inputs:{name}", wanted)
        attribute.default = wanted.defaultValue if value is None else value
        scene = load_stage(stage, width=8)
        assert mentions(scene, f"/M/{shader}.inputs:{name}: left out: its value is not of type"), (kind, scene.warnings)
        assert len(scene.geometry.triangles) == 2


NOWHERE = {
    "prototypes": (
        'def PointInstancer "P"\n{\nint[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\nREL\n}\n',
        "/P.prototypes",
    ),
    "material:binding": ('def Cube "P" ( prepend apiSchemas = ["MaterialBindingAPI"] )\n{\nREL\n}\n', "/P"),
    "collection:lightLink:includes": (
        'def SphereLight "P" ( prepend apiSchemas = ["CollectionAPI:lightLink"] )\n{\nREL\n}\n',
        "/P.collection:lightLink:includes",
    ),
    "collection:shadowLink:excludes": (
        'def SphereLight "P" ( prepend apiSchemas = ["CollectionAPI:shadowLink"] )\n{\nREL\n}\n',
        "/P.collection:shadowLink:excludes",
    ),
    "camera": ('def RenderSettings "P"\n{\nREL\n}\n', "/P.camera"),
    "light:filters": ('def SphereLight "P"\n{\nREL\n}\n', "/P"),
    "skel:skeleton": (
        'def SkelRoot "R"\n{\ndef Mesh "P" ( prepend apiSchemas = ["SkelBindingAPI"] )\n{\n' + SQUARE + "REL\n}\n}\n",
        "/R/P.skel:skeleton",
    ),
    "skel:animationSource": (
        'def SkelRoot "R"\n{\ndef Skeleton "P" ( prepend apiSchemas = ["SkelBindingAPI"] )\n{\nREL\n}\n}\n', "/R/P"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", NOWHERE)
@pytest.mark.parametrize("target", ["rel {} = </Nowhere>", "rel {} = </Other.size>", "float {} = 3"])
def test_a_relationship_to_nowhere_is_a_warning_and_the_rest_is_rendered(name, target):
    text, path = NOWHERE[name]
    text = text.replace("REL", target.format(name)) + 'def Cube "Other"\n{\n}\ndef SphereLight "Key"\n{\n}\n'
    metadata = '(\nrenderSettingsPrimPath = "/P"\n)\n' if name == "camera" else ""
    scene = load(metadata + text, width=8)
    assert any(prim.path == "/Other" for prim in scene.prims)
    if "Nowhere" in target:
        assert sum(line.startswith(path) for line in scene.warnings) == 1, scene.warnings


@pytest.mark.parametrize(
    "targets",
    ["[</Nowhere>, </Other>]", "[</Group.collection:nope>, </Other>]", "[</Nowhere.collection:x>, </Other>]"],
)
@pytest.mark.parametrize("name", ["material:binding", "material:binding:collection:x"])
def test_a_binding_of_which_a_part_leads_nowhere_is_one_warning_for_all_that_is_below(name, targets):
    cubes = 'def Cube "A"\n{\n}\ndef Cube "B"\n{\n}\n'
    head = '( prepend apiSchemas = ["MaterialBindingAPI"] )'
    scene = load(f'def Xform "Group" {head}\n{{\nrel {name} = {targets}\n{cubes}}}\ndef Cube "Other"\n{{\n}}\n')
    assert mentions(scene, f"/Group.{name}: ", "does not exist", "binds no material"), scene.warnings
    assert len(scene.prims) == 3


def test_quaternions_are_no_vectors_of_four():
    scene = load('def Camera "P"\n{\nquath[] clippingPlanes = [(1, 0, 0, 0)]\n}\ndef Cube "Other"\n{\n}\n')
    assert mentions(scene, "/P.clippingPlanes", "not of type float4[]")
    several = load(
        'def PointInstancer "I"\n{\nint[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\n'
        'quatf[] orientations = [(1, 0, 0, 0)]\nrel prototypes = </I/C>\ndef Cube "C"\n{\n}\n}\n'
    )
    assert several.warnings == ()  # quath by the schema, of another precision here


def test_a_connection_to_nowhere_is_a_warning():
    scene = load(textured("nowhere.png", inputs="float inputs:roughness.connect = </M/Gone.outputs:r>"))
    assert mentions(scene, "/M/S.inputs:roughness", "/M/Gone.outputs:r", "does not exist")


CHARACTER = """def SkelRoot "Root"
{
    def Skeleton "Skel" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {
        uniform token[] joints = ["A"]
        uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
        rel skel:animationSource = </Root/Skel/Move>
        def SkelAnimation "Move"
        {
            uniform token[] joints = ["A"]
            float3[] translations = [(0, 0, 1)]
            quatf[] rotations = [(1, 0, 0, 0)]
            half3[] scales = [(1, 1, 1)]
            uniform token[] blendShapes = ["Out"]
            float[] blendShapeWeights = [1]
        }
    }
    def Mesh "Skin" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {
        SQUARE
        rel skel:skeleton = </Root/Skel>
        int[] primvars:skel:jointIndices = [0, 0, 0, 0] ( interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] ( interpolation = "vertex" )
        vector3f[] primvars:tangents = [(1, 0, 0)] ( interpolation = "constant" )
        uniform token[] skel:blendShapes = ["Out"]
        rel skel:blendShapeTargets = </Root/Skin/Out>
        def BlendShape "Out"
        {
            uniform vector3f[] offsets = [(0, 0, 1)]
            uniform vector3f[] normalOffsets = [(0, 0, 1)]
            uniform int[] pointIndices = [0]
        }
    }
}
def Cube "Other"
{
}
""".replace("SQUARE", SQUARE)
SKINNING = {
    "/Root/Skel": ("joints", "bindTransforms", "restTransforms"),
    "/Root/Skel/Move": ("joints", "blendShapes", "translations", "rotations", "scales", "blendShapeWeights"),
    "/Root/Skin/Out": ("offsets", "normalOffsets", "pointIndices"),
    "/Root/Skin": (
        *("primvars:skel:jointIndices", "primvars:skel:jointWeights", "primvars:skel:geomBindTransform"),
        *("primvars:skel:skinningMethod", "skel:joints", "skel:blendShapes", "primvars:tangents"),
    ),
}


@pytest.mark.parametrize(("path", "name"), [(path, name) for path in SKINNING for name in SKINNING[path]])
def test_what_skinning_reads_of_a_wrong_type_is_a_warning_with_its_path(path, name):
    for kind, (type_of_value, value) in WRONG.items():
        if (kind, name) in (("matrix", "primvars:skel:geomBindTransform"), ("text", "primvars:skel:skinningMethod")):
            continue
        stage = stage_of(CHARACTER)
        layer = stage.GetRootLayer()
        spec = layer.GetPrimAtPath(path)
        if layer.GetAttributeAtPath(f"{path}.{name}"):
            spec.RemoveProperty(layer.GetAttributeAtPath(f"{path}.{name}"))
        wanted = Sdf.ValueTypeNames.Find(type_of_value)
        Sdf.AttributeSpec(spec, name, wanted).default = wanted.type.pythonClass(value) if kind == "matrix" else value
        scene = load_stage(stage, width=8)
        assert any(line.startswith(f"{path}.{name}: ") for line in scene.warnings), (kind, scene.warnings)
        assert any(prim.path == "/Other" for prim in scene.prims)
