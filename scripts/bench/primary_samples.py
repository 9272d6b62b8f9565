"""The project's path tracer over primary samples, and Metropolis chains over them; complex_paths.py measures these.

A primary sample is all of a path's random numbers, a point of the unit cube. The path tracer f maps it to radiance.
What f brings above a threshold of the pixel's, T, is called complex:

    f = f_simple + f_complex,    f_complex = f max(0, 1 - T / luminance of f)

`Kernels.sample` is ordinary Monte Carlo on the product's lattice. It adds up f_simple, and keeps of every sample the
luminance of f_complex times the pixel's `worth`, y. `Kernels.put_seed` writes a sample's numbers into a row of a table.
`Kernels.walk` runs a Metropolis chain from each row, whose target is y: a step moves all numbers a little, or with the
probability `large` draws them anew. State and proposal both add f_complex / y, by the probability of each.

Numbers of blocks beyond SLOTS are drawn anew in every step. Those are a path's steps after the twelfth.

References: Kelemen, Szirmay-Kalos, Antal, Csonka (2002), "A Simple and Robust Mutation Strategy for the Metropolis
Light Transport Algorithm"; Bitterli, Jarosz (2019), "Selectively Metropolised Monte Carlo Light Transport Simulation".
"""

from __future__ import annotations

from types import SimpleNamespace

import warp as wp

from warpmis.device.kernel_factory import device_kernel
from warpmis.device.views import CameraView, SceneView, vec_lattice
from warpmis.kernels import lattice, rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.path.li import make_path
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# Rows of a table: slots of four numbers. The first ones are of blocks that a path's steps do not have.
SLOTS = 52
OF_CAMERA, OF_CHOICE, OF_LENS, OF_INTERFACE = (wp.constant(i) for i in range(4))
# How a step's numbers come about: from the row as it is, moved a little, or drawn anew. RngKey.round says so.
AS_THEY_ARE, SMALL, LARGE = (wp.constant(wp.uint32(i)) for i in range(3))
# The block of a step's own decisions, and what its random numbers have apart from those of ordinary samples.
DECISION = wp.constant(-3)
OF_CHAINS = wp.constant(wp.uint32(0x9E3779B9))


@wp.struct
class Chains:
    """What all chains have in common; the table is a row of 4 SLOTS numbers a chain, by its address.

    steps: of each chain; large: probability of a large step; largest, ratio: a small step's size is at most `largest`,
    and at least that divided by e^ratio.
    """

    seed: wp.uint32
    low: wp.uint32
    high: wp.uint32
    steps: int
    large: float
    largest: float
    ratio: float


@wp.struct
class Found:
    """What a primary sample brings: the pixel, f_simple, f_complex, and y."""

    pixel: int
    simple: wp.vec3
    complex: wp.vec3
    y: float


@wp.func
def table_of(key: rng.RngKey) -> wp.array(dtype=wp.vec4):
    """All rows: an RngKey has no array, so its lattice holds the address."""
    address = (wp.uint64(key.lattice[1]) << wp.uint64(32)) | wp.uint64(key.lattice[0])
    return wp.array(ptr=address, shape=((int(key.pixel) + 1) * wp.static(SLOTS),), dtype=wp.vec4)


@wp.func
def moved(u: float, xi: float, size: float) -> float:
    """u moved by `size` times a number, around the circle; as likely there as back."""
    size = size * wp.abs(2.0 * xi - 1.0)
    v = wp.where(xi < 0.5, u + size, u - size)
    return wp.min(v - wp.floor(v), rng.ONE_MINUS_EPSILON)


@wp.func
def proposed(key: rng.RngKey, slot: int) -> wp.vec4:
    """The numbers of one slot in a step: a function of row and step, so that a proposal needs no memory."""
    xi = rng.uniform4(key, slot)
    if key.round == LARGE or slot >= wp.static(SLOTS):
        return xi
    rows = table_of(key)
    u = rows[int(key.pixel) * wp.static(SLOTS) + slot]
    if key.round == AS_THEY_ARE:
        return u
    size = rng.to_unit(key.lattice[2])
    return wp.vec4(
        moved(u[0], xi[0], size), moved(u[1], xi[1], size), moved(u[2], xi[2], size), moved(u[3], xi[3], size)
    )


