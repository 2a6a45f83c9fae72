"""Pictures of normals for docs/studies/surfaces.md, and the error of a mesh, after Palfinger 2022: `star.py draw MESH OUT`, `star.py score TARGET RESULT`.

`draw` writes OUT/images, OUT/transforms.json and OUT/target.obj: 16 pictures of 512 x 512 of the mesh in the unit ball, from 10 units away, whose colours
are smooth normals and whose opacity is the coverage, by rays and not by softrast. `score` prints the root of the mean squared distance between the vertices
of either mesh and the surface of the other, and whether the result is closed and consistently wound. Both need `pip install numpy pillow trimesh rtree embreex`.
"""

import json
import math
import pathlib
import sys

import numpy as np
import trimesh
from PIL import Image

# Pixels, samples a side of a pixel, units, widths of the picture. A full ball would lose a pixel at each side.
SIZE, SAMPLES, AWAY, FOCAL = 512, 2, 10.0, 5.0


def cameras():
    """Camera to world, y up and z behind the camera: four azimuths, four elevations of 36 degrees and their mirror images."""
    for azimuth in np.radians([0, 90, 180, 270]):
        for elevation in np.radians([-54, -18, 18, 54]):
            behind = np.array([-math.cos(elevation) * math.sin(azimuth), -math.sin(elevation), math.cos(elevation) * math.cos(azimuth)])
            right = np.array([math.cos(azimuth), 0, math.sin(azimuth)])
            pose = np.eye(4)
            pose[:3] = np.stack([right, np.cross(behind, right), behind, AWAY * behind], 1)
            yield pose


def picture(mesh, pose):
    """Normals as colours, and coverage `[SIZE, SIZE, 4]`."""
    count = SIZE * SAMPLES
    x, y = np.meshgrid(*2 * [((np.arange(count) + 0.5) / count - 0.5) / FOCAL])
    rays = np.stack([x, -y, -np.ones_like(x)], -1).reshape(-1, 3) @ pose[:3, :3].T
    face = mesh.ray.intersects_first(np.broadcast_to(pose[:3, 3], rays.shape), rays)
    hit = np.flatnonzero(face >= 0)
    corners = mesh.triangles[face[hit]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    far = ((corners[:, 0] - pose[:3, 3]) * across).sum(1) / (rays[hit] * across).sum(1)
    places = trimesh.triangles.points_to_barycentric(corners, pose[:3, 3] + far[:, None] * rays[hit])
    normals = trimesh.unitize((mesh.vertex_normals[mesh.faces[face[hit]]] * places[..., None]).sum(1))
    samples = np.zeros((count * count, 4))
    samples[hit, :3], samples[hit, 3] = (normals + 1) / 2, 1
    pixels = samples.reshape(SIZE, SAMPLES, SIZE, SAMPLES, 4).mean((1, 3))
    pixels[..., :3] /= np.maximum(pixels[..., 3:], 1e-9)
    return pixels


def draw(path, out):
    mesh = trimesh.load(path, force="mesh")
    mesh.vertices -= mesh.bounds.mean(0)
    mesh.vertices /= np.linalg.norm(mesh.vertices, axis=1).max()
    (out / "images").mkdir(parents=True, exist_ok=True)
    mesh.export(out / "target.obj", include_normals=False)
    frames = []
    for k, pose in enumerate(cameras()):
        name = f"images/{k:02}.png"
        Image.fromarray((picture(mesh, pose) * 255 + 0.5).astype(np.uint8), "RGBA").save(out / name)
        frames.append({"file_path": name, "transform_matrix": pose.tolist()})
    lens = {"fl_x": FOCAL * SIZE, "fl_y": FOCAL * SIZE, "cx": SIZE / 2, "cy": SIZE / 2, "w": SIZE, "h": SIZE}
    (out / "transforms.json").write_text(json.dumps({**lens, "frames": frames}, indent=1))


def score(*paths):
    pair = [trimesh.load(path, force="mesh", process=False) for path in paths]
    squares = [(trimesh.proximity.closest_point(of, to.vertices)[1] ** 2).mean() for of, to in (pair, pair[::-1])]
    found = pair[1]
    print(f"error {math.sqrt(sum(squares) / 2):.5f}, {len(found.faces)} faces, closed: {found.is_watertight}, consistent: {found.is_winding_consistent}")
    print(f"faces of zero area: {(found.area_faces == 0).sum()}, Euler number {found.euler_number}")


if __name__ == "__main__":
    {"draw": draw, "score": score}[sys.argv[1]](*map(pathlib.Path, sys.argv[2:]))
