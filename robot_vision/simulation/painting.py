# SPDX-License-Identifier: Apache-2.0
"""Colours an image row once it is known what each of its samples sees, compiled for the renderer."""

from __future__ import annotations

import math

import numpy as np

from robot_vision.simulation.packing import Lamps, Materials, Surfaces, Surroundings
from robot_vision.simulation.shading import Floats, Owners, Singles, compiled, mirrored, shade


@compiled
def _heaven(
    u: float, v: float, rays: Floats, turn: Floats, background: Floats, sky: Singles
) -> tuple[float, float, float]:
    """What is seen where no surface is: the sky above the horizon, the background below."""
    rows, columns = sky.shape[0], sky.shape[1]
    b, g, r = background[0], background[1], background[2]
    if rows == 0:
        return b, g, r
    dx = rays[0, 0] * u + rays[0, 1] * v + rays[0, 2]
    dy = rays[1, 0] * u + rays[1, 1] * v + rays[1, 2]
    x = turn[0, 0] * dx + turn[0, 1] * dy + turn[0, 2]
    y = turn[1, 0] * dx + turn[1, 1] * dy + turn[1, 2]
    z = turn[2, 0] * dx + turn[2, 1] * dy + turn[2, 2]
    above = min(max(z / rays[1, 1] + 0.5, 0.0), 1.0)  # share of the pixel above the horizon
    if above == 0:
        return b, g, r
    i = max(z, 0.0) / math.sqrt(x * x + y * y + z * z) * (rows - 1)
    j = (math.atan2(y, x) / (2 * math.pi) + 1) * columns
    i0, j0 = min(int(i), max(rows - 2, 0)), int(j)
    a, c = i - i0, j - j0
    i1, j0, j1 = min(i0 + 1, rows - 1), j0 % columns, (j0 + 1) % columns
    w00, w01 = above * (1 - a) * (1 - c), above * (1 - a) * c
    w10, w11 = above * a * (1 - c), above * a * c
    rest = 1 - above
    return (
        rest * b + w00 * sky[i0, j0, 0] + w01 * sky[i0, j1, 0] + w10 * sky[i1, j0, 0] + w11 * sky[i1, j1, 0],
        rest * g + w00 * sky[i0, j0, 1] + w01 * sky[i0, j1, 1] + w10 * sky[i1, j0, 1] + w11 * sky[i1, j1, 1],
        rest * r + w00 * sky[i0, j0, 2] + w01 * sky[i0, j1, 2] + w10 * sky[i1, j0, 2] + w11 * sky[i1, j1, 2],
    )


@compiled
def paint(
    row: int,
    owner: Owners,
    places: Floats,
    surfaces: Surfaces,
    materials: Materials,
    lamps: Lamps,
    around: Surroundings,
    line: Singles,
) -> None:
    """Colour an image row (W, 3): each surface a pixel sees is shaded once, in the middle of its samples.

    The arrays are taken out of their tuples once: a reference taken in each pixel costs more than its colour.
    """
    forms, windows, quad_textures, quad_lights = (
        surfaces.forms,
        surfaces.windows,
        surfaces.textures,
        surfaces.lights,
    )
    gloss, normals, mirror_of = surfaces.gloss, surfaces.normals, surfaces.mirror_of
    textures, mips, texels, lights = materials.textures, materials.mips, materials.texels, materials.lights
    mirrors, colours, sizes, roughness = lamps.mirrors, lamps.colours, lamps.sizes, lamps.roughness
    rays, turn, background, sky = around.rays, around.turn, around.background, around.sky
    extinction = around.extinction
    samples, width = owner.shape
    same = np.ones(width, np.uint8)
    for k in range(1, samples):
        for x in range(width):
            same[x] &= np.uint8(owner[k, x] == owner[0, x])
    numbers, counts = np.empty(samples, np.int32), np.empty(samples, np.int64)
    middles = np.empty((samples, 2))
    for x in range(width):
        blue = green = red = 0.0
        kinds = 1
        numbers[0], counts[0], middles[0, 0], middles[0, 1] = owner[0, x], samples, 0.0, 0.0
        if not same[x]:
            kinds = 0
            for k in range(samples):
                q, n = owner[k, x], 0
                while n < kinds and numbers[n] != q:
                    n += 1
                if n == kinds:
                    numbers[n], counts[n], middles[n, 0], middles[n, 1] = q, 0, 0.0, 0.0
                    kinds += 1
                counts[n] += 1
                middles[n, 0] += places[k, 0]
                middles[n, 1] += places[k, 1]
        for n in range(kinds):
            q, share = numbers[n], counts[n] / samples
            u, v = x + middles[n, 0] / counts[n], row + middles[n, 1] / counts[n]
            if q < 0:
                b, g, r = _heaven(u, v, rays, turn, background, sky)
                blue, green, red = blue + share * b, green + share * g, red + share * r
                continue
            b, g, r = shade(
                u, v, q, forms, windows, quad_textures, textures, mips, texels, quad_lights, lights
            )
            if mirror_of[q] >= 0 or extinction > 0:
                dx = rays[0, 0] * u + rays[0, 1] * v + rays[0, 2]
                dy = rays[1, 0] * u + rays[1, 1] * v + rays[1, 2]
                stretch = math.sqrt(dx * dx + dy * dy + 1)
                if mirror_of[q] >= 0:
                    cosine = abs(dx * normals[q, 0] + dy * normals[q, 1] + normals[q, 2]) / stretch
                    grazing = 1 - min(cosine, 1.0)
                    fresnel = gloss[q] * (1 + (0.6 / gloss[q] - 1) * grazing**5)
                    mb, mg, mr = mirrored(u, v, mirrors, mirror_of[q], colours, sizes, roughness)
                    b, g, r = b + fresnel * mb, g + fresnel * mg, r + fresnel * mr
                if extinction > 0:
                    depth = 1.0 / (forms[q, 2, 0] * u + forms[q, 2, 1] * v + forms[q, 2, 2])
                    left = math.exp(-extinction * depth * stretch)
                    b = left * b + (1 - left) * background[0]
                    g = left * g + (1 - left) * background[1]
                    r = left * r + (1 - left) * background[2]
            blue, green, red = blue + share * b, green + share * g, red + share * r
        line[x, 0] = blue
        line[x, 1] = green
        line[x, 2] = red
