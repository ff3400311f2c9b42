"""The kinds of arrays that all modules use, by the type of their numbers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
Int32Array = NDArray[np.int32]
AnyFloatArray = NDArray[np.floating]
FrameArray = NDArray[Any]
Rgb8Array = NDArray[np.uint8]
PixelArray = NDArray[np.uint8] | NDArray[np.uint16]
PointXY = tuple[float, float]
