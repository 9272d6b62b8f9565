"""Eight floats at a time, in a CPU's SIMD registers.

Warp's operations on a vector of eight are loops of eight, which the compiler turns into one instruction each. Not so
where the eight part again: from eight comparisons in Warp's language it makes some forty instructions, and the
operations before them get torn up as well. So the two steps from lanes to bits are said in the compiler's own language:
its vectors, which every processor has in some width. Nor so with Warp's minima and maxima, which leave out a NaN, at
four instructions each: those here are a processor's own, where the second of two lanes stands if either is NaN.
"""

import warp as wp

from warpmis.device.views import vec8f

wp.set_module_options({"enable_backward": False})


@wp.func
def all_eight(x: float) -> vec8f:
    return vec8f(x, x, x, x, x, x, x, x)


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(8)));
    typedef bool bits __attribute__((ext_vector_type(8)));
    lanes x, y;
    __builtin_memcpy(&x, &a, sizeof(x));
    __builtin_memcpy(&y, &b, sizeof(y));
    return __builtin_bit_cast(unsigned char, __builtin_convertvector(x <= y, bits));
""")
def lanes_up_to(a: vec8f, b: vec8f) -> int:
    """A mask of the lanes in which a <= b; the first lane is the lowest bit."""
    ...


@wp.func_native("""
    auto least = a;
    for (int i = 0; i < 8; ++i)
        least[i] = a[i] < b[i] ? a[i] : b[i];
    return least;
""")
def lesser(a: vec8f, b: vec8f) -> vec8f:
    """The lesser of each two lanes."""
    ...


@wp.func_native("""
    auto most = a;
    for (int i = 0; i < 8; ++i)
        most[i] = a[i] > b[i] ? a[i] : b[i];
    return most;
""")
def greater(a: vec8f, b: vec8f) -> vec8f:
    """The greater of each two lanes."""
    ...


@wp.func_native("return __builtin_ctz(mask);")
def lowest_bit(mask: int) -> int:
    """The place of the lowest 1 in a mask that is not 0."""
    ...
