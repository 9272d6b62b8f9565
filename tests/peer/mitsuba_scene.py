"""A warpmis Scene as a Mitsuba 3 scene: an independent renderer to hold ours against.

Only what both renderers define alike is converted; anything else raises NoCounterpartError, so that a comparison
never measures a difference of models. With `approximate` materials may be those that come nearest, which is for
comparing costs, not pictures. The correspondences:

- Materials: mitsuba_material.py.
- Light: its shape with an `area` emitter and the `null` BSDF. UsdLux lights do not occlude: a ray collects what they
  emit and goes on. Mitsuba's `path` lets a ray through `null` with weight one and counts what it finds next in full,
  while a shadow ray that meets such a shape is lost: together that is unbiased. A passage counts as a bounce,
  though, so behind a light Mitsuba's paths are shorter than ours (by one for a rectangle, by two for a sphere).
- Depth: `max_depth` counts the bounces after the camera ray's hit, as warpmis does; Mitsuba counts one more. Russian
  roulette is the same where both begin after as many bounces: the largest component of the throughput, at most 0.95.

It builds for the variant of Mitsuba that is set when it is called, and sets scalar_rgb when it is imported.
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from peer.mitsuba_material import NoCounterpartError, bsdf, color, near_bsdf, painting

from warpmis.scene import (
    Camera,
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Geometry,
    Light,
    RectLight,
    Scene,
    SphereLight,
)
from warpmis.scene.texture import TextureLookup

mi.set_variant("scalar_rgb")

ORTHOGONAL = 1e-5  # how far from a right angle, or from a circle, a light's frame may be, relative to its size


def to_mitsuba(
    scene: Scene,
    *,
    spp: int,
    max_depth: int,
    width: int,
    height: int,
    seed: int = 0,
    roulette_depth: int | None = None,
    sampler: str = "independent",
    approximate: bool = False,
) -> Any:
    """The scene with a `path` integrator and a box filter.

    Args:
        roulette_depth: the bounce from which on there is Russian roulette; None for none within max_depth.
        approximate: takes the nearest material where there is no equal one, instead of refusing the scene.
    """
    if scene.prototypes:
        raise NoCounterpartError(scene.name, "instances that are not flattened")
    rr_depth = max_depth + 2 if roulette_depth is None else roulette_depth
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth + 1, "rr_depth": rr_depth},
        "sensor": sensor(scene.camera, sampler=sampler, spp=spp, width=width, height=height, seed=seed),
    }
    for material in np.unique(scene.geometry.materials):
        for smooth in (False, True):
            mesh = surface(scene, int(material), smooth=smooth, approximate=approximate)
            if mesh is not None:
                content[f"surface_{material}_{'smooth' if smooth else 'flat'}"] = mesh
    for i, item in enumerate(scene.lights):
        content[f"light_{i}"] = light(item)
    return mi.load_dict(content)


def reference_image(
    scene: Scene, *, spp: int, max_depth: int, width: int, height: int, seed: int = 0
) -> NDArray[np.float64]:
    """Mitsuba's picture of the scene, shape (height, width, 3), linear Rec.709, row 0 on top."""
    built = to_mitsuba(scene, spp=spp, max_depth=max_depth, width=width, height=height, seed=seed)
    return np.array(mi.render(built), dtype=np.float64)[..., :3]


def sensor(camera: Camera, *, sampler: str, spp: int, width: int, height: int, seed: int) -> dict[str, Any]:
    """A `perspective` sensor with exactly the camera's window.

    Mitsuba's camera looks along its +Z with +X to the left; the principal point is where the optical axis meets the
    film, as an offset from the centre in film sizes.
    """
    if camera.orthographic or camera.lens_radius > 0.0 or camera.exposure != 1.0:
        raise NoCounterpartError(camera.path, "not a pinhole camera without exposure")
    left, right, bottom, top = camera.window
    aspect = (right - left) / (top - bottom)
    if abs(aspect * height / width - 1.0) > 1e-3:
        raise NoCounterpartError(camera.path, f"the window's aspect {aspect:.4f} is not that of {width} x {height}")
    to_world = np.eye(4)
    to_world[:3, 0], to_world[:3, 1], to_world[:3, 2] = -camera.right_axis, camera.up_axis, camera.forward
    to_world[:3, 3] = camera.position
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f(to_world.tolist()),
        "fov_axis": "x",
        "fov": float(np.degrees(2.0 * np.arctan(0.5 * (right - left)))),
        "principal_point_offset_x": 0.5 * (left + right) / (right - left),
        "principal_point_offset_y": -0.5 * (bottom + top) / (top - bottom),
        "near_clip": 1e-4,
        "far_clip": 1e6,
        "sampler": {"type": sampler, "sample_count": spp, "seed": seed},
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
    }


