"""The choice among many lights: by a tree, in proportion at each turn to an estimate of what each child brings.

The estimate takes the lights of a child for a ball of uniform density in their box. It is 0 only where none of them can
bring anything, and it is a function of the receiver alone, so that the probability of what was chosen can be told. The
cost of either grows with the logarithm of the lights' number. A node has eight children, which a CPU weighs at once.

References: Conty Estevez, Kulla (2018), "Importance Sampling of Many Lights with Adaptive Tree Splitting"; Pharr,
Jakob, Humphreys (2023), "Physically Based Rendering", 4th edition, section 12.6.3: cones, the path as bits.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import LightTreeView, vec8f
from warpmis.kernels.lanes import (
    any_above,
    at_least,
    max8,
    min8,
    pick_lane,
    share_of_lane,
    splat8,
    square_roots,
)
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.light.response import is_glossy, towards_eight
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# Rows of LightTreeView.rows a node, and in which place each stands (device/light_nodes.py: COLUMNS).
ROWS = wp.constant(19)
CENTER = wp.constant(0)
HALF = wp.constant(3)
MEAN = wp.constant(6)
RADIUS2 = wp.constant(9)
WEIGHT = wp.constant(10)
LEAST = wp.constant(11)
AXIS = wp.constant(12)
COS_CONE = wp.constant(15)
SIN_CONE = wp.constant(16)
DIRECTED = wp.constant(17)
TWO_SIDED = wp.constant(18)

# Horizons are lower by this share of what stands above them, so that rounding hides no light.
HORIZON_SLACK = wp.constant(1.0e-5)
# Under a square root or a fraction bar nothing is smaller.
TINY = wp.constant(1.0e-35)
# No child weighs less, and no child's row is 0.
LIGHTEST = wp.constant(5.0e-38)
# No estimate counts as more: the sum of eight is to be finite.
MOST = wp.constant(1.0e30)
FINE_STEP = wp.constant(2.0**-24)


@wp.struct
class LeafChoice:
    """A leaf of the tree, or -1; its probability; and the number that chose it, remapped to [0, 1), also with all its
    digits, as `left`."""

    leaf: int
    pmf: float
    u_remapped: float
    left: wp.float64


@wp.func
def mean_above(middle: vec8f, reach: vec8f) -> vec8f:
    """Means of max(t, 0) over t spread evenly from middle - reach to middle + reach; 0 only if all are below."""
    wide = max8(reach + wp.abs(middle) * HORIZON_SLACK, splat8(TINY))
    highest = max8(middle + wide, splat8(0.0))
    # Where the lowest is above 0 the mean is the middle, else the triangle's: highest^2 / (4 wide).
    return at_least(middle, wide, middle, wp.cw_div(wp.cw_mul(highest, highest), wide * 4.0))


@wp.func
def mean_over_ball(near: vec8f) -> vec8f:
    """Mean of (d^2 + r^2) / distance^2 over balls of radius r about points at distance d, to 11 %, without a division.

    near: r^2 / (d^2 + r^2). Fitted to (3 / 2n) (1 + (2n - 1) / (2 a b) ln((a + b) / |a - b|)), a^2 = n, b^2 = 1 - n.
    """
    square = wp.cw_mul(near, near)
    high = splat8(-243.2906) + near * 101.7384
    middle = splat8(-50.5114) + near * 188.1213
    low = splat8(0.8983) + near * 6.1847
    return low + wp.cw_mul(square, middle + wp.cw_mul(square, high))


@wp.func
def along(x: vec8f, y: vec8f, z: vec8f, n: wp.vec3) -> vec8f:
    return x * n[0] + y * n[1] + z * n[2]


@wp.func
def dots(ax: vec8f, ay: vec8f, az: vec8f, bx: vec8f, by: vec8f, bz: vec8f) -> vec8f:
    return wp.cw_mul(ax, bx) + wp.cw_mul(ay, by) + wp.cw_mul(az, bz)


@wp.func
def seen_under(tree: LightTreeView, row: int, middle: vec8f, d2: vec8f) -> vec8f:
    """Above 0 for children whose box reaches into the cone of directions that they emit in; `middle` is the box's
    middle along the cone's axis, as the receiver sees it, d2 its squared distance."""
    one = splat8(1.0)
    hx = tree.rows[row + HALF]
    hy = tree.rows[row + HALF + 1]
    hz = tree.rows[row + HALF + 2]
    r2 = dots(hx, hy, hz, hx, hy, hz)
    cos_cone = tree.rows[row + COS_CONE]
    cosine = wp.cw_div(-middle, square_roots(d2))
    sine = square_roots(max8(one - wp.cw_mul(cosine, cosine), splat8(0.0)))
    # The box is seen within the angle asin(r / d): is the cone's edge farther away than that?
    cos_apart = wp.cw_mul(cosine, cos_cone) + wp.cw_mul(sine, tree.rows[row + SIN_CONE])
    cos_box = square_roots(max8(one - wp.cw_div(r2, d2), splat8(0.0))) - one * HORIZON_SLACK
    inside = at_least(cosine, cos_cone, one, at_least(cos_apart, cos_box, one, splat8(0.0)))
    inside = at_least(r2, d2, one, inside)
    return at_least(splat8(-1.0), cos_cone, one, inside)


