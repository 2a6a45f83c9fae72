"""Times a step of softrast or of another rasterizer: image, squared error to a disk, gradient to the world vertices, in float32 (deodr in float64).

    python docs/studies/rivals.py CODE [--spot FILE.obj] [--colour] [--device cpu|cuda] [--threads N] [--steps N] [--warm-up N]

CODE is softrast, pytorch3d, drtk, deodr, gendr, softras, metaras or nvdiffrast. Every code needs torch and the wheel of softrast, which has the scenes.
W1 is a sphere of 1,280 faces in 24 views of 64 x 64 pixels; W2 is the mesh spot of 5,856 faces (`--spot`) in one view of 256 x 256 pixels.
Both have a camera at a distance of 2.732 with a field of view of 60 degrees, and a logistic of the squared distance with sigma 1e-4 where the edge is soft.
The output is one row of a Markdown table for each variant of the code: code and machine, median ms on W1 and W2, mean of the images of W1 and W2.

Soft images of one scene have one mean: softrast, pytorch3d, gendr, softras and metaras with a logistic. deodr, drtk and nvdiffrast show hard edges, which
deodr and nvdiffrast antialias. Settings of pytorch3d are those of its tutorial `fit_textured_mesh`, those of gendr and metaras of their experiments on shapes.

With `--colour`, which softrast, drtk and deodr have, every vertex has three channels, and the gradient is that to vertices and colours.

softrast, deodr, pytorch3d and drtk have been run by this script, on a CPU; gendr, softras, metaras and nvdiffrast need CUDA and have not been.
On a CPU pytorch3d takes half a minute for a step: `--steps 1 --warm-up 0`.
"""

import argparse
import importlib.metadata
import math
import os
import statistics
import sys
import time
from dataclasses import dataclass

import numpy as np
import torch

DISTANCE, FOV = 2.732, 60.0
SIGMA = 1e-4
DISK = (0.1, 0.05, 0.5)
# A near and a far depth around the meshes.
PLANES = (1.7, 3.8)


@dataclass
class Scene:
    positions: torch.Tensor  # [V, 3]
    faces: torch.Tensor  # [F, 3], int64
    azimuths: torch.Tensor  # [views], degrees; at 0 the camera is at -z and +x is on its left
    size: int
    colours: torch.Tensor | None = None  # [V, 3] in [0, 1]

    @property
    def views(self):
        return len(self.azimuths)


def disk(size):
    """1 at the centres of pixels in the disk, else 0: `[size, size]`, rows from the top."""
    centres = (2 * torch.arange(size) + 1 - size) / size
    x, y, radius = DISK
    return ((centres[None, :] - x) ** 2 + (-centres[:, None] - y) ** 2 <= radius**2).float()


def seen(vertices, scene):
    """x to the right and y upwards in NDC, and depth, each `[views, V]`."""
    angles = torch.deg2rad(scene.azimuths)[:, None]
    x, y, z = vertices.unbind(-1)
    depth = angles.cos() * z - angles.sin() * x + DISTANCE
    zoom = 1 / math.tan(math.radians(FOV / 2))
    return -zoom * (angles.cos() * x + angles.sin() * z) / depth, zoom * y / depth, depth


def in_pixels(vertices, scene):
    """Column, row and depth, `[views, V, 3]`; (0, 0) is the centre of the top left pixel."""
    x, y, depth = seen(vertices, scene)
    return torch.stack([(x + 1) * scene.size / 2 - 0.5, (1 - y) * scene.size / 2 - 0.5, depth], -1)


def squared_error(image, target):
    return (image - target).square().mean()


# A function for each code: from a scene to variants by name, each a function from vertices [V, 3] to the image [views, size, size], and one from
# image and target to the loss. In colour the image is [views, size, size, 3], or [views, 3, size, size] with a loss of its own.


