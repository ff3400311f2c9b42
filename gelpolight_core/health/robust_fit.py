"""The robust fit of linear effects to the cells of a frame that agree."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.compiling import whole

CORRELATED = 1.6
"""Neighbouring samples share pixels: this is the factor of their deviation over that of independent
ones."""
ROUNDS = 30
LEAST_SCALE = 0.5
"""Variance of light and texture, over that of the stated noise, below which nothing is learnt."""
TAIL = 4.0
"""A cell whose variance is larger than the scale by this factor has a quarter of its weight."""
SETTLED = 0.002
BALANCE = 0.65
"""Mean of the bounded loss at which the scale is found: half of the cells may be pressed. It makes
the scale the most likely one of a Student distribution of the light of a cell."""


@whole(fastmath=True)
def robust_fit(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    at,
    light,
    texture,
    by_light,
    by_texture,
    light_square,
    texture_square,
    count,
    usable,
    prior,
    values,
    inverse,
    weight,
    scales,
):
    """Fit parameters `at` by the cells that agree; write the last four arguments."""
    cells, size = usable.size, at.size
    correlated = CORRELATED * CORRELATED
    rest, fine = np.zeros(cells), np.zeros(cells)
    number, scale, grain = 0, 1.0, 1.0
    for c in range(cells):
        weight[c] = 1.0 if usable[c] else 0.0
        number += usable[c]
        if usable[c]:
            scale = max(scale, light_square[c] / (3.0 * correlated))
    if number == 0:
        return
    for _step in range(ROUNDS):
        matrix, right = np.diag(prior), np.zeros(size)
        for c in range(cells):
            if weight[c] > 0.0:
                of_light = weight[c] / (scale * correlated)
                of_texture = weight[c] / (grain * correlated)
                for i in range(size):
                    m = at[i]
                    right[i] += of_light * by_light[c, m] + of_texture * by_texture[c, m]
                    for j in range(i + 1):
                        n = at[j]
                        matrix[i, j] += of_light * light[c, m, n] + of_texture * texture[c, m, n]
        for i in range(size):
            for j in range(i):
                matrix[j, i] = matrix[i, j]
        inverse[:] = np.linalg.inv(matrix)
        np.dot(inverse, right, values)
        for c in range(cells):
            q, t = light_square[c], texture_square[c]
            for i in range(size):
                m = at[i]
                a, b = -2.0 * by_light[c, m], -2.0 * by_texture[c, m]
                for j in range(size):
                    a += light[c, m, at[j]] * values[j]
                    b += texture[c, m, at[j]] * values[j]
                q += values[i] * a
                t += values[i] * b
            rest[c], fine[c] = max(q, 0.0) / (3.0 * correlated), max(t, 0.0)
        before = scale
        for _repeat in range(3):
            total = 0.0
            for c in range(cells):
                if usable[c]:
                    total += rest[c] / (rest[c] + scale)
            scale = max(scale * total / (number * BALANCE), 0.2 * scale, LEAST_SCALE)
        above, below = 0.0, 0.0
        for c in range(cells):
            if usable[c]:
                weight[c] = (TAIL * scale / (TAIL * scale + rest[c])) ** 2
                above += weight[c] * fine[c]
                below += weight[c] * count[c]
        grain = max(above / below, LEAST_SCALE)
        if abs(scale - before) < SETTLED * scale:
            break
    unlikely = 0.0
    for c in range(cells):
        if usable[c]:
            unlikely += np.log(1.0 + rest[c] / scale)
    scales[0], scales[1], scales[2] = scale, grain, np.log(scale) + unlikely / (number * BALANCE)
