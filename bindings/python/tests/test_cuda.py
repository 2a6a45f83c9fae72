"""Tensors on CUDA devices: what needs no card, with the CPU as the device; and, where there is a card, the rest.

    maturin build --release --manifest-path bindings/python/Cargo.toml --features cuda --out wheels
    pip install wheels/softrast-*.whl
    SOFTRAST_CUDA=1 python -m pytest bindings/python/tests/test_cuda.py
"""

import ctypes
import os
import subprocess
import sys

import numpy as np
import pytest

import softrast
from softrast import _native, _passes

torch = pytest.importorskip("torch")
import softrast.torch as st
from softrast import _ops

FACES = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
CORNERS = torch.tensor([[0.5, 0.1, -0.6], [-0.7, 0.2, 0.1], [0.1, -0.8, 0.3], [0.3, 0.6, 0.5]], dtype=torch.float64)
CAMERAS = torch.tensor([[2.5, 20.0, 30.0, 60.0], [3.0, -10.0, 80.0, 50.0]], dtype=torch.float64)
SEEN = st.project(CORNERS, CAMERAS)
SOFT = softrast.Softness("logistic", 0.02)
# Pixels, and derivatives relative to their length, as the tests of the kernels hold them.
PIXELS, DERIVATIVES = 1e-5, 2e-3


def why_not():
    """The reason for which nothing is run on a card here."""
    if not _native.has_cuda():
        return "this wheel was built without the feature cuda"
    if os.environ.get("SOFTRAST_CUDA") != "1":
        return "SOFTRAST_CUDA is not 1"
    return None if torch.cuda.is_available() else "there is no CUDA device"


@pytest.fixture(params=["the CPU as the device", pytest.param("cuda", marks=pytest.mark.skipif(bool(why_not()), reason=str(why_not())))])
def there(request, monkeypatch):
    """Moves a tensor to the device, in float32, except φ and the background, which may lie elsewhere."""
    if request.param == "cuda":
        return lambda x: x.to("cuda", torch.float32) if x.dim() > 1 else x
    host = _ops._computed

    def computed(order, name, tensors, *flags):
        narrow = tensors[0].dtype == torch.float32
        return _ops._on_device(order, name, tensors, *flags) if narrow else host(order, name, tensors, *flags)

    monkeypatch.setattr(_ops, "_computed", computed)
    return lambda x: x.to(torch.float32) if x.dim() > 1 else x


def apart(found, expected):
    """The difference relative to the length."""
    return float((found.double().cpu() - expected).norm() / (expected.norm() + 1e-12))


def renderer(softness=SOFT, **settings):
    return softrast.Renderer(FACES, (16, 20), softness, **settings)


def painter():
    return softrast.ColourRenderer(FACES, (16, 20), SOFT, (1.0, 4.0))


def weights(*shape):
    return torch.sin(torch.arange(np.prod(shape), dtype=torch.float64)).reshape(shape)


# Functions of tensors to a tensor, and where they are tried.
OWN, OTHER = renderer(), renderer(t_conorm="einstein")
PHI = torch.tensor(OWN.phi)
PAINTER = painter()
PHIS = torch.tensor(PAINTER.phi), torch.tensor(PAINTER.phi_depth)
COLOURS, BEHIND = weights(4, 3) + 1.5, torch.tensor([0.1, 0.5, 0.9], dtype=torch.float64)
TEXTURE, PLACES = weights(5, 7, 3) + 1.5, weights(4, 2) * 0.4 + 0.5
TARGET = (weights(1, 16, 20) > 0.3).double()
FUNCTIONS = {
    "orbit and project": (st.project, CORNERS, CAMERAS),
    "matrices and project": (st.project, CORNERS, weights(2, 3, 4)),
    "silhouette": (lambda x: st.silhouette(OWN, x), SEEN),
    "silhouette of phi": (lambda x, phi: st.silhouette(OWN, x, phi), SEEN, PHI),
    "silhouette under another sum": (lambda x, phi: st.silhouette(OTHER, x, phi), SEEN, PHI),
    "two losses": (lambda x, y: st.mse_loss(x, y) + st.iou_loss(x, y), weights(2, 16, 20) * 0.4 + 0.5, TARGET * 0.8 + 0.1),
    "mse of a silhouette": (lambda x, y: st.silhouette_loss(OWN, x, y), SEEN, TARGET),
    "iou of a silhouette": (lambda x, y: st.silhouette_loss(OWN, x, y, "iou"), SEEN, TARGET),
    "blend": (lambda x, *y: st.blend(PAINTER, x, *y), SEEN, COLOURS, BEHIND),
    "blend of phi": (
        lambda x, y, phi, depth: st.blend(PAINTER, x, y, 0.5, phi=phi, phi_depth=depth, log_weight=-9.0), SEEN, COLOURS, *PHIS),
    "blend of a texture": (lambda x, y, t: st.blend(PAINTER, x, y, BEHIND.to(x), texture=t), SEEN, PLACES, TEXTURE),
}