def softrast(scene):
    import softrast
    import softrast.torch as st

    renderer = softrast.Renderer(scene.faces.numpy(), scene.size, softrast.Softness("logistic", SIGMA, squared=True))
    cameras = torch.from_numpy(softrast.orbit(DISTANCE, 0.0, scene.azimuths.numpy(), FOV)).float()
    seen = lambda vertices: st.project(vertices, cameras)
    if scene.colours is not None:
        softness = softrast.Softness("logistic", SIGMA, squared=True)

        def drawing(culls):
            renderer = softrast.ColourRenderer(scene.faces.numpy(), scene.size, softness, PLANES, cull_back_faces=culls)
            return lambda vertices: st.blend(renderer, seen(vertices), scene.colours)[:, :3]

        loss = lambda image, target: squared_error(image, target.movedim(-1, 1))
        return {"all faces": (drawing(False), loss), "front faces": (drawing(True), loss)}
    return {
        "one op": (seen, lambda corners, target: st.silhouette_loss(renderer, corners, target).mean()),
        "two ops": (lambda vertices: st.silhouette(renderer, seen(vertices)), lambda image, target: st.mse_loss(image, target).mean()),
    }


def pytorch3d(scene):
    from pytorch3d import renderer as pr
    from pytorch3d.structures import Meshes

    device = scene.positions.device
    rotations, translations = pr.look_at_view_transform(DISTANCE, 0.0, 180.0 - scene.azimuths, device=device)
    settings = pr.RasterizationSettings(image_size=scene.size, blur_radius=math.log(1 / 1e-4 - 1) * SIGMA, faces_per_pixel=50)
    cameras = pr.FoVPerspectiveCameras(R=rotations, T=translations, fov=FOV, device=device)
    renderer = pr.MeshRenderer(pr.MeshRasterizer(cameras, settings), pr.SoftSilhouetteShader(pr.BlendParams(sigma=SIGMA)))
    meshes = Meshes([scene.positions], [scene.faces]).extend(scene.views)
    return {"": (lambda vertices: renderer(meshes.update_padded(vertices.expand(scene.views, -1, -1)))[..., 3], squared_error)}


def drtk(scene):
    import drtk

    faces = scene.faces.int()

    def image(vertices):
        corners = in_pixels(vertices, scene)
        index = drtk.rasterize(corners, faces, scene.size, scene.size)
        _, barycentric = drtk.render(corners, faces, index)
        covered = (index != -1).float()[:, None]
        if scene.colours is not None:
            covered = covered * drtk.interpolate(scene.colours.expand(scene.views, -1, -1), faces, index, barycentric)
        image = drtk.edge_grad_estimator(corners, faces, barycentric, covered, index)
        return image[:, 0] if scene.colours is None else image.movedim(1, -1)

    return {"": (image, squared_error)}


def deodr(scene):
    from deodr.differentiable_renderer import Scene2D
    from deodr.triangulated_mesh import TriMeshAdjacencies

    count, faces = len(scene.positions), scene.faces.numpy().astype(np.uint32)
    adjacencies = TriMeshAdjacencies(faces)
    nothing = np.zeros(len(faces), dtype=bool)

    def plane(corners, colours):
        places, channels = np.ascontiguousarray(corners[:, :2]), colours.shape[1]
        return Scene2D(
            faces=faces, faces_uv=faces, ij=places, depths=np.ascontiguousarray(corners[:, 2]), textured=nothing, shaded=nothing,
            uv=np.zeros((count, 2)), shade=np.zeros(count), colors=colours, edgeflags=adjacencies.edge_on_silhouette(places),
            height=scene.size, width=scene.size, nb_colors=channels, texture=np.zeros((0, 0, channels)),
            background_image=np.zeros((scene.size, scene.size, channels)), backface_culling=True,
        )

    class Render(torch.autograd.Function):
        @staticmethod
        def forward(ctx, corners, colours):
            ctx.planes = [plane(view, colours.double().numpy()) for view in corners.double().numpy()]
            return torch.from_numpy(np.stack([each.render()[0] for each in ctx.planes])).float()

        @staticmethod
        def backward(ctx, by_image):
            for each, upstream in zip(ctx.planes, by_image.double().numpy()):
                each.render_backward(np.ascontiguousarray(upstream), make_copies=False)
            by_places = torch.from_numpy(np.stack([each.ij_b for each in ctx.planes])).float()
            by_colours = torch.from_numpy(sum(each.colors_b for each in ctx.planes)).float()
            return torch.nn.functional.pad(by_places, (0, 1)), by_colours

    def image(vertices):
        colours = torch.ones(count, 1) if scene.colours is None else scene.colours
        found = Render.apply(in_pixels(vertices, scene), colours)
        return found[..., 0] if scene.colours is None else found

    return {"": (image, squared_error)}


