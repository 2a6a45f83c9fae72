"""Silhouettes and colours as modules of torch, with softnesses that can be learned.

A module holds its renderer and φ as parameters. It can be copied, pickled and saved; its `state_dict` has φ alone, as faces and size are settings.
"""

from __future__ import annotations

from typing import Any as _Any, Optional as _Optional

import torch as _torch

import softrast as _softrast
import softrast.torch as _st

__all__ = ["SoftRenderer", "SoftSilhouette"]


class SoftSilhouette(_torch.nn.Module):
    """Silhouettes of meshes with these `faces` `[F, 3]`.

    `faces`, `size`, `softness` and the keywords are those of `softrast.Renderer`. `phi` `[P]` (float64) is a parameter that receives gradients if
    `learnable`.
    """

    def __init__(
        self, faces: _softrast._ArrayLike, size: _softrast._Size, softness: _softrast.Softness, *, learnable: bool = True, **settings: _Any,
    ) -> None:
        super().__init__()
        self.renderer = _softrast.Renderer(faces, size, softness, **settings)
        self.phi = _torch.nn.Parameter(_torch.from_numpy(self.renderer.phi), requires_grad=learnable)

    def forward(self, vertices: _torch.Tensor, cameras: _Optional[_torch.Tensor] = None) -> _torch.Tensor:
        """Coverage `[views, height, width]` in [0, 1] of `vertices`.

        They are `[V, 3]` or `[1 or views, V, 3]` in world units with `cameras`, as `softrast.torch.project` takes both, or projected ones
        `[views, V, 3]` without.
        """
        seen = vertices if cameras is None else _st.project(vertices, cameras)
        return _st.silhouette(self.renderer, seen, self.phi)


class SoftRenderer(_torch.nn.Module):
    """Colours of meshes with these `faces` `[F, 3]`.

    `faces`, `size`, `softness`, `planes` and the keywords are those of `softrast.ColourRenderer`. `phi` `[P]`, `phi_depth` `[Q]` and `log_weight`
    `[1]` (float64) are parameters that receive gradients if `learnable`.
    """

    def __init__(
        self, faces: _softrast._ArrayLike, size: _softrast._Size, softness: _softrast.Softness, planes: _Any, *, learnable: bool = True,
        **settings: _Any,
    ) -> None:
        super().__init__()
        self.renderer = _softrast.ColourRenderer(faces, size, softness, planes, **settings)
        of = self.renderer
        own = (_torch.from_numpy(of.phi), _torch.from_numpy(of.phi_depth), _torch.tensor([of.log_weight], dtype=_torch.float64))
        self.phi, self.phi_depth, self.log_weight = (_torch.nn.Parameter(x, requires_grad=learnable) for x in own)

    def forward(
        self, vertices: _torch.Tensor, attributes: _torch.Tensor, background: _Any = 0.0, *, cameras: _Optional[_torch.Tensor] = None,
        corners: _Optional[_softrast._ArrayLike] = None, texture: _Optional[_torch.Tensor] = None,
    ) -> _torch.Tensor:
        """Colours `[views, channels + 1, height, width]`, as `softrast.torch.blend` has them.

        `vertices` are `[V, 3]` or `[1 or views, V, 3]` in world units with `cameras`, or projected ones `[views, V, 3]` without.
        """
        seen = vertices if cameras is None else _st.project(vertices, cameras)
        return _st.blend(
            self.renderer, seen, attributes, background, corners=corners, texture=texture, log_weight=self.log_weight, phi=self.phi,
            phi_depth=self.phi_depth,
        )