@pytest.fixture(params=FUNCTIONS)
def tried(request):
    return FUNCTIONS[request.param]


def derivatives(function, inputs):
    """The value, the gradient along some upstream, and the gradient of that along some directions."""
    leaves = [x.detach().clone().requires_grad_() for x in inputs]
    value = function(*leaves)
    upstream = weights(*value.shape).to(value).requires_grad_()
    first = torch.autograd.grad(value, leaves, upstream, create_graph=True)
    along = sum((x * weights(*x.shape).to(x)).sum().to("cpu", torch.float64) for x in first)
    every = [*leaves, upstream]
    second = torch.autograd.grad(along, every, allow_unused=True)
    second = [torch.zeros_like(x) if found is None else found for x, found in zip(every, second)]
    return [value.detach()], [x.detach() for x in first], [x.detach() for x in second]


def agree(found, expected):
    (value,), (theirs,) = found[0], expected[0]
    assert value.dtype == torch.float32 and (value.double().cpu() - theirs).abs().max() < PIXELS * max(1.0, float(theirs.abs().max()))
    for ours, theirs in zip([*found[1], *found[2]], [*expected[1], *expected[2]]):
        assert ours.shape == theirs.shape and apart(ours, theirs) < DERIVATIVES


def test_values_and_derivatives_are_those_of_float64_on_the_cpu(tried, there):
    function, *inputs = tried
    agree(derivatives(function, [there(x) for x in inputs]), derivatives(function, inputs))


def test_two_calls_have_the_same_bits(tried, there):
    function, *inputs = tried
    once, again = (sum(derivatives(function, [there(x) for x in inputs]), []) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(once, again))


def test_a_surrogate_has_its_own_gradient(there):
    surrogate = renderer(softrast.Softness.learned("pose-surrogate"))
    agree(*(derivatives(lambda x: st.silhouette(surrogate, x), [x]) for x in (there(SEEN), SEEN)))


def test_forward_mode_hvp_and_vmap(there):
    along = weights(*SEEN.shape)
    for call in (
        lambda x, v: st.jvp(OWN, x, v),
        lambda x, v: st.value_and_grad(OWN, x, TARGET.to(x)),
        lambda x, v: st.hvp(OWN, x, TARGET.to(x), v, "iou"),
    ):
        for found, expected in zip(call(there(SEEN), there(along)), call(SEEN, along)):
            assert apart(found, expected) < DERIVATIVES
    if _ops._COMPILES:
        for function in (lambda x: st.silhouette(OWN, x), lambda x: st.silhouette_loss(OWN, x, TARGET.to(x))):
            stacked = torch.stack([SEEN, 0.9 * SEEN])
            assert apart(torch.func.vmap(function)(there(stacked)), torch.func.vmap(function)(stacked)) < DERIVATIVES


def test_views_and_tensors_with_gaps_are_read_in_order(there):
    wide = there(torch.stack([SEEN, -SEEN], -1))
    assert not wide[..., 0].is_contiguous()
    expected = st.silhouette(OWN, there(SEEN))
    assert torch.equal(st.silhouette(OWN, wide[..., 0]), expected)
    both = there(torch.cat([SEEN, SEEN]))
    assert torch.equal(st.silhouette(OWN, both[2:]), expected) and torch.equal(st.silhouette(OWN, both[1:2]), expected[1:])


def test_numbers_that_are_not_finite_are_refused(there):
    with pytest.raises(ValueError, match="attributes must be finite"):
        st.blend(PAINTER, there(SEEN), there(COLOURS / 0.0))


# Only on a card.

on_a_card = pytest.mark.skipif(bool(why_not()), reason=str(why_not()))


