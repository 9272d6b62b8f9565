"""Lookups: a primvar at a hit, and a picture's texels around its texture coordinates, bilinear.

The functions take what they read and no more: Warp passes structs by value, and a scene's is long. What varies over
surfaces is therefore an array of one record.
"""

import warp as wp

from warpmis.device.texel_views import (
    BLACK,
    BLOCK,
    BYTES,
    HALVES,
    MIRRORED,
    NO_CHANNEL,
    REPEAT,
    SHORTS,
    SRGB_BYTES,
    TileView,
)
from warpmis.device.views import NO_TILE, RGB, LookupView, VaryingView

wp.set_module_options({"enable_backward": False})

UDIM_COLUMNS = wp.constant(10)
BYTE = wp.constant(wp.uint32(255))
SHORT = wp.constant(wp.uint32(65535))
BLOCK_SHIFT = wp.constant(2)
assert 1 << BLOCK_SHIFT == BLOCK


@wp.func
def interpolated(primvars: wp.array3d(dtype=float), triangle: int, column: int, u: float, v: float) -> float:
    """A column of the primvars at a hit; u weighs the first corner, v the second.

    Equal corners give exactly their value, which may be compared with a threshold.
    """
    third = primvars[triangle, 2, column]
    return third + (primvars[triangle, 0, column] - third) * u + (primvars[triangle, 1, column] - third) * v


@wp.func
def transformed(lookup: LookupView, s: float, t: float) -> wp.vec2:
    """The place that a lookup looks at where the texture coordinates are (s, t)."""
    st = wp.vec3(s, t, 1.0)
    return wp.vec2(wp.dot(lookup.row_s, st), wp.dot(lookup.row_t, st))


@wp.func
def coordinates(primvars: wp.array3d(dtype=float), lookup: LookupView, triangle: int, u: float, v: float) -> wp.vec2:
    """The place that a lookup looks at for a hit."""
    s = interpolated(primvars, triangle, lookup.column, u, v)
    t = interpolated(primvars, triangle, lookup.column + 1, u, v)
    return transformed(lookup, s, t)


@wp.func
def corner_coordinates(primvars: wp.array3d(dtype=float), lookup: LookupView, triangle: int, corner: int) -> wp.vec2:
    return transformed(lookup, primvars[triangle, corner, lookup.column], primvars[triangle, corner, lookup.column + 1])


@wp.struct
class Footprint:
    """The four texels around a point: where they stand among those of their picture, and how much each counts.

    tile: which of a lookup's tiles has them, or NO_TILE where none does. Beyond a black border a texel counts nothing.
    weights: of the upper right, lower left and lower right texel. coverage: of all four, 1 but at such a border.
    """

    tile: int
    upper_left: int
    upper_right: int
    lower_left: int
    lower_right: int
    weights: wp.vec3
    coverage: float


@wp.func
def wrapped(x: float, mode: int) -> float:
    """A coordinate within [0, 1]; with BLACK within [-1, 2], so that what is outside stays outside."""
    if mode == REPEAT:
        return x - wp.floor(x)
    if mode == MIRRORED:
        x = x - 2.0 * wp.floor(0.5 * x)
        return wp.min(x, 2.0 - x)
    if mode == BLACK:
        return wp.clamp(x, -1.0, 2.0)
    return wp.clamp(x, 0.0, 1.0)


@wp.func
def wrapped_index(i: int, count: int, mode: int) -> int:
    """A texel's index, of one in the picture or beside it."""
    if mode == REPEAT:
        i = wp.where(i < 0, i + count, i)
        i = wp.where(i >= count, i - count, i)
    return wp.clamp(i, 0, count - 1)


@wp.func
def presence(i: int, count: int, mode: int) -> float:
    """0 for a texel beyond a black border, else 1."""
    return wp.where(mode == BLACK and (i < 0 or i >= count), 0.0, 1.0)


@wp.func
def covered(i: int, count: int, mode: int, weights: float) -> float:
    """The weights of texel i and the next one together: exactly 1 where both are there."""
    return wp.where(mode == BLACK and (i < 0 or i + 1 >= count), weights, 1.0)


