"""Texts for fuzz_stages.py: stages of prims of USD's own schemas, any of their attributes with a value of any type."""

from __future__ import annotations

import random
from functools import cache

INTEGERS = ["0", "1", "-1", "2", "3", "-7", "255", "256", "65536", "2147483647", "-2147483648"]
NUMBERS = ["0", "-0", "1", "-1", "0.5", "1e-30", "1e30", "-1e30", "1e300", "1e-300", "nan", "inf", "-inf", "1e19"]
PLAIN = ["0", "1", "2", "0.5", "-1", "3"]
WORDS = ["nonsense", "default", "render", "guide", "invisible", "visible", "none", "cubic", "vertex", "é", "", "a b"]
ASSETS = ["@@", "@nowhere.png@", "@./a.<UDIM>.exr@", "@C:\\\\a\\\\b.png@", "@nowhere.usda[b.png]@", "@.@"]
PATHS = ["</P0>", "</P1>", "</P0/Child>", "</Nowhere>", "</P0.visibility>", "</Look>", "</Look/S.outputs:out>"]

# How many numbers a value has: none for one alone.
SHAPES: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("int", "uint", "int64", "uint64", "uchar", "bool"), ()),
    **dict.fromkeys(("half", "float", "double", "timecode"), ()),
    **{f"{kind}{n}": (n,) for kind in ("int", "half", "float", "double") for n in (2, 3, 4)},
    **{
        f"{role}3{letter}": (3,)
        for role in ("point", "normal", "vector", "color", "texCoord")
        for letter in ("h", "f", "d")
    },
    **{f"{role}{letter}": (4,) for role in ("quat", "color4") for letter in ("h", "f", "d")},
    **{f"texCoord2{letter}": (2,) for letter in ("h", "f", "d")},
    **{f"matrix{n}d": (n, n) for n in (2, 3, 4)},
    "frame4d": (4, 4),
}
WHOLE = ("int", "uint", "int64", "uint64", "uchar", "bool", "int2", "int3", "int4")
TYPES = [*SHAPES, "string", "token", "asset"]

# What is read, and beside it what is left out with a warning.
SCHEMAS = (
    *(
        "Mesh",
        "Cube",
        "Sphere",
        "Cylinder",
        "Cylinder_1",
        "Cone",
        "Capsule",
        "Capsule_1",
        "Plane",
        "BasisCurves",
        "Points",
    ),
    *("PointInstancer", "GeomSubset", "Camera", "Xform", "Scope", "Material", "Shader", "NodeGraph"),
    *("RectLight", "DiskLight", "SphereLight", "CylinderLight", "DistantLight", "DomeLight", "DomeLight_1"),
    *(
        "GeometryLight",
        "PortalLight",
        "PluginLight",
        "LightFilter",
        "SkelRoot",
        "Skeleton",
        "SkelAnimation",
        "BlendShape",
    ),
    *(
        "RenderSettings",
        "RenderProduct",
        "RenderVar",
        "NurbsPatch",
        "NurbsCurves",
        "HermiteCurves",
        "TetMesh",
        "Volume",
    ),
)
APPLIED = (
    *("MaterialBindingAPI", "ShapingAPI", "ShadowAPI", "LightAPI", "MeshLightAPI", "SkelBindingAPI", "VisibilityAPI"),
    *("ColorSpaceAPI", "GeomModelAPI", "MotionAPI", "CollectionAPI:lightLink", "CollectionAPI:shadowLink"),
    "CollectionAPI:materialBind",
)
# Attributes beside the schemas': primvars, transforms, inputs of shaders, old names.
OTHERS = (
    *("primvars:displayColor", "primvars:displayOpacity", "primvars:st", "primvars:normals", "primvars:widths"),
    *("primvars:st:indices", "primvars:skel:jointIndices", "primvars:skel:jointWeights", "primvars:tangents"),
    *("xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale", "xformOp:transform", "xformOp:orient"),
    *("inputs:file", "inputs:st", "inputs:diffuseColor", "inputs:roughness", "inputs:varname", "inputs:fallback"),
    *("inputs:sourceColorSpace", "inputs:wrapS", "inputs:opacity", "inputs:base_color", "inputs:emission"),
    *("outputs:surface", "outputs:rgb", "info:id", "intensity", "inputs:texture:file", "normals", "points"),
)
RELATIONSHIPS = (
    *("prototypes", "material:binding", "material:binding:full", "camera", "products", "orderedVars", "light:filters"),
    *("skel:skeleton", "skel:animationSource", "skel:blendShapeTargets", "collection:lightLink:includes"),
    *("collection:lightLink:excludes", "collection:shadowLink:includes", "proxyPrim", "portals"),
)
SHADERS = (
    *("UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d", "UsdPrimvarReader_float2", "UsdPrimvarReader_float3"),
    *("ND_standard_surface_surfaceshader", "ND_open_pbr_surface_surfaceshader", "ND_image_color3", "ND_normalmap"),
)


