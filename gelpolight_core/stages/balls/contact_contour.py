"""The edge of a ball's contact, found where the shading has its kink.

The membrane leaves the ball tangentially: the slope is continuous and largest at the contact's
edge, and its radial derivative jumps. Whatever the light and the reflectance, brightness is a
smooth function of slope, so every colour channel has a kink at the same radius. A filter that
responds to a kink but not to a parabola finds it without a brightness threshold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.robust import robust_sd, tukey_weights

_RAYS = 180
_STEPS_PER_RADIUS = 80


@dataclass(frozen=True, slots=True)
class ImageCircle:
    """A circle in the image.

    Attributes
    ----------
    x, y : float
        Centre in pixels.
    radius : float
        In pixels.
    """

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class KinkTable:
    """Strength of the kink of the shading, along rays from a centre.

    Attributes
    ----------
    angles_rad : (rays,)
        Directions of the rays, from x towards y.
    radii_px : (steps,)
        Distances from the centre.
    response : (rays, steps, 3) float32
        Response of the filter per channel, positive at a cusp towards dark.
    strength : (rays, steps)
        Root of the summed squares of `response`; NaN where the filter would extend beyond the
        working area.
    wedge_deg : float
        Standard deviation of the average over neighbouring directions.
    """

    angles_rad: Float64Array
    radii_px: Float64Array
    response: Float32Array
    strength: Float64Array
    wedge_deg: float


@dataclass(frozen=True, slots=True)
class ContactContour:
    """The contact's edge in the image.

    Attributes
    ----------
    circle : ImageCircle
        Robust fit to the points.
    points : (N, 2)
        (x, y) of the kink in each direction where it is seen, pixels.
    residual_px : float
        Robust standard deviation of the points about the circle.
    axis_ratio : float
        Shorter over longer axis of the ellipse through the points.
    coverage : float
        Share of the directions in which the edge is seen.
    centre_sd_px : float
        Standard deviation of the circle's centre, along the worse axis, from the residual.
    stretches : tuple of float
        Logarithm of the axis along y over the axis along x, by each method that measured it.
    """

    circle: ImageCircle
    points: Float64Array
    residual_px: float
    axis_ratio: float
    coverage: float
    centre_sd_px: float
    stretches: tuple[float, ...] = ()


def kink_table(
    scaled: Float32Array,
    valid: BoolArray,
    around: ImageCircle,
    *,
    half_width: float,
    wedge_deg: float = 4.0,
) -> KinkTable:
    """Return the strength of the kink along rays, up to 1.9 times the radius.

    Parameters
    ----------
    scaled : (rows, columns, 3)
        Difference to the background in units of noise.
    valid : (rows, columns) bool
        The working area.
    around : ImageCircle
        Where the rays start and which radius to expect.
    half_width : float
        Half the filter's length, as a share of the radius.
    wedge_deg : float, optional
        Standard deviation of the average over neighbouring directions.
    """
    step = around.radius / _STEPS_PER_RADIUS
    half = max(2, round(half_width * _STEPS_PER_RADIUS))
    index = np.arange(round(0.3 * _STEPS_PER_RADIUS) - half, round(1.9 * _STEPS_PER_RADIUS) + half)
    radii = np.asarray(index * step, dtype=np.float64)
    angles = np.linspace(0.0, 2.0 * np.pi, _RAYS, endpoint=False)
    x = (around.x + np.outer(np.cos(angles), radii)).astype(np.float32)
    y = (around.y + np.outer(np.sin(angles), radii)).astype(np.float32)
    polar = np.asarray(cv2.remap(scaled, x, y, cv2.INTER_LINEAR), np.float32)
    inside = cv2.remap(valid.astype(np.uint8), x, y, cv2.INTER_NEAREST, borderValue=0)
    # Neighbouring directions are averaged around the whole turn.
    sigma = wedge_deg / (360.0 / _RAYS)
    reach = int(np.ceil(3.0 * sigma))
    wrapped = np.concatenate([polar[-reach:], polar, polar[:reach]])
    smooth = cv2.GaussianBlur(wrapped, (1, 2 * reach + 1), sigmaX=1e-6, sigmaY=sigma)
    polar = np.asarray(smooth[reach:-reach], np.float32)
    response = cv2.filter2D(polar, -1, _kink_filter(half)[None])
    strength = np.sqrt((response.astype(np.float64) ** 2).sum(axis=2))
    whole = cv2.erode(inside, np.ones((1, 2 * half + 1), np.uint8), borderValue=1) > 0
    keep = slice(half, len(radii) - half)
    valid_strength = np.where(whole, strength, np.nan)[:, keep]
    return KinkTable(
        angles, radii[keep], np.asarray(response[:, keep], np.float32), valid_strength, wedge_deg
    )


def _kink_filter(half: int) -> Float32Array:
    """Return |x| without its mean and parabola, with unit norm."""
    x = np.arange(-half, half + 1) / half
    smooth = np.stack([np.ones_like(x), x * x], axis=1)
    kink = np.abs(x)
    kink = kink - smooth @ np.linalg.lstsq(smooth, kink, rcond=None)[0]
    return np.asarray(kink / np.linalg.norm(kink), dtype=np.float32)


def search_circle(
    table: KinkTable,
    around: ImageCircle,
    *,
    shift: float = 0.4,
    shrink: float = 0.3,
    grow: float = 1.6,
    step: float = 0.05,
) -> ImageCircle:
    """Return the circle along which the kink is strongest, of a grid of circles.

    Along a contact's edge the kink changes smoothly with direction, like the light; noise, specks
    and texture do not. Therefore the responses of each channel along a circle are reduced to their
    mean and first two harmonics, whose energy is compared.

    Parameters
    ----------
    table : KinkTable
        Rays from the centre of `around`.
    around : ImageCircle
        First guess.
    shift : float, optional
        Largest move of the centre, as a share of the radius.
    shrink, grow : float, optional
        Range of radii, as multiples of the guess.
    step : float, optional
        Grid's step, as a share of the radius.
    """
    shifts = np.arange(-shift, shift + 0.5 * step, step) * around.radius
    sizes = np.arange(shrink, grow + 0.5 * step, step) * around.radius
    dx, dy, size = (a.ravel() for a in np.meshgrid(shifts, shifts, sizes, indexing="ij"))
    # Averaged neighbours only take more time.
    rays = slice(None, None, 3 if table.wedge_deg > 3.0 else 1)
    angles, response = table.angles_rad[rays], np.ascontiguousarray(table.response[rays])
    valid = np.isfinite(table.strength[rays])
    # One very dark flank or speck must not dominate the rest of the circle.
    cap = 2.0 * float(np.median(np.where(valid, np.nan_to_num(table.strength[rays]), 0.0).max(1)))
    response = np.where(valid[..., None], np.clip(response, -cap, cap), np.float32(0.0))
    shift_along = np.outer(dx, np.cos(angles)) + np.outer(dy, np.sin(angles))
    shift_across2 = (dx**2 + dy**2)[:, None] - shift_along**2
    radius = shift_along + np.sqrt(np.maximum(size[:, None] ** 2 - shift_across2, 0.0))
    column = (radius - table.radii_px[0]) / (table.radii_px[1] - table.radii_px[0])
    best = int(_coherent_energy(response, column, angles).argmax())
    return ImageCircle(float(around.x + dx[best]), float(around.y + dy[best]), float(size[best]))


def kink_energy(table: KinkTable, radius_px: float) -> float:
    """Return the energy of the kink along a circle about the table's own centre."""
    response = np.where(np.isfinite(table.strength)[..., None], table.response, np.float32(0.0))
    step = table.radii_px[1] - table.radii_px[0]
    column = np.full((1, len(table.angles_rad)), (radius_px - table.radii_px[0]) / step)
    return float(_coherent_energy(response, column, table.angles_rad)[0])


