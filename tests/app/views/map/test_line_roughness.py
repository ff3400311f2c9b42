"""The roughness of the section line."""

import numpy as np
import pytest

from app.views.map.sections import SectionSettings, measure_sections
from gelpolight_core.reconstruction.height_map import HeightMap


def wavy() -> HeightMap:
    x_mm, y_mm = np.arange(-6.0, 6.0, 0.05), np.arange(-1.0, 1.0, 0.05)
    depth = np.broadcast_to(0.01 * np.sin(2.0 * np.pi * x_mm / 0.5), (y_mm.size, x_mm.size))
    flags = np.zeros(depth.shape, np.uint8)
    return HeightMap(depth.astype(np.float32), x_mm, y_mm, 0.05, None, flags, "T", "full", "wave")


@pytest.mark.function("Read roughness along a line")
def test_it_is_measured_only_with_a_cutoff_and_refused_if_the_line_is_too_short():
    line = SectionSettings((-5.0, 0.0), (5.0, 0.0))
    names = {figure.name for figure in measure_sections(wavy(), line, None).figures}
    assert not names & {"ra", "rq", "rz"}
    rough = SectionSettings((-5.0, 0.0), (5.0, 0.0), cutoff_mm=0.8)
    figures = {
        figure.name: figure.value for figure in measure_sections(wavy(), rough, None).figures
    }
    assert figures["ra"] < figures["rq"] < figures["rz"]
    short = SectionSettings((-1.0, 0.0), (1.0, 0.0), cutoff_mm=2.5)
    found = measure_sections(wavy(), short, None)
    assert "rz" not in {figure.name for figure in found.figures}
    assert any("shorter than" in sentence for sentence in found.sentences)