def literal(rng: random.Random, type_name: str) -> str:
    """A value of a type, evil now and then; of "float[]" and the like a few of them."""
    if type_name.endswith("[]"):
        return f"[{', '.join(literal(rng, type_name[:-2]) for _ in range(rng.choice((0, 1, 2, 3, 4, 4, 8))))}]"
    if type_name in ("string", "token"):
        return f'"{rng.choice(WORDS)}"'
    if type_name == "asset":
        return rng.choice(ASSETS)
    pool = PLAIN if rng.random() < 0.7 else NUMBERS
    if type_name in WHOLE:
        pool = ["0", "1"] if type_name == "bool" else ["0", "1", "2", "3"] if rng.random() < 0.7 else INTEGERS
    return _nested(rng, pool, SHAPES[type_name])


def _nested(rng: random.Random, pool: list[str], shape: tuple[int, ...]) -> str:
    if not shape:
        return rng.choice(pool)
    return f"({', '.join(_nested(rng, pool, shape[1:]) for _ in range(shape[0]))})"


def any_type(rng: random.Random) -> str:
    return rng.choice(TYPES) + ("[]" if rng.random() < 0.4 else "")


@cache
def attributes(schema: str, applied: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """The names and types that the schemas give a prim."""
    from pxr import Usd

    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/P", schema)
    for name in applied:
        prim.AddAppliedSchema(name)
    return tuple((str(one.GetName()), str(one.GetTypeName())) for one in prim.GetAttributes())


def declaration(rng: random.Random, name: str, type_name: str) -> str:
    """An attribute's line: of its own type mostly, of another or a relationship now and then."""
    if rng.random() < 0.3 or type_name.removesuffix("[]") not in TYPES:
        type_name = any_type(rng)
    if rng.random() < 0.03:
        return f"rel {name} = {rng.choice(PATHS)}"
    if rng.random() < 0.06:
        return f"{type_name} {name}.connect = {rng.choice(PATHS)}"
    if rng.random() < 0.1:
        return f"{type_name} {name}.timeSamples = {{ 0: {literal(rng, type_name)}, 1: {literal(rng, type_name)} }}"
    metadata = ""
    if name.startswith("primvars:") or name in ("normals", "widths"):
        kind = rng.choice(("constant", "uniform", "vertex", "varying", "faceVarying", "nonsense"))
        metadata = f' ( interpolation = "{kind}" )'
    elif rng.random() < 0.05:
        space = rng.choice(("raw", "sRGB", "acescg", "nonsense"))
        metadata = f' ( colorSpace = "{space}" )'
    return f"{type_name} {name} = {literal(rng, type_name)}{metadata}"


def prim_text(rng: random.Random, name: str, depth: int = 0) -> str:
    schema = rng.choice(SCHEMAS)
    applied = tuple(rng.sample(APPLIED, rng.choice((0, 0, 1, 2))))
    lines: dict[str, str] = {}
    own = attributes(schema, applied)
    for attribute, type_name in rng.sample(own, min(len(own), rng.randrange(0, 12))):
        lines[attribute] = declaration(rng, attribute, type_name)
    for attribute in rng.sample(OTHERS, rng.randrange(0, 4)):
        lines[attribute] = declaration(rng, attribute, any_type(rng))
    for relationship in rng.sample(RELATIONSHIPS, rng.randrange(0, 3)):
        targets = ", ".join(rng.sample(PATHS, rng.choice((1, 1, 2))))
        lines[relationship] = f"rel {relationship} = [{targets}]"
    if schema == "Shader" and rng.random() < 0.8:
        lines["info:id"] = f'uniform token info:id = "{rng.choice(SHADERS)}"'
    if rng.random() < 0.3:
        lines["xformOpOrder"] = (
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale", "xformOp:transform"]'
        )
    names = ", ".join(f'"{one}"' for one in applied)
    metadata = f"( prepend apiSchemas = [{names}] )" if applied else ""
    child = prim_text(rng, "Child", depth + 1) if depth < 2 and rng.random() < 0.4 else ""
    body = "\n".join([*lines.values(), child])
    return f'def {schema} "{name}" {metadata}\n{{\n{body}\n}}\n'


def schema_text(rng: random.Random) -> str:
    """A stage of a few such prims, of which one may be the RenderSettings, and a cube, so that there is something."""
    metadata = rng.choice(("", '(\n    renderSettingsPrimPath = "/P0"\n)\n', '(\n    upAxis = "Z"\n)\n'))
    prims = "".join(prim_text(rng, f"P{i}") for i in range(rng.randrange(1, 5)))
    return f'#usda 1.0\n{metadata}{prims}def Cube "Look"\n{{\n}}\n'
