"""A step of an optimisation, float32: projection, image, mean squared difference, gradient to the vertices.

`python bindings/python/benches/steps.py [--mesh W2_MESH.obj] [--rust target/release/examples/step] [--torch-loss]`, in an environment with the wheel and torch.

Image and loss are two ops (`st.silhouette`, `st.mse_loss`; with `--torch-loss` the loss is by ops of torch) or one (`st.silhouette_loss`). W1 is a
sphere of 1,280 faces in 24 views of 64 x 64; with a mesh it is W2, one view of 256 x 256. With the path of the example `step` both steps in Rust
are timed in turn with ours, so that all have the same neighbours on the machine; else, beside W1, the published formula
`1 - prod(1 - sigmoid(-dists / sigma))` in plain torch ops, over all pairs of pixel and face. The last lines are of the same steps under
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
parser.add_argument("--torch-loss", action="store_true")
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


def two_ops(vertices):
    image = st.silhouette(renderer, st.project(vertices, cameras))
    return ((image - target).pow(2) if given.torch_loss else st.mse_loss(image, target)).mean()


def one_op(vertices):
    return st.silhouette_loss(renderer, st.project(vertices, cameras), target).mean()


def step(loss):
    vertices.grad = None
    loss(vertices).backward()


def compare_compiled(name, loss):
    start, compiled = time.perf_counter(), torch.compile(loss, fullgraph=True)
    step(compiled)
    spent = time.perf_counter() - start
    ratios = [median(lambda: step(compiled), 100) / median(lambda: step(loss), 100) for _ in range(7)]
    print(f"{name}, compiled in {spent:.1f} s; ratio to eager mode, round by round:", *(f"{ratio:.2f}" for ratio in ratios))


def theirs_of_one_view():
    vertices.grad = None
    image = formula(st.project(vertices, cameras[:1])[0], corners)
    (image - target[0]).pow(2).mean().backward()


losses = {"two ops": two_ops, "one op": one_op}
for loss in losses.values():
    median(lambda: step(loss), 20)
rounds, rust = [], given.rust and [given.rust, *([given.mesh] if given.mesh else [])]
for _ in range(7 if rust else 1):
    theirs = subprocess.run(rust, stdout=subprocess.PIPE, text=True, check=True).stdout if rust else ""
    ours = [1e3 * median(lambda: step(loss), 200) for loss in losses.values()]
    rounds.append([*ours, *map(float, theirs.split())])
medians = np.median(rounds, 0)
for k, name in enumerate(losses):
    print(f"{name}: {medians[k]:.2f} ms")
    if rust:
        print(f"  Rust {medians[k + 2]:.2f} ms; ratio, round by round:", *(f"{times[k] / times[k + 2]:.2f}" for times in rounds))
if not rust and not given.mesh:
    with torch.no_grad():
        seen = st.project(vertices, cameras[:1])
        difference = (st.silhouette(renderer, seen)[0] - formula(seen[0], corners)).abs().max()
    print(f"largest difference of a pixel {difference:.1e}")
    plain = VIEWS * median(theirs_of_one_view, 2)
    print(f"the formula in torch ops, 24 times one view, {plain:.1f} s; ratio {1e3 * plain / medians[0]:.0f}")
for name, loss in losses.items():
    compare_compiled(name, loss)
