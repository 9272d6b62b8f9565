"""Small stages that fuzz_stages.py mutates: between them, of all schemas that are read."""

from __future__ import annotations

TEXTS = {
    "subdivided": """#usda 1.0
(
    defaultPrim = "Cage"
    upAxis = "Z"
    metersPerUnit = 0.01
)
def Mesh "Cage" {
    uniform token subdivisionScheme = "catmullClark"
    uniform token interpolateBoundary = "edgeAndCorner"
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1),
        (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    int[] cornerIndices = [0]
    float[] cornerSharpnesses = [10]
    int[] creaseIndices = [1, 3, 5]
    int[] creaseLengths = [3]
    float[] creaseSharpnesses = [2.5]
    int[] holeIndices = [5]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "faceVarying"
    )
    int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]
}
""",
    "instances": """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 10
)
def PointInstancer "Many" {
    int[] protoIndices = [0, 1, 0]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (0.7, 0.7, 0, 0), (0, 1, 0, 0)]
    float3[] scales = [(1, 1, 1), (0.5, 0.5, 0.5), (1, 2, 1)]
    int64[] invisibleIds = [2]
    rel prototypes = [</Many/Ball>, </Many/Rod>]
    def Sphere "Ball" {
        double radius = 0.5
    }
    def Cylinder "Rod" {
        double height = 2
        double radius = 0.2
        uniform token axis = "X"
    }
}
def BasisCurves "Hair" {
    uniform token type = "cubic"
    uniform token basis = "bspline"
    uniform token wrap = "nonperiodic"
    int[] curveVertexCounts = [5, 4]
    point3f[] points = [(0, 0, 0), (0, 1, 0), (0, 2, 1), (0, 3, 0), (1, 3, 0),
        (2, 0, 0), (2, 1, 0), (2, 2, 1), (2, 3, 0)]
    float[] widths = [0.1] (
        interpolation = "constant"
    )
}
def Points "Dust" {
    point3f[] points.timeSamples = {
        1: [(0, 0, 3), (1, 0, 3)],
        10: [(0, 1, 3), (1, 1, 3)],
    }
    float[] widths = [0.1, 0.2]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (
        interpolation = "vertex"
    )
}
""",
    "lights": """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
)
def Cube "Box" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Look>
}
def Material "Look" {
    token outputs:surface.connect = </Look/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/Picture.outputs:rgb>
        color3f inputs:emissiveColor = (0.1, 0, 0)
        float inputs:metallic = 0.2
        float inputs:roughness = 0.4
        float inputs:opacity = 0.5
        float inputs:ior = 1.5
        float inputs:clearcoat = 0.5
        token outputs:surface
    }
    def Shader "Picture" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @nowhere.png@
        float2 inputs:st = (0.3, 0.4)
        float4 inputs:fallback = (1, 0, 0, 1)
        token inputs:wrapS = "mirror"
        float3 outputs:rgb
    }
}
def DiskLight "Disk" (
    prepend apiSchemas = ["ShapingAPI"]
)
{
    float inputs:radius = 0.5
    float inputs:intensity = 3
    float inputs:shaping:cone:angle = 30
    float inputs:shaping:cone:softness = 0.2
    float inputs:shaping:focus = 2
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def CylinderLight "Tube" {
    float inputs:length = 2
    float inputs:radius = 0.1
    bool inputs:normalize = 1
    float inputs:colorTemperature = 3000
    bool inputs:enableColorTemperature = 1
    matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 3, 2, 1))
    uniform token[] xformOpOrder = ["xformOp:transform"]
}
def DistantLight "Sun" {
    float inputs:angle = 0.53
    float inputs:exposure = 2
    float3 xformOp:rotateXYZ = (-45, 10, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    rel collection:lightLink:includes = </Box>
    uniform token collection:lightLink:expansionRule = "expandPrims"
}
def DomeLight "Sky" {
    color3f inputs:color = (0.4, 0.5, 0.6)
    asset inputs:texture:file = @nowhere.hdr@
    token inputs:texture:format = "latlong"
}
def "Products" {
    def RenderProduct "Beauty" {
        token productName = "beauty.exr"
        rel orderedVars = [</Products/Color>]
    }
    def RenderVar "Color" {
        token dataType = "color3f"
        string sourceName = "color"
    }
}
def Camera "Camera" {
    float focalLength = 35
    float fStop = 4
    float focusDistance = 10
    float2 clippingRange = (0.1, 1000)
    token projection = "perspective"
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def "Render" {
    def RenderSettings "Settings" {
        rel camera = </Camera>
        rel products = [</Products/Beauty>]
        uniform int2 resolution = (8, 6)
        uniform float pixelAspectRatio = 1
        uniform float4 dataWindowNDC = (0, 0, 1, 1)
    }
}
""",
    "character": """#usda 1.0
def SkelRoot "Root" (
    prepend apiSchemas = ["SkelBindingAPI"]
)
{
    rel skel:skeleton = </Root/Skel>
    def Skeleton "Skel" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token[] joints = ["A", "A/B"]
        uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 0, 1))]
        uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 0, 1))]
        rel skel:animationSource = </Root/Skel/Bend>
        def SkelAnimation "Bend" {
            uniform token[] joints = ["A", "A/B"]
            float3[] translations = [(0, 0, 0), (0, 1, 0)]
            quatf[] rotations = [(1, 0, 0, 0), (0.7, 0, 0, 0.7)]
            half3[] scales = [(1, 1, 1), (1, 1, 1)]
            uniform token[] blendShapes = ["Out"]
            float[] blendShapeWeights = [0.5]
        }
    }
    def Mesh "Skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)]
        normal3f[] primvars:normals = [(0, 0, 1), (0, 0, 1)] (
            interpolation = "faceVarying"
        )
        int[] primvars:normals:indices = [0, 0, 1, 1]
        vector3f[] primvars:tangents = [(1, 0, 0)] (
            interpolation = "constant"
        )
        matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        int[] primvars:skel:jointIndices = [0, 0, 1, 1] (
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
            interpolation = "vertex"
        )
        uniform token[] skel:blendShapes = ["Out"]
        rel skel:blendShapeTargets = </Root/Skin/Out>
        def BlendShape "Out" {
            uniform vector3f[] offsets = [(0, 0, 3)]
            uniform vector3f[] normalOffsets = [(0, 0, 1)]
            uniform int[] pointIndices = [1]
        }
    }
}
""",
    "library": """#usda 1.0
class Xform "Bolt" (
    prepend apiSchemas = ["ColorSpaceAPI"]
)
{
    uniform token colorSpace:name = "acescg"
    def Mesh "Head" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]
        rel material:binding = </Bolt/Look>
        def GeomSubset "Tip" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </Bolt/Shiny>
        }
    }
    def Material "Look" {
        token outputs:surface.connect = </Bolt/Look/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Bolt/Look/T.outputs:result>
            float inputs:opacityThreshold = 0.5
            token outputs:surface
        }
        def Shader "T" {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "tint"
            float3 inputs:fallback = (1, 0, 0)
            float3 outputs:result
        }
    }
    def Material "Shiny" {
        token outputs:mtlx:surface.connect = </Bolt/Shiny/S.outputs:out>
        def Shader "S" {
            uniform token info:id = "ND_standard_surface_surfaceshader"
            color3f inputs:base_color.connect = </Bolt/Shiny/I.outputs:out>
            float inputs:metalness = 1
            token outputs:out
        }
        def Shader "I" {
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @nowhere.<UDIM>.png@ (
                colorSpace = "srgb_texture"
            )
            color3f inputs:default = (0.5, 0.5, 0.5)
            color3f outputs:out
        }
    }
}
def PointInstancer "Many" (
    prepend apiSchemas = ["VisibilityAPI"]
)
{
    uniform token renderVisibility = "visible"
    int[] protoIndices = [0, 1, 0]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    float3[] primvars:tint = [(0.2, 0.4, 0.6), (1, 0, 0)] (
        interpolation = "varying"
    )
    int[] primvars:tint:indices = [0, 1, 0]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (
        interpolation = "vertex"
    )
    rel prototypes = [</Many/One>, </Many/Ball>]
    def "One" (
        instanceable = true
        inherits = </Bolt>
    )
    {
        uniform token purpose = "render"
    }
    def Sphere "Ball" (
        prepend apiSchemas = ["MeshLightAPI"]
    )
    {
        double radius = 0.2
        color3f inputs:color = (1, 0.5, 0)
        token light:materialSyncMode = "independent"
    }
}
""",
}
