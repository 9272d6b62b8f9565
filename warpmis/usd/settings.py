"""The stage's RenderSettings: resolution, camera and how the camera's window meets the picture's aspect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import UsdRender

from warpmis.errors import StageError
from warpmis.usd.reading import Reading

PURPOSES = {"default", "render", "proxy", "guide"}
CONFORM_POLICIES = {
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
}
WHOLE = (0.0, 0.0, 1.0, 1.0)

# A data window that reaches further, in widths of the picture, is a mistake.
MAX_OVERSCAN = 16.0


@dataclass(frozen=True)
class Settings:
    """What the RenderSettings prim authors.

    Attributes:
        path: the prim's, "" for a stage without one.
        resolution: (width, height) [pixel], or None.
        camera: path of the camera, or None.
        pixel_aspect_ratio: width over height of a pixel.
        conform_policy: UsdRender's aspectRatioConformPolicy.
        data_window: (xmin, ymin, xmax, ymax) of the picture that is rendered, (0, 0) its lower left corner, (1, 1) its
            upper right one.
        purposes: of prims to render, or None.
        disable_depth_of_field: whether every camera is a pinhole.
        material_purposes: purposes of material bindings, the first that a prim has counts; "" is for all purposes.
    """

    path: str = ""
    resolution: tuple[int, int] | None = None
    camera: str | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    data_window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    purposes: tuple[str, ...] | None = None
    disable_depth_of_field: bool = False
    material_purposes: tuple[str, ...] = ("full", "")


def read_settings(reading: Reading, path: str | None) -> Settings:
    """The settings at `path`, or those that the stage's metadata name.

    Raises:
        StageError: `path` is given, and there is no RenderSettings prim.
    """
    if path is not None:
        prim = reading.stage.GetPrimAtPath(path) if path.startswith("/") else None
        if not prim or not prim.IsA(UsdRender.Settings):
            raise StageError("there is no RenderSettings prim here", path)
        return _read(UsdRender.Settings(prim), reading)
    settings = UsdRender.Settings.GetStageRenderSettings(reading.stage)
    if settings:
        return _read(settings, reading)
    named = reading.stage.GetMetadata("renderSettingsPrimPath")
    if named:
        reading.warn(named, "the stage's renderSettingsPrimPath names no RenderSettings prim")
    return Settings()


def _read(settings: Any, reading: Reading) -> Settings:
    path = settings.GetPath()
    ratio = reading.number(settings.GetPrim(), "pixelAspectRatio", 1.0)
    if not 0.0 < ratio < float("inf"):
        reading.warn(path, f"pixelAspectRatio {ratio:g} must be above 0; 1 is used")
        ratio = 1.0
    cameras = settings.GetCameraRel().GetForwardedTargets()
    return Settings(
        path=str(path),
        resolution=_resolution(settings, reading),
        camera=str(cameras[0]) if cameras else None,
        pixel_aspect_ratio=ratio,
        conform_policy=_conform_policy(settings, reading),
        data_window=_data_window(settings, reading),
        purposes=_purposes(settings, reading),
        disable_depth_of_field=bool(reading.get(settings.GetDisableDepthOfFieldAttr(), False)),
        material_purposes=tuple(map(str, reading.get(settings.GetMaterialBindingPurposesAttr(), ("full", "")))),
    )


def _conform_policy(settings: Any, reading: Reading) -> str:
    policy = str(reading.get(settings.GetAspectRatioConformPolicyAttr(), "expandAperture"))
    if policy not in CONFORM_POLICIES:
        reading.warn(settings.GetPath(), f"there is no aspectRatioConformPolicy {policy}; expandAperture is used")
        return "expandAperture"
    return policy


def _data_window(settings: Any, reading: Reading) -> tuple[float, float, float, float]:
    window = reading.get(settings.GetDataWindowNDCAttr(), WHOLE)
    x0, y0, x1, y1 = window
    if not (x0 < x1 and y0 < y1 and max(map(abs, window)) <= MAX_OVERSCAN):
        reading.warn(settings.GetPath(), f"dataWindowNDC {tuple(window)} is no window; the whole picture is rendered")
        return WHOLE
    return x0, y0, x1, y1


def _purposes(settings: Any, reading: Reading) -> tuple[str, ...] | None:
    attribute = settings.GetIncludedPurposesAttr()
    if not attribute.HasAuthoredValue():
        return None
    names = tuple(map(str, reading.get(attribute, ())))
    for name in names:
        if name not in PURPOSES:
            reading.warn(settings.GetPath(), f"there is no purpose {name} to include")
    return tuple(name for name in names if name in PURPOSES)


def _resolution(settings: Any, reading: Reading) -> tuple[int, int] | None:
    attribute = settings.GetResolutionAttr()
    if not attribute.HasAuthoredValue():
        return None
    value = reading.get(attribute)
    if value is None:
        return None
    width, height = value
    if width < 1 or height < 1:
        reading.warn(settings.GetPath(), f"resolution {width} x {height} must be at least 1 x 1; it is not used")
        return None
    return int(width), int(height)
