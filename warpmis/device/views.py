"""The structs through which kernels see the scene. Host code fills them (upload.py); kernels only read them."""

import warp as wp

# Kinds of light. Each is a branch of the kernels that a scene without that kind does not compile.
RECT = 0
DISK = 1
SPHERE = 2
CYLINDER = 3
DISTANT = 4
DOME = 5
MESH = 6

# Kinds of delta light: no direction sampler can hit them, so they have a list of their own.
DELTA_POINT = 0
DELTA_DISTANT = 1


@wp.struct
class TriangleView:
    """What a hit needs beside the position: one record a triangle.

    normals: rows of SceneView.normals, or -1 for a flat triangle; light: index of the mesh light that the triangle
    belongs to, or -1.
    """

    normals: wp.vec3i
    material: int
    light: int


@wp.struct
class MaterialView:
    """A material with its workflow resolved: what the lobes need, no more.

    specular_f0 is the reflectance at normal incidence (0 with `has_specular` 0: no lobe at all); alpha is
    roughness squared.
    """

    diffuse: wp.vec3
    specular_f0: wp.vec3
    emission: wp.vec3
    has_specular: int
    alpha: float
    coat: float
    coat_f0: float
    coat_alpha: float
    opacity: float
    presence: int
    double_sided: int


@wp.struct
class LightView:
    """One light that a direction can hit. The vectors mean what the kind says:

    rect: center, u and v half edges, n the emitting normal; disk: the same with half axes; sphere: center, radius;
    cylinder: center, u half axis, radius; distant: n towards the light, one_minus_cos of its half angle; dome: nothing
    (DomeView has it); mesh: first and count into SceneView.emitter_*. All but distant and dome: bound is the radius of
    a sphere about center that holds the light.
    """

    kind: int
    center: wp.vec3
    u: wp.vec3
    v: wp.vec3
    n: wp.vec3
    radiance: wp.vec3
    luminance: float
    radius: float
    bound: float
    area: float
    one_minus_cos: float
    first: int
    count: int
    two_sided: int
    solid_angle_sampling: int


@wp.struct
class DeltaLightView:
    """A light of one direction or one point: `vector` is the position or the unit direction towards it, `intensity`
    the radiant intensity or the irradiance."""

    kind: int
    vector: wp.vec3
    intensity: wp.vec3
    luminance: float


@wp.struct
class DomeView:
    """The environment. marginal and conditional are cumulative distributions of the rows and, within each, of the
    columns, each ending with 1; density is the probability density over the unit square (u, v)."""

    to_world: wp.mat33
    to_dome: wp.mat33
    radiance: wp.vec3
    picture: wp.array2d(dtype=wp.vec3)
    marginal: wp.array(dtype=float)
    conditional: wp.array2d(dtype=float)
    density: wp.array2d(dtype=float)
    rows: int
    columns: int


@wp.struct
class SceneView:
    """The whole scene.

    lights: first those at a distance, finite_light_count of them, then those at infinity; emitter_cdf: per triangle of
    a mesh light the cumulative share of the light's area.
    """

    mesh: wp.uint64
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.vec3i)
    normals: wp.array(dtype=wp.vec3)
    triangles: wp.array(dtype=TriangleView)
    materials: wp.array(dtype=MaterialView)
    lights: wp.array(dtype=LightView)
    light_count: int
    finite_light_count: int
    delta_lights: wp.array(dtype=DeltaLightView)
    delta_light_count: int
    emitter_bvh: wp.uint64
    emitter_triangles: wp.array(dtype=int)
    emitter_cdf: wp.array(dtype=float)
    dome: DomeView


@wp.struct
class CameraView:
    """The ray through picture point (x, y) leaves `position` along corner + x across + y down."""

    position: wp.vec3
    corner: wp.vec3
    across: wp.vec3
    down: wp.vec3
    forward: wp.vec3
    width: int
    height: int


@wp.struct
class FilmView:
    """Sums over all samples of each pixel so far. A pixel is written by one thread alone.

    color, albedo, normal: sums of linear RGB and of world normals; luminance: (mean, sum of squared deviations) over
    the accepted samples; depth: sum over the samples that hit a surface, hits: how many these are; alpha: samples that
    hit a surface or a visible light; rejected: samples that were not finite.
    """

    color: wp.array(dtype=wp.vec3d)
    luminance: wp.array(dtype=wp.vec2d)
    albedo: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    depth: wp.array(dtype=wp.float64)
    alpha: wp.array(dtype=wp.float64)
    hits: wp.array(dtype=wp.int32)
    accepted: wp.array(dtype=wp.int32)
    rejected: wp.array(dtype=wp.int32)
    rays: wp.array(dtype=wp.int64)
    shadow_rays: wp.array(dtype=wp.int64)
