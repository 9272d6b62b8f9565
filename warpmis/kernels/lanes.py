"""Eight floats at a time, in a CPU's SIMD registers.

Warp's operations on a vector of eight are loops of eight, and the compiler turns each loop into one instruction. Two
kinds of operation it does not vectorise:

- Eight comparisons become some forty instructions, and the operations before them are not vectorised either. So the
  step from lanes to a mask is written with the compiler's vector extension, which every processor supports.
- Warp's minima and maxima skip NaN, at four instructions each. Those here are the processor's own: if a lane of either
  is NaN, the result is the second.
"""

import warp as wp

from warpmis.device.views import vec8f

wp.set_module_options({"enable_backward": False})


@wp.func
def splat8(x: float) -> vec8f:
    return vec8f(x, x, x, x, x, x, x, x)


@wp.func_native("""
    typedef float lanes __attribute__((ext_vector_type(8)));
    typedef bool bits __attribute__((ext_vector_type(8)));
    lanes x, y;
    __builtin_memcpy(&x, &a, sizeof(x));
    __builtin_memcpy(&y, &b, sizeof(y));
    return __builtin_bit_cast(unsigned char, __builtin_convertvector(x <= y, bits));
""")
def mask_less_equal(a: vec8f, b: vec8f) -> int:
    """A mask of the lanes in which a <= b; the first lane is the lowest bit."""
    ...


@wp.func_native("""
    auto least = a;
    for (int i = 0; i < 8; ++i)
        least[i] = a[i] < b[i] ? a[i] : b[i];
    return least;
""")
def min8(a: vec8f, b: vec8f) -> vec8f:
    """The minimum in each lane."""
    ...


@wp.func_native("""
    auto most = a;
    for (int i = 0; i < 8; ++i)
        most[i] = a[i] > b[i] ? a[i] : b[i];
    return most;
""")
def max8(a: vec8f, b: vec8f) -> vec8f:
    """The maximum in each lane."""
    ...


@wp.func_native("return __builtin_ctz(mask);")
def first_set_bit(mask: int) -> int:
    """The index of the lowest 1 in a mask that is not 0."""
    ...
