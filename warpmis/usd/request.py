"""What a caller asks of a stage: checked before the stage is opened, and stronger than what the stage authors."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from pxr import Usd

from warpmis.errors import ConfigError, StageError
from warpmis.usd.settings import CONFORM_POLICIES, MAX_OVERSCAN, PURPOSES, Settings, is_window
from warpmis.whole_numbers import checked_integer

# usdrecord's names, and how many times each refines a subdivision surface.
COMPLEXITIES = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}


@dataclass(frozen=True, kw_only=True)
class Request:
    """The keyword arguments of load_stage, which describes them. None leaves a setting to the stage.

    Raises:
        ConfigError: a value is of a wrong type or out of its range.
    """

    camera: str | None = None
    time: float | None = None
    width: int | None = None
    height: int | None = None
    purposes: Sequence[str] | None = None
    render_settings: str | None = None
    product: str | None = None
    complexity: str = "high"
    variants: Sequence[str] = ()
    mask: Sequence[str] = ()
    session_layer: str | os.PathLike[str] | None = None
    disable_depth_of_field: bool | None = None
    disable_motion_blur: bool | None = None
    pixel_aspect_ratio: float | None = None
    aspect_ratio_conform_policy: str | None = None
    data_window_ndc: Sequence[float] | None = None
    material_binding_purposes: Sequence[str] | None = None

    def __post_init__(self) -> None:
        for name in ("camera", "render_settings", "product"):
            _check_text(name, getattr(self, name))
        for name in ("variants", "mask", "purposes", "material_binding_purposes"):
            _check_texts(name, getattr(self, name))
        for name in ("width", "height"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, checked_integer(name, getattr(self, name)))
        if self.time is not None and not _is_finite(self.time):
            raise ConfigError(f"time must be a finite number, a time code such as 12, got {self.time!r}")
        if self.session_layer is not None and not isinstance(self.session_layer, str | os.PathLike):
            raise ConfigError(f"session layer must be a file's path, got {self.session_layer!r}")
        _check_one_of("complexity", self.complexity, COMPLEXITIES)
        for name in self.purposes or ():
            _check_one_of("purpose", name, sorted(PURPOSES))
        self._check_overrides()

    def _check_overrides(self) -> None:
        for name in ("disable_depth_of_field", "disable_motion_blur"):
            if not isinstance(getattr(self, name), bool | None):
                raise ConfigError(f"{_words(name)} must be True, False or None, got {getattr(self, name)!r}")
        ratio = self.pixel_aspect_ratio
        if ratio is not None and not (_is_finite(ratio) and ratio > 0.0):
            raise ConfigError(f"pixel aspect ratio must be a number above 0, got {ratio!r}")
        if self.aspect_ratio_conform_policy is not None:
            _check_one_of("aspect ratio conform policy", self.aspect_ratio_conform_policy, sorted(CONFORM_POLICIES))
        if self.data_window_ndc is not None:
            _check_window(self.data_window_ndc)

    @property
    def levels(self) -> int:
        """How many times subdivision surfaces are refined."""
        return COMPLEXITIES[self.complexity]

    def over(self, settings: Settings) -> Settings:
        """The stage's settings with what was asked for in their place."""
        asked: dict[str, Any] = {
            "height": self.height,
            "disable_depth_of_field": self.disable_depth_of_field,
            "disable_motion_blur": self.disable_motion_blur,
            "pixel_aspect_ratio": self.pixel_aspect_ratio,
            "conform_policy": self.aspect_ratio_conform_policy,
            "data_window": None if self.data_window_ndc is None else tuple(map(float, self.data_window_ndc)),
            "purposes": None if self.purposes is None else tuple(self.purposes),
        }
        if self.material_binding_purposes is not None:
            asked["material_purposes"] = tuple(self.material_binding_purposes)
        return replace(settings, **{name: value for name, value in asked.items() if value is not None})


def checked_source(path_or_stage: Any) -> Any:
    """A file's path as text, or the stage.

    Raises:
        StageError: it is neither.
    """
    if isinstance(path_or_stage, Usd.Stage):
        if path_or_stage.expired:
            raise StageError("the Usd.Stage has expired: keep a reference to it")
        return path_or_stage
    if not isinstance(path_or_stage, str | bytes | os.PathLike):
        kind = type(path_or_stage).__name__
        raise StageError(f"a stage is the path of a USD file, a Usd.Stage or a Scene, not {kind}")
    path = os.fsdecode(path_or_stage)
    if not path:
        raise StageError("the stage's path is empty: name a USD file")
    if os.path.isdir(path):
        raise StageError("it is a folder: name a USD file", path)
    try:
        path.encode()
    except UnicodeEncodeError:
        raise StageError("USD opens only files with UTF-8 names: rename it", ascii(path)) from None
    return path


def _words(name: str) -> str:
    return name.replace("_", " ")


def _is_finite(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)


def _check_window(window: Any) -> None:
    corners = tuple(window) if isinstance(window, Sequence) else ()
    if len(corners) != 4 or not all(map(_is_finite, corners)) or not is_window(corners):
        raise ConfigError(
            f"data window must be four numbers xmin, ymin, xmax, ymax from -{MAX_OVERSCAN:g} to {MAX_OVERSCAN:g}, the "
            f"first two smaller, such as 0,0,0.5,1, got {window!r}"
        )


def _check_text(name: str, value: object) -> None:
    if value is not None and not isinstance(value, str):
        raise ConfigError(f"{_words(name)} must be a prim's path as text, got {value!r}")


def _check_texts(name: str, values: object) -> None:
    if values is None:
        return
    if isinstance(values, str):
        raise ConfigError(f"{_words(name)} must be a list of texts, such as ['{values}'], not one text")
    if not isinstance(values, Collection) or not all(isinstance(value, str) for value in values):
        raise ConfigError(f"{_words(name)} must be a list of texts, got {values!r}")


def _check_one_of(name: str, value: object, known: Iterable[str]) -> None:
    if value not in (names := list(known)):
        raise ConfigError(f"unknown {name} {value!r}; choose from {', '.join(names)}")
