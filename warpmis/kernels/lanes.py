"""Eight floats at a time, in a CPU's SIMD registers.

Warp's operations on a vector of eight are loops of eight, and the compiler turns each loop into one instruction. Two
kinds of operation it does not vectorise:

- Eight comparisons become some forty instructions, and the operations before them are not vectorised either. So the
  steps from lanes to a mask or to a choice, and the square roots between them, are written with the vectors of Clang,
  Warp's compiler for all CPUs. A GPU's compiler gets the loop.
- Warp's minima and maxima skip NaN, at four instructions each. Those here are the processor's own: if a lane of either
  is NaN, the result is the second.
"""

import warp as wp

from warpmis.device.views import vec8f

wp.set_module_options({"enable_backward": False})

# Clang's vectors, and a copy into one that costs nothing.
VECTORS = """
    typedef float lanes __attribute__((ext_vector_type(8)));
    typedef bool bits __attribute__((ext_vector_type(8)));
    auto lanes_of = [](const auto& values) {
        lanes x;
        __builtin_memcpy(&x, &values, sizeof(x));
        return x;
    };
"""


@wp.func
def splat8(x: float) -> vec8f:
    return vec8f(x, x, x, x, x, x, x, x)


@wp.func_native("return rows.data[row];")
def row8(rows: wp.array(dtype=vec8f), row: int) -> vec8f:
    """A row of an array without gaps; Warp's own access multiplies by the array's stride."""
    ...


@wp.func_native("return rows.data[row][lane];")
def lane_of_row(rows: wp.array(dtype=vec8f), row: int, lane: int) -> float:
    """One of the eight numbers of a row."""
    ...


@wp.func_native(f"""
    {VECTORS}
    return __builtin_bit_cast(unsigned char, __builtin_convertvector(lanes_of(a) <= lanes_of(b), bits));
""")
def mask_less_equal(a: vec8f, b: vec8f) -> int:
    """A mask of the lanes in which a <= b; the first lane is the lowest bit."""
    ...


@wp.func_native(f"""
    auto least = a;
    #ifdef __clang__
    {VECTORS}
    lanes either = lanes_of(a) < lanes_of(b) ? lanes_of(a) : lanes_of(b);
    __builtin_memcpy(&least, &either, sizeof(either));
    #else
    for (int i = 0; i < 8; ++i)
        least[i] = a[i] < b[i] ? a[i] : b[i];
    #endif
    return least;
""")
def min8(a: vec8f, b: vec8f) -> vec8f:
    """The minimum in each lane."""
    ...


@wp.func_native(f"""
    auto most = a;
    #ifdef __clang__
    {VECTORS}
    lanes either = lanes_of(a) > lanes_of(b) ? lanes_of(a) : lanes_of(b);
    __builtin_memcpy(&most, &either, sizeof(either));
    #else
    for (int i = 0; i < 8; ++i)
        most[i] = a[i] > b[i] ? a[i] : b[i];
    #endif
    return most;
""")
def max8(a: vec8f, b: vec8f) -> vec8f:
    """The maximum in each lane."""
    ...


@wp.func_native("return __builtin_ctz(mask);")
def first_set_bit(mask: int) -> int:
    """The index of the lowest 1 in a mask that is not 0."""
    ...


@wp.func_native(f"""
    auto chosen = x;
    #ifdef __clang__
    {VECTORS}
    lanes either = lanes_of(a) >= lanes_of(b) ? lanes_of(x) : lanes_of(y);
    __builtin_memcpy(&chosen, &either, sizeof(either));
    #else
    for (int i = 0; i < 8; ++i)
        chosen[i] = a[i] >= b[i] ? x[i] : y[i];
    #endif
    return chosen;
""")
def at_least(a: vec8f, b: vec8f, x: vec8f, y: vec8f) -> vec8f:
    """x in the lanes in which a >= b, y in the others."""
    ...


@wp.func_native(f"""
    auto roots = a;
    #ifdef __clang__
    {VECTORS}
    lanes all = __builtin_elementwise_sqrt(lanes_of(a));
    __builtin_memcpy(&roots, &all, sizeof(all));
    #else
    for (int i = 0; i < 8; ++i)
        roots[i] = sqrtf(a[i]);
    #endif
    return roots;
""")
def square_roots(a: vec8f) -> vec8f:
    """The square root of each lane, none of which is negative."""
    ...


@wp.func_native(f"""
    #ifdef __clang__
    {VECTORS}
    return __builtin_bit_cast(unsigned char, __builtin_convertvector(lanes_of(a) > b, bits)) != 0;
    #else
    bool found = false;
    for (int i = 0; i < 8; ++i)
        found |= a[i] > b;
    return found;
    #endif
""")
def any_above(a: vec8f, b: float) -> bool:
    """Whether any lane is above b."""
    ...


@wp.func_native("""
    double sums[8];
    double sum = 0.0;
    for (int i = 0; i < 8; ++i)
        sums[i] = sum += a[i];
    double target = u * sum;
    int lane = 0;
    int last = 0;
    for (int i = 0; i < 8; ++i) {
        lane += sums[i] <= target;
        last = a[i] > 0.0f ? i : last;
    }
    lane = lane < 8 ? lane : last;
    wp::vec_t<3, double> pick;
    pick[0] = lane;
    pick[1] = (target - (sums[lane] - a[lane])) / a[lane];
    pick[2] = a[lane] / sum;
    return pick;
""")
def pick_lane(a: vec8f, u: wp.float64) -> wp.vec3d:
    """The lane in whose part of the sum of all lanes u lies, as a share of it in [0, 1); where in that part; and the
    part's share. No lane is negative, and one at least is above 0."""
    ...


@wp.func_native("""
    double sum = 0.0;
    for (int i = 0; i < 8; ++i)
        sum += a[i];
    float share = a[lane] / sum;
    return share;
""")
def share_of_lane(a: vec8f, lane: int) -> float:
    """The lane's share of the sum of all, one of which at least is above 0."""
    ...
