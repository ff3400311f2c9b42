"""The height map that a measurement needs."""

from __future__ import annotations

from gelpolight_core.health.frame_health import refuse_meaningless
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor


def measurable_depth(
    reconstructor: Reconstructor,
    image: LinearImage,
    *,
    name: str = "",
    where: str = "",
    despite_faults: bool = False,
) -> HeightMap:
    """Check an image, and reconstruct it with its standard deviations.

    Parameters
    ----------
    reconstructor : Reconstructor
        With the calibration.
    image : LinearImage
        Image of the camera.
    name : str, optional
        Name of the image, kept in the result; by default its own.
    where : str, optional
        Name of the image in messages; by default `name`.
    despite_faults : bool, optional
        Whether an image with a fault that makes its depth meaningless is reconstructed, too.

    Raises
    ------
    InputError
        If the depth would be meaningless, or as :meth:`Reconstructor.depth`.
    """
    name = name or image.name
    health = reconstructor.health(image.rgb, name=name, loss=image.loss)
    if not despite_faults:
        refuse_meaningless(health, where=where or name)
    return reconstructor.depth(image.rgb, name=name, uncertainty=True, health=health)
