"""The figures of docs/guide/pictures.md: poses against their truth, and masks made worse.

    python tasks/pose/benches/views.py worse VIEWS OUT specks1|specks5|gap|polygon|all
    python tasks/pose/benches/views.py poses target/release/pose MESH VIEWS [--colour ..]

VIEWS is a folder with `transforms.json`, `truth.json` (a list `views` of R and t, as OpenCV has them) and the masks in `images`.
Needs numpy and pillow.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

CORNERS = 36
OFF_BY = 1.0
CUT_AWAY = 0.05


def specks(mask, fraction, rng):
    hit = rng.random(mask.shape) < fraction
    return np.where(hit, rng.integers(0, 2, mask.shape) * 255, mask)


def outline(mask):
    """The longest closed curve along the boundary of a mask, corner by corner."""
    inside = np.pad(mask >= 128, 1)
    after = {}
    for y, x in np.argwhere(inside):
        # Clockwise, with the inside at the right.
        for (dy, dx), a, b in [
            ((-1, 0), (y, x), (y, x + 1)),
            ((0, 1), (y, x + 1), (y + 1, x + 1)),
            ((1, 0), (y + 1, x + 1), (y + 1, x)),
            ((0, -1), (y + 1, x), (y, x)),
        ]:
            if not inside[y + dy, x + dx]:
                after.setdefault(a, []).append(b)
    curves = []
    while after:
        start = at = next(iter(after))
        curve = []
        while True:
            curve.append(at)
            to = after[at].pop()
            if not after[at]:
                del after[at]
            at = to
            if at == start:
                break
        curves.append(curve)
    return np.array(max(curves, key=len), float)[:, ::-1] - 1.0


def gap(mask, rng):
    curve = outline(mask)
    begin, count = rng.integers(len(curve)), max(2, round(CUT_AWAY * len(curve)))
    cut = curve[(begin + np.arange(count)) % len(curve)]
    middle, radius = cut.mean(0), np.abs(cut - cut.mean(0)).max()
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]] + 0.5
    return np.where((x - middle[0]) ** 2 + (y - middle[1]) ** 2 < radius**2, 0, mask)


def polygon(mask, rng):
    curve = outline(mask)
    picked = curve[np.arange(CORNERS) * len(curve) // CORNERS]
    corners = picked + rng.normal(0.0, OFF_BY, picked.shape)
    image = Image.new("L", mask.shape[::-1])
    ImageDraw.Draw(image).polygon([tuple(corner) for corner in corners], fill=255)
    return np.array(image)


def worse(views, out, kind):
    views, out = Path(views), Path(out)
    (out / "images").mkdir(parents=True, exist_ok=True)
    for name in ["transforms.json", "truth.json"]:
        shutil.copy(views / name, out / name)
    rng = np.random.default_rng(0)
    for path in sorted((views / "images").iterdir()):
        picture = Image.open(path)
        mask = np.array(picture.getchannel("A") if "A" in picture.mode else picture.convert("L"))
        if kind in ["polygon", "all"]:
            mask = polygon(mask, rng)
        if kind in ["gap", "all"]:
            mask = gap(mask, rng)
        if kind in ["specks1", "specks5", "all"]:
            mask = specks(mask, 0.01 if kind == "specks1" else 0.05, rng)
        Image.fromarray(mask.astype(np.uint8)).save(out / "images" / path.name)


def off_deg(a, b):
    cosine = (np.trace(np.array(a) @ np.array(b).T) - 1.0) / 2.0
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def poses(program, mesh, views, *more):
    views = Path(views)
    truth = json.loads((views / "truth.json").read_text())["views"]
    command = [program, "--mesh", mesh, "--targets", views / "images", "--camera", views / "transforms.json", *more]
    with tempfile.TemporaryDirectory() as out:
        begun = time.time()
        answer = subprocess.run([*command, "--json", "--quiet", "--out", out], stdout=subprocess.PIPE, check=True).stdout
        seconds = (time.time() - begun) / len(truth)
    found = json.loads(answer)["pictures"]
    first = [off_deg(of["camera"]["R"], true["R"]) for of, true in zip(found, truth, strict=True)]
    near = [
        min([off, *(off_deg(other["camera"]["R"], true["R"]) for other in of["alternatives"])])
        for off, of, true in zip(first, found, truth)
    ]
    right = sum(off <= 5 or (of["iou"] >= 0.97 and least <= 5) for off, least, of in zip(first, near, found))
    print(f"{right} of {len(truth)} right, {sum(off <= 5 for off in first)} within 5 degrees, median {np.median(first):.2f}, "
          f"IoU {np.mean([of['iou'] for of in found]):.3f}, {seconds:.2f} s for one")


if __name__ == "__main__":
    {"worse": worse, "poses": poses}[sys.argv[1]](*sys.argv[2:])
