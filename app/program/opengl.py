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
    surface_format = QSurfaceFormat()
    surface_format.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    surface_format.setVersion(*VERSION)
    surface_format.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    surface_format.setDepthBufferSize(24)
    surface_format.setAlphaBufferSize(8)
    return surface_format


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
    version = context.format().version()
    context.doneCurrent()
    if tuple(version) < VERSION:
        return f"OpenGL {_dotted(VERSION)} is not available. This machine has {_dotted(version)}"
    return ""


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))
