"""Relief of a map for pages: light, averages, contours and outlines."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.report import relief
from slopewise.services.scene.shading import shade
from tests.services.report.page_fixtures import pixels_of


class TestRelief:
    def test_png_round_trip(self) -> None:
        pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 2)).astype(np.uint8)
        np.testing.assert_array_equal(pixels_of(relief.png_uri(pixels)), pixels)

    def test_light_is_from_the_north_west(self) -> None:
        y, x = np.mgrid[0:40, 0:40] * 0.5
        north_west, level, south_east = (
            shade(heights, 0.5)[20, 20, 0] for heights in (0.3 * (x - y), 0.0 * x, 0.3 * (y - x))
        )
        assert south_east + 40 < level < north_west

    def test_coarsening_averages_and_keeps_the_unknown(self) -> None:
        heights = np.arange(24.0).reshape(4, 6)
        heights[:2, :2] = np.nan
        heights[0, 2] = np.nan
        mean, factor = relief.coarsen(heights, 3)
        assert factor == 2
        assert np.isnan(mean[0, 0])
        assert mean[0, 1] == pytest.approx(np.mean([3.0, 8.0, 9.0]))
        assert mean[1, 2] == pytest.approx(np.mean([16.0, 17.0, 22.0, 23.0]))

    def test_large_maps_keep_their_place(self) -> None:
        ground = ElevationMap(elevation=np.zeros((1801, 20)), resolution=0.5, origin=(7.0, 9.0))
        _, table = relief.relief(ground)
        assert table["cell"] == 1.5
        left, right, bottom, top = table["bounds"]
        assert (left, bottom) == (-0.25, -0.25)
        assert right >= 19.5 * 0.5
        assert top >= 1800.5 * 0.5
        assert table["first"] == 0.5


def points_of(path: str) -> list[Floats]:
    """Lines of SVG path data, each (n, 2) in cells."""
    lines = []
    for line in path.split("M")[1:]:
        start, _, steps = line.partition("l")
        first = np.array(start.split(), float)
        moves = np.array(steps.split(), float).reshape(-1, 2)
        lines.append(np.concatenate((first[None], first + np.cumsum(moves, axis=0))) / 10.0)
    return lines


class TestContours:
    def test_cone_has_one_closed_circle(self) -> None:
        y, x = np.mgrid[0:41, 0:41] - 20.0
        (circle,) = points_of(relief.contour_path(-np.hypot(x, y), -12.0))
        np.testing.assert_allclose(np.hypot(*(circle - 20.0).T), 12.0, atol=0.12)
        np.testing.assert_allclose(circle[0], circle[-1], atol=1e-9)

    def test_every_point_lies_at_its_height(self) -> None:
        heights = relief.smoothed(np.random.default_rng(2).normal(size=(30, 40)))
        for line in points_of(relief.contour_path(heights, 0.1)):
            for u, v in line:
                if abs(v - round(v)) <= abs(u - round(u)):  # on a row
                    height = np.interp(u, np.arange(40), heights[round(v)])
                else:
                    height = np.interp(v, np.arange(30), heights[:, round(u)])
                assert height == pytest.approx(0.1, abs=0.12)

    def test_lines_end_at_unknown_ground(self) -> None:
        y, x = np.mgrid[0:20, 0:30].astype(float)
        heights = np.where((x > 12) & (x < 18), np.nan, y)
        lines = points_of(relief.contour_path(heights, 9.5))
        ends = sorted((line[:, 0].min(), line[:, 0].max()) for line in lines)
        assert ends == [(0.0, 12.0), (18.0, 29.0)]

    def test_outlines_close_at_the_edge_of_the_map(self) -> None:
        mask = np.zeros((6, 8), bool)
        mask[:, 5:] = True
        (outline,) = points_of(relief.outline_path(mask))
        np.testing.assert_allclose(outline[0], outline[-1], atol=1e-9)
        assert outline[:, 0].min() == pytest.approx(4.5)

    def test_flat_and_spiky_ground_have_no_contours(self) -> None:
        assert relief.contour_path(np.zeros((5, 5)), 0.5) == ""
        spiky = np.zeros((50, 50))
        spiky[25, 25] = 1e9
        assert len(relief.contour_levels(spiky, relief.contour_interval(spiky))) == 0
