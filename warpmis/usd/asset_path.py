"""Files that a stage names: by the layer that holds the path, whatever stronger layers say of the attribute."""

from __future__ import annotations

from typing import Any, NamedTuple

from pxr import Ar, Sdf, UsdShade

from warpmis.usd.reading import Reading


class AssetFiles(NamedTuple):
    """The path as authored, and the files that it leads to: one, numbered 0, or UDIM tiles by number; none without."""

    path: str
    files: dict[int, str]

    @property
    def file(self) -> str:
        """Of a path without tiles; "" where there is no file."""
        return self.files.get(0, "")

    @property
    def is_udim(self) -> bool:
        return bool(UsdShade.UdimUtils.IsUdimIdentifier(self.path))


def read_asset(attribute: Any, reading: Reading) -> AssetFiles | None:
    """The files of an asset attribute, without a path where it names none; None, with a warning, for a wrong type.

    Where there is no file, backslashes count as slashes: so do paths that were authored on Windows.
    """
    if reading.value(attribute) is None:
        return AssetFiles("", {})
    asset = reading.get(attribute, like=Sdf.AssetPath())
    if asset is None:
        return None
    if not asset.path:
        return AssetFiles("", {})
    for path in dict.fromkeys((asset.path, asset.path.replace("\\", "/"))):
        files = _files(path, asset.resolvedPath if path == asset.path else "", attribute, reading)
        if files:
            return AssetFiles(asset.path, files)
    return AssetFiles(asset.path, {})


def _files(path: str, resolved: str, attribute: Any, reading: Reading) -> dict[int, str]:
    if UsdShade.UdimUtils.IsUdimIdentifier(path):
        found = UsdShade.UdimUtils.ResolveUdimTilePaths(path, _layer_of_value(attribute, reading))
        return {int(number): str(file) for file, number in found}
    if not resolved:
        layer = _layer_of_value(attribute, reading)
        anchored = Sdf.ComputeAssetPathRelativeToLayer(layer, path) if layer else path
        resolved = Ar.GetResolver().Resolve(anchored).GetPathString()
    return {0: resolved} if resolved else {}


def _layer_of_value(attribute: Any, reading: Reading) -> Any:
    """The layer whose opinion the value is: the strongest that has a default or samples, not only metadata."""
    for spec in attribute.GetPropertyStack(reading.time):
        if spec.HasInfo("default") or spec.HasInfo("timeSamples"):
            return spec.layer
    return None