def fit_edge(scaled: Float32Array, valid: BoolArray, start: ImageCircle) -> ContactContour:
    """Find the contact's edge from a circle near it.

    The first step finds the circle with the strongest kink. If the kink is clear, the second step
    finds its position in every direction and the circle through these points; a narrow filter is
    less biased by the curvature of the drape. If noise scatters the points, the circle of the first
    step is the result.

    Parameters
    ----------
    scaled : (rows, columns, 3)
        Difference to the background in units of noise.
    valid : (rows, columns) bool
        The working area.
    start : ImageCircle
        A circle near the edge; kinks farther away are ignored.
    """

    def table(around: ImageCircle, half_width: float, wedge_deg: float = 4.0) -> KinkTable:
        return kink_table(scaled, valid, around, half_width=half_width, wedge_deg=wedge_deg)

    circle = start
    circle = search_circle(table(circle, 0.35), circle, shift=0.2, shrink=0.75, grow=1.35)
    for step in (0.02, 0.005):
        reach = 4.0 * step
        limits = {"shift": reach, "shrink": 1.0 - reach, "grow": 1.0 + reach, "step": step}
        circle = search_circle(table(circle, 0.25, 2.0), circle, **limits)
    contour = trace_contour(table(circle, 0.25), circle)
    contour = trace_contour(table(contour.circle, 0.25), contour.circle)
    if contour.residual_px > 0.06 * contour.circle.radius:
        smooth = trace_contour(table(circle, 0.35, 12.0), circle, margin=0.25)
        # With this much noise, a wrong ring can be found. The scatter about that ring cannot show
        # this.
        sd_px = max(contour.centre_sd_px, smooth.residual_px)
        return replace(smooth, circle=circle, centre_sd_px=sd_px)
    if contour.residual_px < 0.01 * contour.circle.radius:
        return trace_contour(table(contour.circle, 0.15), contour.circle, margin=0.1)
    return contour


