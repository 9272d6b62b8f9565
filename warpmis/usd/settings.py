"""The stage's RenderSettings: resolution, camera and how the camera's window meets the picture's aspect."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    """What the RenderSettings prim authors, or a RenderProduct over it.

    Attributes:
        path: the prim's, "" for a stage without one.
        resolution: (width, height) [pixel], or None.
        height: the image height that the caller asks for [pixel], or None.
        camera: path of the camera, or None.
        pixel_aspect_ratio: width over height of a pixel.
        conform_policy: UsdRender's aspectRatioConformPolicy.
        data_window: (xmin, ymin, xmax, ymax) of the picture that is rendered, (0, 0) its lower left corner, (1, 1) its
            upper right one.
        purposes: of prims to render, or None.
        disable_depth_of_field: whether every camera is a pinhole.
        disable_motion_blur: whether every camera's shutter is shut at once.
        material_purposes: purposes of material bindings, the first that a prim has counts; "" is for all purposes.
    """

    path: str = ""
    resolution: tuple[int, int] | None = None
    height: int | None = None
    camera: str | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    data_window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    purposes: tuple[str, ...] | None = None
    disable_depth_of_field: bool = False
    disable_motion_blur: bool = False
    material_purposes: tuple[str, ...] = ("full", "")


def read_settings(reading: Reading, path: str | None, product: str | None = None) -> Settings:
    """The settings at `path`, or those that the stage's metadata name, with what the RenderProduct authors over them.

    Raises:
        StageError: `path` or `product` is given, and there is no such prim.
    """
    found = settings_prim(reading.stage, path)
    named = reading.stage.GetMetadata("renderSettingsPrimPath")
    if found is None and named:
        reading.warn(named, "the stage's renderSettingsPrimPath does not name a RenderSettings prim")
    settings = Settings() if found is None else _read(found, reading)
    if product is None:
        return settings
    prim = reading.stage.GetPrimAtPath(product) if product.startswith("/") else None
    if not prim or not prim.IsA(UsdRender.Product):
        raise StageError("there is no RenderProduct prim here", product)
    return _read_base(UsdRender.Product(prim), settings, reading)


def settings_prim(stage: Any, path: str | None) -> Any:
    """The RenderSettings at `path`, else those that the stage's metadata name, else None.

    Raises:
        StageError: `path` is given, and there is no RenderSettings prim.
    """
    if path is None:
        settings = UsdRender.Settings.GetStageRenderSettings(stage)
        return settings if settings else None
    prim = stage.GetPrimAtPath(path) if path.startswith("/") else None
    if not prim or not prim.IsA(UsdRender.Settings):
        raise StageError("there is no RenderSettings prim here", path)
    return UsdRender.Settings(prim)


def _read(settings: Any, reading: Reading) -> Settings:
    base = _read_base(settings, Settings(), reading)
    purposes = tuple(map(str, reading.get(settings.GetMaterialBindingPurposesAttr(), ("full", ""))))
    return replace(base, purposes=_purposes(settings, reading), material_purposes=purposes)


def _read_base(prim: Any, below: Settings, reading: Reading) -> Settings:
    """What RenderSettings and RenderProducts have in common: what the prim authors, else what stands `below` it."""
    cameras = reading.targets(prim.GetCameraRel(), "another camera is used")
    authored: dict[str, Any] = {"path": str(prim.GetPath())}
    if cameras and reading.stage.GetPrimAtPath(cameras[0]):
        authored["camera"] = str(cameras[0])
    readers: dict[str, tuple[Any, Any]] = {
        "resolution": (prim.GetResolutionAttr(), _resolution),
        "pixel_aspect_ratio": (prim.GetPixelAspectRatioAttr(), _pixel_aspect_ratio),
        "conform_policy": (prim.GetAspectRatioConformPolicyAttr(), _conform_policy),
        "data_window": (prim.GetDataWindowNDCAttr(), _data_window),
        "disable_depth_of_field": (prim.GetDisableDepthOfFieldAttr(), _no_depth_of_field),
        "disable_motion_blur": (prim.GetDisableMotionBlurAttr(), _no_motion_blur),
    }
    for name, (attribute, read) in readers.items():
        if attribute.HasAuthoredValue():
            authored[name] = read(prim, reading)
    return replace(below, **authored)


def _no_depth_of_field(prim: Any, reading: Reading) -> bool:
    return bool(reading.get(prim.GetDisableDepthOfFieldAttr(), False))


def _no_motion_blur(prim: Any, reading: Reading) -> bool:
    return bool(reading.get(prim.GetDisableMotionBlurAttr(), False))


def _pixel_aspect_ratio(prim: Any, reading: Reading) -> float:
    ratio = reading.number(prim.GetPrim(), "pixelAspectRatio", 1.0)
    if not 0.0 < ratio < float("inf"):
        reading.warn(prim.GetPath(), f"pixelAspectRatio {ratio:g} must be above 0; 1 is used")
        return 1.0
    return ratio


def _conform_policy(settings: Any, reading: Reading) -> str:
    policy = str(reading.get(settings.GetAspectRatioConformPolicyAttr(), "expandAperture"))
    if policy not in CONFORM_POLICIES:
        reading.warn(settings.GetPath(), f"there is no aspectRatioConformPolicy {policy}; expandAperture is used")
        return "expandAperture"
    return policy


def _data_window(settings: Any, reading: Reading) -> tuple[float, float, float, float]:
    window = reading.get(settings.GetDataWindowNDCAttr(), WHOLE)
    x0, y0, x1, y1 = window
    if not is_window(window):
        reading.warn(
            settings.GetPath(), f"dataWindowNDC {tuple(window)} is not a window; the whole picture is rendered"
        )
        return WHOLE
    return x0, y0, x1, y1


def is_window(corners: Any) -> bool:
    """Whether (xmin, ymin, xmax, ymax) is a data window that may be rendered."""
    x0, y0, x1, y1 = corners
    return bool(x0 < x1 and y0 < y1 and max(map(abs, corners)) <= MAX_OVERSCAN)


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
    value = reading.get(settings.GetResolutionAttr())
    if value is None:
        return None
    width, height = value
    if width < 1 or height < 1:
        reading.warn(settings.GetPath(), f"resolution {width} x {height} must be at least 1 x 1; it is not used")
        return None
    return int(width), int(height)
