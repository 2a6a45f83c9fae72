"""Pictures of an object with their masks and cameras."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any, List, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _cameras, _native, _shapes

Path = Union[str, "os.PathLike[str]"]
_Camera = Tuple[List[List[float]], List[float], List[float]]


@dataclass(frozen=True, eq=False)
class Views:
    """Pictures of an object with their masks and cameras, as `load_views` returns them or as you make them.

    - `masks`: for each view `[height, width]`, bool or float in [0, 1], top row first; views may differ in size.
    - `K` `[views, 3, 3]`, or `[3, 3]` for all: in pixels with the centre of the first pixel at (0, 0), without skew.
    - `R` `[views, 3, 3]` and `t` `[views, 3]`: OpenCV's convention, `R X + t` with x right, y down, z ahead; world units.
    - `pictures`: for each view red, green and blue, `[height, width, 3]`, or with opacity behind them `[height, width, 4]`; uint8, or float in
      [0, 1]. None without colours.
    - `normals`: pictures whose red, green and blue are `(n + 1) / 2` of unit normals n in the axes of the world, or None.
    - `names`: for errors; `notes`: lines about what was read.

    `views[k]`, slices such as `views[::2]` and lists of numbers such as `views[[0, 3]]` are views of fewer pictures. Raises `ValueError` if
    shapes do not fit.
    """

    masks: Sequence[NDArray[np.float32]] = field(repr=False)
    K: NDArray[np.float64] = field(repr=False)
    R: NDArray[np.float64] = field(repr=False)
    t: NDArray[np.float64] = field(repr=False)
    pictures: Optional[Sequence[NDArray[np.float32]]] = field(default=None, repr=False)
    normals: Optional[Sequence[NDArray[np.float32]]] = field(default=None, repr=False)
    names: Sequence[str] = ()
    notes: Sequence[str] = ()

    def __post_init__(self) -> None:
        masks = tuple(_shapes.mask(mask) for mask in self.masks)
        count = len(masks)
        if not masks:
            raise ValueError("views need a mask, found none")
        K, R, t = (np.asarray(_shapes.as_array(x, name), np.float64) for x, name in ((self.K, "K"), (self.R, "R"), (self.t, "t")))
        K = np.broadcast_to(K, (count, 3, 3)) if K.shape == (3, 3) else K
        if K.shape != (count, 3, 3) or R.shape != (count, 3, 3) or t.shape != (count, 3):
            found = f"{list(K.shape)}, {list(R.shape)} and {list(t.shape)}"
            raise ValueError(f"K, R and t must be [{count}, 3, 3], [{count}, 3, 3] and [{count}, 3], found {found}")
        if (K[:, 0, 1] != 0.0).any():
            raise ValueError("K must be without skew")
        names = tuple(self.names) or tuple(f"view {k}" for k in range(count))
        if len(names) != count:
            raise ValueError(f"names must be one for each of the {count} masks, found {len(names)}")
        own = {"masks": masks, "K": K, "R": R, "t": t, "names": names, "notes": tuple(self.notes)}
        for name in ("pictures", "normals"):
            pictures = getattr(self, name)
            own[name] = None if pictures is None else _pictures(pictures, masks, name)
        for name, value in own.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """The number of views."""
        return len(self.masks)

    def __getitem__(self, which: Union[int, slice, Sequence[int]]) -> Views:
        """The view of a number, or those of a slice or of a list of numbers."""
        numbers = range(len(self))
        if isinstance(which, slice):
            chosen = list(numbers[which])
        else:
            chosen = [numbers[k] for k in ([which] if isinstance(which, (int, np.integer)) else which)]

        def part(all: Any) -> Any:
            return all[chosen] if isinstance(all, np.ndarray) else None if all is None else [all[k] for k in chosen]

        return Views(*map(part, (self.masks, self.K, self.R, self.t, self.pictures, self.normals, self.names)), self.notes)

    @property
    def cameras(self) -> NDArray[np.float64]:
        """The cameras for `project`, `[views, 3, 4]`."""
        each = [_cameras.pinhole(np, K, R, t, mask.shape, "opencv") for K, R, t, mask in zip(self.K, self.R, self.t, self.masks)]
        return np.concatenate(each)

    @property
    def _lenses(self) -> List[_Camera]:
        """R, t and the lens of each view, with the principal point from the corner of the picture."""
        lenses = [[fx, fy, cx + 0.5, cy + 0.5] for (fx, _, cx), (_, fy, cy), _ in self.K.tolist()]
        return list(zip(self.R.tolist(), self.t.tolist(), lenses))


def _pictures(pictures: Sequence[Any], masks: Tuple[NDArray[np.float32], ...], name: str) -> Tuple[NDArray[np.float32], ...]:
    """Red, green, blue and opacity of each view as float32."""
    if len(pictures) != len(masks):
        raise ValueError(f"{name} must be one for each of the {len(masks)} masks, found {len(pictures)}")
    found = []
    for picture, mask in zip(pictures, masks):
        levels = _shapes.as_array(picture, name)
        if levels.shape not in ((*mask.shape, 3), (*mask.shape, 4)) or levels.dtype.kind != "f" and levels.dtype != np.uint8:
            expected = f"{[*mask.shape, 3]} or {[*mask.shape, 4]}"
            raise ValueError(f"{name} must be {expected} of uint8 or float as their masks are, found {levels.dtype} {list(levels.shape)}")
        levels = levels.astype(np.float32) / np.float32(255.0 if levels.dtype == np.uint8 else 1.0)
        if not ((levels >= 0.0) & (levels <= 1.0)).all():
            raise ValueError(f"{name} must be in [0, 1], found a level that is not")
        found.append(levels if levels.shape[2] == 4 else np.pad(levels, ((0, 0), (0, 0), (0, 1)), constant_values=1.0))
    return tuple(found)


def load_views(
    path: Path, *, masks: Optional[Path] = None, pictures: bool = True, normals: Optional[Path] = None, invert: bool = False,
    threshold: Optional[float] = None, label: Optional[int] = None,
) -> Views:
    """Reads the pictures of a folder with their masks and cameras: `[height, width]` each, undistorted.

    Cameras are those of `transforms.json` (nerfstudio, instant-ngp), of a model of COLMAP in the folder, in `sparse/0` or `colmap`, or of
    `transforms_train.json`; `path` may also be such a file. A mask is the file that the camera file names, or that of the picture's name in the
    folder `masks` or in one of that name beside the pictures, else the picture itself: its transparency, or its luminance. `invert` takes what
    is black, `threshold` in [0, 1] what is at least that bright, `label` the pixels of a class. `pictures=False` reads masks alone. `normals` is
    a folder with pictures of normals, which have the names of the pictures.

    Raises `ValueError` of one line that names the file and the frame if a file is missing or broken.
    """
    names, levels, colours, turned, cameras, notes = _native.load_views(path, masks, (invert, threshold, label), pictures, normals)
    R, t, lenses = (np.array(part) for part in zip(*cameras))
    K = np.zeros((len(names), 3, 3))
    # Pixels from the centre of the first one, not from the corner of the picture.
    K[:, 0, 0], K[:, 1, 1], K[:, 0, 2], K[:, 1, 2], K[:, 2, 2] = lenses[:, 0], lenses[:, 1], lenses[:, 2] - 0.5, lenses[:, 3] - 0.5, 1.0
    return Views(levels, K, R, t, colours, turned, names, notes)
