"""Checks whether this machine can draw in 3D."""

from __future__ import annotations

from functools import cache

from PySide6.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext, QSurfaceFormat

# Required by VTK's renderer.
VERSION = 3, 2
# These platforms may have a GL context but display nothing and report no error.
WITHOUT_SCREEN = ("offscreen", "minimal", "vnc", "linuxfb")


def surface_format() -> QSurfaceFormat:
    """Return the format of all OpenGL widgets. With different formats Qt would rebuild windows."""
    wanted = QSurfaceFormat()
    wanted.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    wanted.setVersion(*VERSION)
    wanted.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    wanted.setDepthBufferSize(24)
    wanted.setAlphaBufferSize(8)
    return wanted


@cache
def opengl_problem() -> str:
    """Return why 3D is not available, as a sentence without full stop. Empty if it is available."""
    platform = QGuiApplication.platformName()
    if platform in WITHOUT_SCREEN:
        return f"The display platform {platform} does not support OpenGL"
    context = QOpenGLContext()
    context.setFormat(surface_format())
    surface = QOffscreenSurface()
    surface.setFormat(surface_format())
    surface.create()
    if not (surface.isValid() and context.create() and context.makeCurrent(surface)):
        return f"OpenGL {_dotted(VERSION)} is not available"
    found = context.format().version()
    context.doneCurrent()
    if tuple(found) < VERSION:
        return f"OpenGL {_dotted(VERSION)} is not available. This machine has {_dotted(found)}"
    return ""


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))