@wp.func
def within_block(i: int, along: int, step: int) -> int:
    """What a row or a column adds to a texel's place: `along` for each block before it, `step` within its own.

    By shifts, not divisions, which round negative numbers towards 0 and take longer for it: there are none.
    """
    return (i >> BLOCK_SHIFT) * along + (i & (BLOCK - 1)) * step


@wp.func
def footprint_in(tile: TileView, s: float, t: float, wrap_s: int, wrap_t: int) -> Footprint:
    """Texel centres stand at half integers; t = 0 is the lower edge of the last row."""
    x = wrapped(s, wrap_s) * float(tile.columns) - 0.5
    y = (1.0 - wrapped(t, wrap_t)) * float(tile.rows) - 0.5
    column = int(wp.floor(x))
    row = int(wp.floor(y))
    right = x - float(column)
    left = float(column + 1) - x
    lower = y - float(row)
    upper = float(row + 1) - y
    coverage = float(1.0)
    if wrap_s == BLACK or wrap_t == BLACK:
        right *= presence(column + 1, tile.columns, wrap_s)
        left *= presence(column, tile.columns, wrap_s)
        lower *= presence(row + 1, tile.rows, wrap_t)
        upper *= presence(row, tile.rows, wrap_t)
        coverage = covered(column, tile.columns, wrap_s, left + right) * covered(row, tile.rows, wrap_t, upper + lower)
    at_left = within_block(wrapped_index(column, tile.columns, wrap_s), BLOCK * BLOCK, 1)
    at_right = within_block(wrapped_index(column + 1, tile.columns, wrap_s), BLOCK * BLOCK, 1)
    block_row = tile.blocks * (BLOCK * BLOCK)
    at_upper = within_block(wrapped_index(row, tile.rows, wrap_t), block_row, BLOCK)
    at_lower = within_block(wrapped_index(row + 1, tile.rows, wrap_t), block_row, BLOCK)
    f = Footprint()
    f.upper_left = at_upper + at_left
    f.upper_right = at_upper + at_right
    f.lower_left = at_lower + at_left
    f.lower_right = at_lower + at_right
    f.weights = wp.vec3(upper * right, lower * left, lower * right)
    f.coverage = coverage
    return f


@wp.func
def footprint(varying: wp.array(dtype=VaryingView), lookup: LookupView, st: wp.vec2) -> Footprint:
    """The texels of a lookup at texture coordinates; in a UDIM picture those of the tile that they are in."""
    s = st[0]
    t = st[1]
    index = int(0)
    if lookup.udim_rows > 0:
        column = wp.floor(s)
        row = wp.floor(t)
        index = NO_TILE
        if column >= 0.0 and row >= 0.0 and column < float(UDIM_COLUMNS) and row < float(lookup.udim_rows):
            index = int(row) * UDIM_COLUMNS + int(column)
        s = s - column
        t = t - row
    tile = varying[0].tiles[lookup.tile + wp.max(index, 0)]
    f = footprint_in(tile, s, t, lookup.wrap_s, lookup.wrap_t)
    f.tile = wp.where(tile.rows == 0, NO_TILE, index)
    return f


@wp.func
def interpolated_texels(
    f: Footprint, upper_left: float, upper_right: float, lower_left: float, lower_right: float
) -> float:
    """Equal texels give exactly their value: a sum of four products would be off by a rounding, and fall below an
    opacityThreshold that the texels meet."""
    return (
        upper_left * f.coverage
        + (upper_right - upper_left) * f.weights[0]
        + (lower_left - upper_left) * f.weights[1]
        + (lower_right - upper_left) * f.weights[2]
    )


@wp.func
def decoded(byte_values: wp.array(dtype=float), encoding: int, channel: int, bits: wp.uint32) -> float:
    """The linear value of a channel; `bits` begins with it, and holds other things above it."""
    if encoding >= BYTES:
        table = wp.where(encoding == SRGB_BYTES and channel < 3, 256, 0)
        return byte_values[table + int(bits & BYTE)]
    if encoding == SHORTS:
        return float(bits & SHORT) / 65535.0
    if encoding == HALVES:
        return float(wp.cast(wp.uint16(bits & SHORT), wp.float16))
    return wp.cast(bits, float)