def dilution(points: Float64Array, circle: ImageCircle) -> float:
    """Return how much worse the seen part of an edge gives the centre than the whole edge does.

    An arc hardly distinguishes a shift along its axis from a larger circle: 1 for a whole edge, 1.4
    for 70 % of it, 2.3 for a half.

    Parameters
    ----------
    points : (N, 2)
        (x, y) of the edge, evenly spread over the seen directions; infinite for fewer than three.
    circle : ImageCircle
        Through the points.
    """
    if len(points) < 3:
        return np.inf
    offsets_px = points - np.array([circle.x, circle.y])
    directions = offsets_px / np.linalg.norm(offsets_px, axis=1, keepdims=True)
    directions -= directions.mean(axis=0)
    return float(np.sqrt(0.5 / np.linalg.eigvalsh(directions.T @ directions / len(points))[0]))


def distance_in_radii(shape: tuple[int, ...], circle: ImageCircle) -> Float32Array:
    """Return the distance (rows, columns) of each pixel from the centre over the radius."""
    dx = (np.arange(shape[1], dtype=np.float32) - circle.x) / circle.radius
    dy = (np.arange(shape[0], dtype=np.float32) - circle.y) / circle.radius
    return np.asarray(np.hypot(dx[None, :], dy[:, None]), dtype=np.float32)


def _coherent_energy(
    response: Float32Array, column: Float64Array, angles: Float64Array
) -> Float64Array:
    """Return, per row of `column`, the energy of the smooth part of the responses along it.

    Parameters
    ----------
    response : (rays, steps, 3)
        Responses of the filter.
    column : (circles, rays)
        Where each circle crosses each ray, in steps.
    angles : (rays,)
        Directions of the rays.
    """
    phases = np.outer(angles, [1.0, 2.0])
    waves = [np.full((len(angles), 1), np.sqrt(0.5)), np.cos(phases), np.sin(phases)]
    smooth = np.concatenate(waves, axis=1).astype(np.float32)
    steps = response.shape[1]
    lower = np.clip(np.floor(column), 0, steps - 2)
    fraction = np.clip(column - lower, 0.0, 1.0).astype(np.float32)[..., None]
    inside = ((column >= 0.0) & (column <= steps - 1))[..., None]
    flat = response.reshape(-1, 3)
    index = lower.astype(np.intp) + steps * np.arange(len(angles))
    sampled = flat.take(index, axis=0) * (1.0 - fraction)
    sampled += flat.take(index + 1, axis=0) * fraction
    sampled *= inside
    projected = np.matmul(smooth.T, sampled)
    return np.asarray((projected.astype(np.float64) ** 2).sum(axis=(1, 2)))


