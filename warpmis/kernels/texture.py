"""Lookups: a primvar at a hit, and a picture's texels around its texture coordinates, bilinear."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import BLACK, FLOATS, MIRRORED, REPEAT, RGB, SRGB_BYTES, LookupView, SceneView, TileView
from warpmis.features import Features

wp.set_module_options({"enable_backward": False})

UDIM_COLUMNS = wp.constant(10)


@wp.func
def interpolated(scene: SceneView, triangle: int, column: int, u: float, v: float) -> float:
    """A column of the primvars at a hit; u weighs the first corner, v the second."""
    p = scene.primvars
    return p[triangle, 0, column] * u + p[triangle, 1, column] * v + p[triangle, 2, column] * (1.0 - u - v)


@wp.func
def texture_coordinates(scene: SceneView, lookup: LookupView, triangle: int, u: float, v: float) -> wp.vec2:
    s = interpolated(scene, triangle, lookup.column, u, v)
    t = interpolated(scene, triangle, lookup.column + 1, u, v)
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
def texel(scene: SceneView, tile: TileView, row: int, column: int) -> wp.vec4:
    """Linear red, green, blue and alpha; black where row or column is -1."""
    if row < 0 or column < 0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    first = tile.first + (row * tile.columns + column) * tile.channels
    g = wp.where(tile.channels >= 3, 1, 0)
    b = wp.where(tile.channels >= 3, 2, 0)
    alpha = float(1.0)
    if tile.encoding == FLOATS:
        if tile.channels % 2 == 0:
            alpha = scene.floats[first + tile.channels - 1]
        return wp.vec4(scene.floats[first], scene.floats[first + g], scene.floats[first + b], alpha)
    table = wp.where(tile.encoding == SRGB_BYTES, 256, 0)
    if tile.channels % 2 == 0:
        alpha = scene.byte_values[int(scene.bytes[first + tile.channels - 1])]
    return wp.vec4(
        scene.byte_values[table + int(scene.bytes[first])],
        scene.byte_values[table + int(scene.bytes[first + g])],
        scene.byte_values[table + int(scene.bytes[first + b])],
        alpha,
    )


@wp.func
def bilinear(scene: SceneView, tile: TileView, s: float, t: float, wrap_s: int, wrap_t: int) -> wp.vec4:
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
    above = texel(scene, tile, upper, left) * (1.0 - fx) + texel(scene, tile, upper, right) * fx
    below = texel(scene, tile, lower, left) * (1.0 - fx) + texel(scene, tile, lower, right) * fx
    return above * (1.0 - fy) + below * fy


@wp.func
def picture_value(scene: SceneView, lookup: LookupView, st: wp.vec2) -> wp.vec4:
    """scale * texel + bias at texture coordinates; in a UDIM picture of the tile that they are in."""
    s = st[0]
    t = st[1]
    index = lookup.tile
    wrap_s = lookup.wrap_s
    wrap_t = lookup.wrap_t
    if lookup.udim_rows > 0:
        column = wp.floor(s)
        row = wp.floor(t)
        if column < 0.0 or row < 0.0 or column >= float(UDIM_COLUMNS) or row >= float(lookup.udim_rows):
            return lookup.fallback
        index += int(row) * UDIM_COLUMNS + int(column)
        s = s - column
        t = t - row
    tile = scene.tiles[index]
    if tile.rows == 0:
        return lookup.fallback
    value = bilinear(scene, tile, s, t, wrap_s, wrap_t)
    return wp.cw_mul(value, lookup.scale) + lookup.bias


def make_texture(features: Features) -> SimpleNamespace:
    """Lookup functions for what varies in `features`: color, number."""

    @wp.func
    def color(scene: SceneView, row: int, triangle: int, u: float, v: float) -> wp.vec3:
        """A lookup's colour, not clamped."""
        lookup = scene.lookups[row]
        if wp.static(features.vertex_colors):
            if lookup.tile < 0:
                red = interpolated(scene, triangle, lookup.column, u, v)
                green = interpolated(scene, triangle, lookup.column + 1, u, v)
                blue = interpolated(scene, triangle, lookup.column + 2, u, v)
                return wp.vec3(red, green, blue)
        value = wp.vec4()
        if wp.static(features.textures):
            value = picture_value(scene, lookup, texture_coordinates(scene, lookup, triangle, u, v))
            if lookup.channel != RGB:
                channel = value[lookup.channel]
                return wp.vec3(channel, channel, channel)
        return wp.vec3(value[0], value[1], value[2])

    @wp.func
    def number(scene: SceneView, row: int, triangle: int, u: float, v: float) -> float:
        """A lookup's number within [0, 1]."""
        lookup = scene.lookups[row]
        if wp.static(features.vertex_colors):
            if lookup.tile < 0:
                return wp.clamp(interpolated(scene, triangle, lookup.column, u, v), 0.0, 1.0)
        value = float(0.0)
        if wp.static(features.textures):
            st = texture_coordinates(scene, lookup, triangle, u, v)
            value = picture_value(scene, lookup, st)[lookup.channel]
        return wp.clamp(value, 0.0, 1.0)

    return SimpleNamespace(color=color, number=number)