def surface(scene: Scene, material: int, *, smooth: bool, approximate: bool) -> Any | None:
    """All triangles of a material, those with shading normals or those without, as one mesh; None if there are none."""
    geometry = scene.geometry
    has_normals = geometry.normal_indices[:, 0] >= 0
    chosen = np.flatnonzero((geometry.materials == material) & (has_normals == smooth))
    if chosen.size == 0:
        return None
    look = scene.materials[material]
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(near_bsdf(look) if approximate else bsdf(look))
    if max(look.mean_emission) > 0.0:
        shining = {scene.prims[i].path for i in np.unique(geometry.prims[chosen]) if scene.prims[i].double_sided}
        if shining:
            raise NoCounterpartError(min(shining), "a mesh that shines on both sides")
        props["mesh_emitter"] = mi.load_dict(area_emitter(look.mean_emission))
    return triangle_mesh(geometry, chosen, props, smooth=smooth, painted=painting(look))


def triangle_mesh(
    geometry: Geometry, chosen: NDArray[Any], props: Any, *, smooth: bool, painted: TextureLookup | None
) -> Any:
    """The chosen triangles, no vertex shared: that keeps a normal, and coordinates, per corner."""
    mesh = mi.Mesh(
        "surface",
        3 * chosen.size,
        chosen.size,
        has_vertex_normals=smooth,
        has_vertex_texcoords=painted is not None,
        props=props,
    )
    params = mi.traverse(mesh)
    params["vertex_positions"] = geometry.points[geometry.triangles[chosen]].ravel()
    params["faces"] = np.arange(3 * chosen.size, dtype=np.uint32)
    if smooth:
        params["vertex_normals"] = geometry.normals[geometry.normal_indices[chosen]].ravel()
    if painted is not None:
        params["vertex_texcoords"] = picture_coordinates(geometry, chosen, painted).ravel()
    params.update()
    return mesh


def picture_coordinates(geometry: Geometry, chosen: NDArray[Any], painted: TextureLookup) -> NDArray[np.float32]:
    """Where the corners of triangles lie in the picture, from its upper left corner, shape (triangles, 3, 2)."""
    s_t = geometry.primvars[chosen, :, painted.column : painted.column + 2]
    homogeneous = np.concatenate([s_t, np.ones_like(s_t[..., :1])], axis=-1)
    found = homogeneous @ np.array(painted.transform, np.float32).T
    found[..., 1] = 1.0 - found[..., 1]
    return found


def light(item: Light) -> dict[str, Any]:
    """The light as a Mitsuba emitter, or as a shape that emits and lets every ray pass."""
    if item.control.asks:
        raise NoCounterpartError(item.path, "a light that is shaped, filtered or linked")
    if isinstance(item, DomeLight):
        return dome(item)
    if isinstance(item, DistantLight):
        if item.half_angle > 0.0:
            raise NoCounterpartError(item.path, "a distant light with an extent")
        towards = [float(-x) for x in item.direction]
        return {"type": "directional", "direction": towards, "irradiance": color(item.radiance)}
    if isinstance(item, SphereLight) and item.radius == 0.0:
        return {"type": "point", "position": item.center.tolist(), "intensity": color(item.radiance)}
    return {**light_shape(item), "emitter": area_emitter(item.radiance), "bsdf": {"type": "null"}}


def light_shape(item: RectLight | DiskLight | SphereLight | CylinderLight) -> dict[str, Any]:
    """The shape of an area light, its normal on the side that shines."""
    if isinstance(item, SphereLight):
        return {"type": "sphere", "center": item.center.tolist(), "radius": item.radius}
    if isinstance(item, CylinderLight):
        ends = {"p0": (item.center - item.half_axis).tolist(), "p1": (item.center + item.half_axis).tolist()}
        return {"type": "cylinder", "radius": item.radius, **ends}
    u, v = item.half_u, item.half_v
    size_u, size_v = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    if abs(float(u @ v)) > ORTHOGONAL * size_u * size_v:
        raise NoCounterpartError(item.path, "a sheared light")
    if isinstance(item, DiskLight) and abs(size_u - size_v) > ORTHOGONAL * size_u:
        raise NoCounterpartError(item.path, "an elliptic light")
    to_world = np.eye(4)  # Mitsuba's shapes shine along +Z = X x Y, ours along v x u
    normal = np.cross(v, u)
    to_world[:3, 0], to_world[:3, 1], to_world[:3, 2] = v, u, normal / np.linalg.norm(normal)
    to_world[:3, 3] = item.center
    kind = "disk" if isinstance(item, DiskLight) else "rectangle"
    return {"type": kind, "to_world": mi.ScalarTransform4f(to_world.tolist())}


def dome(item: DomeLight) -> dict[str, Any]:
    """A constant or lat-long environment; Mitsuba's picture lies in its frame as ours does: u = 0 along -Z."""
    if item.picture is None:
        return {"type": "constant", "radiance": color(item.radiance)}
    to_world = np.eye(4)
    to_world[:3, :3] = item.to_world
    picture = np.ascontiguousarray(item.picture * np.asarray(item.radiance), dtype=np.float32)
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(picture),
        "to_world": mi.ScalarTransform4f(to_world.tolist()),
    }


def area_emitter(radiance: Any) -> dict[str, Any]:
    """One-sided emission, the same in all directions."""
    return {"type": "area", "radiance": color(radiance)}