@wp.func
def of_pixel(key: rng.RngKey, block: int) -> wp.vec4:
    if block == rng.CAMERA:
        return proposed(key, OF_CAMERA)
    return proposed(key, OF_LENS)


@wp.func
def of_step(key: rng.RngKey, step: int, purpose: int) -> wp.vec4:
    return proposed(key, purpose + step * rng.BLOCKS + OF_INTERFACE)


@wp.func
def independent_of_step(key: rng.RngKey, step: int, purpose: int) -> wp.vec4:
    """At the first step an interface's numbers are not those of the lattice, so they have a slot of their own."""
    if step == 0 and purpose == rng.SCATTER:
        return proposed(key, OF_INTERFACE)
    return of_step(key, step, purpose)


TABLE_SAMPLER = SimpleNamespace(of_pixel=of_pixel, of_step=of_step, independent_of_step=independent_of_step)


def make_split() -> wp.Function:
    @wp.func
    def split(L: wp.vec3, pixel: int, threshold: wp.array(dtype=float), worth: wp.array(dtype=float)) -> Found:
        """Radiance in its two parts; what is not finite counts as nothing, as in the product's film."""
        found = Found()
        found.pixel = pixel
        brightness = luminance(L)
        if not wp.isfinite(brightness) or brightness <= 0.0:
            return found
        part = wp.max(0.0, 1.0 - threshold[pixel] / brightness)
        found.complex = L * part
        found.simple = L - found.complex
        found.y = brightness * part * worth[pixel]
        return found

    return split


def base_kernels(features: Features) -> SimpleNamespace:
    """Kernels `sample` and `put_seed`, by the product's lattice sampler."""
    path = make_path(features)
    camera_ray = make_camera(features)
    sampler = make_sampler(features)
    split = make_split()
    Li, vec_0 = path.Li, path.strategies.vec_s

    @wp.func
    def key_of(seed: wp.uint32, steps: vec_lattice, pixel: int, k: int) -> rng.RngKey:
        key = rng.RngKey()
        key.seed = seed
        key.pixel = wp.uint32(pixel)
        key.sample = wp.uint32(k)
        key.lattice = steps
        return key

    def sample(
        scene: SceneView,
        camera: CameraView,
        seed: wp.uint32,
        steps: vec_lattice,
        max_depth: int,
        threshold: wp.array(dtype=float),
        worth: wp.array(dtype=float),
        simple: wp.array(dtype=wp.vec3),
        y: wp.array2d(dtype=float),
    ):
        """A thread a pixel: the mean of f_simple, and y of each sample."""
        pixel = wp.tid()
        total = wp.vec3()
        for k in range(y.shape[1]):
            key = key_of(seed, steps, pixel, k)
            u = sampler.of_pixel(key, rng.CAMERA)
            ray = camera_ray(camera, key, pixel, u[0], u[1])
            found = split(Li(scene, ray, key, vec_0(), lattice.choice(key), max_depth).L, pixel, threshold, worth)
            total += found.simple
            y[pixel, k] = found.y
        simple[pixel] = total / float(y.shape[1])

    def put_seed(
        camera: CameraView,
        seed: wp.uint32,
        steps: vec_lattice,
        pixels: wp.array(dtype=int),
        samples: wp.array(dtype=int),
        rows: wp.array(dtype=wp.vec4),
    ):
        """A thread a chain: the numbers of its first sample."""
        pixel = pixels[wp.tid()]
        key = key_of(seed, steps, pixel, samples[wp.tid()])
        first = wp.tid() * wp.static(SLOTS)
        u = sampler.of_pixel(key, rng.CAMERA)
        x = (float(pixel % camera.width) + u[0]) / float(camera.width)
        y = (float(pixel / camera.width) + u[1]) / float(camera.height)
        rows[first + OF_CAMERA] = wp.vec4(x, y, 0.0, 0.0)
        rows[first + OF_CHOICE] = wp.vec4(lattice.choice(key), 0.0, 0.0, 0.0)
        rows[first + OF_LENS] = sampler.of_pixel(key, rng.LENS)
        rows[first + OF_INTERFACE] = sampler.independent_of_step(key, 0, rng.SCATTER)
        for slot in range(OF_INTERFACE + 1, wp.static(SLOTS)):
            block = slot - OF_INTERFACE - 1
            rows[first + slot] = sampler.of_step(key, block / rng.BLOCKS, block % rng.BLOCKS + 1)

    return SimpleNamespace(sample=device_kernel(sample), put_seed=device_kernel(put_seed))


