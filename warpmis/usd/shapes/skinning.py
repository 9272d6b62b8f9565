"""UsdSkel: characters in their pose at the reading's time, baked into the stage's session layer."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Usd, UsdSkel

from warpmis.usd.reading import PxrError, Reading, one_line
from warpmis.usd.shapes.skinned_vectors import prepare_directions

# What leads from a skinned prim to what poses it, and what becomes of the prim without. Of skel:skeleton pxr warns.
RELATED = {
    "skel:animationSource": "it stays in its rest pose",
    "skel:blendShapeTargets": "it is not used",
}
# What UsdSkel reads and leaves out silently where it is of the wrong type, by schema.
READ = {
    "Skeleton": ("joints", "bindTransforms", "restTransforms"),
    "SkelAnimation": ("joints", "blendShapes"),
    "BlendShape": ("offsets", "normalOffsets", "pointIndices"),
}
READ_OF_BINDINGS = (
    *("primvars:skel:jointIndices", "primvars:skel:jointWeights", "primvars:skel:geomBindTransform"),
    *("primvars:skel:skinningMethod", "skel:joints", "skel:blendShapes"),
)
ANIMATED = ("translations", "rotations", "scales", "blendShapeWeights")


def has_skeletons(stage: Any) -> bool:
    """Whether there is a SkelRoot, under which alone skinning takes place."""
    return any(prim.IsA(UsdSkel.Root) for prim in _prims(stage))


def bake_skinning(reading: Reading) -> None:
    """Writes the skinned points, normals and transforms at the reading's time into the session layer.

    UsdSkel bakes at times that have samples, so each animation gets one at the reading's time, of the value that it
    has there anyway. Instances of skinned prims become prims of their own.
    """
    stage = reading.stage
    _expand_instances(stage)
    time = reading.time
    for prim in _prims(stage):
        if prim.IsA(UsdSkel.Animation):
            for name in ANIMATED:
                attribute = prim.GetAttribute(name)
                _set_sample(attribute, reading)
        bound = READ_OF_BINDINGS if prim.HasAPI(UsdSkel.BindingAPI) else ()
        for name in (*READ.get(str(prim.GetTypeName()), ()), *bound):
            reading.get(prim.GetAttribute(name))
        for name, otherwise in RELATED.items():
            reading.targets(prim.GetRelationship(name), otherwise)
    for prim in [prim for prim in _prims(stage) if prim.IsA(UsdSkel.Root)]:
        try:
            prepare_directions(UsdSkel.Root(prim), reading)
            baked = UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(time.GetValue(), time.GetValue()))
        except PxrError:
            baked = False
        if not baked:
            reading.warn(prim.GetPath(), "its skinning cannot be computed; its meshes are rendered in their bind pose")


def _set_sample(attribute: Any, reading: Reading) -> None:
    """Writes the value that the attribute has at the reading's time as its sample there."""
    value = reading.get(attribute)
    try:
        if value is not None:
            attribute.Set(value, reading.time)
    except PxrError as error:  # of another precision, of which UsdSkel makes nothing either
        reading.warn(attribute.GetPath(), f"left out: {one_line(error)}")


def _prims(stage: Any) -> Any:
    return Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))


def _expand_instances(stage: Any) -> None:
    """Makes what holds anything of a skeleton no instance, since no opinion can be written inside one."""
    while True:
        inside = [prim for prim in _prims(stage) if prim.IsInstanceProxy() and _is_skinned(prim)]
        instances = {_outermost_instance(prim).GetPath() for prim in inside}
        if not instances:
            return
        for path in instances:
            stage.GetPrimAtPath(path).SetInstanceable(False)


def _is_skinned(prim: Any) -> bool:
    return bool(prim.IsA(UsdSkel.Root) or prim.IsA(UsdSkel.Animation) or prim.HasAPI(UsdSkel.BindingAPI))


def _outermost_instance(prim: Any) -> Any:
    while prim.IsInstanceProxy():
        prim = prim.GetParent()
    return prim