@wp.func
def emitted(tree: LightTreeView, row: int, middle: vec8f, inverse: vec8f) -> vec8f:
    """The children's intensity towards the receiver over that of bodies that show each of their sides alike."""
    hx = tree.rows[row + HALF]
    hy = tree.rows[row + HALF + 1]
    hz = tree.rows[row + HALF + 2]
    ax = tree.rows[row + AXIS]
    ay = tree.rows[row + AXIS + 1]
    az = tree.rows[row + AXIS + 2]
    reach = dots(hx, hy, hz, wp.abs(ax), wp.abs(ay), wp.abs(az))
    one = splat8(1.0)
    front = mean_above(-middle, reach)
    both = (front + mean_above(middle, reach)) * 0.5
    facing = at_least(tree.rows[row + TWO_SIDED], one, both, front)
    cosine = min8(wp.cw_mul(facing, inverse), one)
    return one + wp.cw_mul(tree.rows[row + DIRECTED], cosine * 4.0 - one)


@wp.func
def children_importance(tree: LightTreeView, node: int, r: wp.ref[Receiver], asks_response: bool) -> vec8f:
    """Estimated irradiances [luminance nit sr] of a node's children at r, times its response if that is asked for."""
    x = r.x
    n = r.n
    row = node * ROWS
    one = splat8(1.0)
    zero = splat8(0.0)
    dx = tree.rows[row + CENTER] - one * x[0]
    dy = tree.rows[row + CENTER + 1] - one * x[1]
    dz = tree.rows[row + CENTER + 2] - one * x[2]
    reach = along(tree.rows[row + HALF], tree.rows[row + HALF + 1], tree.rows[row + HALF + 2], wp.abs(n))
    above = mean_above(along(dx, dy, dz, n), reach)
    mx = tree.rows[row + MEAN] - one * x[0]
    my = tree.rows[row + MEAN + 1] - one * x[1]
    mz = tree.rows[row + MEAN + 2] - one * x[2]
    radius2 = tree.rows[row + RADIUS2]
    d2 = dots(mx, my, mz, mx, my, mz)
    size2 = max8(d2 + radius2, splat8(TINY))
    square = wp.cw_div(one, size2)
    inverse = square_roots(square)
    brought = wp.cw_mul(wp.cw_mul(tree.rows[row + WEIGHT], square), mean_over_ball(wp.cw_mul(radius2, square)))
    brought = wp.cw_mul(brought, min8(wp.cw_mul(above, inverse), one))
    # Of bodies that emit in all directions alike that is all.
    if any_above(tree.rows[row + COS_CONE], -1.0) or any_above(tree.rows[row + DIRECTED], 0.0):
        middle = dots(dx, dy, dz, tree.rows[row + AXIS], tree.rows[row + AXIS + 1], tree.rows[row + AXIS + 2])
        brought = wp.cw_mul(brought, emitted(tree, row, middle, inverse))
        seen = seen_under(tree, row, middle, max8(dots(dx, dy, dz, dx, dy, dz), splat8(TINY)))
        above = wp.cw_mul(above, seen)
    if asks_response:
        if is_glossy(r.response):
            extent2 = wp.cw_mul(radius2, square)
            wx, wy, wz = wp.cw_mul(mx, inverse), wp.cw_mul(my, inverse), wp.cw_mul(mz, inverse)
            brought = wp.cw_mul(brought, towards_eight(r.response, n, wx, wy, wz, extent2))
    # In this order, what is no number counts as least.
    return at_least(zero, above, zero, min8(max8(brought, tree.rows[row + LEAST]), splat8(MOST)))