def chain_kernel(features: Features) -> wp.Kernel:
    """The kernel `walk`."""
    path = make_path(features, sampler=TABLE_SAMPLER)
    camera_ray = make_camera(features, TABLE_SAMPLER)
    split = make_split()
    Li, vec_0 = path.Li, path.strategies.vec_s

    @wp.func
    def evaluate(
        scene: SceneView,
        camera: CameraView,
        key: rng.RngKey,
        max_depth: int,
        threshold: wp.array(dtype=float),
        worth: wp.array(dtype=float),
    ) -> Found:
        """The path of a step's numbers."""
        at = proposed(key, OF_CAMERA)
        x, y = at[0] * float(camera.width), at[1] * float(camera.height)
        column, row = wp.min(int(x), camera.width - 1), wp.min(int(y), camera.height - 1)
        pixel = row * camera.width + column
        ray = camera_ray(camera, key, pixel, x - float(column), y - float(row))
        u_choice = proposed(key, OF_CHOICE)[0]
        return split(Li(scene, ray, key, vec_0(), u_choice, max_depth).L, pixel, threshold, worth)

    def walk(
        scene: SceneView,
        camera: CameraView,
        chains: Chains,
        max_depth: int,
        threshold: wp.array(dtype=float),
        worth: wp.array(dtype=float),
        picture: wp.array(dtype=wp.vec3),
        log: wp.array2d(dtype=float),
    ):
        """A thread a chain: the sum of f_complex / y over its states; log: y of the first state, share of accepted
        steps. The order of the threads must be fixed, as it is on a CPU's single one."""
        key = rng.RngKey()
        key.seed = chains.seed ^ OF_CHAINS
        key.pixel = wp.uint32(wp.tid())
        key.round = AS_THEY_ARE
        key.lattice[0] = chains.low
        key.lattice[1] = chains.high
        now = evaluate(scene, camera, key, max_depth, threshold, worth)
        log[wp.tid(), 0] = now.y
        accepted = float(0.0)  # noqa: UP018 - a variable in Warp's sense
        for k in range(chains.steps):
            key.sample = wp.uint32(k)
            decision = rng.uniform4(key, DECISION)
            key.round = wp.where(decision[0] < chains.large, LARGE, SMALL)
            key.lattice[2] = wp.uint32(chains.largest * wp.exp(-chains.ratio * decision[2]) * 4.294967e9)
            new = evaluate(scene, camera, key, max_depth, threshold, worth)
            a = 1.0
            if now.y > 0.0:
                a = wp.min(1.0, new.y / now.y)
                wp.atomic_add(picture, now.pixel, now.complex * ((1.0 - a) / now.y))
            if new.y > 0.0:
                wp.atomic_add(picture, new.pixel, new.complex * (a / new.y))
            if decision[1] < a:
                rows = table_of(key)
                for slot in range(wp.static(SLOTS)):
                    rows[wp.tid() * wp.static(SLOTS) + slot] = proposed(key, slot)
                now = new
                accepted += 1.0
        log[wp.tid(), 1] = accepted / float(wp.max(chains.steps, 1))

    return device_kernel(walk)