def mirrored(image, target):
    """SoftRas and the codes made from it see +x on the right."""
    return squared_error(image, target.flip(-1))


def eyes(scene, camera):
    zeros = torch.zeros_like(scene.azimuths)
    camera.set_eyes_from_angles(zeros + DISTANCE, zeros, scene.azimuths)
    return camera


def generalized(library, scene, variants):
    """GenDR or MetaRas, which is made from it, for renderers by name."""
    camera = eyes(scene, library.LookAt(viewing_angle=FOV / 2))
    faces = scene.faces.int().expand(scene.views, -1, -1).contiguous()

    def drawing(renderer):
        return lambda vertices: renderer(camera(library.Mesh(vertices.repeat(scene.views, 1, 1), faces)))[:, 3]

    return {name: (drawing(renderer), mirrored) for name, renderer in variants.items()}


GENERALIZED = {"dist_shape": 0.0, "dist_shift": 0.0, "dist_eps": 100, "aggr_alpha_func": "probabilistic", "aggr_alpha_t_conorm_p": 0.0, "aggr_rgb_func": "hard"}


def gendr(scene):
    import gendr

    return generalized(gendr, scene, {"": gendr.GenDR(scene.size, dist_func="logistic", dist_scale=SIGMA, dist_squared=True, **GENERALIZED)})


def metaras(scene):
    import metaras

    device = scene.positions.device
    # Its scales are decimal logarithms; both must be tensors, since its backward pass returns a gradient for each.
    scales = {"dist_scale": torch.tensor([math.log10(SIGMA)], device=device), "dist_scale_rgb": torch.tensor([-2.0], device=device)}
    settings = {**scales, "dist_squared": True, **GENERALIZED}
    weights = {f"w{k}": torch.nn.Parameter(torch.rand(n, device=device)) for k, n in enumerate((4, 16, 16, 16, 4), 1)}
    network = metaras.MetaRas(scene.size, dist_func="mlp", **settings, **weights)
    return generalized(metaras, scene, {"logistic": metaras.MetaRas(scene.size, dist_func="logistic", **settings), "network": network})


def softras(scene):
    import soft_renderer as sr

    renderer = sr.SoftRenderer(scene.size, camera_mode="look_at", viewing_angle=FOV / 2, sigma_val=SIGMA, aggr_func_rgb="hard")
    eyes(scene, renderer.transform)
    faces = scene.faces.int().expand(scene.views, -1, -1).contiguous()
    return {"": (lambda vertices: renderer(vertices.repeat(scene.views, 1, 1), faces)[:, 3], mirrored)}


def nvdiffrast(scene):
    import nvdiffrast.torch as dr

    context, faces, size = dr.RasterizeCudaContext(), scene.faces.int(), (scene.size, scene.size)
    topology = dr.antialias_construct_topology_hash(faces)

    def image(vertices):
        x, y, depth = seen(vertices, scene)
        z = 1.02 * depth - 0.202  # near plane at 0.1, far plane at 10
        # nvdiffrast has rows from the bottom: -y has them from the top.
        clip = torch.stack([x * depth, -y * depth, z, depth], -1).contiguous()
        # The mask has no gradient but that of antialiasing.
        found = dr.rasterize(context, clip, faces, size)[0].detach()
        return dr.antialias((found[..., 3:] > 0).float(), found, clip, faces, topology_hash=topology)[..., 0]

    return {"": (image, squared_error)}


# Codes with images in colour.
COLOURED = ["softrast", "drtk", "deodr"]

# The function, the name of the distribution, the devices, and how to install the code.
CODES = {
    "softrast": (softrast, "softrast", ["cpu"], "maturin build --release --manifest-path bindings/python/Cargo.toml --out wheels && pip install wheels/softrast-*.whl"),
    "pytorch3d": (pytorch3d, "pytorch3d", ["cpu", "cuda"], "pip install --no-build-isolation git+https://github.com/facebookresearch/pytorch3d"),
    "drtk": (drtk, "drtk", ["cpu", "cuda"], "pip install --no-build-isolation git+https://github.com/facebookresearch/DRTK (the package drtk on PyPI is another)"),
    "deodr": (deodr, "deodr", ["cpu"], "pip install deodr==0.2.3 trimesh"),
    "gendr": (gendr, "gendr", ["cuda"], "pip install --no-build-isolation git+https://github.com/Felix-Petersen/gendr"),
    "softras": (softras, "soft_renderer", ["cuda"], "pip install --no-build-isolation git+https://github.com/ShichenLiu/SoftRas"),
    "metaras": (metaras, "metaras", ["cuda"], "pip install --no-build-isolation git+https://github.com/Theo-Wu/MetaRas"),
    "nvdiffrast": (nvdiffrast, "nvdiffrast", ["cuda"], "pip install --no-build-isolation git+https://github.com/NVlabs/nvdiffrast"),
}