def make_light_tree(features: Features) -> SimpleNamespace:
    """Functions of the tree: importances, choose_leaf, leaf_pmf; and of a part of it: descend, leaf_pmf_below."""

    @wp.func
    def importances(tree: LightTreeView, node: int, r: wp.ref[Receiver]) -> vec8f:
        """Of the node's children; 0 for those whose lights do not reach the receiver's prim."""
        found = children_importance(tree, node, r, wp.static(features.glossy_choice))
        if wp.static(features.light_links):
            for i in range(8):
                if (tree.links[8 * node + i] & r.links) == 0:
                    found[i] = 0.0
        if node > 0 and not any_above(found, 0.0):
            # The node's own box, cone or bits promised what none of its children has: whichever, it brings nothing.
            found = at_least(tree.rows[node * ROWS + WEIGHT], splat8(LIGHTEST), splat8(1.0), splat8(0.0))
        return found

    @wp.func
    def descend(tree: LightTreeView, r: wp.ref[Receiver], root: int, of_root: vec8f, u: wp.float64) -> LeafChoice:
        """A leaf below the node `root` by the number u; of_root: importances of its children, some above 0."""
        c = LeafChoice()
        c.pmf = 1.0
        left = u
        node = int(root)
        found = of_root
        while node >= 0:
            pick = pick_lane(found, left)
            left = wp.clamp(pick[1], wp.float64(0.0), wp.float64(1.0))
            c.pmf *= float(pick[2])
            node = tree.child_nodes[8 * node + int(pick[0])]
            if node >= 0:
                found = importances(tree, node, r)
        c.leaf = -1 - node
        c.left = left
        c.u_remapped = wp.clamp(float(left), 0.0, ONE_MINUS_EPSILON)
        return c

    @wp.func
    def choose_leaf(tree: LightTreeView, r: wp.ref[Receiver], of_root: vec8f, u: float) -> LeafChoice:
        """A light by the number u, whose last digits, which many turns use up, come from r.u_fine; leaf -1 where none
        brings anything. of_root: importances of the root's children."""
        if not any_above(of_root, 0.0):
            c = LeafChoice()
            c.leaf = -1
            c.pmf = 1.0
            return c
        left = wp.float64(u) + wp.float64(r.u_fine) * wp.float64(FINE_STEP)
        return descend(tree, r, 0, of_root, left)

    @wp.func
    def leaf_pmf_below(tree: LightTreeView, r: wp.ref[Receiver], root: int, leaf: int) -> float:
        """The probability with which `descend` takes the leaf."""
        pmf = float(1.0)
        path = tree.paths[leaf]
        node = int(root)
        while node >= 0:
            found = importances(tree, node, r)
            if not any_above(found, 0.0):
                return 0.0
            turn = int(path & wp.uint64(7))
            pmf *= share_of_lane(found, turn)
            path = path >> wp.uint64(3)
            node = tree.child_nodes[8 * node + turn]
        return pmf

    @wp.func
    def leaf_pmf(tree: LightTreeView, r: wp.ref[Receiver], leaf: int) -> float:
        """The probability with which choose_leaf takes the leaf."""
        return leaf_pmf_below(tree, r, 0, leaf)

    return SimpleNamespace(
        importances=importances,
        choose_leaf=choose_leaf,
        leaf_pmf=leaf_pmf,
        descend=descend,
        leaf_pmf_below=leaf_pmf_below,
    )
