"""Draws docs/guide/python.png with the Python package, NumPy and Pillow: python3 docs/guide/python.py"""

import pathlib

import numpy as np
import softrast
from PIL import Image

SIZE, GAP = 200, 8
SCALES = [0.002, 0.01, 0.04]  # in NDC

positions, faces, _ = softrast.fox()


def silhouette(scale, azimuth):
    renderer = softrast.Renderer(faces, SIZE, softrast.Softness("logistic", scale))
    return softrast.silhouette(renderer, softrast.project(positions, softrast.orbit(2.6, 15.0, azimuth)))[0]


def grey(alpha):
    return np.repeat(255 - 228 * alpha[..., None], 3, axis=2)


def signed(change):
    """White at 0, blue where the coverage rises, orange where it falls."""
    share = np.clip(change / np.abs(change).max(), -1, 1)[..., None]
    ends = np.where(share > 0, [37, 99, 235], [194, 88, 10])
    return 255 + np.sqrt(np.abs(share)) * (ends - 255)


# The derivative with respect to the azimuth, by central differences.
turned = (silhouette(SCALES[1], 60.5) - silhouette(SCALES[1], 59.5)).astype(float)
panels = [grey(silhouette(scale, 60.0)) for scale in SCALES] + [signed(turned)]
gap = np.full((SIZE, GAP, 3), 255.0)
row = np.hstack([part for panel in panels for part in (panel, gap)][:-1])
Image.fromarray(row.round().astype(np.uint8)).save(pathlib.Path(__file__).with_suffix(".png"), optimize=True)
