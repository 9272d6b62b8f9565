"""Lookups: a primvar at a hit, and a picture's texels around its texture coordinates, bilinear.

The functions take what they read and no more: Warp passes structs by value, and a scene's is long. What varies over
surfaces is therefore an array of one record.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import (
    BLACK,
    BLOCK,
    FLOATS,
    MIRRORED,
    REPEAT,
    RGB,
    SRGB_BYTES,
    LookupView,
    TileView,
    VaryingView,
)
from warpmis.features import Features

wp.set_module_options({"enable_backward": False})

UDIM_COLUMNS = wp.constant(10)
BYTE = wp.constant(wp.uint32(255))


@wp.func
def interpolated(primvars: wp.array3d(dtype=float), triangle: int, column: int, u: float, v: float) -> float:
    """A column of the primvars at a hit; u weighs the first corner, v the second."""
    first = primvars[triangle, 0, column] * u
    second = primvars[triangle, 1, column] * v
    return first + second + primvars[triangle, 2, column] * (1.0 - u - v)


@wp.func
def coordinates(primvars: wp.array3d(dtype=float), lookup: LookupView, triangle: int, u: float, v: float) -> wp.vec2:
    """The texture coordinates at which a lookup looks."""
    s = interpolated(primvars, triangle, lookup.column, u, v)
    t = interpolated(primvars, triangle, lookup.column + 1, u, v)
    st = wp.vec3(s, t, 1.0)
    return wp.vec2(wp.dot(lookup.row_s, st), wp.dot(lookup.row_t, st))


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
    """A texel's index beside one that is in the picture; -1 where there is none."""
    if i >= 0 and i < count:
        return i
    if mode == BLACK:
        return -1
    if mode == REPEAT:
        return wp.where(i < 0, i + count, i - count)
    return wp.clamp(i, 0, count - 1)


@wp.func
def place_of(tile: TileView, row: int, column: int) -> int:
    """Where a texel stands among those of its picture, block by block."""
    block = (row / BLOCK) * tile.blocks + column / BLOCK
    return (block * BLOCK + row % BLOCK) * BLOCK + column % BLOCK


@wp.func
def texel(
    texels: wp.array(dtype=wp.uint32), byte_values: wp.array(dtype=float), tile: TileView, row: int, column: int
) -> wp.vec4:
    """Linear red, green, blue and alpha; black where row or column is -1."""
    if row < 0 or column < 0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    place = place_of(tile, row, column)
    if tile.encoding == FLOATS:
        first = tile.first + place * tile.channels
        r = wp.cast(texels[first], float)
        g = r
        b = r
        if tile.channels >= 3:
            g = wp.cast(texels[first + 1], float)
            b = wp.cast(texels[first + 2], float)
        a = float(1.0)
        if tile.channels % 2 == 0:
            a = wp.cast(texels[first + tile.channels - 1], float)
        return wp.vec4(r, g, b, a)
    word = texels[tile.first + place]
    table = wp.where(tile.encoding == SRGB_BYTES, 256, 0)
    return wp.vec4(
        byte_values[table + int(word & BYTE)],
        byte_values[table + int((word >> wp.uint32(8)) & BYTE)],
        byte_values[table + int((word >> wp.uint32(16)) & BYTE)],
        byte_values[int(word >> wp.uint32(24))],
    )


@wp.func
def bilinear(
    texels: wp.array(dtype=wp.uint32),
    byte_values: wp.array(dtype=float),
    tile: TileView,
    s: float,
    t: float,
    wrap_s: int,
    wrap_t: int,
) -> wp.vec4:
    """Texel centres stand at half integers; t = 0 is the lower edge of the last row."""
    x = wrapped(s, wrap_s) * float(tile.columns) - 0.5
    y = (1.0 - wrapped(t, wrap_t)) * float(tile.rows) - 0.5
    column = int(wp.floor(x))
    row = int(wp.floor(y))
    fx = x - float(column)
    fy = y - float(row)
    left = wrapped_index(column, tile.columns, wrap_s)
    right = wrapped_index(column + 1, tile.columns, wrap_s)
    upper = wrapped_index(row, tile.rows, wrap_t)
    lower = wrapped_index(row + 1, tile.rows, wrap_t)
    upper_left = texel(texels, byte_values, tile, upper, left)
    upper_right = texel(texels, byte_values, tile, upper, right)
    lower_left = texel(texels, byte_values, tile, lower, left)
    lower_right = texel(texels, byte_values, tile, lower, right)
    above = upper_left * (1.0 - fx) + upper_right * fx
    below = lower_left * (1.0 - fx) + lower_right * fx
    return above * (1.0 - fy) + below * fy


@wp.func
def picture_value(varying: wp.array(dtype=VaryingView), lookup: LookupView, st: wp.vec2) -> wp.vec4:
    """scale * texel + bias at texture coordinates; in a UDIM picture of the tile that they are in."""
    s = st[0]
    t = st[1]
    index = lookup.tile
    if lookup.udim_rows > 0:
        column = wp.floor(s)
        row = wp.floor(t)
        if column < 0.0 or row < 0.0 or column >= float(UDIM_COLUMNS) or row >= float(lookup.udim_rows):
            return lookup.fallback
        index += int(row) * UDIM_COLUMNS + int(column)
        s = s - column
        t = t - row
    tile = varying[0].tiles[index]
    if tile.rows == 0:
        return lookup.fallback
    value = bilinear(varying[0].texels, varying[0].byte_values, tile, s, t, lookup.wrap_s, lookup.wrap_t)
    return wp.cw_mul(value, lookup.scale) + lookup.bias


def make_texture(features: Features) -> SimpleNamespace:
    """The lookup for what varies in `features`: value."""

    @wp.func
    def value(varying: wp.array(dtype=VaryingView), row: int, triangle: int, u: float, v: float) -> wp.vec4:
        """All channels of a lookup, not clamped; of a primvar that is a number, the first."""
        lookup = varying[0].lookups[row]
        if wp.static(features.vertex_colors):
            if lookup.tile < 0:
                red = interpolated(varying[0].primvars, triangle, lookup.column, u, v)
                if lookup.channel != RGB:
                    return wp.vec4(red, 0.0, 0.0, 1.0)
                green = interpolated(varying[0].primvars, triangle, lookup.column + 1, u, v)
                blue = interpolated(varying[0].primvars, triangle, lookup.column + 2, u, v)
                return wp.vec4(red, green, blue, 1.0)
        if wp.static(features.textures):
            return picture_value(varying, lookup, coordinates(varying[0].primvars, lookup, triangle, u, v))
        return wp.vec4(0.0, 0.0, 0.0, 1.0)

    return SimpleNamespace(value=value)
