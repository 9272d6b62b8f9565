"""What a prim authors that would be passed over without a word: a warning for each kind of it, with the remedy."""

from __future__ import annotations

from functools import cache
from typing import Any

from pxr import Kind, Usd, UsdGeom, UsdLux

from warpmis.usd.reading import Reading

# API schemas of lights whose attributes count only where the schema is applied, by the attributes' beginning.
LIGHT_APIS = {"inputs:shaping:": UsdLux.ShapingAPI, "inputs:shadow:": UsdLux.ShadowAPI}

# By a prim's type and the API schemas that are applied to it.
KNOWN_NAMES: dict[tuple[str, ...], frozenset[str]] = {}


def warn_unread(prim: Any, reading: Reading) -> None:
    """Warnings for a prim of the scene: an unknown type, a drawMode, and attributes of lights that do not count."""
    if prim.GetTypeName() and prim.GetPrimTypeInfo().GetSchemaType().isUnknown:
        what = f"its type {prim.GetTypeName()} is not known"
        reading.warn(prim.GetPath(), f"{what}; it is left out, and what is below it is rendered")
    if prim.IsModel():
        _warn_of_draw_mode(prim, reading)
    if prim.HasAPI(UsdLux.LightAPI):
        _warn_of_light_attributes(prim, reading)


def _warn_of_draw_mode(prim: Any, reading: Reading) -> None:
    """Of a model that viewers draw as its box, its axes or cards; by the schema that is up to components and to those
    that ask for it."""
    model = UsdGeom.ModelAPI(prim)
    is_component = Kind.Registry.IsA(Usd.ModelAPI(prim).GetKind(), Kind.Tokens.component)
    if not (is_component or reading.get(model.GetModelApplyDrawModeAttr(), False)):
        return
    mode = str(model.ComputeModelDrawMode())
    if mode in ("origin", "bounds", "cards"):
        reading.warn(prim.GetPath(), f"its drawMode {mode} is not supported; its geometry is rendered")


def _warn_of_light_attributes(prim: Any, reading: Reading) -> None:
    path, authored = prim.GetPath(), sorted(str(name) for name in prim.GetAuthoredPropertyNames())
    known = _known_names(prim)
    old = [name for name in authored if f"inputs:{name}" in known and f"inputs:{name}" not in authored]
    if old:
        reading.warn(path, f"not read: {', '.join(old)}: since USD 21.02 these names begin with inputs:")
    for beginning, schema in LIGHT_APIS.items():
        found = [name for name in authored if name.startswith(beginning)]
        if found and not prim.HasAPI(schema):
            reading.warn(path, f"not read: {', '.join(found)}: {schema.__name__} is not applied; add it to apiSchemas")
    connected = [name for name in authored if name.startswith("inputs:") and _is_connected(prim, name)]
    if connected:
        reading.warn(path, f"not supported: what {', '.join(connected)} of a light is connected to; its value is used")


def _known_names(prim: Any) -> frozenset[str]:
    """The names of all that the prim's schemas define, and of api_attributes."""
    schemas = (str(prim.GetTypeName()), *map(str, prim.GetAppliedSchemas()))
    if schemas not in KNOWN_NAMES:
        names = prim.GetPrimDefinition().GetPropertyNames()
        KNOWN_NAMES[schemas] = frozenset(map(str, names)) | api_attributes()
    return KNOWN_NAMES[schemas]


@cache
def api_attributes() -> frozenset[str]:
    """The names of the attributes of LIGHT_APIS."""
    return frozenset(str(name) for api in LIGHT_APIS.values() for name in api.GetSchemaAttributeNames(False))


def _is_connected(prim: Any, name: str) -> bool:
    return bool(prim.GetAttribute(name).HasAuthoredConnections())
