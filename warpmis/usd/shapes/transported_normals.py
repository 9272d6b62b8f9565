"""Frames along curves that do not twist: the normal is turned from sample to sample by the smallest rotation."""

from __future__ import annotations

import numpy as np

from warpmis.usd.shapes.surfaces import FloatArray, IntArray


def transported_normals(tangents: FloatArray, first: IntArray, following: IntArray) -> FloatArray:
    """A unit normal at every sample, shape (s, 3), parallel along each curve as far as that is possible.

    On a closed curve what is left of the turn after one round is spread over its samples.

    Args:
        tangents: unit tangents, curve after curve, shape (s, 3).
        first: the first sample of each sample's curve, shape (s,).
        following: the sample after, the first again at the end of a closed curve, -1 at an open end, shape (s,).
    """
    samples = np.arange(len(tangents))
    place = samples - first
    rotations = _smallest_rotations(tangents[np.maximum(samples - 1, 0)], tangents)
    rotations[place == 0] = [1.0, 0.0, 0.0, 0.0]
    distance = 1
    while distance <= place.max(initial=0):  # a running product, in as many steps as the length has binary digits
        ahead = np.flatnonzero(place >= distance)
        rotations[ahead] = _product(rotations[ahead], rotations[ahead - distance])
        distance *= 2
    normals = _rotated(_perpendicular(tangents[first]), rotations)
    closing = np.flatnonzero((following == first) & (following >= 0))
    if len(closing):
        normals = _closed(normals, tangents, first, place, closing)
    return normals


def _closed(
    normals: FloatArray, tangents: FloatArray, first: IntArray, place: IntArray, closing: IntArray
) -> FloatArray:
    """The normals turned about their tangents so that each closed curve's round ends as it begins."""
    begin = first[closing]
    arrived = _rotated(normals[closing], _smallest_rotations(tangents[closing], tangents[begin]))
    sine = np.einsum("ij,ij->i", np.cross(normals[begin], arrived), tangents[begin])
    excess, size = np.zeros(len(normals)), np.ones(len(normals))
    excess[begin] = np.arctan2(sine, np.einsum("ij,ij->i", normals[begin], arrived))
    size[begin] = place[closing] + 1
    angle = -(excess[first] * place / size[first])[:, None]
    return np.cos(angle) * normals + np.sin(angle) * np.cross(tangents, normals)


def _perpendicular(vectors: FloatArray) -> FloatArray:
    """A unit vector at a right angle to each, shape (n, 3)."""
    axis = np.eye(3)[np.argmin(np.abs(vectors), axis=1)]
    return unit(np.cross(vectors, axis))


def _smallest_rotations(begin: FloatArray, end: FloatArray) -> FloatArray:
    """Quaternions (w, x, y, z) that turn unit vectors into others, shape (n, 4)."""
    w = 1.0 + np.einsum("ij,ij->i", begin, end)
    rotations = np.concatenate([w[:, None], np.cross(begin, end)], axis=1)
    opposite = w < 1e-9
    rotations[opposite, 0] = 0.0
    rotations[opposite, 1:] = _perpendicular(begin[opposite])
    return unit(rotations)


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    """The rotations q and then p."""
    w = p[:, 0] * q[:, 0] - np.einsum("ij,ij->i", p[:, 1:], q[:, 1:])
    xyz = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return unit(np.concatenate([w[:, None], xyz], axis=1))


def _rotated(vectors: FloatArray, rotations: FloatArray) -> FloatArray:
    double = 2.0 * np.cross(rotations[:, 1:], vectors)
    return vectors + rotations[:, :1] * double + np.cross(rotations[:, 1:], double)


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors of length 1; zero ones stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
