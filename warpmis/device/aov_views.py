"""The struct through which kernels keep light apart by the path that it took."""

import warp as wp

# What a path can be beside its light: seen at once, then three first lobes of one scattering, then of several.
EMISSION = wp.constant(0)
DIRECT = wp.constant(1)
INDIRECT = wp.constant(4)
DIFFUSE = wp.constant(0)
SPECULAR = wp.constant(1)
TRANSMISSION = wp.constant(2)
CLASSES = wp.constant(7)


@wp.struct
class AovView:
    """Sums of light apart, of all paths that no asked picture tells apart together.

    rows: for each light group, CLASSES numbers: which of the `row_count` sums that light goes into, -1 for none.
    groups: of each light, then of each delta light, its group; group_count: how many there are.
    sample: of each pixel, row_count sums of the present sample. on_ray: of each pixel and group two, of what the
    present ray meets: all emission, and the part of it that the last vertex scatters diffusely.
    """

    rows: wp.array(dtype=int)
    row_count: int
    groups: wp.array(dtype=int)
    group_count: int
    sample: wp.array(dtype=wp.vec3)
    on_ray: wp.array(dtype=wp.vec3)
