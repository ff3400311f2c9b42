"""The error that a user can fix."""

from __future__ import annotations

from enum import StrEnum, unique
from pathlib import Path
from typing import Any


@unique
class Remedy(StrEnum):
    """What a person does about an error: the same sentence for the same action everywhere.

    The error says what was found and where.
    """

    # Entries and files
    CORRECT_VALUE = "Correct this value"
    CORRECT_ENTRY = "Correct this entry"
    CORRECT_FILE = "Correct the file"
    CORRECT_AND_REPEAT = "Correct the files, and run the same command again"
    STATE_IN_SESSION = "State it in session.toml"
    STATE_WITH = "State it with {option}"
    REMOVE_OPTION = "Remove this option"
    ONE_OF = "Choose one of {names}"
    TRUTH_ROW = "Put each image beside truth.csv, and give it one row with its true size"
    WRITE_POINT = "Write decimals with a point, and nothing between thousands"
    SAVE_CSV = "Save it again as CSV in UTF-8"
    REPAIR_FILE = "Correct or restore the file, or move it away"
    COPY_AGAIN = "Copy the file again, or choose another one"
    REPLACE_LINK = "Replace the link by the file or folder itself"
    CHECK_NAME = "Check the name"
    CHECK_DISK = "Check the name, the permissions and the disk"
    FREE_SPACE = "Free some disk space, or choose another disk"
    MAY_READ = "Ask its owner for permission to read it, or choose another one"
    ASK_PERMISSION = "Choose a folder of your own, or ask for permission"
    CHOOSE_FILE = "Choose another file"
    CHOOSE_NAME = "Choose another name"
    CHOOSE_FOLDER = "Choose another folder"
    CHOOSE_IMAGES = "Choose images, recordings or folders of them"
    CHOOSE_SESSION = "Choose another session"
    CHOOSE_SHAPE = "State the shape that is pressed, or use another tool"
    CHOOSE_OBJECT = "Choose one of them: --seed X Y"
    SEPARATE_FOLDERS = "Write the results into separate folders"
    START_NEW = "Continue it as it was started, or start another one in a new folder"
    STOP_OTHER = "Stop the other run first, or choose another folder"
    OPEN_AGAIN = "Open it again"
    REPEAT_CHANGE = "Open it again, and repeat your change"
    # The program and its parts
    UPDATE = "Use a newer version of GelPoLight Studio"
    INSTALL = 'Install it: pip install "{package}"'
    REINSTALL = "Install the program again; the log names the part that is missing"
    CLUSTER = "Check that the cluster runs and each worker has this program and folder"
    CLOSE_PROGRAM = "Close the other program that uses it"
    # Calibrations
    SAME_SENSOR = "Use images and a calibration of the same sensor"
    OTHER_MODEL = "Choose another model or calibration"
    IMPORT_CALIBRATION = "Import it on the Sensors page"
    COMPLETE_STAGES = "Complete the stages that are not done yet"
    CHECK_LENGTHS = "Check the working diameter, the thicknesses and the square size"
    WIDER_LEDS = "Place the LEDs wider apart around the sensor's axis"
    MOVE_NODES = "Move the nodes of the curve"
    # Images
    CAPTURE_AGAIN = "Capture the image again, or remove it"
    REMOVE_ODD = "Remove the image that is of an earlier calibration, or capture the stage again"
    CAPTURE_STAGE = "Capture these images, or copy them into the folder as PNG or TIFF"
    CAPTURE_COLOUR = "Capture it in colour"
    SHORTER_EXPOSURE = "Use a shorter exposure"
    LIGHT_ON = "Switch the light on, or use a longer exposure"
    CHECK_EXPOSURE = "Check the exposure of whiteboard, background and press"
    SAME_LIGHT = "Keep light and exposure constant, and capture background and press again"
    SAME_CAMERA = "Use the same camera and image size for all images"
    LESS_MEMORY = "Use smaller images or fewer jobs, or close other programs"
    SMALLER_IMAGES = "Use smaller images"
    PNG = "Use PNG or TIFF images of 8 or 16 bit"
    SAVE_RGB = "Save the original image as PNG or TIFF in RGB"
    DEMOSAIC = "Demosaic it, and save it as PNG or TIFF in RGB"
    SEPARATE_IMAGES = "Save each image as a file of its own"
    LINEAR_ARRAY = "Use unsigned 8 or 16 bit integers, or floats of linear light 0..1"
    SINGLE_LED = "Capture one image of each LED alone: red, green and blue"
    FOCUS = "Focus the camera, and capture the image without motion"
    WITH_MEMBRANE = "Capture the background with the membrane and the whiteboard without"
    PRESS_BOARD = "Press the board onto the elastomer without air: the contact must look wet"
    CLEAN_MIRROR = "Put a clean mirror in, darken the room and use a shorter exposure"
    MIRROR_VIEW = "Check that each LED is on and its whole reflection is in view"
    MIRROR_AGAIN = "Capture mirror and whiteboard again"
    MORE_EXPOSURES = "Capture a still, evenly lit scene at more exposures"
    STEADY_SERIES = "Keep scene, light and gain constant, and state the true exposure times"
    # The board
    BOARD_SIZE = "Correct the number of inner corners and the side of the squares"
    REMOVE_BOARD = "Remove the checkerboard, and capture the image without it"
    SHOW_BOARD = "Show the whole board, flat and evenly lit, with a light margin around it"
    FLAT_BOARD = "Use a flat board, check its square size, and hold it still"
    SQUARE_BOARD = "Print the board again at its own size, not fitted to the page, and measure it"
    BOARD_ON_TOP = "Lay the board flat on the top surface, and capture it there"
    # Presses
    PRESS_BALLS = "Press balls of known diameter deeper or at more places"
    PRESS_DEEPER = "Press deeper, then capture the image"
    PRESS_MIDDLE = "Press nearer to the middle of the sensor"
    ONE_BALL = "Press a single clean ball straight down"
    CHECK_RADIUS = "Check the stated diameter of the ball (session.toml holds its radius)"
    CHECK_SIZES = "Check the ball diameters and the scale (mm per pixel)"
    SWAP_IMAGES = "Swap the two images, or capture the background again without contact"
    STATE_SCALE = "Press it straight and deeper, or state mm_per_px"
    # Places on a map
    CHECK_AREA = "Check the image and the working area"
    MOVE_INSIDE = "Move it inside the working area"
    LARGER_AREA = "Make it larger, or move it inside the working area"
    DRAW_AGAIN = "Draw it at another place"
    PLACE_POINTS = "Place the points further apart, and not on one line"
    # Cameras and other sources
    PLUG_IN = "Plug it in at the same port"
    OTHER_BUS = (
        "Plug one of the cameras into a port of another USB bus, or choose a smaller image or a "
        "lower frame rate"
    )
    CHECK_CABLE = "Check its cable, then open it again"
    WAIT = "Wait until it responds again, or check its cable"
    NO_SUCH_SETTING = "Set it in the camera manufacturer's program, or leave it unchanged"

    def format(self, *args: object, **values: Any) -> str:
        """Return the remedy with its placeholders filled."""
        return self.value.format(*args, **values)


