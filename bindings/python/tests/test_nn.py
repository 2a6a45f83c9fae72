"""Modules, copies, pickles, and tensors as they come."""

import copy
import io
import pickle

import numpy as np
import pytest

import softrast

torch = pytest.importorskip("torch")
import softrast.nn as sn  # noqa: E402
import softrast.torch as st  # noqa: E402

FACES = [[0, 1, 2], [1, 3, 2]]
CORNERS = torch.tensor([[-0.6, -0.5, 0.1], [0.5, -0.6, -0.2], [0.05, 0.55, 0.0], [0.8, 0.4, 0.3]])
CAMERAS = torch.from_numpy(softrast.orbit(2.5, 10.0, [20.0, 70.0]))
VALUES = torch.tensor([[0.1, 0.7], [0.4, 0.2], [0.9, 0.5], [0.3, 0.6]])


def silhouettes(**settings):
    return sn.SoftSilhouette(FACES, (6, 5), softrast.Softness("logistic", 0.1), **settings)


def colours():
    return sn.SoftRenderer(FACES, (6, 5), softrast.Softness("logistic", 0.1), [1.5, 3.5], cull_back_faces=False)


def saved(module):
    file = io.BytesIO()
    torch.save(module, file)
    file.seek(0)
    # Older versions have no such argument, and load all.
    return torch.load(file, **({"weights_only": False} if int(torch.__version__.split(".")[0]) > 1 else {}))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda module: pickle.loads(pickle.dumps(module)), saved], ids=["copy", "pickle", "save"])
@pytest.mark.parametrize("of", [
    (silhouettes, lambda module: module(CORNERS, CAMERAS)), (colours, lambda module: module(CORNERS, VALUES, cameras=CAMERAS)),
], ids=["silhouettes", "colours"])
def test_modules_can_be_copied(copied, of):
    make, draw = of
    module = make()
    with torch.no_grad():
        module.phi += 0.25
    again = copied(module)
    assert again.renderer is not module.renderer and torch.equal(draw(again), draw(module))
    draw(again).sum().backward()
    assert again.phi.grad.abs().sum() > 0.0 and module.phi.grad is None


@pytest.mark.parametrize("softness", ["pose", "shape3d-surrogate"])
def test_renderers_and_softnesses_can_be_pickled(softness):
    softness = softrast.Softness.learned(softness)
    again = pickle.loads(pickle.dumps(softness))
    assert repr(again) == repr(softness) and np.array_equal(again.phi_at(0.3, 64), softness.phi_at(0.3, 64))
    draw = softrast.Renderer(FACES, (6, 5), softness, progress=0.3, tolerance=1e-4, t_conorm="einstein")
    seen = softrast.project(CORNERS.numpy(), CAMERAS.numpy())
    assert np.array_equal(softrast.silhouette(pickle.loads(pickle.dumps(draw)), seen), softrast.silhouette(draw, seen))
    assert np.array_equal(copy.deepcopy(draw).faces, FACES)


def test_a_state_has_the_parameters_and_goes_into_another_module():
    first, second = silhouettes(), silhouettes()
    with torch.no_grad():
        first.phi += 0.25
    assert set(first.state_dict()) == {"phi"} and set(colours().state_dict()) == {"phi", "phi_depth", "log_weight"}
    second.load_state_dict(first.state_dict())
    assert torch.equal(first(CORNERS, CAMERAS), second(CORNERS, CAMERAS))


def test_an_optimiser_learns_the_softness():
    target = st.silhouette(softrast.Renderer(FACES, (6, 5), softrast.Softness("logistic", 0.03)), st.project(CORNERS, CAMERAS))
    module = silhouettes()
    adam = torch.optim.Adam(module.parameters(), lr=0.1)
    for _ in range(120):
        adam.zero_grad()
        st.mse_loss(module(CORNERS, CAMERAS), target).sum().backward()
        adam.step()
    assert module.phi.exp().item() == pytest.approx(0.03, rel=0.02)
    assert not any(parameter.requires_grad for parameter in silhouettes(learnable=False).parameters())


class Drawn(torch.utils.data.Dataset):
    """Silhouettes that workers draw."""

    def __init__(self):
        self.draw = silhouettes(learnable=False)

    def __len__(self):
        return 4

    def __getitem__(self, k):
        return self.draw(CORNERS, st.orbit(2.5, 10.0, 20.0 * k))[0]


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_two_workers_of_a_loader_draw_the_same(start):
    if start not in torch.multiprocessing.get_all_start_methods():
        pytest.skip(f"no {start}")
    data = Drawn()
    expected = torch.stack([data[k] for k in range(4)])
    loader = torch.utils.data.DataLoader(data, batch_size=2, num_workers=2, multiprocessing_context=start, timeout=60)
    assert torch.equal(torch.cat(list(loader)), expected)


