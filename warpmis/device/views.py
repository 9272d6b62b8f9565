"""The structs through which kernels see the scene. Host code fills them (upload.py); kernels only read them."""

import warp as wp

from warpmis.device.aov_views import AovView
from warpmis.device.cache_views import CacheView
from warpmis.device.instance_views import EmitterPlaceView, InstanceView
from warpmis.device.texel_views import TileView

# Kinds of light. Each is a branch of the kernels that a scene without that kind does not compile.
RECT = 0
DISK = 1
SPHERE = 2
CYLINDER = 3
DISTANT = 4
DOME = 5
MESH = 6

# In place of a light's index.
NO_LIGHT = -1

# Kinds of delta light: no direction sampler can hit them, so they have a list of their own.
DELTA_POINT = 0
DELTA_DISTANT = 1

# The inputs of a material that a lookup can give.
DIFFUSE = 0
EMISSIVE = 1
SPECULAR = 2
METALLIC = 3
ROUGHNESS = 4
COAT = 5
COAT_ROUGHNESS = 6
OPACITY = 7
NORMAL = 8

# In place of rows: of TriangleView.normals, MaterialView.inputs and LookupView.tile.
FLAT = -1
CONSTANT = -1
NO_TILE = -1

# What LookupView.channel means beside 0 to 3 for red, green, blue and alpha.
RGB = -1


@wp.struct
class TriangleView:
    """What a hit needs beside the position: one record a triangle.

    n: unit normal of its front, 0 where it has none; normals: rows of SceneView.normals, or -1 for a flat triangle;
    emitter: the row of SceneView.emitter_triangles that the triangle is, where it emits, or -1.
    """

    n: wp.vec3
    normals: wp.vec3i
    material: int
    emitter: int


@wp.struct
class MaterialView:
    """A material with its workflow resolved: what the lobes need, no more.

    specular_f0: reflectance at normal incidence, of a lobe that is there where has_specular. alpha: roughness squared.
    normal: of a normal map, along the directions in which s and t grow and the shading normal; 0 where there is none.
    opacity_is_presence: opacity cuts all lobes; if not, the specular lobes reflect first, and opacity cuts the rest.
    transmission: the share of the surface that is a dielectric interface; ior: of what is behind its front, relative to
    what is before it; tint: of light at each passage; absorption: of light within [1/scene unit]; thin_walled: the same
    medium is on both sides.
    inputs: row of VaryingView.inputs, or CONSTANT where no input varies over the surface. Where some do, the fields
    here are those of the inputs' means.
    """

    diffuse: wp.vec3
    specular_f0: wp.vec3
    emission: wp.vec3
    normal: wp.vec3
    has_specular: bool
    alpha: float
    coat: float
    coat_f0: float
    coat_alpha: float
    opacity: float
    opacity_is_presence: bool
    transmission: float
    ior: float
    tint: wp.vec3
    absorption: wp.vec3
    thin_walled: bool
    double_sided: bool
    inputs: int


@wp.struct
class InputsView:
    """UsdPreviewSurface's inputs before its workflow is resolved: a constant each. Those that vary over the surface are
    given by `lookup_count` rows of VaryingView.lookups from `first_lookup` on; normal_lookup: such a row, of a
    material with a normal map."""

    diffuse: wp.vec3
    emissive: wp.vec3
    specular: wp.vec3
    normal: wp.vec3
    metallic: float
    roughness: float
    coat: float
    coat_roughness: float
    opacity: float
    opacity_threshold: float
    use_specular_workflow: bool
    first_lookup: int
    lookup_count: int
    normal_lookup: int


@wp.struct
class LookupView:
    """One lookup of one input.

    input: DIFFUSE to NORMAL. column: of VaryingView.primvars, where its texture coordinates begin or, with NO_TILE, the
    value itself. row_s, row_t: the map of (s, t, 1) to the coordinates that are looked up. tile: the first of its rows
    in VaryingView.tiles, udim_rows * 10 of them, or one where udim_rows is 0. reuses_footprint: it looks at the same
    place as the row before, in a picture of the same size. scale, bias, fallback: of red, green and blue or, thrice, of
    the one channel.
    """

    input: int
    reuses_footprint: bool
    column: int
    tile: int
    udim_rows: int
    row_s: wp.vec3
    row_t: wp.vec3
    wrap_s: int
    wrap_t: int
    channel: int
    scale: wp.vec3
    bias: wp.vec3
    fallback: wp.vec3