@wp.func
def place_of(tile: TileView, channel: int) -> int:
    """The first byte of red, green, blue or alpha (0 to 3) within a texel's words, or NO_CHANNEL."""
    return int((tile.places >> wp.uint32(8 * channel)) & BYTE)


@wp.func
def filtered(varying: wp.array(dtype=VaryingView), tile: TileView, f: Footprint, channel: int) -> float:
    """Red, green, blue or alpha (0 to 3) of a picture, linear, interpolated between the footprint's texels."""
    place = place_of(tile, channel)
    if place == NO_CHANNEL:
        return f.coverage
    texels = varying[0].texels
    byte_values = varying[0].byte_values
    first = tile.first + (place >> 2)
    shift = wp.uint32(8 * (place & 3))
    return interpolated_texels(
        f,
        decoded(byte_values, tile.encoding, channel, texels[first + f.upper_left * tile.stride] >> shift),
        decoded(byte_values, tile.encoding, channel, texels[first + f.upper_right * tile.stride] >> shift),
        decoded(byte_values, tile.encoding, channel, texels[first + f.lower_left * tile.stride] >> shift),
        decoded(byte_values, tile.encoding, channel, texels[first + f.lower_right * tile.stride] >> shift),
    )


@wp.func
def filtered_color(varying: wp.array(dtype=VaryingView), tile: TileView, f: Footprint) -> wp.vec3:
    """Red, green and blue of a picture, linear. Colours of bytes stand in one word, which is read once."""
    if tile.encoding < BYTES:
        return wp.vec3(filtered(varying, tile, f, 0), filtered(varying, tile, f, 1), filtered(varying, tile, f, 2))
    texels = varying[0].texels
    byte_values = varying[0].byte_values
    table = wp.where(tile.encoding == SRGB_BYTES, 256, 0)
    first = tile.first + (place_of(tile, 0) >> 2)
    upper_left = texels[first + f.upper_left * tile.stride]
    upper_right = texels[first + f.upper_right * tile.stride]
    lower_left = texels[first + f.lower_left * tile.stride]
    lower_right = texels[first + f.lower_right * tile.stride]
    color = wp.vec3()
    for channel in range(3):
        shift = wp.uint32(8 * (place_of(tile, channel) & 3))
        color[channel] = interpolated_texels(
            f,
            byte_values[table + int((upper_left >> shift) & BYTE)],
            byte_values[table + int((upper_right >> shift) & BYTE)],
            byte_values[table + int((lower_left >> shift) & BYTE)],
            byte_values[table + int((lower_right >> shift) & BYTE)],
        )
    return color


@wp.func
def picture_value(varying: wp.array(dtype=VaryingView), lookup: LookupView, f: Footprint) -> wp.vec3:
    """scale * texel + bias of a lookup's channels; of a number, in each component."""
    value = lookup.fallback
    if f.tile != NO_TILE:
        tile = varying[0].tiles[lookup.tile + f.tile]
        if lookup.channel == RGB:
            value = filtered_color(varying, tile, f)
        else:
            number = filtered(varying, tile, f, lookup.channel)
            value = wp.vec3(number, number, number)
        value = wp.cw_mul(value, lookup.scale) + lookup.bias
    return value


@wp.func
def primvar_value(primvars: wp.array3d(dtype=float), lookup: LookupView, triangle: int, u: float, v: float) -> wp.vec3:
    """A primvar at a hit; a number in each component."""
    red = interpolated(primvars, triangle, lookup.column, u, v)
    if lookup.channel != RGB:
        return wp.vec3(red, red, red)
    green = interpolated(primvars, triangle, lookup.column + 1, u, v)
    blue = interpolated(primvars, triangle, lookup.column + 2, u, v)
    return wp.vec3(red, green, blue)
