"""Any small stage, its values drawn by Hypothesis: read, or refused by a WarpmisError of one line; never anything else.

Values are of the right type and otherwise anything: negative, infinite, NaN, of the wrong number, out of range.
"""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from usd.stages import check_invariants, stage_of

import warpmis

NUMBER = st.one_of(
    st.sampled_from([0.0, 1.0, -1.0, 0.5, float("nan"), float("inf"), -float("inf"), 1e30, -1e30, 1e-30]),
    st.floats(-10.0, 10.0, width=32),
)
INTEGER = st.one_of(st.integers(-2, 9), st.sampled_from([-(2**31), 2**31 - 1, 10**6]))


def number(value: float) -> str:
    return {"nan": "nan", "inf": "inf", "-inf": "-inf"}.get(str(value), repr(value))


def vector(size: int) -> st.SearchStrategy[str]:
    return st.lists(NUMBER, min_size=size, max_size=size).map(lambda v: f"({', '.join(map(number, v))})")


def array(item: st.SearchStrategy[str], most: int = 9) -> st.SearchStrategy[str]:
    return st.lists(item, max_size=most).map(lambda items: f"[{', '.join(items)}]")


def token(*names: str) -> st.SearchStrategy[str]:
    return st.sampled_from([*names, "nonsense", ""]).map(lambda name: f'"{name}"')


VALUES = {
    "float": NUMBER.map(number),
    "double": NUMBER.map(number),
    "int": INTEGER.map(str),
    "bool": st.sampled_from(["0", "1"]),
    "double3": vector(3),
    "float2": vector(2),
    "int2": st.tuples(INTEGER, INTEGER).map(str),
    "color3f": vector(3),
    "int[]": array(INTEGER.map(str)),
    "float[]": array(NUMBER.map(number)),
    "point3f[]": array(vector(3)),
    "normal3f[]": array(vector(3)),
    "color3f[]": array(vector(3)),
    "quath[]": array(vector(4)),
    "float3[]": array(vector(3)),
    "matrix4d": st.lists(vector(4), min_size=4, max_size=4).map(lambda rows: f"({', '.join(rows)})"),
}

LIGHT = [
    ("float", "inputs:intensity"),
    ("float", "inputs:exposure"),
    ("color3f", "inputs:color"),
    ("bool", "inputs:normalize"),
]
LIGHT += [("float", "inputs:colorTemperature"), ("bool", "inputs:enableColorTemperature")]
ATTRIBUTES = {
    "Mesh": [
        ("int[]", "faceVertexCounts"), ("int[]", "faceVertexIndices"), ("point3f[]", "points"),
        ("normal3f[]", "normals"), ("color3f[]", "primvars:displayColor"), ("int[]", "holeIndices"),
        ("int[]", "creaseIndices"), ("int[]", "creaseLengths"), ("float[]", "creaseSharpnesses"),
        ("int[]", "cornerIndices"), ("float[]", "cornerSharpnesses"),
    ],
    "Sphere": [("double", "radius")],
    "Cylinder": [("double", "radius"), ("double", "height")],
    "Cone": [("double", "radius"), ("double", "height")],
    "Capsule": [("double", "radius"), ("double", "height")],
    "Cube": [("double", "size")],
    "Plane": [("double", "width"), ("double", "length")],
    "BasisCurves": [("int[]", "curveVertexCounts"), ("point3f[]", "points"), ("float[]", "widths")],
    "Points": [("point3f[]", "points"), ("float[]", "widths")],
    "PointInstancer": [
        ("int[]", "protoIndices"), ("point3f[]", "positions"), ("quath[]", "orientations"), ("float3[]", "scales"),
    ],
    "RectLight": [*LIGHT, ("float", "inputs:width"), ("float", "inputs:height")],
    "DiskLight": [*LIGHT, ("float", "inputs:radius"), ("float", "inputs:shaping:cone:angle")],
    "SphereLight": [*LIGHT, ("float", "inputs:radius"), ("bool", "treatAsPoint")],
    "CylinderLight": [*LIGHT, ("float", "inputs:radius"), ("float", "inputs:length")],
    "DistantLight": [*LIGHT, ("float", "inputs:angle")],
    "DomeLight": LIGHT,
    "Camera": [
        ("float", "focalLength"), ("float", "horizontalAperture"), ("float", "verticalAperture"), ("float", "fStop"),
        ("float", "focusDistance"), ("float2", "clippingRange"), ("float", "exposure"),
    ],
}  # fmt: skip
TOKENS = {
    "Mesh": [
        ("subdivisionScheme", token("none", "catmullClark", "loop", "bilinear")),
        ("orientation", token("leftHanded")),
    ],
    "BasisCurves": [("type", token("linear", "cubic")), ("basis", token("bezier", "bspline", "catmullRom"))],
    "Cylinder": [("axis", token("X", "Y", "Z"))],
}
# What makes sense together: drawn as often as anything else, so that one bad value meets good ones.
GOOD = {
    ("Mesh", "faceVertexCounts"): "[4, 3]",
    ("Mesh", "faceVertexIndices"): "[0, 1, 2, 3, 1, 0, 4]",
    ("Mesh", "points"): "[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]",
    ("BasisCurves", "curveVertexCounts"): "[4]",
    ("BasisCurves", "points"): "[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]",
    ("Points", "points"): "[(0, 0, 0), (1, 0, 0)]",
    ("PointInstancer", "protoIndices"): "[0, 0]",
    ("PointInstancer", "positions"): "[(0, 0, 0), (3, 0, 0)]",
}
# Never empty: what is drawn stands beside this.
TRIANGLE = """
def Mesh "Triangle" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
"""


@st.composite
def prim(draw: st.DrawFn, name: str) -> str:
    kind = draw(st.sampled_from(sorted(ATTRIBUTES)))
    lines = []
    for type_name, attribute in ATTRIBUTES[kind]:
        value = GOOD.get((kind, attribute))
        if draw(st.booleans()):
            value = draw(VALUES[type_name])
        if value is not None:
            lines.append(f"{type_name} {attribute} = {value}")
    for attribute, names in TOKENS.get(kind, []):
        if draw(st.booleans()):
            lines.append(f"uniform token {attribute} = {draw(names)}")
    operation = draw(st.sampled_from([None, ("double3", "translate"), ("double3", "scale"), ("matrix4d", "transform")]))
    if operation is not None:
        lines.append(f"{operation[0]} xformOp:{operation[1]} = {draw(VALUES[operation[0]])}")
        lines.append(f'uniform token[] xformOpOrder = ["xformOp:{operation[1]}"]')
    if kind == "PointInstancer":
        lines.append("rel prototypes = [</Triangle>, </P0>]")
    body = "\n    ".join(lines)
    return f'def {kind} "{name}"\n{{\n    {body}\n}}\n'


@st.composite
def stages(draw: st.DrawFn) -> str:
    return TRIANGLE + "".join(draw(prim(f"P{index}")) for index in range(draw(st.integers(1, 3))))


@settings(derandomize=True, deadline=None, max_examples=150, database=None)
@given(stages())
def test_any_small_stage_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        scene = warpmis.load_stage(stage_of(text), width=4)
    except warpmis.WarpmisError as error:
        assert len(str(error).splitlines()) == 1
        return
    check_invariants(scene)
    for light in scene.lights:
        assert np.isfinite(light.radiance).all()
    assert all(len(line.splitlines()) == 1 for line in scene.warnings)
