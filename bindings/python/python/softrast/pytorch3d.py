"""The soft silhouette of PyTorch3D by its own arguments, for a script that comes from there; PyTorch3D itself is not needed.

    silhouettes = SoftSilhouette(mesh.faces_packed(), 256, sigma=1e-4)
    alpha = silhouettes(mesh.verts_padded(), cameras(R, T, focal_length=1.73))[..., 3]

The guide `docs/guide/coming-from-pytorch3d.md` has the conventions of both sides in full.
"""

from __future__ import annotations

import math as _math
from typing import Optional as _Optional, Union as _Union

import torch as _torch

import softrast as _softrast
import softrast.torch as _st

__all__ = ["SoftSilhouette", "cameras"]

# A cut where a face covers more than this is seen in the image, and not drawn here.
_SEEN = 1e-3


def cameras(
    R: _torch.Tensor, T: _torch.Tensor, focal_length: _Union[float, _torch.Tensor] = 1.0,
    principal_point: _Union[float, _torch.Tensor] = 0.0,
) -> _torch.Tensor:
    """Cameras of PyTorch3D as matrices `[N, 3, 4]` for `softrast.torch.project`, differentiable in all arguments.

    `R` `[N, 3, 3]` and `T` `[N, 3]` are for row vectors, `X R + T`, with axes x left, y up, z ahead; T in world units. `focal_length` and
    `principal_point` are in its NDC, x left: a number, `[N]` or `[N, 2]`, as `PerspectiveCameras(in_ndc=True)` has them.
    `FoVPerspectiveCameras(fov=f)` with an aspect ratio of 1 has the focal length `1 / tan(f / 2)`.
    """
    R, T = _st._floats(R, "R"), _st._floats(T, "T")
    if R.dim() != 3 or R.shape[1:] != (3, 3) or T.shape != (R.shape[0], 3) or R.shape[0] == 0:
        raise ValueError(f"R must be [N, 3, 3] and T [N, 3], found {list(R.shape)} and {list(T.shape)}")
    along = _torch.cat([R.transpose(1, 2), T.to(R)[..., None]], 2)
    focal, middle = (_pair(x, name, along) for x, name in [(focal_length, "focal_length"), (principal_point, "principal_point")])
    left, up, ahead = along.unbind(1)
    # Their x goes left, ours right.
    right = -(focal[:, :1] * left + middle[:, :1] * ahead)
    return _torch.stack([right, focal[:, 1:] * up + middle[:, 1:] * ahead, ahead], 1)


def _pair(x, name, like):
    """`[N, 2]` of a number, `[N]` or `[N, 2]`."""
    x = _torch.as_tensor(x, dtype=like.dtype, device=like.device)
    x = x[:, None] if x.dim() == 1 and len(x) in (1, len(like)) else x
    if x.dim() not in (0, 2) or x.dim() == 2 and (x.shape[0] not in (1, len(like)) or x.shape[1] not in (1, 2)):
        raise ValueError(f"{name} must be a number, [{len(like)}] or [{len(like)}, 2], found {list(x.shape)}")
    return x.expand(len(like), 2)


class SoftSilhouette:
    """`MeshRenderer` with a `SoftSilhouetteShader`, for meshes with these `faces` `[F, 3]`.

    `image_size` is a number of pixels or `(height, width)`, `sigma` that of `BlendParams`, in NDC². No face is cut off and none left out here:
    no pixel is off by more than `tolerance`. So `blur_radius` (NDC²) and `faces_per_pixel` change nothing, and are taken so that a call can
    stay. Raises `ValueError` for a `blur_radius` that cuts where a face still covers more than 0.001, since that image is another one.
    """

    def __init__(
        self, faces: _softrast._ArrayLike, image_size: _softrast._Size = 256, *, sigma: float = 1e-4, blur_radius: _Optional[float] = None,
        faces_per_pixel: _Optional[int] = None, tolerance: float = 1e-5,
    ) -> None:
        softness = _softrast.Softness("logistic", sigma, squared=True)
        if blur_radius is not None:
            cut = 0.5 - 0.5 * _math.tanh(0.5 * blur_radius / sigma)
            if not cut <= _SEEN:
                raise ValueError(
                    f"blur_radius {blur_radius:g} cuts faces off where they cover {cut:.1g}, and nothing is cut here: leave it out, or take "
                    f"log(1 / 1e-4 - 1) * sigma"
                )
        self.renderer = _softrast.Renderer(faces, image_size, softness, tolerance=tolerance)

    def __call__(self, verts: _torch.Tensor, cameras: _torch.Tensor) -> _torch.Tensor:
        """Images `[N, height, width, 4]` of `verts` `[V, 3]` or `[1 or N, V, 3]` in world units: ones, and the silhouette last.

        `cameras` `[N, 3, 4]` are those that `cameras` returns, or orbits `[N, 4]`.
        """
        alpha = _st.silhouette(self.renderer, _st.project(verts, cameras))[..., None]
        return _torch.cat([_torch.ones_like(alpha).expand(*alpha.shape[:3], 3), alpha], 3)
