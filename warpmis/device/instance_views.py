"""The structs of prototypes' places: where rays meet them, and those that emit (device/views.py has the others)."""

import warp as wp


@wp.struct
class InstanceView:
    """A place of a prototype, whose triangles are the rows of SceneView.triangles from `first_triangle` on.

    mesh, root: as in SceneView; linear, translation: a point p of the mesh is at linear p + translation; inverse: of
    `linear`; prim, copy: in place of SceneView.prims and copies.
    """

    mesh: wp.uint64
    root: int
    first_triangle: int
    prim: int
    copy: int
    linear: wp.mat33
    translation: wp.vec3
    inverse: wp.mat33


@wp.struct
class EmitterPlaceView:
    """A place of a prototype that has emissive triangles.

    instance: row of SceneView.instances; root: the node of SceneView.light_tree at which the tree over the prototype's
    emitters begins, in the prototype's space; first_light: what to add to emitter_lights of these, for the lights of
    this place; bvh: over the boxes of the emitters, in the prototype's space, the first of which is the row
    first_emitter of SceneView.emitter_triangles.
    """

    instance: int
    root: int
    first_light: int
    first_emitter: int
    bvh: wp.uint64
