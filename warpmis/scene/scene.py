"""The scene between USD and the renderer: plain frozen NumPy data in world space, no pxr and no Warp.

World space is the stage's own: its up axis and its unit of length are kept, so nothing here depends on
metersPerUnit or upAxis. Colours are linear Rec.709; radiance is in nits as UsdLux defines it, so that a light of
intensity 1 seen by the camera is a pixel of 1.

Instances are flattened, but for those whose copies would take much memory: these stand as prototypes with a transform
for each place.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.camera import Camera
from warpmis.scene.geometry import Geometry, Prototype
from warpmis.scene.light import Light
from warpmis.scene.light_control import PLAIN, LightControl
from warpmis.scene.material import Material


@dataclass(frozen=True)
class Prim:
    """A gprim as rendered: its path (instances: the instance proxy's path) and its sidedness.

    Surfaces are laminae: both sides reflect. `double_sided` decides whether an emissive surface shines on both
    sides or from its front alone. `control` is what a light prim made of geometry asks for; `is_light`: whether the
    prim is one.
    """

    path: str
    double_sided: bool = False
    control: LightControl = PLAIN
    is_light: bool = False


@dataclass(frozen=True, eq=False)
class Scene:
    """A stage at one time, as NumPy arrays: everything that the renderer needs.

    Emissive surfaces are ordinary triangles whose material has an emissive_color: the renderer finds them itself.

    Attributes:
        name: the stage's file name or identifier.
        resolution: (width, height) [pixel].
        geometry: the triangles in world space.
        prototypes: triangles that have several places, traced through the transforms of these.
        origin: of all positions here, in the stage's world space: 0 but for scenes far from it [scene units], shape
            (3,) float64.
        time: of the stage [time code].
        next_frame: the scene one time code later, for motion vectors; None where nobody asks for them.
        warnings: what in the stage is not supported, one line each, with the prim path.
        notes: what was supplied because the stage has none (camera, light), one line each.
    """

    name: str
    camera: Camera
    resolution: tuple[int, int]
    geometry: Geometry
    materials: tuple[Material, ...]
    prims: tuple[Prim, ...]
    lights: tuple[Light, ...]
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    time: float = 0.0
    warnings: tuple[str, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    prototypes: tuple[Prototype, ...] = ()
    next_frame: Scene | None = None

    @property
    def parts(self) -> tuple[Geometry, ...]:
        """The triangles in world space, and those of each prototype."""
        return (self.geometry, *(prototype.geometry for prototype in self.prototypes))

    @property
    def used_materials(self) -> NDArray[np.int32]:
        """The indices of the materials that triangles have, ascending."""
        return np.unique(np.concatenate([np.unique(part.materials) for part in self.parts]))

    @property
    def instance_count(self) -> int:
        """How many places the prototypes have."""
        return sum(len(prototype.prims) for prototype in self.prototypes)

    @property
    def triangle_count(self) -> int:
        """Triangles to be seen, those of a prototype in each of its places."""
        copied = sum(len(one.prims) * len(one.geometry.triangles) for one in self.prototypes)
        return len(self.geometry.triangles) + copied