@on_a_card
def test_another_stream_finds_what_it_was_given_and_goes_on_with_the_result():
    seen = SEEN.float().cuda()
    expected, stream = 2.0 * st.silhouette(OWN, seen), torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    for _ in range(10):
        with torch.cuda.stream(stream):
            # Work that takes long enough to be overtaken by what does not wait for it.
            late = torch.zeros_like(seen)
            matrix = torch.ones(2048, 2048, device="cuda")
            for _ in range(10):
                matrix = matrix @ matrix * 1e-4
            late += seen + 0.0 * matrix[0, 0].clamp(0.0, 1.0)
            found = 2.0 * st.silhouette(OWN, late)
        stream.synchronize()
        assert torch.equal(found, expected)


@on_a_card
def test_memory_that_is_freed_and_used_again_keeps_its_numbers_apart():
    seen = [(SEEN * scale).float().cuda() for scale in (1.0, 0.9, 0.8)]
    expected = [st.silhouette(OWN, x) for x in seen]
    for _ in range(50):
        for x, image in zip(seen, expected):
            assert torch.equal(st.silhouette(OWN, x + 0.0), image)


@on_a_card
def test_phi_and_cameras_may_lie_on_a_card_or_beside_it():
    expected = st.silhouette(OWN, st.project(CORNERS.float().cuda(), CAMERAS), PHI)
    for cameras, phi in ((CAMERAS.float().cuda(), PHI.cuda()), (CAMERAS, PHI.float().cuda())):
        leaf = phi.clone().requires_grad_()
        found = st.silhouette(OWN, st.project(CORNERS.float().cuda(), cameras), leaf)
        found.sum().backward()
        assert apart(found.detach(), expected.double().cpu()) < PIXELS and leaf.grad.device == leaf.device and leaf.grad.dtype == leaf.dtype


@on_a_card
def test_every_card_draws_what_lies_on_it():
    expected = st.silhouette(OWN, SEEN)
    for k in range(torch.cuda.device_count()):
        found = st.silhouette(OWN, SEEN.float().cuda(k))
        assert found.device.index == k and apart(found, expected) < PIXELS
    assert torch.cuda.current_device() == 0


