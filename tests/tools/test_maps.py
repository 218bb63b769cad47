"""ROS map_server maps: conventions, real maps, and files that are not maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from config.errors import DataError, InputError
from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.maps import read_map, state_shades, write_map

GREY = np.array([[0, 100, 205, 254], [254, 205, 100, 0]], np.uint8)


def save(folder: Path, grey: NDArray[np.uint8], more: str = "", image: str = "a.pgm") -> Path:
    Image.fromarray(grey).save(folder / image)
    (folder / "a.yaml").write_text(f"image: {image}\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\n{more}")
    return folder / "a.yaml"


def test_top_row_of_the_image_is_the_northmost_row_of_the_grid(tmp_path: Path) -> None:
    grid = read_map(save(tmp_path, GREY)).grid
    assert grid.state.tolist() == [[FREE, UNKNOWN, UNKNOWN, OCCUPIED], [OCCUPIED, UNKNOWN, UNKNOWN, FREE]]
    assert (grid.x0_m, grid.y0_m, grid.cell_m) == (-1.0, 2.0, 0.05)
    assert np.sign(grid.log_odds).tolist() == [[-1, 0, 0, 1], [1, 0, 0, -1]]


def test_negate_and_thresholds_of_the_description_count(tmp_path: Path) -> None:
    negated = read_map(save(tmp_path, GREY, "negate: 1\n")).grid
    assert negated.state[0, 0] == OCCUPIED
    wide = read_map(save(tmp_path, GREY, "occupied_thresh: 0.6  # looser\nfree_thresh: 0.2\n")).grid
    assert wide.state[1].tolist() == [OCCUPIED, OCCUPIED, FREE, FREE]


def test_raw_mode_takes_the_values_as_per_cent(tmp_path: Path) -> None:
    grid = read_map(save(tmp_path, np.array([[0, 100, 255, 40]], np.uint8), "mode: raw\n")).grid
    assert grid.state.tolist() == [[FREE, OCCUPIED, UNKNOWN, UNKNOWN]]


def test_transparent_pixels_are_unknown(tmp_path: Path) -> None:
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[0, 0, 3] = 255
    assert read_map(save(tmp_path, pixels, image="a.png")).grid.state.tolist() == [[OCCUPIED, UNKNOWN]]


def test_what_is_written_reads_back_the_same(tmp_path: Path) -> None:
    grid = read_map(save(tmp_path, GREY)).grid
    write_map(tmp_path, "map", grid, state_shades(grid.state), 0.25)
    again = read_map(tmp_path / "map.yaml")
    assert np.array_equal(again.grid.state, grid.state)
    assert (again.grid.cell_m, again.grid.x0_m, again.grid.y0_m, again.yaw_rad) == (0.05, -1.0, 2.0, 0.25)


def test_a_list_may_be_written_one_item_a_line(tmp_path: Path) -> None:
    Image.fromarray(GREY).save(tmp_path / "a.pgm")
    (tmp_path / "a.yaml").write_text('image: "a.pgm"\nresolution: 0.1\norigin:\n - 1.5\n - 2.5\n - 0\n')
    assert read_map(tmp_path / "a.yaml").grid.y0_m == 2.5


def test_an_image_renamed_with_its_description_is_found(tmp_path: Path) -> None:
    path = save(tmp_path, GREY)
    path.write_text(path.read_text().replace("a.pgm", "map.pgm"))
    assert read_map(path).image == "a.pgm"


@pytest.mark.parametrize(
    "text",
    [
        "resolution: 0.05\norigin: [0, 0, 0]\n",
        "image: a.pgm\nresolution: nan\n",
        "image: a.pgm\nresolution: 0\n",
        "image: a.pgm\nresolution: 0.05\norigin: [1]\n",
        "image: a.pgm\nresolution: 0.05\norigin: [x, 0, 0]\n",
        "image: a.pgm\nresolution: 0.05\nmode: fancy\n",
        "image: a.pgm\nresolution: 0.05\nfree_thresh: 0.9\n",
        "just words\n",
        "",
    ],
)
def test_a_wrong_description_is_one_line_of_bad_data(tmp_path: Path, text: str) -> None:
    path = save(tmp_path, GREY)
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_map(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("a.yaml")


def test_wrong_images_are_bad_data_and_absent_ones_no_input(tmp_path: Path) -> None:
    path = save(tmp_path, GREY)
    whole = (tmp_path / "a.pgm").read_bytes()
    for wrong in (b"", b"P5\n", whole[:-3], b"P5\n-4 2\n255\n", b"\x00" * 50, b"P5\n900000 900000\n255\n"):
        (tmp_path / "a.pgm").write_bytes(wrong)
        with pytest.raises(DataError, match=r"readable image|pixels"):
            read_map(path)
    (tmp_path / "a.pgm").unlink()
    with pytest.raises(InputError, match=r"a\.pgm"):
        read_map(path)
    with pytest.raises(InputError):
        read_map(tmp_path / "none.yaml")


def test_an_image_given_as_description_is_bad_data(tmp_path: Path) -> None:
    save(tmp_path, GREY)
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00\x81 not text")
    with pytest.raises(DataError, match=r"\.yaml"):
        read_map(tmp_path / "b.yaml")


def test_every_real_map_has_water_and_walls(shared_data: Path) -> None:
    paths = sorted((shared_data / "maps").glob("*/*.yaml"))
    assert paths
    for path in paths:
        grid = read_map(path).grid
        assert np.count_nonzero(grid.state == FREE) > 1000, path.name
        assert np.count_nonzero(grid.state == OCCUPIED) > 100, path.name
