"""A step of an optimisation, float32: projection, image, mean squared difference (by `st.mse_loss`, or by ops of torch), gradient to the vertices.

`python bindings/python/benches/steps.py [--mesh W2_MESH.obj] [--rust target/release/examples/step] [--loss torch]`, in an environment with the wheel and torch.

W1 is a sphere of 1,280 faces in 24 views of 64 x 64; with a mesh it is W2, one view of 256 x 256. With the path of the example `step` the step
in Rust is timed in turn with ours, so that both have the same neighbours on the machine; else, beside W1, the published formula
`1 - prod(1 - sigmoid(-dists / sigma))` in plain torch ops, over all pairs of pixel and face. The last line is of the same step under
`torch.compile(fullgraph=True)`, in turn with eager mode.
"""

import argparse
import subprocess
import time

import numpy as np
import torch

import softrast
import softrast.torch as st

parser = argparse.ArgumentParser()
parser.add_argument("--mesh")
parser.add_argument("--rust")
parser.add_argument("--loss", choices=["softrast", "torch"], default="softrast")
given = parser.parse_args()

SIGMA = 1e-4
SIZE, VIEWS, AZIMUTH = (256, 1, 180.0) if given.mesh else (64, 24, 0.0)


def formula(seen, faces):
    """Silhouette `[64, 64]` of one view `[V, 3]`, by every pixel and face."""
    places = (2 * torch.arange(SIZE) + 1 - SIZE) / SIZE
    y, x = torch.meshgrid(-places, places, indexing="ij")
    pixels = torch.stack([x, y], -1).reshape(-1, 1, 2).to(seen)
    corners = seen[faces][..., :2]
    nearest, sides = None, []
    for k in range(3):
        start, along = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        off = pixels - start
        t = ((off * along).sum(-1) / (along * along).sum(-1).clamp_min(1e-12)).clamp(0, 1)
        squared = (off - t[..., None] * along).pow(2).sum(-1)
        nearest = squared if nearest is None else torch.minimum(nearest, squared)
        sides.append(along[:, 0] * off[..., 1] - along[:, 1] * off[..., 0] > 0)
    inside = (sides[0] == sides[1]) & (sides[1] == sides[2])
    outside = torch.where(inside, -nearest, nearest)
    return 1 - (1 - torch.sigmoid(-outside / SIGMA)).prod(-1).reshape(SIZE, SIZE)


def median(step, repetitions):
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        step()
        times.append(time.perf_counter() - start)
    return np.median(times)


positions, faces, _ = softrast.load_mesh(given.mesh) if given.mesh else softrast.icosphere(3)
cameras = torch.from_numpy(softrast.orbit(2.732, 0.0, AZIMUTH + np.arange(VIEWS) * 15.0)).float()
vertices = torch.from_numpy(positions).float()[None].requires_grad_()
renderer = softrast.Renderer(faces, SIZE, softrast.Softness("logistic", SIGMA, squared=True))
corners = torch.from_numpy(faces)
target = torch.zeros(VIEWS, SIZE, SIZE)


def loss(vertices):
    image = st.silhouette(renderer, st.project(vertices, cameras))
    return (st.mse_loss(image, target) if given.loss == "softrast" else (image - target).pow(2)).mean()


def ours():
    vertices.grad = None
    loss(vertices).backward()


def compare_compiled():
    start, compiled = time.perf_counter(), torch.compile(loss, fullgraph=True)

    def step():
        vertices.grad = None
        compiled(vertices).backward()

    step()
    spent = time.perf_counter() - start
    ratios = [median(step, 100) / median(ours, 100) for _ in range(7)]
    print(f"compiled in {spent:.1f} s; ratio to eager mode, round by round:", *(f"{ratio:.2f}" for ratio in ratios))


def theirs_of_one_view():
    vertices.grad = None
    image = formula(st.project(vertices, cameras[:1])[0], corners)
    (image - target[0]).pow(2).mean().backward()


median(ours, 20)
rounds = []
rust = [given.rust, *([given.mesh] if given.mesh else [])] if given.rust else None
for _ in range(7 if rust else 1):
    theirs = rust and float(subprocess.run(rust, stdout=subprocess.PIPE, text=True, check=True).stdout.split()[1])
    rounds.append((1e3 * median(ours, 200), theirs))
steps = [step for step, _ in rounds]
print(f"softrast {np.median(steps):.2f} ms")
if rust:
    print("Rust {:.2f} ms; ratio, round by round:".format(np.median([theirs for _, theirs in rounds])), *(f"{a / b:.2f}" for a, b in rounds))
elif not given.mesh:
    with torch.no_grad():
        seen = st.project(vertices, cameras[:1])
        difference = (st.silhouette(renderer, seen)[0] - formula(seen[0], corners)).abs().max()
    print(f"largest difference of a pixel {difference:.1e}")
    plain = VIEWS * median(theirs_of_one_view, 2)
    print(f"the formula in torch ops, 24 times one view, {plain:.1f} s; ratio {1e3 * plain / np.median(steps):.0f}")
compare_compiled()
