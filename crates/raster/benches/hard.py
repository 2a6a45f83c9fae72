"""DEODR's hard rasterizer on the workloads W1 and W2, in one channel and in colour, for comparison on the same machine.

    pip install deodr==0.2.3 trimesh
    python crates/raster/benches/hard.py sphere_642.obj spot.obj

Image, squared difference to a disk, and gradient to the vertices of the image and to their colours, one thread:
what DEODR offers. Projection is left out here, so the comparison is in DEODR's favour.
"""

import statistics
import sys
import time

import numpy as np
from deodr.differentiable_renderer import Scene2D


def load(path):
    vertices, faces = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
            faces += [[corners[0], *pair] for pair in zip(corners[1:], corners[2:])]
    return np.array(vertices), np.array(faces, dtype=np.uint32)


def projected(vertices, azimuth, size):
    a = np.radians(azimuth)
    x = np.cos(a) * vertices[:, 0] + np.sin(a) * vertices[:, 2]
    depth = -np.sin(a) * vertices[:, 0] + np.cos(a) * vertices[:, 2] + 2.732
    zoom = 1 / np.tan(np.radians(30))
    ndc = np.stack([zoom * x / depth, -zoom * vertices[:, 1] / depth], 1)
    return (ndc + 1) * size / 2 - 0.5, depth


def scene(vertices, faces, azimuth, size, channels):
    ij, depth = projected(vertices, azimuth, size)
    clockwise = np.cross(ij[faces[:, 1]] - ij[faces[:, 0]], ij[faces[:, 2]] - ij[faces[:, 0]]) > 0
    # Where one side is drawn and edges between front and back are softened, as DEODR does for meshes.
    edges = {}
    for face, corners in enumerate(faces):
        for k in range(3):
            pair = tuple(sorted((corners[k], corners[(k + 1) % 3])))
            edges.setdefault(pair, []).append((face, k))
    edgeflags = np.zeros(faces.shape, dtype=bool)
    for sides in edges.values():
        front = [clockwise[face] for face, _ in sides]
        if len(set(front)) > 1 or len(sides) == 1:
            for face, k in sides:
                edgeflags[face, k] = clockwise[face]
    count = len(vertices)
    return Scene2D(
        faces=faces, faces_uv=faces, ij=ij, depths=depth, textured=np.zeros(len(faces), dtype=bool),
        uv=np.zeros((count, 2)), shade=np.zeros(count), colors=colours(count, channels),
        shaded=np.zeros(len(faces), dtype=bool), edgeflags=edgeflags, height=size, width=size,
        nb_colors=channels, texture=np.zeros((0, 0, channels)), background_image=np.zeros((size, size, channels)),
        clockwise=True, backface_culling=True,
    )


def colours(count, channels):
    """White, or in colour the waves of `blend.rs`."""
    if channels == 1:
        return np.ones((count, 1))
    return 0.5 + 0.5 * np.sin(0.1 * np.arange(count * channels)).reshape(count, channels)


def disk(size, channels):
    centres = (2 * np.arange(size) + 1 - size) / size
    inside = (centres[None, :] + 0.1) ** 2 + (-centres[:, None] - 0.05) ** 2 <= 0.25
    return inside[:, :, None].repeat(channels, 2).astype(float)


def measure(name, path, azimuths, size, channels=1):
    vertices, faces = load(path)
    scenes = [scene(vertices, faces, azimuth, size, channels) for azimuth in azimuths]
    target = disk(size, channels)
    times = []
    for _ in range(32):
        start = time.perf_counter()
        for one in scenes:
            image, _, _, _ = one.render_compare_and_backward(target)
        times.append(1e3 * (time.perf_counter() - start))
    print(f"{name}: {statistics.median(times):.2f} ms, coverage {image.mean():.4f}")


if __name__ == "__main__":
    sphere, spot = sys.argv[1:3]
    measure("W1", sphere, range(0, 360, 15), 64)
    measure("W2", spot, [180], 256)
    measure("W1 in colour", sphere, range(0, 360, 15), 64, 3)
    measure("W3: W2 in colour", spot, [180], 256, 3)