class InputError(Exception):
    """Input that the user can correct. It is shown as one sentence, never as a traceback.

    Parameters
    ----------
    found : str
        What is wrong, as a sentence without a full stop ("The image is black").
    where : str or Path
        The file, stage or key where it was found.
    advice : str
        What to do about it, as a sentence without a full stop: a :class:`Remedy`, or a text.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> try:
    ...     gp.read_calibration("missing.gplcal")
    ... except gp.InputError as error:
    ...     print(error.where)
    missing.gplcal
    """

    def __init__(self, found: str, where: str | Path, advice: str) -> None:
        self.found = found
        self.where = where if isinstance(where, str) else str(where)
        self.advice = advice
        super().__init__(found, self.where, self.advice)

    def __str__(self) -> str:
        """Return the message that the user reads: where, what, advice."""
        where, found, advice = map(_printable, (self.where, self.found, self.advice))
        return f"{where}: {found}. {advice}."


def not_installed(library: str, what: str, extra: str) -> InputError:
    """Return the error for a library that is installed with an extra of this package only.

    Parameters
    ----------
    library : str
        Its name.
    what : str
        What needs it.
    extra : str
        Extra of pyproject.toml.
    """
    install = Remedy.INSTALL.format(package=f"gelpolight-studio[{extra}]")
    return InputError(f"{library} is not installed", what, install)


def _printable(text: str) -> str:
    """Return a text without terminal control characters, which a file name may contain."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


COMPUTER = "This computer"


def as_input_error(error: BaseException) -> InputError | None:
    """Return the sentence for an error of the input or the computer, or None.

    Too little memory, a missing permission and a full disk are no mistakes in the program.
    """
    if isinstance(error, InputError):
        return error
    # -4 is OpenCV's StsNoMem.
    of_opencv = (type(error).__module__, getattr(error, "code", 0)) == ("cv2", -4)
    if of_opencv or isinstance(error, MemoryError):
        text = "There is too little free memory for this"
        return InputError(text, COMPUTER, Remedy.LESS_MEMORY)
    if isinstance(error, OSError):
        text = f"The operating system refused it ({error.strerror or error})"
        return InputError(text, error.filename or COMPUTER, Remedy.CHECK_DISK)
    return None


def error_message(error: BaseException) -> str:
    """Return the sentence that a person reads about any error."""
    return str(as_input_error(error) or f"Internal error: {type(error).__name__}; see the log.")