def measure(draw, loss, scene, steps, warm_up=3):
    """Median ms of a step, and the mean of the image; not a number where the image stays inside an op."""
    vertices = scene.positions.clone().requires_grad_()
    target = disk(scene.size).to(vertices.device).repeat(scene.views, 1, 1)
    inputs = [vertices]
    if scene.colours is not None:
        target = target[..., None].expand(-1, -1, -1, 3)
        inputs.append(scene.colours)
    times = []
    for _ in range(warm_up + steps):
        for x in inputs:
            x.grad = None
        start = time.perf_counter()
        image = draw(vertices)
        loss(image, target).backward()
        if vertices.is_cuda:
            torch.cuda.synchronize()
        times.append(1e3 * (time.perf_counter() - start))
    if not all(x.grad.isfinite().all() and x.grad.abs().sum() > 0 for x in inputs):
        sys.exit("a gradient is not finite or is zero")
    return statistics.median(times[-steps:]), image.mean().item() if image.shape[1] in (3, scene.size) else math.nan


def machine(device, threads):
    if device == "cuda":
        return torch.cuda.get_device_name()
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown CPU")
    return f"{threads} thread{'s' * (threads > 1)} of {model}, load {os.getloadavg()[0]:.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("code", choices=CODES)
    parser.add_argument("--spot", metavar="FILE.obj", help="the mesh of W2; without it W1 alone is timed")
    parser.add_argument("--colour", action="store_true", help="an image in three channels")
    parser.add_argument("--device", choices=["cpu", "cuda"], help="default: the one where the code runs, the CPU if both do")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--warm-up", type=int, default=10, help="steps before those that are timed")
    given = parser.parse_args()
    build, distribution, devices, install = CODES[given.code]
    device = given.device or devices[0]
    if device not in devices:
        parser.error(f"{given.code} does not run on {device}")
    if given.colour and given.code not in COLOURED:
        parser.error(f"{given.code} is not drawn in colour here, but {', '.join(COLOURED)}")
    if given.threads < 1 or given.steps < 1 or given.warm_up < 0:
        parser.error("--threads and --steps start at 1, --warm-up at 0")
    os.environ["RAYON_NUM_THREADS"] = str(given.threads)
    torch.set_num_threads(given.threads)
    torch.manual_seed(0)
    try:
        from softrast import icosphere, load_mesh
    except ImportError as error:
        sys.exit(f"{error}; install it: {CODES['softrast'][3]}")
    if device == "cuda" and not torch.cuda.is_available():
        sys.exit(f"torch finds no CUDA device, and {given.code} needs one here")

    meshes = [(icosphere(3), 15.0 * torch.arange(24), 64), *([(load_mesh(given.spot), torch.tensor([180.0]), 256)] if given.spot else [])]
    results = {}
    for (positions, faces, _), azimuths, size in meshes:
        scene = Scene(torch.from_numpy(positions).float().to(device), torch.from_numpy(faces).long().to(device), azimuths.to(device), size)
        if given.colour:
            waves = 0.5 + 0.5 * torch.sin(0.1 * torch.arange(3 * len(positions))).reshape(-1, 3)
            scene.colours = waves.to(device).requires_grad_()
        try:
            variants = build(scene)
        except ImportError as error:
            sys.exit(f"{error}; install {given.code}: {install}")
        for name, (draw, loss) in variants.items():
            results.setdefault(name, []).append(measure(draw, loss, scene, given.steps, given.warm_up))
    try:
        version = importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        version = ""
    for name, cells in results.items():
        words = " ".join(filter(None, [given.code, version, name]))
        print(f"| {words}, {machine(device, given.threads)} | {', '.join(f'{ms:.2f}' for ms, _ in cells)} | {', '.join(f'{mean:.4f}' for _, mean in cells)} |")


if __name__ == "__main__":
    main()
