"""Counts the cameras that the program `pose` finds from masks of meshes.

    cargo build --release -p pose
    python docs/studies/poses.py MESH.obj..
    python docs/studies/poses.py MESH.obj --kinds clean specks1 specks5 gap polygon all side corner
    python docs/studies/poses.py MESH.ply --views VIEWS --colour

Each mesh has 24 masks of 200 x 150 pixels, drawn by NumPy with 4 x 4 samples a pixel. The cameras lie all around the mesh and look near its middle, from
jittered distances and with jittered rolls; the principal point is off the middle of the picture. `pose` has the mesh, the masks and the lens, and no start.
*First* counts rotations within 5 degrees of the truth; *found* also masks with an IoU of at least 0.97 where an alternative is within 5 degrees.
Rotations that leave the mesh as it is are not taken into account: a box or a bottle counts as not found.

| kind | the masks |
|---|---|
| `clean` | as drawn |
| `specks1`, `specks5` | 1 or 5 % of the pixels are black or white |
| `gap` | a disc over 5 % of the outline is black |
| `polygon` | a polygon of 36 corners along the outline, each off by about a pixel |
| `all` | the polygon with the gap and 5 % of specks |
| `side`, `corner` | 30 to 60 % of the area is outside the picture, which is cropped at one side or at the two sides of a corner |

`--views VIEWS` uses a folder with `transforms.json` (`fl_x, fl_y, cx, cy, w, h`) and the pictures in `images` instead of drawn masks. `--out DIR` keeps masks,
cameras and answers. Other flags, such as `--colour`, go to `pose`. Needs numpy and pillow.
"""

import argparse
import json
import math
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

VIEWS, WIDTH, HEIGHT, SAMPLES = 24, 200, 150, 4
LENS = np.array([[1.1 * WIDTH, 0, WIDTH / 2 + 4.5], [0, 1.111 * WIDTH, HEIGHT / 2 - 3.25], [0, 0, 1]])
SPECKS = {"specks1": 0.01, "specks5": 0.05, "all": 0.05}
GAP, CORNERS, OFF_BY, OUTSIDE = 0.05, 36, 1.0, (0.3, 0.6)
# Ends of the rows and columns that are cropped: -1 for the first, 1 for the last.
CUTS = {"side": [(0, -1), (0, 1), (-1, 0), (1, 0)], "corner": [(-1, -1), (-1, 1), (1, -1), (1, 1)]}
ROW = "| {} | {} | {} of {} | {} | {} | {} |"
# Between the axes of a camera in OpenGL and in OpenCV.
FLIP = np.diag([1.0, -1.0, -1.0])


def load(path):
    """Corners of the faces of an OBJ file, `[F, 3, 3]`, centred and with the longest side of their box scaled to 2."""
    points, faces = [], []
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            ids = [int(word.split("/")[0]) for word in words[1:]]
            ids = [k - 1 if k > 0 else k + len(points) for k in ids]
            faces += [[ids[0], *pair] for pair in zip(ids[1:], ids[2:])]
    if not faces:
        raise SystemExit(f"{path} has no faces of an OBJ file: masks are drawn of OBJ files alone")
    points = np.array(points)
    low, high = points.min(0), points.max(0)
    return ((points - (low + high) / 2) * 2 / (high - low).max())[np.array(faces)]


def cameras(rng):
    """R and t of each view as OpenCV has them, along a spiral over the sphere."""
    for k in range(VIEWS):
        azimuth, height = 2 * math.pi * (0.618034 * k % 1), np.clip(2 * (k + 0.5) / VIEWS - 1, -0.9, 0.9)
        flat = math.sqrt(1 - height**2)
        distance = 4.2 * (1 + 0.12 * rng.standard_normal())
        eye = distance * np.array([flat * math.sin(azimuth), height, flat * math.cos(azimuth)])
        ahead = 0.12 * rng.standard_normal(3) - eye
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 1, 0])
        right /= np.linalg.norm(right)
        roll, down = 0.2 * rng.standard_normal(), np.cross(ahead, right)
        rows = [math.cos(roll) * right + math.sin(roll) * down, math.cos(roll) * down - math.sin(roll) * right, ahead]
        yield np.array(rows), -np.array(rows) @ eye


