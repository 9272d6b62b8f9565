"""What a path carries from vertex to vertex."""

import warp as wp

from warpmis.device.views import MaterialView
from warpmis.kernels.bsdf.surface import Surface
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.shading_frame import Frame

wp.set_module_options({"enable_backward": False})


@wp.struct
class FirstHit:
    """The camera's view of the first surface that does not let the ray pass: the auxiliary pictures' values.

    is_surface: 1, or 0 where there is none; then all else is 0, except alpha, which is also 1 for a light in view.
    """

    is_surface: int
    alpha: float
    albedo: wp.vec3
    normal: wp.vec3
    distance: float


@wp.func
def first_hit_of(material: MaterialView, frame: Frame, distance: float) -> FirstHit:
    first = FirstHit()
    first.is_surface = 1
    first.alpha = 1.0
    first.albedo = material.diffuse + material.specular_f0
    first.normal = frame.n
    first.distance = distance
    return first


@wp.struct
class Vertex:
    """A point where a path scatters.

    ng: geometric normal on the side from which the path comes; frame: of the shading normal; surface: the BSDF for the
    direction from which the path comes; u_light, u_bsdf, u_delta: random numbers in [0, 1) for a light sample, for a
    direction from the BSDF, and for the choice of a delta light; u_cache: for the choice between BSDF and guide, the
    shadow ray and the roulette.
    """

    ng: wp.vec3
    frame: Frame
    surface: Surface
    u_light: wp.vec4
    u_bsdf: wp.vec4
    u_delta: float
    u_cache: wp.vec3


def make_state(Estimate: type, Record: type, Scattering: type) -> type:
    """The type PathState. Estimate, Record: what the estimator and learning keep of a path; empty structs for
    next-event estimation. Scattering: of its first vertex, where light is kept apart, else an empty struct."""

    @wp.struct
    class PathState:
        """A path as far as it has been traced.

        L: radiance found so far; beta: throughput, the product of f cos / pdf of its vertices.
        origin, wi: the present ray; travelled: distance from the last vertex to `origin`, above 0 where the ray has
        gone straight through a surface.
        receiver: the last vertex, as its lights know it; pdf: the density of wi there, against which light samples are
        weighed [1/sr].
        weighs_emission: a light sample of the last vertex could have found what the ray meets, so the emission that it
        meets has a weight below 1. Not so after the camera or a mirror.
        bounces: vertices so far, mirrors among them; has_scattered: whether one of them was neither that nor an
        interface; is_first: whether the present one is the first of these.
        u_choice: the number for choices at that first vertex, u_remapped: the same after the
        estimator's own choice.
        """

        L: wp.vec3
        beta: wp.vec3
        origin: wp.vec3
        wi: wp.vec3
        travelled: float
        receiver: Receiver
        pdf: float
        weighs_emission: bool
        bounces: int
        has_scattered: bool
        is_first: bool
        u_choice: float
        u_remapped: float
        rays: int
        shadow_rays: int
        first_hit: FirstHit
        estimate: Estimate
        record: Record
        first_scattering: Scattering

    return PathState