def trace_contour(table: KinkTable, around: ImageCircle, *, margin: float = 0.2) -> ContactContour:
    """Return the kink in every direction and the circle through it.

    Parameters
    ----------
    table : KinkTable
        Rays from the centre of `around`.
    around : ImageCircle
        Circle near the edge.
    margin : float, optional
        The edge is searched within this share of the radius.
    """
    in_range = np.abs(table.radii_px - around.radius) <= margin * around.radius
    radii, strength = table.radii_px[in_range], table.strength[:, in_range]
    usable = np.asarray(np.isfinite(strength).all(axis=1))
    position, peak = _peaks(radii, np.nan_to_num(strength), usable)
    has_peak = usable & np.isfinite(position)
    if np.count_nonzero(has_peak) < 8:
        return ContactContour(around, np.empty((0, 2)), np.inf, 0.0, 0.0, np.inf)
    clear_mask = has_peak & (peak > 0.25 * np.median(peak[has_peak]))
    (mean, cx, cy), weight, sd_px = _fit_harmonics(table.angles_rad, position, clear_mask, order=1)
    ellipse, _, _ = _fit_harmonics(table.angles_rad, position, clear_mask, order=2)
    second = float(np.hypot(ellipse[3], ellipse[4]))
    circle = ImageCircle(float(around.x + cx), float(around.y + cy), float(mean))
    inlier_mask = clear_mask & (weight > 0.0)
    direction = np.stack([np.cos(table.angles_rad), np.sin(table.angles_rad)], axis=1)
    points = np.array([around.x, around.y]) + position[inlier_mask, None] * direction[inlier_mask]
    # Neighbouring directions are averaged; the width of a Gaussian is 2 sqrt(pi) times its sigma.
    independent = float(inlier_mask.mean()) * 360.0 / (2.0 * np.sqrt(np.pi) * table.wedge_deg)
    return ContactContour(
        circle,
        points,
        sd_px,
        float((mean - second) / (mean + second)),
        float(inlier_mask.mean()),
        sd_px * float(np.sqrt(2.0 / max(independent, 1.0))) * dilution(points, circle),
        (float(-2.0 * ellipse[3] / mean),),
    )


def _peaks(
    radii: Float64Array, strength: Float64Array, usable: BoolArray
) -> tuple[Float64Array, Float64Array]:
    """Return position (NaN at the window's ends) and size of the largest kink of each ray."""
    rays = np.arange(len(strength))
    index = strength.argmax(axis=1)
    inner = np.clip(index, 1, len(radii) - 2)
    before, peak, after = (strength[rays, inner + i] for i in (-1, 0, 1))
    curvature = np.minimum(before - 2.0 * peak + after, -1e-12)
    offset = np.clip(0.5 * (before - after) / curvature, -0.5, 0.5)
    position = radii[inner] + offset * (radii[1] - radii[0])
    return np.where(usable & (index == inner), position, np.nan), peak


def _fit_harmonics(
    angles: Float64Array, position: Float64Array, clear_mask: BoolArray, *, order: int
) -> tuple[Float64Array, Float64Array, float]:
    """Fit radius over angle by harmonics with Tukey's weights.

    The first harmonic is a shift of the centre, the second an ellipse. On an arc they are hard to
    distinguish, so the circle is fitted with the first alone.
    """
    phases = np.outer(angles, np.arange(1, order + 1))
    waves = np.stack([np.cos(phases), np.sin(phases)], axis=2).reshape(len(angles), -1)
    design = np.column_stack([np.ones_like(angles), waves])[clear_mask]
    value = position[clear_mask]
    # With the median, far outliers do not affect the first round.
    residual = value - np.median(value)
    weight, sd_px = np.ones(len(value)), 0.0
    coefficients = np.zeros(1 + 2 * order)
    for _ in range(8):
        sd_px = max(robust_sd(residual), 1e-3)
        weight = tukey_weights(residual, 5.0 * sd_px)
        root = np.sqrt(weight)
        coefficients, *_ = np.linalg.lstsq(design * root[:, None], value * root, rcond=None)
        residual = value - design @ coefficients
    weights = np.zeros(len(clear_mask))
    weights[clear_mask] = weight
    return coefficients, weights, sd_px