def rasterized(corners, rotation, translation):
    """Share of the samples of each pixel that lie in a face, 0 to 255."""
    in_camera = corners @ rotation.T + translation
    places = in_camera @ LENS.T
    places = SAMPLES * places[..., :2] / places[..., 2:]
    covered = np.zeros((SAMPLES * HEIGHT, SAMPLES * WIDTH), dtype=bool)
    low = np.maximum(np.floor(places.min(1)).astype(int), 0)
    high = np.minimum(np.ceil(places.max(1)).astype(int), covered.shape[::-1])
    for face in np.flatnonzero((in_camera[..., 2].min(1) > 0) & (low < high).all(1)):
        (x0, y0), (x1, y1) = low[face], high[face]
        x, y = np.arange(x0, x1) + 0.5, np.arange(y0, y1)[:, None] + 0.5
        a, b, c = places[face]
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        covered[y0:y1, x0:x1] |= (np.minimum.reduce(sides) >= 0) | (np.maximum.reduce(sides) <= 0)
    return np.round(255 * covered.reshape(HEIGHT, SAMPLES, WIDTH, SAMPLES).mean((1, 3))).astype(np.uint8)


def saved(folder, transforms, masks):
    for frame, mask in zip(transforms["frames"], masks, strict=True):
        path = folder / frame["file_path"]
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(mask.astype(np.uint8)).save(path)
    (folder / "transforms.json").write_text(json.dumps(transforms, indent=1), encoding="utf-8")
    return folder


def drawn(mesh, folder):
    corners, frames, masks = load(mesh), [], []
    for k, (rotation, translation) in enumerate(cameras(np.random.default_rng(1))):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T @ FLIP, -rotation.T @ translation
        frames.append({"file_path": f"images/{k:03}.png", "transform_matrix": pose.tolist()})
        masks.append(rasterized(corners, rotation, translation))
    lens = {"fl_x": LENS[0, 0], "fl_y": LENS[1, 1], "cx": LENS[0, 2], "cy": LENS[1, 2], "w": WIDTH, "h": HEIGHT}
    return saved(folder, {**lens, "frames": frames}, masks)


def outline(mask):
    """The longest closed curve along the boundary of a mask, corner by corner, as y and x."""
    inside, after = np.pad(mask >= 128, 1), {}
    for y, x in np.argwhere(inside):
        # Clockwise, with the inside at the right.
        corners = [(y, x), (y, x + 1), (y + 1, x + 1), (y + 1, x)]
        for k, (dy, dx) in enumerate([(-1, 0), (0, 1), (1, 0), (0, -1)]):
            if not inside[y + dy, x + dx]:
                after.setdefault(corners[k], []).append(corners[(k + 1) % 4])
    curves = []
    while after:
        curve = [next(iter(after))]
        while len(curve) == 1 or curve[-1] != curve[0]:
            curve.append(after[curve[-1]].pop())
            if not after[curve[-2]]:
                del after[curve[-2]]
        curves.append(curve[:-1])
    return np.array(max(curves, key=len), float)[:, ::-1] - 1.0


def gap(mask, rng):
    curve = outline(mask)
    begin, count = rng.integers(len(curve)), max(2, round(GAP * len(curve)))
    cut = curve[(begin + np.arange(count)) % len(curve)]
    middle, radius = cut.mean(0), np.abs(cut - cut.mean(0)).max()
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]] + 0.5
    return np.where((x - middle[0]) ** 2 + (y - middle[1]) ** 2 < radius**2, 0, mask)