@pytest.mark.parametrize("half", [torch.float16, torch.bfloat16])
def test_halves_are_computed_in_f32_and_receive_gradients_of_their_own_type(half):
    draw = silhouettes()
    corners = CORNERS.to(half).requires_grad_()
    image = draw(corners, CAMERAS.to(half))
    assert image.dtype == torch.float32 and torch.equal(image, draw(corners.detach().float(), CAMERAS.to(half).float()))
    image.sum().backward()
    assert corners.grad.dtype == half and corners.grad.abs().max() > 0.0
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(draw(CORNERS, CAMERAS), draw(CORNERS, CAMERAS)) and draw(CORNERS, CAMERAS).dtype == torch.float32


def test_tensors_of_any_layout_draw_the_same():
    draw = silhouettes().renderer
    seen = st.project(CORNERS, CAMERAS)
    expected = st.silhouette(draw, seen)
    strided = torch.zeros(2, 4, 6)[..., ::2]
    strided.copy_(seen)
    assert not strided.is_contiguous() and torch.equal(st.silhouette(draw, strided), expected)
    leaf = CORNERS.clone().requires_grad_()
    one = st.silhouette(draw, st.project(leaf, CAMERAS[:1])[0].expand(3, 4, 3))
    assert torch.equal(one, expected[:1].expand(3, 6, 5))
    one.sum().backward()
    (alone,) = torch.autograd.grad(st.silhouette(draw, st.project(leaf, CAMERAS[:1])).sum(), leaf)
    torch.testing.assert_close(leaf.grad, 3.0 * alone)


def test_one_camera_sees_meshes_of_all_views():
    moved = CORNERS + torch.tensor([[[0.0, 0.0, 0.0]], [[0.1, 0.0, 0.0]], [[0.0, 0.2, 0.0]]])
    for camera in (CAMERAS[:1].float(), st.pinhole(torch.eye(3), torch.eye(3), torch.tensor([0.0, 0.0, 2.0]), 6)):
        seen = st.project(moved, camera)
        assert torch.equal(seen, torch.cat([st.project(corners, camera) for corners in moved]))
        assert np.array_equal(softrast.project(moved.numpy(), camera.numpy()), seen)
    with pytest.raises(ValueError, match=r"vertices must be \[V, 3\] or \[1 or 2, V, 3\], found \[3, 4, 3\]"):
        st.project(moved, CAMERAS)


def test_meshes_with_other_faces_draw_in_one_call():
    positions, faces, _ = softrast.icosphere(1)
    ball = softrast.Renderer(faces, (6, 5), softrast.Softness("logistic", 0.1))
    both = [ball, silhouettes().renderer]
    seen = [st.project(torch.from_numpy(positions).float(), CAMERAS[:1]), st.project(CORNERS, CAMERAS)]
    padded, packed = st.silhouettes(both, seen), st.silhouettes(both, seen, packed=True)
    assert padded.shape == (2, 2, 6, 5) and (padded[0, 1] == 0.0).all()
    assert torch.equal(packed, torch.cat([padded[0, :1], padded[1]]))
    assert torch.equal(padded[1], st.silhouette(both[1], seen[1]))
    with pytest.raises(ValueError, match="a renderer for each mesh, of one size"):
        st.silhouettes(both[:1], seen)


def test_gradients_of_padded_meshes_are_those_of_each():
    positions, faces, _ = softrast.icosphere(1)
    both = [softrast.Renderer(faces, (6, 5), softrast.Softness("logistic", 0.1)), silhouettes().renderer]
    leaves = [torch.from_numpy(positions).float().requires_grad_(), CORNERS.clone().requires_grad_()]
    see = lambda: [st.project(leaves[0], CAMERAS[:1]), st.project(leaves[1], CAMERAS)]
    padded = torch.autograd.grad(st.silhouettes(both, see()).pow(2).sum(), leaves)
    each = [torch.autograd.grad(st.silhouette(draw, seen).pow(2).sum(), leaf)[0] for draw, seen, leaf in zip(both, see(), leaves)]
    assert all(torch.equal(a, b) for a, b in zip(padded, each))


