"""Where the mesh's leaf size and the order of its triangles come from:

    python scripts/bench/bvh.py [--triangles N]

Rays per second of incoherent rays through a closed scene of wavy shells, for leaf sizes 1 to 8, with the triangles in
random order and along a Morton curve; each relative to leaf size 1 in random order, medians of interleaved runs.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
import warp as wp

from warpmis.device.order import first_use_order, morton_order

LEAF_SIZES = (1, 2, 4, 8)


@wp.kernel(enable_backward=False)
def random_walks(mesh: wp.uint64, bounces: int, hits: wp.array(dtype=int)):
    """Rays as a diffuse scene makes them: each starts where the last one ended."""
    i = wp.tid()
    state = wp.rand_init(1, i)
    origin = wp.vec3(0.0, 0.0, 0.0)
    direction = wp.sample_unit_sphere_surface(state)
    for _bounce in range(bounces):
        query = wp.mesh_query_ray(mesh, origin, direction, 1.0e30)
        if query.result:
            hits[i] = hits[i] + 1
            origin = origin + direction * (query.t * 0.999)
            direction = wp.sample_unit_sphere_surface(state)


def shells(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Eight small wavy balls within a large one, in random order, shapes (V, 3) and (F, 3)."""
    side = max(4, int(np.sqrt(triangles / 18)))
    theta, phi = np.meshgrid(np.linspace(0.0, np.pi, side + 1), np.linspace(0.0, 2 * np.pi, side + 1), indexing="ij")
    radius = 1.0 + 0.1 * np.sin(9 * theta) * np.sin(7 * phi)
    ball = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    ball = (ball * radius[..., None]).reshape(-1, 3)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quad = np.stack([corner, corner + 1, corner + side + 2, corner, corner + side + 2, corner + side + 1], axis=1)
    centers = 3.0 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = np.concatenate([ball * 9.0, *(ball + center for center in centers)]).astype(np.float32)
    faces = np.concatenate([quad.reshape(-1, 3) + number * len(ball) for number in range(9)]).astype(np.int32)
    return points, np.random.default_rng(0).permutation(faces)


def build(points: np.ndarray, faces: np.ndarray, leaf_size: int, morton: bool) -> wp.Mesh:
    if morton:
        kept, faces = first_use_order(faces[morton_order(points, faces)], len(points))
        points = points[kept]
    indices = wp.array(faces.ravel(), dtype=wp.int32, device="cpu")
    return wp.Mesh(wp.array(points, dtype=wp.vec3, device="cpu"), indices, bvh_leaf_size=leaf_size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--triangles", type=int, default=400_000)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    points, faces = shells(arguments.triangles)
    meshes = {(leaf, morton): build(points, faces, leaf, morton) for morton in (False, True) for leaf in LEAF_SIZES}
    walks, bounces = 20_000, 16
    hits = wp.zeros(walks, dtype=int, device="cpu")

    def cpu_time(mesh: wp.Mesh) -> float:
        start = time.process_time()
        wp.launch(random_walks, dim=walks, inputs=[mesh.id, bounces, hits], device="cpu")
        return time.process_time() - start

    for mesh in meshes.values():
        cpu_time(mesh)
    times = [{key: cpu_time(mesh) for key, mesh in meshes.items()} for _ in range(arguments.repeats)]
    print(f"{len(faces)} triangles; speed relative to leaf size 1 in random order")
    for key in meshes:
        speeds = [run[1, False] / run[key] for run in times]
        order = "Morton" if key[1] else "random"
        print(f"leaf {key[0]}  {order}  {statistics.median(speeds):.2f}  ({min(speeds):.2f} to {max(speeds):.2f})")


if __name__ == "__main__":
    main()
