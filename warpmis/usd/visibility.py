"""Which prims are rendered: visibility, purposes, and the visibility of a purpose (UsdGeomVisibilityAPI)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pxr import UsdGeom

from warpmis.usd.reading import Reading

# The attribute that shows or hides what has a purpose. What is of purpose "default" has none.
PURPOSE_VISIBILITY = {"render": "renderVisibility", "proxy": "proxyVisibility", "guide": "guideVisibility"}


@dataclass(frozen=True)
class Shown:
    """What a prim says of itself and of what is below it.

    Attributes:
        purpose: "default", "render", "proxy" or "guide".
        is_inherited: whether what is below has the same purpose where it authors none.
        hidden: of a purpose, whether prims of it are hidden. A purpose of which no prim above speaks is not in it.
    """

    purpose: str = "default"
    is_inherited: bool = False
    hidden: Mapping[str, bool] = field(default_factory=dict)

    def is_rendered(self, reading: Reading) -> bool:
        return self.purpose in reading.purposes and not self.hidden.get(self.purpose, False)


def shown_below(prim: Any, above: Shown, reading: Reading) -> Shown | None:
    """What holds for a prim below another; None for one that is invisible with everything below it.

    By UsdGeomImageable: a purpose is authored or inherited from an authored one. By UsdGeomVisibilityAPI: of a
    purpose's visibility the nearest opinion counts, so that "visible" overrides "invisible" above; guides are hidden
    where the schema is applied and says nowhere that they are visible. Where it is applied nowhere, the purposes of
    the render say which guides are seen.
    """
    imageable = UsdGeom.Imageable(prim)
    if not imageable:
        return above
    if reading.get(imageable.GetVisibilityAttr()) == UsdGeom.Tokens.invisible:
        return None
    found = above
    purpose = imageable.GetPurposeAttr()
    own = reading.get(purpose) if purpose.HasAuthoredValue() else None
    if own is not None:
        found = replace(found, purpose=str(own), is_inherited=True)
    elif not above.is_inherited:
        found = replace(found, purpose="default")
    if prim.HasAPI(UsdGeom.VisibilityAPI):
        found = replace(found, hidden={"guide": True, **found.hidden, **_own_opinions(prim, reading)})
    return found


def _own_opinions(prim: Any, reading: Reading) -> dict[str, bool]:
    """Of each purpose that the prim speaks of: whether it hides it."""
    said = {purpose: str(reading.get(prim.GetAttribute(name))) for purpose, name in PURPOSE_VISIBILITY.items()}
    return {purpose: value == "invisible" for purpose, value in said.items() if value in ("visible", "invisible")}
