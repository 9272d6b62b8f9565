"""What the spatial cache learns from: a record for each vertex of some pixels' paths.

While a path lasts, its records hold what it had gathered before each vertex; when it ends, what came by way of each is
the difference. Kernels that do not record have functions of the same names, which do nothing.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.cache_views import VertexRecord
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.kernels.shading_frame import luminance
from warpmis.kernels.warps import INV_PI

wp.set_module_options({"enable_backward": False})

NO_RECORD = wp.constant(-1)


def make_vertex_records(PathState: type, count: int) -> SimpleNamespace:
    """Functions: begin_path; vertex, direction: at a vertex, before and after its densities are known; end. count:
    of the strategies whose mixture draws directions."""
    vec_s = wp.types.vector(length=count, dtype=wp.float32)

    @wp.func
    def begin_path(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey):
        path.estimate.first_record = NO_RECORD
        if scene.cache[0].records.shape[0] > 0:
            x = int(key.pixel) % scene.cache[0].width
            y = int(key.pixel) / scene.cache[0].width
            stride = scene.cache[0].record_stride
            if x % stride == 0 and y % stride == 0:
                cell = y / stride * ((scene.cache[0].width + stride - 1) / stride) + x / stride
                index = cell * scene.cache[0].samples + int(key.sample) - scene.cache[0].first_sample
                path.estimate.first_record = index * scene.cache[0].vertices

    @wp.func
    def cost_so_far(path: wp.ref[PathState]) -> float:
        return float(path.rays) + SHADOW_RAY_COST * float(path.shadow_rays)

    @wp.func
    def vertex(scene: SceneView, path: wp.ref[PathState], n: wp.vec3, light: float):
        """The vertex with its direction; light: squared luminance of what its light sample brought."""
        path.estimate.is_recorded = (
            path.estimate.first_record != NO_RECORD and path.estimate.recorded < scene.cache[0].vertices
        )
        if path.estimate.is_recorded:
            record = VertexRecord()
            record.used = 1
            record.x = path.origin
            record.n = n
            record.u = path.estimate.place[0]
            record.v = path.estimate.place[1]
            record.light = light
            record.cost = cost_so_far(path)
            scene.cache[0].records[path.estimate.first_record + path.estimate.recorded] = record
            path.estimate.recorded += 1

    @wp.func
    def direction(
        scene: SceneView, path: wp.ref[PathState], cos_theta: float, response: float, densities: vec_s, pdf: float
    ):
        """That the direction scatters light; before the roulette.

        response: luminance of f cos; densities: of each strategy, pdf: of their mixture [1/sr].
        """
        if path.estimate.is_recorded:
            at = path.estimate.first_record + path.estimate.recorded - 1
            record = scene.cache[0].records[at]
            record.jacobian = cos_theta * INV_PI / pdf
            record.tail = response / pdf
            record.throughput = luminance(path.beta)
            record.radiance = luminance(path.L)
            scene.cache[0].records[at] = record
            for s in range(wp.static(count)):
                scene.cache[0].ratios[at * wp.static(count) + s] = densities[s] / pdf

    @wp.func
    def end(scene: SceneView, path: wp.ref[PathState]):
        """What came by way of each vertex."""
        for i in range(path.estimate.recorded):
            at = path.estimate.first_record + i
            record = scene.cache[0].records[at]
            if record.throughput > 0.0:
                radiance = wp.max(luminance(path.L) - record.radiance, 0.0) / record.throughput
                tail = record.tail * radiance
                record.radiance = radiance
                record.tail = tail * tail
            record.cost = cost_so_far(path) - record.cost
            scene.cache[0].records[at] = record

    @wp.func
    def emission(path: wp.ref[PathState], radiance: wp.vec3):
        pass

    return SimpleNamespace(begin_path=begin_path, vertex=vertex, direction=direction, end=end, emission=emission)
