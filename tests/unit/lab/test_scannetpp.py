"""ScanNet++ folders as training data: reading, refusals and pairs."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from scannetpp_files import write_ply, write_scannetpp
from untyped import any_typed
from walls import FISHEYE, registered

from pointglass.model.common.errors import DataError
from pointglass.model.data.images.scannetpp import load_scannetpp, scenes
from pointglass.model.data.pairs import build

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture
def scannetpp(tmp_path):
    return write_scannetpp(tmp_path / "root")


def test_scannetpp_photographs_agree_with_the_scan(scannetpp):
    place = load_scannetpp(scannetpp, "aa11bb22cc")
    assert scenes(scannetpp, "train") == scenes(scannetpp, "nvs_sem_train") == ["aa11bb22cc"]
    assert place.name == "aa11bb22cc/dslr" and len(place.views) == 13  # one is bad
    for view in (place.views[0], place.views[7]):
        registered(place, view)
    assert np.mean(any_typed(place.views[0].known())) > 0.99
    phone = load_scannetpp(scannetpp, "aa11bb22cc", "iphone")
    assert len(phone.views) == 3 and (phone.views[0].width, phone.views[0].height) == (120, 90)
    registered(phone, phone.views[1])


def test_scannetpp_poses_are_the_same_from_colmap_and_from_nerfstudio(scannetpp):
    colmap = load_scannetpp(scannetpp, "aa11bb22cc")
    folder = scannetpp / "data" / "aa11bb22cc" / "dslr" / "colmap"
    folder.rename(folder.with_name("elsewhere"))
    other = load_scannetpp(scannetpp, "aa11bb22cc")
    assert len(other.views) == 13 and other.views[0].fl == colmap.views[0].fl
    for a, b in zip(colmap.views, other.views, strict=True):
        assert np.allclose(a.camera_to_world, b.camera_to_world, atol=1e-9)


def test_scannetpp_parts_masks_and_anonymised_points(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="test").views) == 2
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="train").views) == 11
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="train", every=4).views) == 3
    (home / "scans" / "pc_aligned_mask.txt").write_text("0 5 59999")
    assert len(load_scannetpp(scannetpp, "aa11bb22cc").original_scan().xyz) == 59_997
    masks = home / "dslr" / "resized_anon_masks"
    masks.mkdir()
    half = np.full((FISHEYE.height, FISHEYE.width), 255, np.uint8)
    half[:, :60] = 0
    for number in range(14):
        Image.fromarray(half).save(masks / f"DSC{number:05d}.png")
    lists = home / "dslr" / "train_test_lists.json"
    lists.write_text(lists.read_text().replace("false", "true"))
    known = load_scannetpp(scannetpp, "aa11bb22cc").views[0].known()
    assert known is not None and not known[:, :55].any() and known[:, 65:].mean() > 0.99
    for name in ("DSC00012.JPG", "DSC00013.JPG"):  # as in the benchmark's test scenes
        (home / "dslr" / "resized_images" / name).unlink()
    assert len(load_scannetpp(scannetpp, "aa11bb22cc").views) == 11


def test_points_on_the_scannetpp_mesh_have_its_colours(scannetpp):
    scans = scannetpp / "data" / "aa11bb22cc" / "scans"
    (scans / "pc_aligned.ply").unlink()
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], float)
    colours = np.array([[0, 0, 0], [200, 0, 0], [200, 100, 0], [0, 100, 0]], np.uint8)  # 50 a metre along x, 33.3 along y
    write_ply(scans / "mesh_aligned_0.05.ply", corners, colours, np.array([[0, 1, 2], [0, 2, 3]]))
    with pytest.raises(DataError, match=r"pc_aligned\.ply: missing.*surface='mesh'"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    scan = load_scannetpp(scannetpp, "aa11bb22cc", surface="mesh", mesh_points=20_000).original_scan()
    assert np.allclose(scan.rgb[:, 0], scan.xyz[:, 0] * 50, atol=0.6)
    assert np.allclose(scan.rgb[:, 1], scan.xyz[:, 1] * 100 / 3, atol=0.6)
    cells, _, _ = np.histogram2d(scan.xyz[:, 0], scan.xyz[:, 1], bins=(4, 3))
    assert cells.min() > 1500 and cells.max() < 1850  # 1667 each


def test_unusable_scannetpp_folders_are_refused_before_training(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    with pytest.raises(DataError, match="found: nvs_sem_train, nvs_sem_val"):
        scenes(scannetpp, "nvs_test")
    with pytest.raises(DataError, match="no such scene"):
        load_scannetpp(scannetpp, "nowhere")
    pictures = home / "dslr" / "resized_images"
    torn = (pictures / "DSC00000.JPG").read_bytes()
    (pictures / "DSC00000.JPG").write_bytes(torn[: len(torn) // 2])
    Image.new("RGB", (64, 48)).save(pictures / "DSC00001.JPG")
    for number in range(4, 14):
        (pictures / f"DSC{number:05d}.JPG").unlink()
    with pytest.raises(DataError) as refused:
        load_scannetpp(scannetpp, "aa11bb22cc", part="train")
    text = str(refused.value)
    assert text.startswith(f"{home}: 10 of 11 files cannot be used")
    assert "DSC00000.JPG cannot be read" in text and "DSC00001.JPG has 64x48 pixels, not 120x80" in text
    assert text.count("is missing") == 8 and "DSC00004.JPG is missing" in text
    for number in (0, 1, 2):
        (pictures / f"DSC{number:05d}.JPG").unlink()
    (home / "dslr" / "train_test_lists.json").unlink()
    (home / "dslr" / "nerfstudio" / "transforms.json").unlink()
    (pictures / "DSC00003.JPG").unlink()
    with pytest.raises(DataError) as refused:
        load_scannetpp(scannetpp, "aa11bb22cc")
    assert str(refused.value).count("is missing") == 10 and "and 4 more" in str(refused.value)


def test_without_the_library_of_the_lab_a_mesh_is_refused_with_the_remedy(scannetpp, monkeypatch):
    monkeypatch.setitem(sys.modules, "plyfile", None)
    with pytest.raises(DataError, match=r"plyfile, .* is not installed; `pip install 'pointglass\[lab\]'`") as caught:
        load_scannetpp(scannetpp, "aa11bb22cc")
    assert "\n" not in str(caught.value)


def test_truncated_scannetpp_scans_and_poses_are_refused(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    cloud = home / "scans" / "pc_aligned.ply"
    data = cloud.read_bytes()
    cloud.write_bytes(data[:-1])
    with pytest.raises(DataError, match=r"pc_aligned\.ply: truncated"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cloud.write_bytes(b"no ply")
    with pytest.raises(DataError, match=r"pc_aligned\.ply: not a PLY"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cloud.write_bytes(data)
    images = home / "dslr" / "colmap" / "images.txt"
    text = images.read_text()
    images.write_text(text.replace("10.5 12.25 -1\n", "", 1))
    with pytest.raises(DataError, match=r"images\.txt: line 2: the next line"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    images.write_text(text.replace(" 1 DSC00002", " 7 DSC00002"))
    with pytest.raises(DataError, match=r"line 6: camera '7' is not in cameras\.txt"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cameras = home / "dslr" / "colmap" / "cameras.txt"
    cameras.write_text(cameras.read_text().replace("OPENCV_FISHEYE", "FOV"))
    with pytest.raises(DataError, match=r"cameras\.txt: line 2: camera model 'FOV' is not supported"):
        load_scannetpp(scannetpp, "aa11bb22cc")


@pytest.mark.parametrize("preset", ["auto", "off"])
def test_training_pairs_have_the_photographs_colours(scannetpp, tmp_path, preset):
    """The paper's method: at measured points in front, input and truth agree far better than with the scan's colours."""
    place = load_scannetpp(scannetpp, "aa11bb22cc", every=6)
    gaps = []
    for recipe in (True, False):
        out = tmp_path / f"pairs-{recipe}"
        bare = any_typed(SimpleNamespace(name="bare", views=place.views, scan=place.scan))
        build([place if recipe else bare], out, scans=1, variants=1, preset=preset, seed=3)
        x, truth = np.load(out / "measured.npy").astype(np.float32), np.load(out / "truth.npy").astype(np.float32) / 255
        measured = (x[:, 3] > 0) & (truth[:, 4] > 0)
        gaps.append(np.median(np.abs(x[:, :3] - truth[:, :3]).mean(1)[measured]))
    assert gaps[0] < 0.1 * gaps[1]
