"""Stages of one square with a material of any render context, and the shaders in it."""

from __future__ import annotations

from usd.stages import load

from warpmis.scene import Material, Scene

USD_TYPES = {
    "float": "float", "color3": "color3f", "color4": "color4f", "vector2": "float2", "vector3": "float3",
    "vector4": "float4", "integer": "int",
}  # fmt: skip


def text(surface: str, inputs: str = "", nodes: str = "", context: str = "mtlx", mesh: str = "") -> str:
    """A unit square with st = (x, y), and a material whose surface shader is an info:id, or its first lines in full."""
    head = surface if "info:" in surface else f'uniform token info:id = "{surface}"'
    terminal = f"outputs:{context}:surface" if context else "outputs:surface"
    return f"""def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = </M>
    {mesh}
}}
def Material "M"
{{
    token {terminal}.connect = </M/S.outputs:out>
    def Shader "S"
    {{
        {head}
        {inputs}
        token outputs:out
    }}
    {nodes}
}}
"""


def square(surface: str, inputs: str = "", nodes: str = "", context: str = "mtlx", mesh: str = "") -> Scene:
    return load(text(surface, inputs, nodes, context, mesh))


def the(scene: Scene) -> Material:
    """The material of a scene that has one, and nothing to warn of."""
    assert scene.warnings == ()
    (material,) = scene.materials
    return material


def node(name: str, kind: str, inputs: str = "", output: str = "color3", out: str = "out") -> str:
    """A shader of the material; the output of a MaterialX type."""
    return f"""def Shader "{name}"
    {{
        uniform token info:id = "{kind}"
        {inputs}
        {USD_TYPES[output]} outputs:{out}
    }}
"""


def image(name: str, file: object, kind: str = "color3", more: str = "") -> str:
    return node(name, f"ND_image_{kind}", f"asset inputs:file = @{file}@\n{more}", kind)