def polygon(mask, rng):
    curve = outline(mask)
    corners = curve[np.arange(CORNERS) * len(curve) // CORNERS] + rng.normal(0.0, OFF_BY, (CORNERS, 2))
    image = Image.new("L", mask.shape[::-1])
    ImageDraw.Draw(image).polygon([tuple(corner) for corner in corners], fill=255)
    return np.array(image)


def window(mask, kind, rng):
    """First row and column of a smaller picture, and the row and the column after its last."""
    covered = np.argwhere(mask)
    low, high = covered.min(0), covered.max(0) + 1
    cut, share = np.array(CUTS[kind][rng.integers(4)]), rng.uniform(*OUTSIDE)
    away = np.round(np.linspace(0, 1, 501)[:, None] * (high - low)).astype(int)
    windows = [*zip(np.where(cut < 0, low + away, 0), np.where(cut > 0, high - away, mask.shape))]
    outside = [1 - mask[top:bottom, left:right].sum() / mask.sum() for (top, left), (bottom, right) in windows]
    return windows[np.argmin(np.abs(np.array(outside) - share))]


def worse(views, folder, kind):
    transforms, masks = json.loads((views / "transforms.json").read_text(encoding="utf-8")), []
    transforms["frames"].sort(key=lambda frame: frame["file_path"])
    rng = np.random.default_rng(0)
    for frame in transforms["frames"]:
        picture = Image.open(views / frame["file_path"])
        mask = np.array(picture.getchannel("A") if "A" in picture.mode else picture.convert("L"))
        if kind in ["polygon", "all"]:
            mask = polygon(mask, rng)
        if kind in ["gap", "all"]:
            mask = gap(mask, rng)
        if kind in SPECKS:
            hit = rng.random(mask.shape) < SPECKS[kind]
            mask = np.where(hit, rng.integers(0, 2, mask.shape) * 255, mask)
        if kind in CUTS:
            (top, left), (bottom, right) = np.array(window(mask, kind, rng)).tolist()
            mask = mask[top:bottom, left:right]
            lens = {key: frame.get(key, transforms[key]) for key in ["fl_x", "fl_y", "cx", "cy"]}
            frame.update({**lens, "cx": lens["cx"] - left, "cy": lens["cy"] - top, "w": right - left, "h": bottom - top})
        masks.append(mask)
    return saved(folder, transforms, masks)


def find(program, mesh, views, out, more):
    """Errors of the first answers in degrees, whether each truth was found, and seconds for one mask."""
    frames = json.loads((views / "transforms.json").read_text(encoding="utf-8"))["frames"]
    truth = {Path(frame["file_path"]).name: np.array(frame["transform_matrix"])[:3, :3] @ FLIP for frame in frames}
    command = [program, "--mesh", mesh, "--targets", views / "images", "--camera", views / "transforms.json", "--out", out, "--json", "--quiet", *more]
    begun = time.perf_counter()
    answer = subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout
    seconds = (time.perf_counter() - begun) / len(frames)
    errors, found = [], []
    for picture in json.loads(answer)["pictures"]:
        to_world = truth.pop(Path(picture["target"]).name)
        traces = [np.trace(np.array(pose["camera"]["R"]) @ to_world) for pose in [picture, *picture["alternatives"]]]
        off = np.degrees(np.arccos(np.clip((np.array(traces) - 1) / 2, -1, 1)))
        errors.append(off[0])
        found.append(off[0] <= 5 or picture["iou"] >= 0.97 and off.min() <= 5)
    assert not truth, f"pose has no answer for {', '.join(truth)}"
    return np.array(errors), found, seconds


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog="Other flags go to pose.")
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    parser.add_argument("--kinds", nargs="+", choices=["clean", *SPECKS, "gap", "polygon", *CUTS], default=["clean"], metavar="KIND", help="%(choices)s")
    parser.add_argument("--views", type=Path, help="folder with pictures and cameras for one mesh, instead of drawn masks")
    parser.add_argument("--out", type=Path, help="folder for masks, cameras and answers")
    parser.add_argument("--program", default="target/release/pose")
    given, more = parser.parse_known_args()
    if given.views and len(given.meshes) > 1:
        parser.error("--views is for one mesh")
    print("| mesh | masks | first | found | median error, degrees | seconds for one |\n|---|---|--:|--:|--:|--:|")
    totals = {kind: np.zeros(3, int) for kind in given.kinds}
    with tempfile.TemporaryDirectory() as scratch:
        for mesh in given.meshes:
            out = (given.out or Path(scratch)) / Path(mesh).stem
            clean = given.views or drawn(mesh, out / "clean")
            for kind in given.kinds:
                views = clean if kind == "clean" else worse(clean, out / kind, kind)
                errors, found, seconds = find(given.program, mesh, views, out / f"{kind}-poses", more)
                totals[kind] += (counts := [sum(errors <= 5), len(errors), sum(found)])
                print(ROW.format(Path(mesh).stem, kind, *counts, f"{np.median(errors):.2f}", f"{seconds:.2f}"), flush=True)
    for kind, counts in totals.items() if len(given.meshes) > 1 else []:
        print(ROW.format("all", kind, *counts, "", ""))
