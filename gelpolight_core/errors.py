"""The error that a user can fix."""

from __future__ import annotations

from enum import StrEnum, unique
from pathlib import Path
from typing import Any

from gelpolight_core.translation import Text, marked, pattern, translated


@unique
class Remedy(StrEnum):
    """What a person does about an error: the same sentence for the same action everywhere.

    The error says what was found and where. A remedy is in English; the error translates it.
    """

    # Entries and files
    CORRECT_VALUE = marked("Correct this value")
    CORRECT_ENTRY = marked("Correct this entry")
    CORRECT_FILE = marked("Correct the file")
    CORRECT_AND_REPEAT = marked("Correct the files, and run the same command again")
    STATE_IN_SESSION = marked("State it in session.toml")
    STATE_WITH = marked("State it with {option}")
    REMOVE_OPTION = marked("Remove this option")
    ONE_OF = marked("Choose one of {names}")
    TRUTH_ROW = marked("Put each image beside truth.csv, and give it one row with its true size")
    WRITE_POINT = marked("Write decimals with a point, and nothing between thousands")
    SAVE_CSV = marked("Save it again as CSV in UTF-8")
    REPAIR_FILE = marked("Correct or restore the file, or move it away")
    COPY_AGAIN = marked("Copy the file again, or choose another one")
    REPLACE_LINK = marked("Replace the link by the file or folder itself")
    CHECK_NAME = marked("Check the name")
    CHECK_DISK = marked("Check the name, the permissions and the disk")
    FREE_SPACE = marked("Free some disk space, or choose another disk")
    MAY_READ = marked("Ask its owner for permission to read it, or choose another one")
    ASK_PERMISSION = marked("Choose a folder of your own, or ask for permission")
    CHOOSE_FILE = marked("Choose another file")
    CHOOSE_NAME = marked("Choose another name")
    CHOOSE_FOLDER = marked("Choose another folder")
    CHOOSE_IMAGES = marked("Choose images, recordings or folders of them")
    CHOOSE_SESSION = marked("Choose another session")
    CHOOSE_SHAPE = marked("State the shape that is pressed, or use another tool")
    CHOOSE_OBJECT = marked("Choose one of them: --seed X Y")
    SEPARATE_FOLDERS = marked("Write the results into separate folders")
    START_NEW = marked("Continue it as it was started, or start another one in a new folder")
    STOP_OTHER = marked("Stop the other run first, or choose another folder")
    OPEN_AGAIN = marked("Open it again")
    REPEAT_CHANGE = marked("Open it again, and repeat your change")
    # The program and its parts
    UPDATE = marked("Use a newer version of GelPoLight Studio")
    INSTALL = marked('Install it: pip install "{package}"')
    REINSTALL = marked("Install the program again; the log names the part that is missing")
    CLUSTER = marked("Check that the cluster runs and each worker has this program and folder")
    CLOSE_PROGRAM = marked("Close the other program that uses it")
    # Calibrations
    SAME_SENSOR = marked("Use images and a calibration of the same sensor")
    OTHER_MODEL = marked("Choose another model or calibration")
    IMPORT_CALIBRATION = marked("Import it on the Sensors page")
    COMPLETE_STAGES = marked("Complete the stages that are not done yet")
    CHECK_LENGTHS = marked("Check the working diameter, the thicknesses and the square size")
    WIDER_LEDS = marked("Place the LEDs wider apart around the sensor's axis")
    MOVE_NODES = marked("Move the nodes of the curve")
    # Images
    CAPTURE_AGAIN = marked("Capture the image again, or remove it")
    CAPTURE_STAGE = marked("Capture these images, or copy them into the folder as PNG or TIFF")
    CAPTURE_COLOUR = marked("Capture it in colour")
    SHORTER_EXPOSURE = marked("Use a shorter exposure")
    LIGHT_ON = marked("Switch the light on, or use a longer exposure")
    CHECK_EXPOSURE = marked("Check the exposure of whiteboard, background and press")
    SAME_LIGHT = marked("Keep light and exposure constant, and capture background and press again")
    SAME_CAMERA = marked("Use the same camera and image size for all images")
    LESS_MEMORY = marked("Use smaller images or fewer jobs, or close other programs")
    SMALLER_IMAGES = marked("Use smaller images")
    PNG = marked("Use PNG or TIFF images of 8 or 16 bit")
    LINEAR_ARRAY = marked("Use unsigned 8 or 16 bit integers, or floats of linear light 0..1")
    SINGLE_LED = marked("Capture one image of each LED alone: red, green and blue")
    FOCUS = marked("Focus the camera, and capture the image again without motion")
    WITH_MEMBRANE = marked("Capture the background with the membrane and the whiteboard without")
    CLEAN_MIRROR = marked("Put a clean mirror in, darken the room and use a shorter exposure")
    MIRROR_VIEW = marked("Check that each LED is on and its whole reflection is in view")
    MIRROR_AGAIN = marked("Capture mirror and whiteboard again")
    MORE_EXPOSURES = marked("Capture a still, evenly lit scene at more exposures")
    STEADY_SERIES = marked("Keep scene, light and gain constant, and state the true exposure times")
    # The board
    BOARD_SIZE = marked("Correct the number of inner corners and the side of the squares")
    REMOVE_BOARD = marked("Remove the checkerboard and capture the image again")
    SHOW_BOARD = marked("Show the whole board, flat and evenly lit, with a light margin around it")
    MORE_VIEWS = marked("Capture more sharp views of the board, tilted by 15 to 40 degrees")
    FLAT_BOARD = marked("Use a flat board, check its square size, and hold it still")
    BOARD_ON_TOP = marked("Lay the board flat on the top surface, and capture it there")
    # Presses
    PRESS_BALLS = marked("Press balls of known diameter deeper or at more places")
    PRESS_DEEPER = marked("Press deeper, and capture the image again")
    PRESS_MIDDLE = marked("Press nearer to the middle of the sensor")
    ONE_BALL = marked("Press a single clean ball straight down")
    CHECK_RADIUS = marked("Check the stated diameter of the ball (session.toml holds its radius)")
    CHECK_SIZES = marked("Check the ball diameters and the scale (mm per pixel)")
    SWAP_IMAGES = marked("Swap the two images, or capture the background again without contact")
    STATE_SCALE = marked("Press it straight and deeper, or state mm_per_px")
    # Places on a map
    CHECK_AREA = marked("Check the image and the working area")
    MOVE_INSIDE = marked("Move it inside the working area")
    LARGER_AREA = marked("Make it larger, or move it inside the working area")
    DRAW_AGAIN = marked("Draw it at another place")
    PLACE_POINTS = marked("Place the points further apart, and not on one line")
    # Cameras and other sources
    PLUG_IN = marked("Plug it in at the same port")
    CHECK_CABLE = marked("Check its cable, then open it again")
    WAIT = marked("Wait until it responds again, or check its cable")
    NO_SUCH_SETTING = marked("Set it in the camera manufacturer's program, or leave it unchanged")

    def format(self, *args: object, **values: Any) -> Text:
        """Return the remedy in the user's language, with its placeholders filled."""
        return translated(self.value).format(*args, **values)