def test_colours_of_meshes_with_other_faces_draw_in_one_call():
    positions, faces, _ = softrast.icosphere(1)
    ball = softrast.ColourRenderer(faces, (6, 5), softrast.Softness("logistic", 0.1), [1.0, 4.0])
    both = [ball, colours().renderer]
    seen = [st.project(torch.from_numpy(positions).float(), CAMERAS[:1]), st.project(CORNERS, CAMERAS)]
    values = [torch.from_numpy(positions[:, :2].copy()).float(), VALUES]
    padded, packed = st.blends(both, seen, values, 0.5), st.blends(both, seen, values, 0.5, packed=True)
    assert padded.shape == (2, 2, 3, 6, 5) and (padded[0, 1] == 0.0).all()
    assert torch.equal(packed, torch.cat([padded[0, :1], padded[1]]))
    assert torch.equal(padded[1], st.blend(both[1], seen[1], VALUES, 0.5))
    with pytest.raises(ValueError, match="attributes must be one tensor for each of the 2 meshes, of as many channels"):
        st.blends(both, seen, [values[0], VALUES[:, :1]])


@pytest.mark.parametrize("half", [torch.float16, torch.bfloat16])
def test_colours_and_losses_of_halves_are_computed_in_f32(half):
    draw, values = colours(), VALUES.to(half).requires_grad_()
    image = draw(CORNERS.to(half), values, torch.tensor([0.25, 0.5], dtype=half), cameras=CAMERAS)
    assert torch.equal(image, draw(CORNERS.to(half).float(), values.detach().float(), torch.tensor([0.25, 0.5]), cameras=CAMERAS))
    loss = st.mse_loss(image[:, 0], torch.zeros(1, 6, 5, dtype=half)).sum()
    loss.backward()
    assert loss.dtype == torch.float32 and values.grad.dtype == half and values.grad.abs().max() > 0.0


def test_a_step_under_autocast_trains_the_layer_before():
    layer, draw = torch.nn.Linear(3, 3), silhouettes()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        moved = layer(CORNERS)
        loss = st.iou_loss(draw(CORNERS + 0.1 * moved, CAMERAS), torch.ones(1, 6, 5)).mean()
    loss.backward()
    assert moved.dtype == torch.bfloat16 and loss.dtype == torch.float32
    assert layer.weight.grad.abs().max() > 0.0 and torch.isfinite(layer.weight.grad).all()


def test_attributes_and_pictures_of_any_layout_show_the_same():
    draw = colours().renderer
    seen, picture = st.project(CORNERS, CAMERAS), torch.rand(2, 3, 3, generator=torch.Generator().manual_seed(0))
    places = VALUES * 0.5 + 0.2
    expected = st.blend(draw, seen, places, 0.5, texture=picture)
    turned = st.blend(draw, seen, places.T.contiguous().T, torch.tensor(0.5).expand(3), texture=picture.transpose(0, 2).contiguous().transpose(0, 2))
    assert torch.equal(turned, expected)
    leaf = places.clone().requires_grad_()
    spread = st.blend(draw, seen, leaf.expand(2, 4, 2), 0.5, texture=picture)
    assert torch.equal(spread, expected)
    (both,) = torch.autograd.grad(spread.sum(), leaf)
    (alone,) = torch.autograd.grad(st.blend(draw, seen, leaf, 0.5, texture=picture).sum(), leaf)
    torch.testing.assert_close(both, alone)


def test_one_target_is_compared_with_all_views():
    image, target = torch.rand(3, 6, 5, generator=torch.Generator().manual_seed(0)), torch.rand(1, 6, 5, generator=torch.Generator().manual_seed(1))
    for loss in (st.mse_loss, st.iou_loss):
        assert torch.equal(loss(image, target), loss(image, target.expand(3, 6, 5).contiguous()))


@pytest.mark.parametrize("call, message", [
    (lambda: st.silhouette(silhouettes().renderer, st.project(CORNERS, CAMERAS), torch.zeros(2)), r"phi must be \[1\], found \[2\]"),
    (lambda: st.mse_loss(torch.zeros(2, 3, 4), torch.zeros(2, 4, 3)), r"target \[1 or views, height, width\], found \[2, 3, 4\] and \[2, 4, 3\]"),
    (lambda: st.value_and_grad(silhouettes().renderer, st.project(CORNERS, CAMERAS), torch.zeros(1, 6, 5), "l1"), "loss must be one of mse, iou"),
    (lambda: st.silhouette_loss(silhouettes().renderer, st.project(CORNERS, CAMERAS), torch.zeros(1, 6, 5), "l1"), "loss must be one of mse, iou"),
    (lambda: st.silhouette_loss(silhouettes().renderer, st.project(CORNERS, CAMERAS), torch.zeros(1, 5, 6)), r"found \[2, 6, 5\] and \[1, 5, 6\]"),
    (lambda: st.jvp(silhouettes().renderer, st.project(CORNERS, CAMERAS), CORNERS), r"direction must be \[2, 4, 3\] as the vertices are, found \[4, 3\]"),
    (lambda: st.silhouette(silhouettes().renderer, CORNERS[None].to("meta")), "vertices must lie on the CPU, found meta"),
])
def test_bad_input_is_an_error_of_one_line(call, message):
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
