"""How the device stores pictures of materials."""

import warp as wp

# How texels are stored: as float32, as float16, as 16-bit integers over 65535, as bytes over 255, or as bytes of which
# the colours are sRGB encoded.
FLOATS = 0
HALVES = 1
SHORTS = 2
BYTES = 3
SRGB_BYTES = 4

# In TileView.places, of a channel that no lookup reads; of an alpha that the picture has not, which is 1.
NO_CHANNEL = 255

# A picture's texels stand in square blocks with so many along each side, so that the four of one lookup, bytes of 64 in
# a block, are mostly in one line of the cache.
BLOCK = 4

# Wrap modes of texture coordinates.
BLACK = 0
CLAMP = 1
REPEAT = 2
MIRRORED = 3


@wp.struct
class TileView:
    """A picture's texels in VaryingView.texels from `first` on, each `stride` words after the one before. These words
    also hold the texels of pictures that are looked up at the same places. places: in its lowest byte the first byte of
    red within a texel's words, then those of green, blue and alpha, or NO_CHANNEL. `blocks` blocks side by side, one
    such row after the other from the top, and so within a block. rows is 0 where a UDIM picture has no tile."""

    encoding: int
    first: int
    stride: int
    rows: int
    columns: int
    blocks: int
    places: wp.uint32