NOT_INSTALLED = marked("{library} is not installed")


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
        self.advice = translated(advice)
        super().__init__(found, self.where, self.advice)

    @property
    def text(self) -> str:
        """Where, what and advice, also in English."""
        where, found, advice = map(_printable, (self.where, self.found, self.advice))
        return pattern("{where}: {found}. {advice}.", where=where, found=found, advice=advice)

    def __str__(self) -> str:
        """Return the message that the user reads: where, what, advice."""
        return str(self.text)


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
    found = translated(NOT_INSTALLED).format(library=library)
    return InputError(found, what, Remedy.INSTALL.format(package=f"gelpolight-studio[{extra}]"))


def _printable(text: str) -> str:
    """Return a text without terminal control characters, which a file name may contain."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


OPENCV_NO_MEMORY = -4
"""Its error code StsNoMem."""
NO_MEMORY = marked("There is too little free memory for this")
REFUSED = marked("The operating system refused it ({reason})")
COMPUTER = marked("This computer")
INTERNAL = marked("Internal error: {kind}; see the log.")


def machine_fault(error: BaseException) -> InputError | None:
    """Return the sentence for an error of the input or the computer; None for one of the program.

    Too little memory, a missing permission and a full disk are no mistakes in the program.
    """
    if isinstance(error, InputError):
        return error
    of_opencv = (type(error).__module__, getattr(error, "code", 0)) == ("cv2", OPENCV_NO_MEMORY)
    if of_opencv or isinstance(error, MemoryError):
        return InputError(translated(NO_MEMORY), translated(COMPUTER), Remedy.LESS_MEMORY)
    if isinstance(error, OSError):
        found = translated(REFUSED).format(reason=error.strerror or error)
        return InputError(found, error.filename or translated(COMPUTER), Remedy.CHECK_DISK)
    return None


def sentence_of(error: BaseException) -> str:
    """Return the sentence that a person reads about any error."""
    internal = translated(INTERNAL).format(kind=type(error).__name__)
    return str(machine_fault(error) or internal)
