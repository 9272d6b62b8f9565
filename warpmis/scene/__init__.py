"""What a scene is: frozen NumPy data in world space; no pxr, no Warp."""

from warpmis.scene.camera import Camera
from warpmis.scene.geometry import Geometry
from warpmis.scene.light import CylinderLight, DiskLight, DistantLight, DomeLight, Light, RectLight, SphereLight
from warpmis.scene.material import COLOR_INPUTS, Color, Material
from warpmis.scene.scene import Prim, Scene

__all__ = [
    "COLOR_INPUTS",
    "Camera",
    "Color",
    "CylinderLight",
    "DiskLight",
    "DistantLight",
    "DomeLight",
    "Geometry",
    "Light",
    "Material",
    "Prim",
    "RectLight",
    "Scene",
    "SphereLight",
]