@wp.struct
class VaryingView:
    """What varies over surfaces. primvars: per triangle and corner what its material's lookups read, NaN where the
    instance has it: its row, from first_place on, holds it for all corners; texels: bits, see TileView; byte_values:
    linear values of the bytes, plain in the first 256, of sRGB in the second."""

    inputs: wp.array(dtype=InputsView)
    lookups: wp.array(dtype=LookupView)
    tiles: wp.array(dtype=TileView)
    texels: wp.array(dtype=wp.uint32)
    byte_values: wp.array(dtype=float)
    primvars: wp.array3d(dtype=float)
    first_place: int


@wp.struct
class LightView:
    """One light that a direction can hit. The vectors mean what the kind says:

    rect: center, u and v half edges, n the emitting normal, dual_u and dual_v in their plane with dual_u . u = 1 and
    dual_u . v = 0, the other likewise, lengths those of u and v; disk: the same with half axes; sphere: center, radius;
    cylinder: center, u half axis, radius; distant: n towards the light, one_minus_cos of its half angle; dome: nothing
    (DomeView has it); mesh: first and count into SceneView.emitter_*. All but distant and dome: bound is the radius of
    a sphere about center that holds the light. luminance is relative to the brightest light's.
    """

    kind: int
    center: wp.vec3
    u: wp.vec3
    v: wp.vec3
    dual_u: wp.vec3
    dual_v: wp.vec3
    lengths: wp.vec2
    n: wp.vec3
    radiance: wp.vec3
    luminance: float
    radius: float
    bound: float
    area: float
    one_minus_cos: float
    first: int
    count: int
    two_sided: bool
    samples_solid_angle: bool


@wp.struct
class ControlView:
    """A light's controls; an array is empty where the stage does not set that control.

    to_light turns directions into the light's frame, where it emits along -Z. The cone fades from cone_start to
    cone_end [radian], the angles to that axis. ies_intensity: a row for each horizontal angle, a column for each
    vertical one. picture: of a rect light, with row 0 at +v and column 0 at +u. tint: what surfaces see of the
    radiance, but not the camera. diffuse, specular: what the lobes see of it. illuminates, shadow_casters: 1 for each
    prim that the light reaches, and for each that casts its shadow.
    """

    to_light: wp.mat33
    cone_start: float
    cone_end: float
    focus: float
    focus_tint: wp.vec3
    picture: wp.array2d(dtype=wp.vec3)
    ies_vertical: wp.array(dtype=float)
    ies_horizontal: wp.array(dtype=float)
    ies_intensity: wp.array2d(dtype=float)
    ies_angle_scale: float
    tint: wp.vec3
    diffuse: float
    specular: float
    illuminates: wp.array(dtype=int)
    shadow_casters: wp.array(dtype=int)


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
    """The environment. marginal, of one row, and conditional are cumulative distributions of the rows and, within each,
    of the columns, each ending with 1, with an index to search them by (environment.py: index_of); density is the
    probability density over the unit square (u, v)."""

    to_world: wp.mat33
    to_dome: wp.mat33
    radiance: wp.vec3
    picture: wp.array2d(dtype=wp.vec3)
    marginal: wp.array2d(dtype=float)
    marginal_index: wp.array2d(dtype=int)
    conditional: wp.array2d(dtype=float)
    conditional_index: wp.array2d(dtype=int)
    density: wp.array2d(dtype=float)
    rows: int
    columns: int


vec8f = wp.types.vector(length=8, dtype=wp.float32)
vec8i = wp.types.vector(length=8, dtype=wp.int32)


@wp.struct
class WideTreeView:
    """Trees over triangles for a CPU, one for each mesh, in common arrays (kernels/wide_tree.py).

    bounds: six rows a node, of its eight boxes: lower x, upper x, lower y, and so on; children: eight entries a node,
    of each box the node, or -1 - leaf; corners: nine rows a leaf, of its eight triangles: x, y, z of the first corner,
    and so on; faces: eight entries a leaf, of each triangle the row among its mesh's. Triangles that fill a leaf up
    repeat its first one.
    """

    bounds: wp.array(dtype=vec8f)
    children: wp.array(dtype=int)
    corners: wp.array(dtype=vec8f)
    faces: wp.array(dtype=int)


@wp.struct
class LightTreeView:
    """The tree by which lights are chosen, in nodes of eight children, with the fields of LightNodes
    (device/light_nodes.py), children and links flat. No node at all where lights are weighed one by one."""

    rows: wp.array(dtype=vec8f)
    child_nodes: wp.array(dtype=int)
    links: wp.array(dtype=int)
    analytic: wp.array(dtype=int)
    paths: wp.array(dtype=wp.uint64)