@on_a_card
def test_what_a_card_cannot_do_is_an_error_of_one_line():
    for call, message in (
        (lambda: st.silhouette(OWN, SEEN.cuda()), "arrays on a device must be float32"),
        (lambda: st.hard_silhouette(SEEN.float().cuda(), FACES, 8), "vertices must lie on the CPU, found cuda:0"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            call()
        assert "\n" not in str(error.value)
    leaf = SEEN.float().cuda().requires_grad_()
    (first,) = torch.autograd.grad(st.silhouette(OWN, leaf).pow(2).sum(), leaf, create_graph=True)
    (second,) = torch.autograd.grad(first.pow(2).sum(), leaf, create_graph=True)
    with pytest.raises(RuntimeError, match="twice, not a third time"):
        second.sum().backward()


# Capsules by hand, as a library without a card cannot make them.


class Managed(ctypes.Structure):
    _fields_ = [
        ("data", ctypes.c_void_p), ("device", ctypes.c_int32 * 2), ("axes", ctypes.c_int32), ("code", ctypes.c_uint8), ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16), ("shape", ctypes.POINTER(ctypes.c_int64)), ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("offset", ctypes.c_uint64), ("owner", ctypes.c_void_p), ("free", ctypes.c_void_p),
    ]


_KEPT = []


def capsule(numbers, *, name=b"dltensor", device=(1, 0), code=2, offset=0, **fields):
    """A capsule of a `DLManagedTensor` that frees nothing."""
    lengths = [(ctypes.c_int64 * 8)(*fields.pop(key, default)) for key, default in (
        ("shape", numbers.shape), ("strides", [stride // numbers.itemsize for stride in numbers.strides]))]
    managed = Managed(
        numbers.ctypes.data - offset, device, numbers.ndim, code, 8 * numbers.itemsize, fields.pop("lanes", 1), *lengths, offset, None, None)
    _KEPT.append((numbers, lengths, managed, name))
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return new(ctypes.addressof(managed), name, None)


ORBITS = CAMERAS.numpy().astype(np.float32)


def drawn(given, out):
    _passes.ORBIT_MATRIX.call_dlpack("value", [given], [out], [], [])


def test_a_capsule_is_read_where_it_says():
    expected = st.project(torch.eye(3), torch.from_numpy(ORBITS))
    found = np.full((2, 3, 4), np.nan, np.float32)
    for given in (capsule(ORBITS), capsule(ORBITS, offset=16), capsule(ORBITS, strides=[4, 1])):
        found[:] = np.nan
        drawn(given, capsule(found))
        assert np.array_equal(st.project(torch.eye(3), torch.from_numpy(found)), expected)
    one = np.full((1, 3, 4), np.nan, np.float32)
    # The stride of an axis with one number means nothing.
    drawn(capsule(ORBITS[:1], strides=[99, 1]), capsule(one))
    assert np.array_equal(one[0], found[0])


@pytest.mark.parametrize("given, message", [
    (lambda: capsule(ORBITS, name=b"used_dltensor"), "PyCapsule_GetPointer called with incorrect name"),
    (lambda: capsule(ORBITS, strides=[8, 1]), "an array is not contiguous"),
    (lambda: capsule(ORBITS[:, ::-1]), "an array is not contiguous"),
    (lambda: capsule(ORBITS, code=0), "arrays must be float32 or float64"),
    (lambda: capsule(ORBITS, lanes=4), "arrays must be float32 or float64"),
    (lambda: capsule(ORBITS.astype(np.float16)), "arrays must be float32 or float64"),
    (lambda: capsule(ORBITS, shape=[0, 4]), "an array has no numbers"),
    (lambda: capsule(ORBITS, shape=[-2, 4]), "an array has no numbers"),
    (lambda: capsule(ORBITS, shape=[2 ** 62, 4]), "an array has no numbers, or too many"),
    (lambda: capsule(ORBITS, device=(4, 0)), "softrast does not draw on the device of the arrays"),
    (lambda: capsule(ORBITS.astype(np.float64)), "arrays on a device must be float32|arrays of a call must be of one type"),
    (lambda: capsule(ORBITS.reshape(4, 2)), "arrays of these shapes do not fit"),
])
def test_a_capsule_that_does_not_fit_is_an_error_of_one_line(given, message):
    with pytest.raises(ValueError, match=message) as error:
        drawn(given(), capsule(np.zeros((2, 3, 4), np.float32)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("out, message", [
    (lambda: [], "results of a call have other shapes"),
    (lambda: [capsule(np.zeros((2, 3, 3), np.float32))], "results of a call have other shapes"),
    (lambda: [capsule(np.zeros((2, 3, 4)))], "arrays on a device must be float32"),
    (lambda: [capsule(np.zeros((2, 3, 4), np.float32), device=(2, 0))], "the arrays of a call must lie on one device"),
])
def test_results_that_do_not_fit_are_not_written(out, message):
    with pytest.raises(ValueError, match=message):
        _passes.ORBIT_MATRIX.call_dlpack("value", [capsule(ORBITS)], out(), [], [])


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_a_cuda_array_without_a_card_is_an_error_that_names_what_is_missing():
    missing = "no driver for CUDA found|finds no card|no NVRTC found|no CUDA headers" if _native.has_cuda() else "does not draw on the device"
    with pytest.raises(ValueError, match=missing) as error:
        drawn(capsule(ORBITS, device=(2, 0)), capsule(np.zeros((2, 3, 4), np.float32), device=(2, 0)))
    assert "\n" not in str(error.value)


class OnACard(torch.Tensor):
    """A tensor that says that it lies on a CUDA device."""

    device, is_cuda = torch.device("cuda:0"), True


@pytest.mark.parametrize("asked", ["", "0", "1"])
def test_a_cuda_tensor_is_refused_unless_it_was_asked_for(asked):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_cuda import OnACard, OWN, SEEN, st\n"
        "try: st._floats(SEEN.float().as_subclass(OnACard), 'vertices')\n"
        "except ValueError as error: print(error)\n"
    )
    environment = {**os.environ, "SOFTRAST_CUDA": asked}
    said = subprocess.run(
        [sys.executable, "-c", script, os.path.dirname(__file__)], env=environment, stdout=subprocess.PIPE, text=True, check=True)
    allowed = asked == "1" and _native.has_cuda()
    assert said.stdout == ("" if allowed else "vertices must lie on the CPU, found cuda:0: move it with cpu()\n")
