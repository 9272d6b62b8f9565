"""Small stages to measure on, beside usd_scenes: two where light is hidden, two interiors, two where it is not.

two_rooms  closed; the lamp is in one, the camera in the other, a gap between them
cove       a hall lit by lamps in a trough that shine at the ceiling
window     a room with furniture, lit by the sky through its window
office     lamps in the ceiling, tables, a glossy floor
yard       sun and sky on walls
products   glossy solids on a backdrop between three soft boxes
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

Vector = Sequence[float]
WHITE, GREY, RED, BLUE, WOOD = (0.8, 0.8, 0.8), (0.5, 0.5, 0.5), (0.7, 0.2, 0.15), (0.2, 0.3, 0.6), (0.5, 0.33, 0.2)


class Stage:
    """A stage under construction: boxes and balls, lamps, a camera; metres, Y is up."""

    def __init__(self, path: Path) -> None:
        self.usd = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(self.usd, UsdGeom.Tokens.y)
        self.usd.SetDefaultPrim(UsdGeom.Xform.Define(self.usd, "/World").GetPrim())
        self.count = 0

    def path(self, kind: str) -> str:
        self.count += 1
        return f"/World/{kind}{self.count}"

    def box(self, low: Vector, high: Vector, color: Vector, **surface: float) -> None:
        """From corner to corner."""
        cube = UsdGeom.Cube.Define(self.usd, self.path("Box"))
        cube.CreateSizeAttr(1.0)
        cube.AddTranslateOp().Set(Gf.Vec3d(*((a + b) / 2 for a, b in zip(low, high, strict=True))))
        cube.AddScaleOp().Set(Gf.Vec3f(*(b - a for a, b in zip(low, high, strict=True))))
        self._paint(cube, color, surface)

    def ball(self, center: Vector, radius: float, color: Vector, **surface: float) -> None:
        sphere = UsdGeom.Sphere.Define(self.usd, self.path("Ball"))
        sphere.CreateRadiusAttr(radius)
        sphere.AddTranslateOp().Set(Gf.Vec3d(*center))
        self._paint(sphere, color, surface)

    def _paint(self, shape: UsdGeom.Gprim, color: Vector, surface: dict[str, float]) -> None:
        material = UsdShade.Material.Define(self.usd, self.path("Material"))
        shader = UsdShade.Shader.Define(self.usd, material.GetPath().AppendChild("Surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
        values = {"roughness": 1.0, "specularColor": 0.0, **surface}
        if values.pop("specularColor") == 0.0 and "metallic" not in surface and "roughness" not in surface:
            shader.CreateInput("useSpecularWorkflow", Sdf.ValueTypeNames.Int).Set(1)
            shader.CreateInput("specularColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.0))
        for name, value in values.items():
            shader.CreateInput(name, Sdf.ValueTypeNames.Float).Set(value)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(material)

    def panel(self, center: Vector, size: Sequence[float], turn: Vector, intensity: float) -> None:
        """A rect light; turn: rotations about X, Y, Z [degree], (-90, 0, 0) shines down."""
        lamp = UsdLux.RectLight.Define(self.usd, self.path("Panel"))
        lamp.CreateWidthAttr(size[0])
        lamp.CreateHeightAttr(size[1])
        lamp.CreateIntensityAttr(intensity)
        lamp.AddTranslateOp().Set(Gf.Vec3d(*center))
        lamp.AddRotateXYZOp().Set(Gf.Vec3f(*turn))

    def bulb(self, center: Vector, radius: float, intensity: float) -> None:
        lamp = UsdLux.SphereLight.Define(self.usd, self.path("Bulb"))
        lamp.CreateRadiusAttr(radius)
        lamp.CreateIntensityAttr(intensity)
        lamp.AddTranslateOp().Set(Gf.Vec3d(*center))

    def sky(self, color: Vector) -> None:
        UsdLux.DomeLight.Define(self.usd, self.path("Sky")).CreateColorAttr(Gf.Vec3f(*color))

    def sun(self, turn: Vector, intensity: float) -> None:
        lamp = UsdLux.DistantLight.Define(self.usd, self.path("Sun"))
        lamp.CreateIntensityAttr(intensity)
        lamp.CreateAngleAttr(0.53)
        lamp.AddRotateXYZOp().Set(Gf.Vec3f(*turn))

    def camera(self, eye: Vector, target: Vector, focal: float = 18.0) -> None:
        camera = UsdGeom.Camera.Define(self.usd, "/World/Camera")
        camera.CreateFocalLengthAttr(focal)
        camera.CreateHorizontalApertureAttr(24.0)
        camera.CreateVerticalApertureAttr(18.0)
        view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(0.0, 1.0, 0.0))
        camera.AddTransformOp().Set(view.GetInverse())

    def shell(self, low: Vector, high: Vector, color: Vector, *, without: str = "", thick: float = 0.1) -> None:
        """Six walls about a box; `without` leaves some out: x- x+ y- y+ z- z+."""
        for axis, letter in enumerate("xyz"):
            for side, at in (("-", low), ("+", high)):
                if letter + side in without:
                    continue
                a, b = [v - thick for v in low], [v + thick for v in high]
                a[axis], b[axis] = (at[axis] - thick, at[axis]) if side == "-" else (at[axis], at[axis] + thick)
                self.box(a, b, color)


def two_rooms(stage: Stage) -> None:
    stage.shell((-2, 0, -1.5), (2, 2.2, 1.5), WHITE)
    stage.box((-0.05, 0, -1.5), (0.05, 2.2, 1.1), GREY)  # the gap is 0.4 wide
    stage.box((-1.4, 0, -0.9), (-0.8, 0.7, -0.3), RED)
    stage.bulb((1.2, 1.8, -0.6), 0.12, 40.0)
    stage.camera((-0.4, 1.2, 1.3), (-1.5, 0.6, -1.0))


def cove(stage: Stage) -> None:
    stage.shell((-3, 0, -3), (3, 2.8, 3), WHITE)
    for x in (-2.9, 2.5):
        stage.box((x, 2.3, -3), (x + 0.4, 2.34, 3), GREY)
        stage.panel((x + 0.2, 2.36, 0.0), (0.2, 5.0), (90, 0, 0), 12.0)
    for k, color in enumerate((RED, BLUE, WOOD)):
        stage.box((-2 + 1.5 * k, 0, -1.5), (-1.2 + 1.5 * k, 1.0 + 0.3 * k, -0.8), color)
    stage.camera((0.0, 1.5, 2.8), (0.0, 1.2, -1.0))


def window(stage: Stage) -> None:
    stage.shell((-2.5, 0, -2), (2.5, 2.5, 2), WHITE, without="x-")
    stage.box((-2.6, 0, -2), (-2.5, 0.9, 2), WHITE)
    stage.box((-2.6, 2.1, -2), (-2.5, 2.5, 2), WHITE)
    for z in (-2.0, 0.8):
        stage.box((-2.6, 0.9, z), (-2.5, 2.1, z + 1.2), WHITE)
    stage.sky((4.0, 4.5, 5.5))
    stage.box((-0.7, 0.7, -1.0), (0.9, 0.76, 0.2), WOOD, roughness=0.3)
    for x, z in ((-0.6, -0.9), (0.8, -0.9), (-0.6, 0.1), (0.8, 0.1)):
        stage.box((x - 0.04, 0, z - 0.04), (x + 0.04, 0.7, z + 0.04), WOOD)
    stage.box((1.6, 0, -1.9), (2.5, 1.9, -1.2), BLUE)
    stage.ball((0.1, 0.92, -0.4), 0.16, RED, roughness=0.2)
    stage.camera((1.9, 1.5, 1.8), (-0.5, 0.9, -0.8), 16.0)


def office(stage: Stage) -> None:
    stage.shell((-4, 0, -3), (4, 2.7, 3), WHITE, without="y-")
    stage.box((-4, -0.1, -3), (4, 0, 3), GREY, roughness=0.25)
    for x in (-2.4, 0.0, 2.4):
        for z in (-1.5, 1.2):
            stage.panel((x, 2.69, z), (1.2, 0.3), (-90, 0, 0), 8.0)
            stage.box((x - 0.6, 0.7, z - 0.4), (x + 0.6, 0.75, z + 0.4), WOOD)
            stage.box((x - 0.55, 0, z - 0.35), (x - 0.5, 0.7, z + 0.35), GREY)
            stage.box((x + 0.5, 0, z - 0.35), (x + 0.55, 0.7, z + 0.35), GREY)
    stage.camera((3.5, 1.7, 2.8), (-0.6, 0.8, -1.0), 18.0)


def yard(stage: Stage) -> None:
    stage.box((-20, -0.1, -20), (20, 0, 20), (0.45, 0.42, 0.38))
    stage.box((-4, 0, -4), (4, 3, -3.8), WHITE)
    stage.box((-4, 0, -4), (-3.8, 3, 3), WHITE)
    stage.box((0.5, 0, -2.0), (1.7, 1.2, -1.0), RED)
    stage.ball((-1.2, 0.6, -1.6), 0.6, BLUE)
    stage.sky((0.3, 0.45, 0.8))
    stage.sun((-50, 30, 0), 100_000.0)
    stage.camera((4.0, 2.4, 4.5), (-0.8, 0.7, -1.5), 22.0)


def products(stage: Stage) -> None:
    stage.box((-6, -0.1, -3), (6, 0, 6), WHITE)
    stage.box((-6, -0.1, -3.1), (6, 5, -3), WHITE)
    stage.ball((-1.3, 0.6, 0.0), 0.6, (0.95, 0.64, 0.54), metallic=1.0, roughness=0.15)
    stage.ball((0.1, 0.6, 0.3), 0.6, BLUE, roughness=0.05)
    stage.box((0.9, 0, -0.5), (1.9, 1.1, 0.5), RED, roughness=0.3)
    stage.panel((-3.0, 3.5, 2.0), (1.5, 1.5), (-45, -45, 0), 8.0)
    stage.panel((3.0, 3.0, 2.5), (1.0, 2.0), (-35, 45, 0), 5.0)
    stage.panel((0.0, 4.5, 0.0), (3.0, 1.0), (-90, 0, 0), 4.0)
    stage.camera((0.2, 1.6, 5.0), (0.2, 0.6, 0.0), 30.0)


STAGES: dict[str, Callable[[Stage], None]] = {
    build.__name__: build for build in (two_rooms, cove, window, office, yard, products)
}


def write_interior(name: str, folder: Path) -> Path:
    """Write one of STAGES, and return its path."""
    path = folder / f"{name}.usda"
    stage = Stage(path)
    STAGES[name](stage)
    stage.usd.Save()
    return path