@wp.struct
class SceneView:
    """The whole scene.

    mesh: on a GPU, the triangles in world space, the first rows of `triangles`; the rows of prototypes follow, with
    points and normals in their own spaces. tree: on a CPU, of the same meshes; root: the node at which that of the
    triangles in world space begins. instance_bvh: over the boxes of `instances`, of which there may be none. lights:
    first those at a distance, finite_light_count of them, then those at infinity; the first analytic_light_count are no
    mesh lights. emitter_triangles: the mesh lights' triangles; emitter_lights: the light of each; emitter_cdf: the
    cumulative share of that light's area. Those of prototypes follow, with a number among the lights of their place:
    emitter_places, whose boxes emitter_place_bvh holds; place_of_instance: the row there of each instance, or -1.
    light_tree: of many lights, over the analytic ones, emitter_triangles and emitter_places (device/place_lights.py);
    light_bvh: on a GPU, over the boxes of the analytic ones; prim_links: per prim the bits of the lights that reach it.
    delta_lights: first the points, delta_point_count of them; delta_tree: over many points, whose weights are shares of
    delta_brightest. controls: one for each of `lights`, then one for each of `delta_lights`, or none; prims: per
    triangle, where there are controls or ids are asked for; faces, copies: the same for ids; varying, cache, aov: one
    record each or none, in an array for the scene is passed by value. albedos: of a GGX lobe (device/albedo.py).
    """

    mesh: wp.uint64
    tree: WideTreeView
    root: int
    instance_bvh: wp.uint64
    instances: wp.array(dtype=InstanceView)
    instance_count: int
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.vec3i)
    normals: wp.array(dtype=wp.vec3)
    triangles: wp.array(dtype=TriangleView)
    materials: wp.array(dtype=MaterialView)
    albedos: wp.array2d(dtype=wp.vec2)
    varying: wp.array(dtype=VaryingView)
    lights: wp.array(dtype=LightView)
    light_count: int
    finite_light_count: int
    analytic_light_count: int
    light_tree: LightTreeView
    light_bvh: wp.uint64
    prim_links: wp.array(dtype=int)
    delta_lights: wp.array(dtype=DeltaLightView)
    delta_light_count: int
    delta_point_count: int
    delta_tree: LightTreeView
    delta_brightest: float
    controls: wp.array(dtype=ControlView)
    prims: wp.array(dtype=int)
    faces: wp.array(dtype=int)
    copies: wp.array(dtype=int)
    emitter_bvh: wp.uint64
    emitter_triangles: wp.array(dtype=int)
    emitter_lights: wp.array(dtype=int)
    emitter_cdf: wp.array(dtype=float)
    emitter_places: wp.array(dtype=EmitterPlaceView)
    emitter_place_bvh: wp.uint64
    place_of_instance: wp.array(dtype=int)
    dome: DomeView
    cache: wp.array(dtype=CacheView)
    aov: wp.array(dtype=AovView)


@wp.struct
class CameraView:
    """The ray through picture point (x, y) leaves `position` along corner + x across + y down; an orthographic
    camera's ray leaves position + corner + x across + y down along `forward`.

    lens_u, lens_v: axes of a thin lens, of its radius' length; planes: (n, d) each, which see a point p where
    n . (p - position) + d >= 0.
    """

    position: wp.vec3
    corner: wp.vec3
    across: wp.vec3
    down: wp.vec3
    forward: wp.vec3
    lens_u: wp.vec3
    lens_v: wp.vec3
    focus_distance: float
    is_orthographic: bool
    planes: wp.array(dtype=wp.vec4)
    width: int
    height: int


# Steps of a lattice's coordinates from one point to the next, in units of 2^-32 (kernels/lattice.py).
vec_lattice = wp.types.vector(length=9, dtype=wp.uint32)


@wp.struct
class RoundView:
    """A round's numbers, or those of a piece of its samples: all that its launches have in common.

    first_sample, end_sample: each pixel takes the samples from the one to before the other; seed, max_depth,
    stratified: settings of the render (RenderConfig).
    lattice_start: the sample at which the first lattice begins; lattice_length: points of each; lattice_steps: of all.
    stride: a thread is for a cell of stride x stride pixels and traces the first of them.
    direct_only: learn from the light that comes straight from the lights.
    """

    first_sample: int
    end_sample: int
    seed: wp.uint32
    max_depth: int
    stratified: bool
    lattice_start: int
    lattice_length: int
    lattice_steps: vec_lattice
    stride: int
    direct_only: bool


@wp.struct
class FilmView:
    """Sums over all samples of each pixel so far. A pixel is written by one thread alone.

    color, albedo, normal: sums of linear RGB and of world normals; luminance: (mean, sum of squared deviations) over
    the accepted samples; depth: sum over the samples that hit a surface, hits: how many these are; alpha: samples that
    hit a surface or a visible light; rejected: samples that were not finite. aovs: row_count sums a pixel.
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
    aovs: wp.array2d(dtype=wp.vec3d)
