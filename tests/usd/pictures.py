"""Picture files that tests write, and a square that shows one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
from usd.points import seen_at

from warpmis.scene import Scene


def write(path: Path, pixels: np.ndarray, kind: str = "float") -> Path:
    """A picture file; pixels shape (rows, columns, channels) in [0, 1], stored as `kind`."""
    rows, columns, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(columns, rows, channels, kind)
    spec["oiio:UnassociatedAlpha"] = 1
    spec["compression"] = "none" if path.suffix != ".jpg" else "jpeg:100"
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec), OpenImageIO.geterror()
    assert output.write_image(np.ascontiguousarray(pixels, np.float32)), output.geterror()
    output.close()
    return path


# 2 x 2 texels of different grey, row 0 on top: the lower left one is 0.6.
GREYS = np.array([[0.2, 0.4], [0.6, 0.8]])
# The texels' centres in the order of GREYS, as points of the unit square.
CENTRES = [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25)]


def grey(tmp_path: Path, values: np.ndarray = GREYS) -> Path:
    return write(tmp_path / "grey.exr", np.repeat(values[..., None], 3, axis=-1))


def stage(
    file: Path | str,
    *,
    inputs: str = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>",
    texture: str = "",
    st: str = "[(0, 0), (1, 0), (1, 1), (0, 1)]",
    st_source: str = "</M/R.outputs:result>",
    more: str = "",
    mesh: str = "",
) -> str:
    """A unit square in the xy plane, seen from +Z, with one texture; st is x and y unless given."""
    return f"""def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = {st} ( interpolation = "faceVarying" )
    rel material:binding = </M>
    {mesh}
}}
def Material "M"
{{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
    }}
    def Shader "T"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = {st_source}
        {texture}
        float3 outputs:rgb
        float outputs:r
        float outputs:g
        float outputs:b
        float outputs:a
    }}
    def Shader "R"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
    {more}
}}
"""


def diffuse(scene: Scene, xy) -> np.ndarray:
    return seen_at(scene, xy)["diffuse"]
